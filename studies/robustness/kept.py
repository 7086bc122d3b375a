"""Parts of the study kept as they end, each with the code it was made with, so that days and machines add up.

Takes a folder and plain rows. Gives them back, those of one code apart from those of others.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bayesid.code import loaded_code
from bayesid.files import write_json

Rows = list[dict[str, Any]]
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Kept:
    """Files of one part: FOLDER/CODE-NAME.json.

    Attributes
    ----------
    codes : that are counted, the present one unless others are asked for; only the present one is written
    """

    folder: Path
    codes: tuple[str, ...]

    @cached_property
    def commit(self) -> str:
        """The last commit of the package, with a + where it was changed since; empty outside a checkout."""

        def asked(*words: str) -> str:
            line = ["git", "-C", str(ROOT), *words, "--", "bayesid"]
            try:
                return subprocess.run(line, capture_output=True, text=True, timeout=60).stdout.strip()
            except OSError:
                return ""

        return asked("log", "-1", "--format=%h") + ("+" if asked("status", "--porcelain") else "")

    def read(self, name: str) -> dict[str, Any] | None:
        """What was kept under a name by this code."""
        try:
            return dict(json.loads(self._path(name).read_text("utf-8")))
        except (OSError, ValueError):
            return None

    def write(self, name: str, rows: Rows, **more: Any) -> None:
        """Keep rows, and where the work was."""
        write_json(self._path(name), {"code": loaded_code(), "commit": self.commit, **more, "rows": rows})

    def _path(self, name: str) -> Path:
        return self.folder / f"{loaded_code()}-{name.replace(' ', '-').replace(',', '')}.json"

    def all(self) -> list[dict[str, Any]]:
        """Every file of every code."""
        return [json.loads(path.read_text("utf-8")) for path in sorted(self.folder.glob("*.json"))]

    def rows(self) -> Rows:
        """Rows made with these codes."""
        return [row for file in self.all() if file["code"] in self.codes for row in file["rows"]]

    def commits(self) -> list[str]:
        """Commits of these codes that rows were made with."""
        return sorted({file["commit"] for file in self.all() if file["code"] in self.codes})

    def earlier(self) -> dict[str, Rows]:
        """Rows of other codes, by the commit they were made with."""
        found: dict[str, Rows] = {}
        for file in self.all():
            if file["code"] not in self.codes:
                found.setdefault(file.get("commit") or file["code"], []).extend(file["rows"])
        return found


def added(rows: Rows, keys: tuple[str, ...], sums: tuple[str, ...]) -> Rows:
    """Rows of the same keys as one, `sums` added up."""
    found: Rows = []
    for row in rows:
        same = next((r for r in found if all(r[k] == row[k] for k in keys)), None)
        if same is None:
            found.append(dict(row))
        else:
            same.update({k: same[k] + row[k] for k in sums})
    return found
