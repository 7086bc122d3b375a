"""Every iterate on disk, one JSON line each, so that a killed fit goes on where it was.

Takes plain numbers. A torn last line, as a kill leaves it, is ignored on reading. Does not decide anything.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.errors import FitError


class Journal:
    """Append-only log of a fit; without a path it forgets.

    Attributes
    ----------
    found : lines of an earlier run of the same problem, oldest first; empty for a new fit
    """

    def __init__(
        self, path: str | os.PathLike[str] | None, header: Mapping[str, Any], resume: bool = True
    ) -> None:
        self.found: list[dict[str, Any]] = []
        self._handle = None
        if path is None:
            return
        target = Path(path)
        lines = read_lines(target) if resume else []
        if lines and all(lines[0].get(k) == header[k] for k in ("digest", "seed")):
            self.found = lines[1:]
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            if not self.found:
                target.write_text(json.dumps(header) + "\n", encoding="utf-8")
            elif not target.read_bytes().endswith(b"\n"):
                target.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
            self._handle = target.open("a", encoding="utf-8")
        except OSError as error:
            raise FitError(f"{target}: the fit's log cannot be written ({error.strerror})") from None

    def write(self, **line: Any) -> None:
        """Append one line; a reader never sees half of it followed by another."""
        if self._handle is not None:
            self._handle.write(json.dumps(line) + "\n")
            self._handle.flush()

    def close(self) -> None:
        if self._handle is not None:
            self._handle.close()
            self._handle = None


def read_lines(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """All complete lines of a log, [] if there is none; stops at the first broken one."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return []
    found = []
    for line in text.splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            break
        if not isinstance(entry, dict):
            break
        found.append(entry)
    return found
