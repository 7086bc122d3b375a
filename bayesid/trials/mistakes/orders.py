"""An angle logged as measured that is the order: it jumps where a fin would be seen on its way.

Takes runs weighed as they are, and the rates of the vehicle's fins where they are stated. Gives hypotheses.
Does not: tell an order from a fin that is faster than the log is read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import logsumexp

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.plausible import implausible
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.trial import Floats, Run

# An order stands exactly still most of the time and jumps by more than an angle faster than fins move
JUMP_ANGLE, JUMP_RATE, STANDS = math.radians(3.0), math.radians(60.0), 0.8
ON_THE_WAY = 0.1  # share of moves read on their way, from which on the angle is no order that jumps
FEWEST_JUMPS = 3
SURE = 30.0  # nats of an angle that jumps faster than any fin
RATE_SD = 0.4  # of the logarithm of a fin's rate over the one stated, as of what a fin does to the vehicle
RATES = np.linspace(-4.0, 4.0, 33)  # standard deviations over which it is averaged
LEAST = 1e-3  # chance that one move falls between two readings, whatever the rate


def ordered(base: Sequence[Base], rates: Mapping[str, float] | None = None) -> list[Weighed]:
    """Angles logged as measured that stand still and jump as only orders do.

    Parameters
    ----------
    rates : fin -> stated rate [rad/s]: a fin that takes a time to move is read on its way, unless every move
        falls between two readings; an order never is
    """
    out = []
    fins = sorted({name for one in base for name in one.run.measured_inputs if name.startswith("delta_")})
    for name in fins:
        found = [jumps(one.run, name) if is_measured(one.run, name) else None for one in base]
        there = np.array([one is not None for one in found])
        if not there.any():
            continue
        faster = np.array([t and _is_order(one.run, name) for t, one in zip(there, base, strict=True)])
        sure = np.where(faster & (faster.sum() >= 0.5 * there.sum()), SURE, 0.0)
        missed = -_log_chance([one for one in found if one is not None], (rates or {}).get(name, math.inf))
        odds = np.maximum(sure, np.where(there, missed / there.sum(), 0.0))
        if not odds.any():
            continue
        says = f"{name} jumps faster than the fin moves and then stands still: an order, not a measured angle"
        correction = Correction(rename={name: f"{name}_cmd"})
        mistake = Mistake(f"{name}: order read as measured", says, correction, USUAL)
        out.append(Weighed(mistake, odds, {"size": odds}))
    return out


def _log_chance(moves: Sequence[tuple[Floats, Floats]], rate: float) -> float:
    """Log probability that a fin with about this rate [rad/s] is read on its way in none of its moves.

    Orders come at any time between two readings, or always with a reading where one clock makes both: as
    likely.
    """
    if not math.isfinite(rate):
        return 0.0
    size, step = (np.concatenate(one) for one in zip(*moves, strict=True))
    share = size / (rate * np.exp(RATE_SD * RATES)[:, None] * step)  # of a step that a move takes
    any_time = np.log(np.maximum(1.0 - share, LEAST)).sum(axis=1)
    in_step = math.log(LEAST) * (share > 1.0).sum(axis=1)
    each = np.logaddexp(any_time, in_step) - math.log(2.0)
    prior = -0.5 * RATES**2
    return float(logsumexp(each + prior) - logsumexp(prior))


def is_measured(run: Run, name: str) -> bool:
    """Whether a run logs the angle of a fin as measured, and no order beside it."""
    return name in run.measured_inputs and f"{name}_cmd" not in run.commands


def jumps(run: Run, name: str) -> tuple[Floats, Floats] | None:
    """Sizes [rad] and steps [s] of all moves of an angle, none of them read on its way; else None."""
    values = run.measured_inputs[name]
    change, step = np.diff(values), np.diff(run.t)
    way = np.sign(change)
    first = np.flatnonzero((way != 0) & np.concatenate(([True], way[1:] != way[:-1])))
    last = np.flatnonzero((way != 0) & np.concatenate((way[1:] != way[:-1], [True])))
    size = np.abs(values[last + 1] - values[first])
    large = size > JUMP_ANGLE
    if large.sum() < FEWEST_JUMPS or float(np.mean((last > first)[large])) > ON_THE_WAY:
        return None
    at = large & (last == first)
    return size[at], step[first[at]]


def _is_order(run: Run, name: str) -> bool:
    change = np.abs(np.diff(run.measured_inputs[name]))
    moves = change > JUMP_ANGLE
    if name in implausible(run):
        return False  # another unit first
    return (
        bool(moves.any())
        and float(np.mean(change == 0.0)) > STANDS
        and bool(np.median(change[moves] / np.diff(run.t)[moves]) > JUMP_RATE)
    )
