"""Numbers and names in sentences.

Takes a count and its noun, or names. Does not: know any sentence.
"""

from __future__ import annotations

from collections.abc import Iterable


def counted(number: int, noun: str, plural: str = "") -> str:
    """`1 run`, `2 runs`; `plural` where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def first_few(names: Iterable[str], most: int, between: str = ", ") -> str:
    """`a, b and 3 more`: the first `most` of some names, and how many more there are."""
    every = list(names)
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return between.join(every[:most]) + more


def and_list(names: Iterable[str]) -> str:
    """`a`, `a and b`, `a, b and c`; nothing where there is none."""
    *others, last = list(names) or [""]
    return f"{', '.join(others)} and {last}" if others else last
