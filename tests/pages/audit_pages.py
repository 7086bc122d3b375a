"""Look at HTML pages in headless Chromium, at desktop and phone width: does a page scroll sideways, does the
browser print a message, is a picture broken?

    python tests/pages/audit_pages.py reports/*/report.html out/docs/*.html

Needs `chromium` on the path. Prints a line for every page that fails and ends with 1 if there is one. Boxes
that scroll by themselves (wide tables, printed commands) are no fault. Not collected by pytest.
"""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

WIDTHS = (1280, 390)
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--disable-web-security",
    "--allow-file-access-from-files", "--enable-logging=stderr", "--virtual-time-budget=8000",
    "--window-size=1400,1000", "--dump-dom",
)  # fmt: skip
# Chromium's own window is never narrower than 500 px: the page is shown in a frame. What hangs out of a box
# that scrolls, or is fixed beside the page, is left out.
PROBE = """<body style="margin:0"><iframe id="f" src="%s" style="width:%dpx;height:900px;border:0"></iframe>
<pre id="o"></pre><script>
const f = document.getElementById("f");
f.onload = () => setTimeout(() => {
  const d = f.contentDocument, w = d.documentElement.clientWidth, out = [];
  for (const x of d.querySelectorAll("body *")) {
    const r = x.getBoundingClientRect();
    if (!r.width || r.right <= w + 1) continue;
    let p = x, held = false;
    while (p && p !== d.body && !held) {
      const s = f.contentWindow.getComputedStyle(p);
      held = s.position === "fixed" || (p !== x && s.overflowX !== "visible");
      p = p.parentElement;
    }
    if (!held) out.push(x.tagName + "." + x.className);
  }
  const broken = [...d.images].filter(i => !i.complete || !i.naturalWidth).length;
  const found = {scrolls: d.documentElement.scrollWidth > w, out: out.slice(0, 4), broken};
  document.getElementById("o").textContent = "@@" + JSON.stringify(found) + "@@";
}, 300);
</script></body>"""


def look(page: Path, width: int) -> dict[str, Any]:
    """What is wrong with a page at a width; nothing where all is well."""
    with tempfile.TemporaryDirectory() as folder:
        shown = Path(folder) / "shown.html"
        shown.write_text(PROBE % (page.resolve().as_uri(), width), "utf-8")
        done = subprocess.run(
            ["chromium", f"--user-data-dir={folder}/profile", *FLAGS, shown.as_uri()],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
    told = re.search(r"@@(\{.*?\})@@", done.stdout.partition('<pre id="o">')[2])
    if told is None:
        return {"not shown": done.stderr[-300:]}
    found = json.loads(html.unescape(told[1]))
    found["messages"] = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return {k: v for k, v in found.items() if v}


def main(pages: list[str]) -> int:
    """1 if a page fails at a width."""
    bad = 0
    for page in map(Path, pages):
        for width in WIDTHS:
            if found := look(page, width):
                bad += 1
                print(f"{page} at {width} px: {found}")
    print(f"{len(pages)} pages at {' and '.join(map(str, WIDTHS))} px: {bad} faults")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
