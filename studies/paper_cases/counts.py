"""Counts over seeds: coefficients on a bound, errors per axis, strays; and what the ratio figures show.

Takes the plain records of `simulated_recovery`. Does not simulate, draw or choose words.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.paper_cases.targets import values

Runs = Sequence[Mapping[str, Any]]
AXES, ALL_AXES = ("X", "Y", "N"), "XYZKMN"
STRAY = 5.0  # %; the paper names strays by eye, half of the 10 % width of the starts is taken here


@dataclass(frozen=True)
class Shown:
    """One column of a ratio figure; `kind` is unknown, known or zero, arrays hold one ratio per seed.

    A known coefficient has only `end`, the value the fit was given; a zero one has none.
    """

    name: str
    kind: str
    start: tuple[float, ...] = ()
    end: tuple[float, ...] = ()
    later: tuple[float, ...] = ()
    low: float = float("nan")
    high: float = float("nan")


def on_bound(runs: Runs) -> list[int]:
    """Coefficients on a bound, per fit."""
    return [len(run["at_bound"]) for run in runs]


def names_on_bound(runs: Runs) -> Counter[str]:
    """Fits per coefficient that ended on a bound."""
    return Counter(name for run in runs for name in run["at_bound"])


def axis_errors(runs: Runs, stage: str | None) -> dict[str, float]:
    """Rms error of the coefficients of each axis [%], median over seeds; `stage` None for plain searches."""
    off = 100 * (values(runs, "ratio") if stage is None else values(runs, stage, "ratio")) - 100
    names = runs[0]["names"]
    found = {}
    for axis in AXES:
        mine = off[:, [i for i, n in enumerate(names) if n[0] == axis]]
        if mine.size:
            found[axis] = float(np.median(np.sqrt(np.mean(mine**2, axis=1))))
    return found


def errors_by_name(runs: Runs, stage: str | None) -> dict[str, tuple[float, int]]:
    """Coefficient -> median size of its error [%] and seeds in which it exceeds `STRAY`; worst first."""
    off = 100 * np.abs((values(runs, "ratio") if stage is None else values(runs, stage, "ratio")) - 1)
    middle = np.median(off, axis=0)
    return {
        runs[0]["names"][i]: (float(middle[i]), int(np.sum(off[:, i] > STRAY))) for i in np.argsort(-middle)
    }


def strays(runs: Runs, stage: str | None) -> dict[str, tuple[float, int]]:
    """Those of `errors_by_name` whose median error exceeds `STRAY`."""
    return {n: found for n, found in errors_by_name(runs, stage).items() if found[0] > STRAY}


def shown(runs: Runs, names: Sequence[str], zeros: Sequence[str], stage: str) -> list[Shown]:
    """Every coefficient of the equations in the order of the axes: unknown, known and zero ones.

    Parameters
    ----------
    names : coefficients the vehicle has
    zeros : rows of the equations whose coefficient is zero
    stage : read as the estimate; "end" is shown beside it where the record has both
    """
    unknown = list(runs[0]["names"])
    given = [n for n in names if n not in unknown]
    start, end, later = (values(runs, s, "ratio") for s in ("start", stage, "end"))
    low, high = values(runs, "low").min(axis=0), values(runs, "high").max(axis=0)
    known = values(runs, "known_ratio")
    out = []
    for name in sorted([*names, *zeros], key=lambda n: ALL_AXES.index(n[0])):
        if name in unknown:
            k = unknown.index(name)
            more = tuple(later[:, k]) if stage != "end" else ()
            out.append(
                Shown(
                    name, "unknown", tuple(start[:, k]), tuple(end[:, k]), more, float(low[k]), float(high[k])
                )
            )
        elif name in given:
            column = known[:, given.index(name)] if known.size else np.ones(1)
            out.append(Shown(name, "known", end=tuple(float(v) for v in column)))
        else:
            out.append(Shown(name, "zero"))
    return out


def rank_correlation(first: Mapping[str, float], second: Mapping[str, float]) -> float:
    """Spearman's rank correlation of two numbers per coefficient."""
    a, b = (np.argsort(np.argsort([m[n] for n in first])) for m in (first, second))
    return float(np.corrcoef(a, b)[0, 1])
