"""Numbers and names in sentences.

Takes a count and its noun, or names. Does not: know any sentence.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LEAST_ALIKE = 0.6  # ratio of `difflib` from which a known name is taken for what was meant


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


def did_you_mean(names: Iterable[str], known: Iterable[str]) -> str:
    """`; did you mean N_dr?`: the known name nearest to each unknown one; nothing where none is near."""
    there = list(known)
    small = {name.lower(): name for name in there}
    near = [difflib.get_close_matches(n[:60].lower(), small, n=1, cutoff=LEAST_ALIKE) for n in names]
    told = list(dict.fromkeys(small[match] for found in near for match in found))
    return f"; did you mean {', '.join(told)}?" if told else ""
