"""Whether an actuator that stays where it is, whatever is ordered, explains an event as a free signal does.

Takes runs cut into pieces and a signal found in one of them. Gives a frozen `Stuck`, or nothing. Names no
effect: it says what the event looks like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.cut_runs import BriefSignal, CutRun, Joint, cut, orders, signals_of
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.run_data import Array

# Actuators asked, by the place of their signal where they have one alone.
ACTUATOR_PLACES = {"delta_r": "rudder", "n": "rpm"}
# Prior sd of where it stuck, about what was ordered then, over a large disturbance of the input.
ABOUT_ORDER = 0.15
# Share of what a free signal of many unknowns gains that it has to gain with one and times of pieces.
ALIKE = 0.9
# Pieces by which it may begin earlier or end later than the free signal.
REACH = 8


@dataclass(frozen=True)
class Stuck:
    """An actuator that stays where it is.

    Attributes
    ----------
    actuator : its name
    start, end : [s], by the clock of the log
    order, sd : where it stuck, and its standard deviation [rad, rpm]
    gain : log evidence over none, less the logarithm of how many such were tried
    """

    actuator: str
    start: float
    end: float
    order: float
    sd: float
    gain: float


def stuck_actuator(
    problem: DiagnosisProblem,
    beside: RefittedHypothesis,
    path: Linearisation,
    runs: Sequence[CutRun],
    others: Sequence[BriefSignal],
    found: BriefSignal,
) -> Stuck | None:
    """The actuator whose order, not followed, explains an event best; None where a free signal does better.

    Parameters
    ----------
    beside, path : explanation, and the run of the event linearised along it
    runs, others : all runs cut into pieces, and what else was found
    found : the event as a free signal

    Notes
    -----
    It stays near what was ordered when it stuck, so it has one unknown beside its times, which are sought up
    to `REACH` pieces beyond those of the free signal.
    """
    size, t = units(problem.model), path.log.plan.t
    actuators = [n for n in problem.model.kernel.actuators if n in path.inputs and n in size]
    if not actuators:
        return None
    signals = signals_of(problem)
    signals = (*signals, *(n for n in actuators if n not in signals))
    free, count = beside.fit.free, runs[found.run].count
    run = cut(problem, free, found.run, path, signals, actuators)
    if run.count != count:  # more columns than fit: of other pieces nothing is said
        return None
    joint = Joint([*runs[: found.run], run, *runs[found.run + 1 :]], len(free.names), others)
    ss, se = joint.rest(found.run)
    best, tried = None, 0
    for i, actuator in enumerate(actuators):
        order = orders(problem, found.run, actuator)
        moved = signals.index(actuator) * run.count
        against = (len(signals) + i) * run.count
        for first in range(max(found.first - REACH, 0), found.last):
            start = run.start + first * run.width
            stays = float(order[max(int(np.searchsorted(t, start)) - 1, 0)])
            for last in range(max(first, found.first) + 2, min(found.last + REACH, run.count) + 1):
                end = run.start + last * run.width
                moved_on = np.abs(order[(t >= start) & (t <= end)] - stays)
                if not moved_on.size or moved_on.max() < ABOUT_ORDER * size[actuator]:
                    continue  # where it is told to stay it does not stick
                at = np.arange(first, last)
                gain, off, sd = _gain(ss, se, against + at, moved + at, stays / size[actuator], ABOUT_ORDER)
                tried += 1
                if best is None or gain > best.gain:
                    where, error = stays + size[actuator] * off, size[actuator] * sd
                    best = Stuck(actuator, start, end, where, error, gain)
    if best is None or best.gain < ALIKE * (found.gain + found.chosen):
        return None
    order, inside = orders(problem, found.run, best.actuator), (t >= best.start) & (t <= best.end)
    moves = t[inside & (np.abs(order - best.order) > best.sd)]  # until then it does as it is told
    start = max(best.start, float(moves[0])) if moves.size else best.start
    return replace(best, start=start, gain=best.gain - float(np.log(tried)))


def _gain(
    ss: Array, se: Array, against: Array, moved: Array, stays: float, about: float
) -> tuple[float, float, float]:
    """Log evidence of an actuator that stays, by how much it is off `stays`, and the standard deviation.

    Parameters
    ----------
    ss, se : products of all columns with each other and with the residual
    against : columns of the order taken away
    moved : columns of a unit of the actuator
    stays, about : mean and prior sd of where it stays, in these units
    """
    columns = np.concatenate([against, moved])
    ss, se = ss[np.ix_(columns, columns)], se[columns]
    sure, free = np.ones(columns.size), np.zeros(columns.size)
    sure[against.size :] = stays
    free[against.size :] = about
    left = se - ss @ sure
    precision = 1.0 + float(free @ ss @ free)
    z = float(free @ left) / precision
    told = float(sure @ se) - 0.5 * float(sure @ ss @ sure)
    return told + 0.5 * z * z * precision - 0.5 * float(np.log(precision)), about * z, about / precision**0.5
