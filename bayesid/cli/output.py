"""Printing answers: aligned columns for people, JSON for programs, both on stdout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesid.files import json_text
from bayesid.progress import printable
from bayesid.report.blocks import cell_text


def say(text: str = "") -> None:
    """One line or paragraph of the answer."""
    print(printable(text))


def say_json(data: Any) -> None:
    """The answer for a program."""
    print(json_text(data))


def say_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 4) -> None:
    """Aligned columns; numbers to the right, the last column as long as it wants."""
    cells = [[printable(cell_text(value, digits)).replace("\n", " ") for value in row] for row in rows]
    widths = [max(len(row[k]) for row in [list(columns), *cells]) for k in range(len(columns))]
    right = [bool(rows) and all(_is_number(row[k]) for row in rows) for k in range(len(columns))]

    def line(row: Sequence[str]) -> str:
        padded = (c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True))
        return "  ".join(padded).rstrip()

    print(line(columns))
    print("  ".join("-" * width for width in widths))
    for row in cells:
        print(line(row))


def _is_number(value: Any) -> bool:
    return value is None or (hasattr(value, "__float__") and not isinstance(value, bool | str))
