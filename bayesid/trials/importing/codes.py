"""Numbers that stand for no reading, such as -32.768 m/s of a DVL without bottom lock: found, said, left out.

Works on a `Draft` whose channels are named: their cells become holes in its recordings, and `missing` in its
map. Does not: look at orders, which hold no readings.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from bayesid.trials.importing.converting import resolve
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.names import WITH_ORDER
from bayesid.trials.trial import Floats
from bayesid.words import and_list, counted

_NINES = re.compile(r"9{4,}")  # 9999, -99.999
_FEW_NINES = re.compile(r"9{3}")  # 99.9 and 999 may be readings: only where they are repeated
_WIDTHS = frozenset({"32768", "32767", "65535", "65536", "2147483647", "2147483648", "4294967295"})
FAR = 1.0  # extents of the other readings, from which a code is no reading
FARTHER = 5.0  # from which a number that is no known code is asked about
REPEATED = 3  # times
MOST_VALUES = 20  # different numbers looked at on each side
_BOTTOM = frozenset({"u", "v", "w", "v_north", "v_east", "v_down"})


def leave_codes_out(draft: Draft) -> None:
    """Takes what is a code as missing, and asks about a number that is repeated far from all others."""
    seen: set[str] = set()
    for role, entry in list(draft.map.channels.items()):
        if role.removesuffix("_cmd") in WITH_ORDER or role.endswith("_cmd") or role.startswith("delta_"):
            continue
        values = draft.raw(role)
        codes = codes_in(values)
        if codes and entry.source not in seen:
            draft.map = draft.change(role, missing=tuple(codes))
            _say(draft, role, codes, values)
        _clear(draft, role, codes)
        seen.add(entry.source)
        left = values[~np.isin(values, codes)]
        for value, count in _repeated_far_off(left):
            draft.ask(
                1,
                f"{counted(count, 'reading')} of {draft.column(role)} are exactly {value:g}, the others "
                f"{_span(left[left != value])}; is that a code for no reading? then write "
                f"`missing = [{value!r}]` in its line of the map",
            )


def codes_in(values: Floats) -> list[float]:
    """Numbers of a series that are codes for no reading: known ones, far outside the others."""
    found: list[float] = []
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    for _ in range(2 * MOST_VALUES):
        rest = values[~np.isin(values, found)]
        if rest.size < 4:
            break
        ends = [v for v in (float(rest.min()), float(rest.max())) if v not in found]
        new = [v for v in ends if _is_code(v, int(np.sum(rest == v)))]
        new = [v for v in new if _far(v, rest[~np.isin(rest, [*new, v])], FAR)]
        if not new:
            break
        found += list(dict.fromkeys(new))
    return sorted(found)


def _figures(value: float) -> str:
    """Digits of a number, as of one that was kept in 32 bits."""
    text = f"{abs(value):.7g}"
    return (f"{abs(value):.10g}" if "e" in text else text).replace(".", "").lstrip("0")


def _is_code(value: float, count: int) -> bool:
    figures = _figures(value)
    if "e" in figures:
        return False
    bare = figures.rstrip("0") or figures
    if figures in _WIDTHS or _NINES.fullmatch(bare):
        return True
    return count >= REPEATED and _FEW_NINES.fullmatch(bare) is not None


def _far(value: float, others: Floats, times: float) -> bool:
    if others.size < 4:
        return False
    low, high = float(others.min()), float(others.max())
    off = max(low - value, value - high)
    return off > times * (high - low) and abs(value) > 2.0 * max(abs(low), abs(high))


def _repeated_far_off(values: Floats) -> list[tuple[float, int]]:
    found = []
    for value in {float(values.min()), float(values.max())} if values.size else ():
        count = int(np.sum(values == value))
        others = values[values != value]
        if (
            count >= REPEATED
            and others.size > 2 * count
            and np.ptp(others) > 0.0
            and _far(value, others, FARTHER)
        ):
            found.append((value, count))
    return found


def _say(draft: Draft, role: str, codes: list[float], values: Floats) -> None:
    count = int(np.isin(values, codes).sum())
    bottom = role in _BOTTOM and all(_figures(c) in _WIDTHS for c in codes)
    what = ", the code of a DVL without bottom lock" if bottom else ", a code for no reading"
    what = f"{what}, " if len(codes) == 1 else ", codes for no reading, "
    verb = "is" if count == 1 else "are"
    draft.remark(
        f"{counted(count, 'reading')} of {draft.column(role)} {verb} {and_list([f'{c:g}' for c in codes])}"
        f"{what}and {verb} taken as missing: the others {_span(values[~np.isin(values, codes)])}; `missing` "
        "in its line of the map says so"
    )


def _span(others: Floats) -> str:
    return f"reach from {others.min():.4g} to {others.max():.4g}"


def _clear(draft: Draft, role: str, codes: list[float]) -> None:
    """The cells of codes become holes in the recordings of a draft."""
    if not codes:
        return
    label, name = resolve(draft.map, role)
    for recording in draft.recordings:
        log = recording.logs.get(label)
        if log is None or name not in log.by_name:
            continue
        channels = tuple(
            replace(c, values=np.where(np.isin(c.values, codes), np.nan, c.values)) if c.name == name else c
            for c in log.channels
        )
        recording.logs[label] = replace(log, channels=channels)
