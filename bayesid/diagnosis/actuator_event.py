"""Whether an actuator that sticks, or is off by a constant, explains an event as well as a free signal does.

Takes runs cut into pieces and a signal found in one of them. Gives a frozen `ActuatorEvent`, or nothing.
Names no effect: it says what the event looks like.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.diagnosis.cut_runs import BriefSignal, CutRun, Joint, cut, orders, signals_of
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array

# Actuators asked, by the place of their signal where they have one alone.
ACTUATOR_PLACES = {"delta_r": "rudder", "n": "rpm"}
# Prior sd over a large disturbance of the input: of where it stuck, about what was ordered then, and of how
# far it is off.
ABOUT_ORDER, OFF = 0.15, 1.0
# Share of what a free signal of many unknowns gains that it has to gain with one and times of pieces.
ALIKE = 0.9
# Pieces by which it may begin earlier or end later than the free signal.
REACH = 8
# Share of how far the order goes away from where an actuator stuck, from which it counts as away.
AWAY = 0.1


@dataclass(frozen=True)
class ActuatorEvent:
    """An actuator that does not do what is ordered.

    Attributes
    ----------
    actuator : its name
    start, end : [s], by the clock of the log
    value, sd : where it stuck, or by how much it is off its order, and the standard deviation, that of its
        times included [rad, rpm]
    sticks : which of these
    gain : log evidence over none, less the logarithm of how many such were tried
    """

    actuator: str
    start: float
    end: float
    value: float
    sd: float
    sticks: bool
    gain: float


@dataclass(frozen=True, eq=False)
class _Tried:
    """One actuator in some pieces: value and sd in its unit."""

    actuator: str
    first: int
    last: int
    stays: float | None
    gain: float
    value: float
    sd: float


def actuator_event(
    problem: DiagnosisProblem,
    free: GaussianPrior,
    path: Linearisation,
    runs: Sequence[CutRun],
    others: Sequence[BriefSignal],
    found: BriefSignal,
) -> ActuatorEvent | None:
    """The actuator that explains an event best by one number; None where a free signal does better.

    Parameters
    ----------
    free, path : parameters of the explanation, and the run of the event linearised along it
    runs, others : all runs cut into pieces, and what else was found
    found : the event as a free signal

    Notes
    -----
    It stays near what was ordered when it stuck, or follows its order at a constant distance. Its times are
    sought up to `REACH` pieces beyond those of the free signal.
    """
    size = units(problem.model)
    actuators = [n for n in problem.model.kernel.actuators if n in path.inputs and n in size]
    if not actuators:
        return None
    signals = signals_of(problem)
    signals = (*signals, *(n for n in actuators if n not in signals))
    taken = [(n, orders(problem, found.run, n)) for n in actuators]
    run = cut(problem, free, found.run, path, signals, taken)
    if run.count != runs[found.run].count:  # more columns than fit: of other pieces nothing is said
        return None
    joint = Joint([*runs[: found.run], run, *runs[found.run + 1 :]], len(free.names), others)
    ss, se = joint.rest(found.run)
    tried: list[_Tried] = []
    t = path.log.plan.t
    for i, actuator in enumerate(actuators):
        order = orders(problem, found.run, actuator)
        moved, against = signals.index(actuator) * run.count, (len(signals) + i) * run.count
        for first in range(max(found.first - REACH, 0), found.last):
            start = run.start + first * run.width
            stays = float(order[max(int(np.searchsorted(t, start)) - 1, 0)])
            for last in range(max(first, found.first) + 2, min(found.last + REACH, run.count) + 1):
                at = np.arange(first, last)
                off = _gain(ss, se, moved + at, None, 0.0, OFF)
                tried.append(_Tried(actuator, first, last, None, *off))
                inside = (t >= start) & (t <= run.start + last * run.width)
                if np.abs(order[inside] - stays).max(initial=0.0) > ABOUT_ORDER * size[actuator]:
                    held = _gain(ss, se, moved + at, against + at, stays / size[actuator], ABOUT_ORDER)
                    tried.append(_Tried(actuator, first, last, stays, *held))
    best = max(tried, key=lambda one: one.gain, default=None)
    if best is None or best.gain < ALIKE * (found.gain + found.chosen):
        return None
    return _told(best, orders(problem, found.run, best.actuator), t, run, size[best.actuator], len(tried))


def _told(best: _Tried, order: Array, t: Array, run: CutRun, size: float, tried: int) -> ActuatorEvent:
    """In SI, from when its order leaves it to when it is there again."""
    start, end = (run.start + run.width * k for k in (best.first, best.last))
    value, apart = size * best.value, abs(size * best.value)
    if best.stays is not None:
        value += best.stays
        apart = float(np.abs(order[(t >= start) & (t <= end)] - value).max())
        start, end = times_apart(t, order, value, start, end, run.width)
    sd = float(np.hypot(size * best.sd, uncertain_times(apart, start, end, run.width)))
    gain = best.gain - float(np.log(tried))
    return ActuatorEvent(best.actuator, start, end, value, sd, best.stays is not None, gain)


def times_apart(
    t: Array, order: Array, value: float, start: float, end: float, width: float
) -> tuple[float, float]:
    """From when an order leaves where its actuator stuck to when it is there again, between two times [s].

    Parameters
    ----------
    t, order : of the log
    width : of a piece [s]
    """
    inside = (t >= start) & (t <= end)
    distance = np.abs(order[inside] - value)
    away = t[inside][distance > AWAY * distance.max(initial=0.0)]
    if not away.size:
        return start, end
    return max(start, float(away[0])), min(end, float(away[-1]) + width)


def uncertain_times(apart: float, start: float, end: float, width: float) -> float:
    """Standard deviation of where an actuator stuck as its times are known to half a piece at either end.

    Parameters
    ----------
    apart : how far its order went away
    start, end, width : of the event, and of a piece [s]
    """
    return apart * width / (2.0 * max(end - start, width))


def _gain(
    ss: Array, se: Array, moved: Array, against: Array | None, about: float, spread: float
) -> tuple[float, float, float]:
    """Log evidence of an actuator with one unknown, its mean away from `about`, and standard deviation.

    Parameters
    ----------
    ss, se : products of all columns with each other and with the residual
    moved : columns of a unit of the actuator
    against : columns of its order taken away; None where it follows that
    about, spread : mean and prior sd of the unknown, in that unit
    """
    columns = moved if against is None else np.concatenate([moved, against])
    ss, se = ss[np.ix_(columns, columns)], se[columns]
    sure, free = np.ones(columns.size), np.zeros(columns.size)
    sure[: moved.size], free[: moved.size] = about, spread
    left = se - ss @ sure
    precision = 1.0 + float(free @ ss @ free)
    z = float(free @ left) / precision
    told = float(sure @ se) - 0.5 * float(sure @ ss @ sure)
    gain = told + 0.5 * z * z * precision - 0.5 * float(np.log(precision))
    return gain, spread * z, spread / precision**0.5
