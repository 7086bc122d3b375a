"""Read typed values out of a parsed TOML table, collecting every problem instead of stopping at the first.

Takes: a table and the name it has in the file. Gives values, or None where one is missing or wrong.
Does not: know what a vehicle is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from bayesid.words import did_you_mean

LARGEST = 1e30  # keeps 1/2 rho L^6 times a coefficient finite


def shown(value: object) -> str:
    """repr, cut to a length that fits a message."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def hint(name: str, known: Iterable[str]) -> str:
    """ "; did you mean ...?" with the nearest known name, or nothing."""
    return did_you_mean((name,), known)


class TomlTable:
    """One table of a file; problems of all its keys end up in the shared list `problems`."""

    def __init__(self, data: Any, where: str, problems: list[str]) -> None:
        self.where, self.problems = where, problems
        self.data: Mapping[str, Any] = data if isinstance(data, dict) else {}
        if not isinstance(data, dict):
            problems.append(f"[{where}] must be a table, not {shown(data)}")

    def problem(self, text: str) -> None:
        self.problems.append(f"[{self.where}] {text}")

    def only(self, known: Iterable[str]) -> None:
        """Report every key that is not in `known`."""
        known = list(known)
        for key in self.data:
            if key not in known:
                self.problem(f"unknown key {shown(key)}{hint(key, known)}")

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        required: bool = False,
        low: float = -LARGEST,
        high: float = LARGEST,
    ) -> float | None:
        """A finite number between low and high, both allowed."""
        if key not in self.data:
            if required:
                self.problem(f"{key} is missing")
            return default
        value = as_number(self.data[key])
        if value is None:
            self.problem(f"{key} must be a finite number, not {shown(self.data[key])}")
            return default
        if not low <= value <= high:
            self.problem(f"{key} = {value:g} must lie between {low:g} and {high:g}")
            return default
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.data.get(key, default)
        if not isinstance(value, bool):
            self.problem(f"{key} must be true or false, not {shown(value)}")
            return default
        return value

    def text(
        self, key: str, default: str = "", *, required: bool = False, choices: Iterable[str] = ()
    ) -> str:
        if key not in self.data:
            if required:
                self.problem(f"{key} is missing")
            return default
        value, choices = self.data[key], list(choices)
        if not isinstance(value, str):
            self.problem(f"{key} must be text, not {shown(value)}")
            return default
        if choices and value not in choices:
            self.problem(f"{key} = {shown(value)} must be one of {', '.join(choices)}{hint(value, choices)}")
            return default
        return value

    def vector(self, key: str, default: tuple[float, float, float]) -> tuple[float, float, float]:
        value = self.data.get(key, default)
        numbers = [as_number(item) for item in value] if isinstance(value, (list, tuple)) else []
        if len(numbers) != 3 or any(item is None or abs(item) > 1e5 for item in numbers):
            self.problem(f"{key} must be three finite numbers [m], not {shown(value)}")
            return default
        x, y, z = (float(item) for item in numbers if item is not None)
        return (x, y, z)


def as_number(value: object) -> float | None:
    """Float of an int or float (not of true/false) that is finite, else None."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
