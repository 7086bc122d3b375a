"""Which manoeuvres of a library to run, and in which order.

Takes information of candidates and a `Goal`. Gives an ordered choice: the best next one each time, then
exchanges until none helps. Does not fly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from bayesid.analysis.design.criteria import gain, posterior
from bayesid.analysis.design.goals import Goal
from bayesid.analysis.design.information import RunInformation

Array = np.ndarray


@dataclass(frozen=True)
class Choice:
    """An ordered set of manoeuvres.

    names : in flying order; a name may come twice
    values : of the goal after each, in its unit; `before` without any
    exchanged : whether exchanges improved on the greedy choice
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    before: float
    exchanged: bool


@dataclass(frozen=True)
class BestSet:
    """The set of so many runs that teaches most.

    names : of the manoeuvres; one may come twice
    seconds : all together
    adds : information gained on top of the runs executed [nats]: least, mean and most of the vehicles drawn
    left : mean share of what was known, as variance, that is left after them and the runs executed
    """

    names: tuple[str, ...]
    seconds: float
    adds: tuple[float, float, float]
    left: float


def best_sets(
    candidates: Mapping[str, RunInformation],
    now: Array,
    most: float = np.inf,
    sizes: Sequence[int] = (1, 2, 3),
) -> tuple[BestSet, ...]:
    """The best single run, pair and triple within a time; every set is tried.

    Parameters
    ----------
    now : (d, k, k) information of the runs executed so far
    most : time of a set [s]; sizes of which no set is that short are left out
    """
    found = []
    before = gain(now)
    for size in sizes:
        best: tuple[float, tuple[str, ...], Array, float] | None = None
        for names in combinations_with_replacement(candidates, size):
            seconds = sum(candidates[n].duration for n in names)
            if seconds > most:
                continue
            total = _sum(now, names, candidates)
            gains = gain(total) - before
            if best is None or np.mean(gains) > best[0]:
                best = float(np.mean(gains)), names, total, seconds
        if best is None:
            continue
        value, names, total, seconds = best
        gains = gain(total) - before
        left = float(np.mean(np.einsum("dii->di", posterior(total))))
        found.append(BestSet(names, seconds, (float(np.min(gains)), value, float(np.max(gains))), left))
    return tuple(found)


def rank(candidates: Mapping[str, RunInformation], goal: Goal, now: Array) -> list[tuple[str, float]]:
    """Candidates with the goal's value after each alone, best first."""
    values = {name: goal.value(now + info.matrices) for name, info in candidates.items()}
    return sorted(values.items(), key=lambda item: -item[1])


def choose(candidates: Mapping[str, RunInformation], goal: Goal, now: Array, count: int) -> Choice:
    """Greedy choice of `count` runs, improved by exchanges (Fedorov 1972), ordered by what each adds.

    Parameters
    ----------
    now : (d, k, k) information of the runs executed so far
    """
    picked: list[str] = []
    total = now
    for _ in range(count):
        best = rank(candidates, goal, total)[0][0]
        picked.append(best)
        total = total + candidates[best].matrices
    greedy = list(picked)
    value = goal.value(total)
    for _ in range(10):
        better = False
        for i in range(count):
            without = _sum(now, [p for j, p in enumerate(picked) if j != i], candidates)
            name, new = rank(candidates, goal, without)[0]
            if new > value + 1e-9 * abs(value):
                picked[i], value, better = name, new, True
        if not better:
            break
    order, values, total = [], [], now
    left = list(picked)
    while left:
        name = rank({n: candidates[n] for n in left}, goal, total)[0][0]
        left.remove(name)
        total = total + candidates[name].matrices
        order.append(name)
        values.append(goal.shown(total))
    return Choice(tuple(order), tuple(values), goal.shown(now), sorted(greedy) != sorted(picked))


def _sum(now: Array, names: Sequence[str], candidates: Mapping[str, RunInformation]) -> Array:
    total = now
    for name in names:
        total = total + candidates[name].matrices
    return total
