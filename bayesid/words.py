"""Numbers and names in sentences.

Takes a count and its noun, or names. Does not: know any sentence.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

LEAST_ALIKE = 0.6  # ratio of `difflib` from which a known name is taken for what was meant
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
WRITTEN_OUT = 1e7  # below it a large number is written without a power of ten


def counted(number: int, noun: str, plural: str = "") -> str:
    """`1 run`, `2 runs`; `plural` where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def first_few(names: Iterable[str], most: int, between: str = ", ") -> str:
    """`a, b and 3 more`: the first `most` of some names, and how many more there are."""
    every = list(names)
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return between.join(every[:most]) + more


def digits(x: float, count: int) -> str:
    """Some significant digits of a number; one of thousands or millions is written out: 220, not 2.2e+02."""
    text = f"{x:.{count}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(x) < WRITTEN_OUT else text


def and_list(names: Iterable[str]) -> str:
    """`a`, `a and b`, `a, b and c`; nothing where there is none."""
    *others, last = list(names) or [""]
    return f"{', '.join(others)} and {last}" if others else last


def did_you_mean(names: Iterable[str], known: Iterable[str]) -> str:
    """`; did you mean N_dr?`: the known name nearest to each unknown one; nothing where none is near.

    The bars of a coefficient, which a shell takes for its own, may be left out: N_rr is N_r|r|.
    """
    there = list(known)
    bare = {name.replace("|", "").lower(): name for name in there if "|" in name}
    small = {name.lower(): name for name in there}
    told: dict[str, None] = {}
    for name in names:
        low = name[:60].lower()
        near = difflib.get_close_matches(low, small, n=1, cutoff=LEAST_ALIKE)
        told |= dict.fromkeys([bare[low]] if low in bare else [small[match] for match in near])
    return f"; did you mean {', '.join(told)}?" if told else ""


def decimal_comma(text: bytes, error: ValueError) -> str:
    """ "; is -12,8 meant as -12.8?", where the line that a parser of TOML names has such a number; else
    nothing."""
    line = re.search(r"at line (\d+)", str(error))
    if line is None:
        return ""
    lines = text.decode("utf-8", "replace").splitlines()
    at = int(line[1]) - 1
    found = re.search(r"=\s*([+-]?\d+),(\d+)\s*(#|$)", lines[at]) if at < len(lines) else None
    return f"; is {found[1]},{found[2]} meant as {found[1]}.{found[2]}?" if found else ""


def grouped(warnings: Sequence[str]) -> list[str]:
    """Remarks that differ in run and number alone as one, with how many runs have it."""
    groups: dict[str, list[str]] = {}
    for text in warnings:
        file, mark, rest = text.partition(".csv: ")
        key = _NUMBER.sub("#", rest) if mark and " " not in file else text
        groups.setdefault(key, []).append(text)
    return [
        g[0] if len(g) == 1 else f"{g[0]} (and alike in {len(g) - 1} other runs)" for g in groups.values()
    ]
