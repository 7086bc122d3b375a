"""Every iterate on disk, one JSON line each, so that a killed fit goes on where it was.

Takes plain numbers. A torn last line, as a kill leaves it, is ignored on reading. Does not decide anything.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TextIO

from bayesid.errors import FitError
from bayesid.files import read_lines, write_atomic


class IterateLog:
    """Append-only log of fits; without a path it forgets.

    Every line carries the digest of what it belongs to. Lines of another fit stay where they are and are not
    used.

    Attributes
    ----------
    found : lines of an earlier run of the same fit, oldest first; empty for a new one
    of_others : whether the file holds lines of another fit
    """

    def __init__(
        self, path: str | os.PathLike[str] | None, header: Mapping[str, Any], resume: bool = True
    ) -> None:
        self.found: list[dict[str, Any]] = []
        self.of_others = False
        self._header = dict(header)
        self._path = None if path is None else Path(path)
        self._handle: TextIO | None = None
        if self._path is None:
            return
        lines = read_lines(self._path)
        mine = [line for line in lines if line.get("digest") == header["digest"] and "kind" in line]
        self.of_others = any(line.get("digest") != header["digest"] for line in lines)
        kept = lines if resume else [line for line in lines if line.get("digest") != header["digest"]]
        self.found = mine if resume else []
        self._open(kept)

    def _open(self, kept: list[dict[str, Any]]) -> None:
        """Go on after the lines that are kept; the file is written anew where it holds anything else."""
        assert self._path is not None
        text = "".join(json.dumps(line) + "\n" for line in kept)
        if not self.found:
            text += json.dumps(self._header) + "\n"
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            if not self._path.exists() or self._path.read_bytes() != text.encode("utf-8"):
                write_atomic(self._path, text)
            self._handle = self._path.open("a", encoding="utf-8")
        except OSError as error:
            raise FitError(f"{self._path}: the fit's log cannot be written ({error.strerror})") from None

    def refuse(self) -> Path | None:
        """Put the log aside under another name and begin anew; gives that name."""
        self.found = []
        if self._path is None:
            return None
        self.close()
        number = 1
        while (aside := self._path.with_suffix(f".refused{number}{self._path.suffix}")).exists():
            number += 1
        try:
            os.replace(self._path, aside)
        except OSError as error:
            raise FitError(f"{self._path}: the fit's log cannot be put aside ({error.strerror})") from None
        self._open([])
        return aside

    def write(self, **line: Any) -> None:
        """Append one line; a reader never sees half of it followed by another."""
        if self._handle is not None:
            try:
                self._handle.write(json.dumps({"digest": self._header["digest"], **line}) + "\n")
                self._handle.flush()
            except OSError as error:
                raise FitError(
                    f"{self._path}: the fit's log cannot be written ({error.strerror}); make room and run "
                    "the same command again: it goes on where it was"
                ) from None

    def close(self) -> None:
        if self._handle is not None:
            with suppress(OSError):  # what could not be written was told
                self._handle.close()
            self._handle = None
