"""What time stamps of a log are like, and what is said of those that are not the times of its readings.

Takes a `RawLog`. Does not: ask or change anything.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.trials.assemble import ROUNDED, SET_BACK
from bayesid.trials.equal_times import rows_behind
from bayesid.trials.health import uneven_steps
from bayesid.trials.importing.converting import resolve
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.raw import RawLog
from bayesid.trials.trial import Floats

GAP, SHORTEST = 10.0, 2.0  # times the usual step, and seconds
FEWEST = 10  # stamps


@dataclass(frozen=True)
class Stamps:
    """What the stamps of a log, in the order of its rows, are like.

    equal : share of the readings of one column that repeat the stamp before; repeats : which ones, in words
    late : rows behind an earlier one, singly
    set_back : (time before [s], step back [s]) of every place from which on the clock runs behind
    gaps : (start [s], length [s]); usual : median step that is not zero [s]
    uneven : 15th and 85th per cent of the steps [s] where they jitter, else None
    """

    equal: float
    repeats: str
    late: int
    set_back: tuple[tuple[float, float], ...]
    gaps: tuple[tuple[float, float], ...]
    usual: float
    uneven: tuple[float, float] | None


def look_at(t: Floats) -> Stamps | None:
    """Stamps of rows in the order of the file; None for too few of them."""
    t = t[np.isfinite(t)]
    if t.size < FEWEST:
        return None
    step = np.diff(t)
    usual = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    top = np.maximum.accumulate(t)
    first, last = rows_behind(t)
    long = [(a, b) for a, b in zip(first, last, strict=True) if b - a >= SET_BACK]
    late = int(sum(b - a for a, b in zip(first, last, strict=True) if b - a < SET_BACK))
    wide = np.flatnonzero(step > max(GAP * usual, SHORTEST))
    return Stamps(
        float(np.mean(step == 0.0)),
        "rows",
        late,
        tuple((float(t[a - 1]), float(top[a] - t[a])) for a, _ in long),
        tuple((float(t[k]), float(step[k])) for k in wide),
        usual,
        uneven_steps(step[step > 0]),
    )


def columns_of(found: LogMap, label: str) -> frozenset[str]:
    """Columns that a map reads from files of a label."""
    named = (resolve(found, role) for role in found.channels)
    return frozenset(name for its, name in named if its == label)


def look_into(log: RawLog, columns: Collection[str]) -> Stamps | None:
    """Stamps of a log; of readings that repeat a stamp, by the column among some in which most do.

    Sensors that share a table and a stamp have a row each with the cells of the others empty, and nothing of
    these is lost.
    """
    longest = max(log.channels, key=lambda c: c.t.size, default=None)
    found = None if longest is None else look_at(longest.t)
    if found is None:
        return None
    most, repeats = 0.0, found.repeats
    for channel in log.channels:
        good = np.isfinite(channel.t) & np.isfinite(channel.values)
        if channel.name not in columns or good.sum() < FEWEST:
            continue
        equal = float(np.mean(np.diff(channel.t[good]) == 0.0))
        if equal > most:
            most = equal
            repeats = "rows" if good.all() else f"readings of {channel.name!r}"
    return replace(found, equal=most, repeats=repeats)


def set_back_words(name: str, found: Stamps) -> str:
    """Of a clock that is set back."""
    at, back = max(found.set_back, key=lambda item: item[1])
    more = f" ({len(found.set_back)} times; the largest step)" if len(found.set_back) > 1 else ""
    return (
        f"the clock of {name} is set back by {back:.3g} s after {at:.1f} s{more}: rows are sorted by "
        "time, which mixes what was before and after; correct the file, or cut that time out by `window`"
    )


def rounded_words(name: str, label: str, found: Stamps, lost: str = "", spread: bool = False) -> str:
    """Of stamps that are rounded; lost : what becomes of the rest as the map stands; spread : whether the map
    spreads them already."""
    each = 1.0 / (1.0 - found.equal)
    return (
        f"stamps of {name} are rounded: about {each:.1f} {found.repeats} have one stamp, {found.usual:.3g} s "
        f"apart{lost}; spread = true in [sources.{label}]{', which is set,' if spread else ''} spreads "
        f"rows evenly until the next stamp, right within {found.usual:.3g} s; better give the stamps with "
        "more digits"
    )


def small_words(name: str, found: Stamps) -> list[str]:
    """Of stamps that are repeated here and there, and of rows out of order."""
    out = []
    if 0.0 < found.equal <= ROUNDED:
        out.append(
            f"{name}: {found.equal:.1%} of the {found.repeats} repeat a stamp; the last of each is read"
        )
    if found.late:
        rows = "1 row is" if found.late == 1 else f"{found.late} rows are"
        out.append(f"{name}: {rows} out of order and sorted by time")
    return out


def told_of(found: LogMap, logs: Mapping[str, RawLog]) -> list[str]:
    """What an import by a map that is there says of the stamps, as a proposal would ask or remark."""
    out = []
    for label, log in logs.items():
        name, stamps = Path(log.path).name, look_into(log, columns_of(found, label))
        if stamps is None:
            continue
        if stamps.set_back:
            out.append(set_back_words(name, stamps))
        if stamps.equal > ROUNDED:
            out.append(rounded_words(name, label, stamps, ", of which the last is read"))
        out += small_words(name, stamps)
    return out
