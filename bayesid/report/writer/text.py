"""Answers as plain text: aligned columns.

Takes finished cells. Does not print.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bayesid.progress import printable
from bayesid.report.writer.blocks import cell_text


def table_text(columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 4) -> str:
    """Aligned columns, without a line end; numbers to the right, the last column as long as it wants."""
    cells = [[printable(cell_text(value, digits)).replace("\n", " ") for value in row] for row in rows]
    widths = [max(len(row[k]) for row in [list(columns), *cells]) for k in range(len(columns))]
    right = [bool(rows) and all(_is_number(row[k]) for row in rows) for k in range(len(columns))]

    def line(row: Sequence[str]) -> str:
        padded = (c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True))
        return "  ".join(padded).rstrip()

    return "\n".join(
        [line(columns), "  ".join("-" * width for width in widths), *(line(row) for row in cells)]
    )


def _is_number(value: Any) -> bool:
    return value is None or (hasattr(value, "__float__") and not isinstance(value, bool | str))
