"""A column that repeats its last value for seconds while the vehicle moves on: a sensor that froze.

Takes runs weighed as they are. Gives hypotheses whose mend leaves the repeated readings out.
Does not: take a saturated or quantised column for a frozen one, or one that rests in a steady run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.trial import Floats, Run

LEAST = 8  # readings repeated
# s; the receiver of the tanker in the pond drops out for 1.3 s, which is an outlier and no mistake of the log
SHORTEST = 2.0
USUALLY = 0.05  # share of repeated readings beside the frozen stretches: above it the column is quantised
OTHERS = 0.5  # share of the time in which other columns change meanwhile
HELD = 0.4  # share of steps outside the stretches, below which the column is that of a slower sensor, held
JUMP = 4.0  # step out of a stretch, over the median step, where a column has no noise that must change it
NOISY = 0.7  # change from step to step over the median step; 1.7 for white noise, small for smooth motion
NATS_PER_READING, MOST = 2.5, 40.0  # a reading with noise repeats itself once in twenty at most


def frozen(base: Sequence[Base]) -> list[Weighed]:
    """Every column that froze in some runs."""
    names = dict.fromkeys(name for one in base for name in one.run.data)
    out = []
    for name in names:
        count = np.array([_repeated(one.run, name) for one in base])
        if not count.any():
            continue
        odds = np.minimum(MOST, NATS_PER_READING * count)
        seconds = max(_longest(one.run, name) for one in base)
        where = tuple(one.run.name for one, k in zip(base, count, strict=True) if k)
        says = f"{name} repeats its last value for up to {seconds:.3g} s while the vehicle moves on"
        correction = Correction(skip_repeats=(name,), runs=where if len(where) < len(base) else ())
        mistake = Mistake(f"frozen {name}", says, correction, USUAL)
        out.append(Weighed(mistake, odds, {"size": odds}))
    return out + _at_once(base, out)


def _at_once(base: Sequence[Base], found: Sequence[Weighed]) -> list[Weighed]:
    """Columns that froze together, at least two: one receiver, one mistake."""
    frozen_at = {
        w.mistake.channels[0]: [frozen_samples(one.run, w.mistake.channels[0]) for one in base] for w in found
    }
    groups: list[list[Weighed]] = []
    for w in found:
        own = frozen_at[w.mistake.channels[0]]
        first = next((g for g in groups if _together(frozen_at[g[0].mistake.channels[0]], own)), None)
        if first is None:
            groups.append([w])
        else:
            first.append(w)
    return [_joint(base, group) for group in groups if len(group) > 1]


def _joint(base: Sequence[Base], group: Sequence[Weighed]) -> Weighed:
    names = [w.mistake.channels[0] for w in group]
    seen = {r for w in group if (c := w.mistake.correction) for r in c.runs or (one.run.name for one in base)}
    where = tuple(one.run.name for one in base if one.run.name in seen)
    both = Correction(skip_repeats=tuple(names), runs=where if len(where) < len(base) else ())
    seconds = max(_longest(one.run, n) for one in base for n in names)
    says = f"{' and '.join(names)} repeat their last values at the same time, for up to {seconds:.3g} s"
    odds = np.sum([w.odds for w in group], axis=0)
    mistake = Mistake(f"frozen {', '.join(names)}", f"{says}, while the vehicle moves on", both, USUAL)
    return Weighed(mistake, odds, {"size": odds})


def frozen_samples(run: Run, name: str) -> np.ndarray:
    """Whether a column is frozen at each sample of a run."""
    out = np.zeros(run.n_samples, dtype=bool)
    for first, last in _frozen(run, name):
        out[first : last + 1] = True
    return out


def _together(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> bool:
    """Whether two columns are frozen at once for half of the time that either is, in the runs where both are.

    In others one may come back so near to where it froze that it is not seen.
    """
    both = [(a, b) for a, b in zip(one, other, strict=True) if a.any() and b.any()]
    common = sum(int(np.sum(a & b)) for a, b in both)
    return bool(both) and 2 * common >= sum(int(np.sum(a | b)) for a, b in both)


def _stretches(run: Run, name: str) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Samples at which a column is read, and first and last of the stretches of equal readings in them."""
    good = np.flatnonzero(np.isfinite(run.data[name]))
    x = run.data[name][good]
    change = np.flatnonzero(np.concatenate(([True], np.diff(x) != 0.0, [True])))
    pairs = zip(change[:-1], change[1:] - 1, strict=True)
    return good, [(int(a), int(b)) for a, b in pairs if b - a >= LEAST]


def _frozen(run: Run, name: str) -> list[tuple[int, int]]:
    """First and last sample of every stretch in which a column is frozen."""
    if name not in run.data:
        return []
    good, pairs = _stretches(run, name)
    x: Floats = run.data[name][good]
    step = np.abs(np.diff(x))
    if not pairs or good.size < 4 * LEAST:
        return []
    outside = np.ones(step.size, dtype=bool)
    for a, b in pairs:
        outside[a:b] = False
    if outside.mean() < HELD or float(np.mean(step[outside] == 0.0)) > USUALLY:
        return []
    usual = float(np.median(step[outside]))
    noisy = float(np.median(np.abs(np.diff(np.diff(x)[outside])))) > NOISY * usual
    out = []
    for a, b in pairs:
        saturated = x[a] in (x.min(), x.max()) and sum(x[a] == x[p] for p, _ in pairs) > 1
        # one without noise that rests from the first reading on is steady until the first order
        leaps = noisy or (a > 0 and (b + 1 >= x.size or abs(x[b + 1] - x[b]) > JUMP * usual))
        lasts = run.t[good[b]] - run.t[good[a]] >= SHORTEST
        if lasts and not saturated and leaps and _others_move(run, name, int(good[a]), int(good[b])):
            out.append((int(good[a]), int(good[b])))
    return out


def _others_move(run: Run, name: str, first: int, last: int) -> bool:
    shares = []
    for other, values in run.data.items():
        part = values[first : last + 1]
        part = part[np.isfinite(part)]
        if other != name and part.size > LEAST // 2:
            shares.append(float(np.mean(np.diff(part) != 0.0)))
    return bool(shares) and float(np.median(shares)) >= OTHERS


def _repeated(run: Run, name: str) -> float:
    return float(sum(b - a for a, b in _frozen(run, name)))


def _longest(run: Run, name: str) -> float:
    return max((float(run.t[b] - run.t[a]) for a, b in _frozen(run, name)), default=-math.inf)
