"""What a report is made of: sections holding text, tables and figures, all frozen plain data.

Takes finished content. Checks shapes and names at once, so that a long study does not fail at its last line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

_FIGURE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,79}")


@dataclass(frozen=True)
class Text:
    """Words in a small markup: blank line = paragraph, `- ` and `1. ` lists, ``` fences, **bold**, `code`,
    [link](https://...). HTML is never interpreted; pass foreign names through `literal`."""

    body: str


@dataclass(frozen=True)
class Table:
    """Rows of plain cells (text, number, bool or None); cells are never markup.

    `digits` is the number of significant digits of a float.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    caption: str = ""
    digits: int = 4

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", tuple(str(column) for column in self.columns))
        object.__setattr__(self, "rows", tuple(tuple(row) for row in self.rows))
        for number, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                cells = f"{len(row)} cells for {len(self.columns)} columns"
                raise ValueError(f"table {self.caption!r}: row {number} has {cells}")


@dataclass(frozen=True)
class Figure:
    """A finished picture: PNG bytes, or any object with matplotlib's `savefig`.

    `name` is the file name without ending below `figures/`.
    """

    name: str
    image: Any
    caption: str = ""
    alt: str = ""

    def __post_init__(self) -> None:
        if not _FIGURE_NAME.fullmatch(self.name):
            raise ValueError(f"figure name {self.name!r}: use letters, digits, - and _ only, at most 80")
        if not hasattr(self.image, "savefig") and bytes(self.image[:4]) != b"\x89PNG":
            raise ValueError(f"figure {self.name!r}: neither PNG bytes nor a matplotlib figure")


@dataclass(frozen=True)
class Row:
    """Figures beside one another on a wide page, below one another on a narrow one; one caption for all."""

    figures: Sequence[Figure]
    caption: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "figures", tuple(self.figures))


@dataclass(frozen=True)
class Replay:
    """A run that can be played in the HTML report; Markdown and print leave it out.

    `data` is plain: t, series of label, colour, dash, x, y, psi (first the log; None where nothing is),
    orders of label, unit, values, and forces of label, colour, dash, X, Y [N], N [N m] in body axes, drawn as
    arrows on the log; all of one length.
    """

    data: Mapping[str, Any]
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A heading and its blocks; a block may be a section of the next level."""

    title: str
    blocks: Sequence[Block] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        object.__setattr__(self, "blocks", tuple(self.blocks))


Block: TypeAlias = "Text | Table | Figure | Row | Replay | Section"


@dataclass(frozen=True)
class Report:
    """A title, the finding in a few sentences, and the sections.

    Attributes
    ----------
    lead : same markup as Text; stands in a box
    failures : checks that failed, same markup; stand in the box too
    first : blocks of the first screen, above the contents
    """

    title: str
    lead: str
    sections: Sequence[Section]
    failures: Sequence[str] = ()
    first: Sequence[Block] = ()

    def __post_init__(self) -> None:
        for name in ("sections", "failures", "first"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        seen: set[str] = set()
        for figure in figures_of((*self.first, *self.sections)):
            if figure.name in seen:
                raise ValueError(f"two figures are named {figure.name!r}; one would overwrite the other")
            seen.add(figure.name)


def figures_of(blocks: Sequence[Block]) -> list[Figure]:
    """All figures below these blocks, in reading order."""
    found: list[Figure] = []
    for block in blocks:
        if isinstance(block, Figure):
            found.append(block)
        elif isinstance(block, Row):
            found.extend(block.figures)
        elif isinstance(block, Section):
            found.extend(figures_of(block.blocks))
    return found


def cell_text(value: Any, digits: int = 4) -> str:
    """One table cell as text: floats to `digits` significant digits, None and NaN a dash, bool yes or no."""
    if hasattr(value, "item") and getattr(value, "ndim", 0) == 0:
        value = value.item()
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "–" if value != value else format_number(value, digits)
    return str(value)


def format_number(value: float, digits: int = 4) -> str:
    """A number a reader can compare: fixed point from 1e-3 to 1e6, else a power of ten."""
    if value == 0:
        return "0"
    if value in (float("inf"), float("-inf")):
        return f"{value:g}"
    if 1e-3 <= abs(value) < 1e6:
        text = f"{value:.{digits}g}"
        return text if "e" not in text else f"{value:.0f}"
    return f"{value:.{digits - 1}e}"
