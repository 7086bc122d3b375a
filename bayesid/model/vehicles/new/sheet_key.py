"""One number of a data sheet, and its line in a template.

Takes: nothing. Does not: read a sheet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Key:
    """One number of a data sheet: unit, meaning, range, value where it may be left out."""

    unit: str
    meaning: str
    low: float = 1e-6
    high: float = 1e9
    default: float | None = None
    required: bool = False


def template_line(key: str, row: Key, example: Mapping[str, float]) -> str:
    """The key with its example (a comment without one), unit and meaning."""
    value = example.get(key, row.default)
    shown = f"{key} = {value:g}" if value is not None else f"# {key} ="
    return f"{shown}  # {row.unit}: {row.meaning}" + (" (needed)" if row.required else "")
