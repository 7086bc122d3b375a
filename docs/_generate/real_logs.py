"""The real logs of `reports/real_logs`: every held-out run, simulated against measured on one chart."""

from __future__ import annotations

import re
from pathlib import Path

REPORTS = Path(__file__).parents[2] / "reports" / "real_logs"
SHIPS = {
    "kvlcc2_hsva": (
        "KVLCC2, a tanker model in a towing tank",
        "Zig-zags of a free-running model of 7 m (HSVA, SIMMAN 2014).",
    ),
    "esso_osaka": (
        "Esso Osaka, a tanker model on a pond",
        "Turning circles and zig-zags of a model of 3 m in wind. Data: NAOE-5thLab/FRT-DS-ESSO, CC BY-NC-SA "
        "4.0; Wakita et al. 2022 (doi 10.1007/s00773-021-00867-1).",
    ),
}  # fmt: skip
_FIGURE = re.compile(r"^!\[(.*)\]\((figures/run\d+\.png)\)$", re.MULTILINE)
_LEAD = re.compile(r"^\*\*(.+?)\*\*", re.MULTILINE | re.DOTALL)


def real_logs() -> str:
    """Headline and pictures of every ship, as its report has them."""
    parts = []
    for folder, (title, about) in SHIPS.items():
        text = (REPORTS / folder / "report.md").read_text("utf-8")
        lead = _LEAD.search(text)
        pictures = _FIGURE.findall(text)
        if lead is None or not pictures:
            raise ValueError(f"reports/real_logs/{folder}/report.md has no headline or no pictures")
        parts += [f"## {title}", about, f"**{lead.group(1)}**"]
        for words, path in pictures:
            target = f"../../reports/real_logs/{folder}/{path}"
            parts.append(f"```{{figure}} {target}\n:alt: {words}\n\n{words}\n```")
    return "\n\n".join(parts)
