"""Docstrings of the house, whose entries stand on one line, as numpydoc has them."""

from __future__ import annotations

import re
from collections.abc import Sequence

_LISTED = ("Parameters", "Attributes")
_GIVEN = ("Returns", "Raises")
_NAMED = re.compile(r"^(\*{0,2}\w[\w, *]*) : (.*)$")
_TWO_PARTS = re.compile(r"^(\S.*?\S|\S)(?:\s{2,}| : )(.*)$")


def spread(lines: Sequence[str]) -> list[str]:
    """`a, b : text` of Parameters and Attributes, `Kind    text` of Returns and Raises, on two lines."""
    out: list[str] = []
    section = ""
    for k, line in enumerate(lines):
        below = lines[k + 1].strip() if k + 1 < len(lines) else ""
        if below and set(below) == {"-"}:
            section = line.strip()
        pattern = _NAMED if section in _LISTED else _TWO_PARTS if section in _GIVEN else None
        found = pattern.match(line) if pattern is not None else None
        out += [found[1], "    " + found[2]] if found is not None else [line]
    return out
