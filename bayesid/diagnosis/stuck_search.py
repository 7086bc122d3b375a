"""Actuators that stick for long, in one run or in many: where, when and at what, by linear theory.

Takes an explanation and its problem. Gives dated `Event`s of kind "stuck", not yet judged: the explanation
may have followed a part of them, its environment the rest. A refit with the orders held judges
(`stuck_stage`). Of a short one a free signal tells (`brief_events`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.actuator_event import ABOUT_ORDER, ACTUATOR_PLACES, times_apart, uncertain_times
from bayesid.diagnosis.cut_runs import CutRun, Sought, cut, orders, orders_of
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.diagnosis.joined_runs import Joined, fewer, joined, longest_runs
from bayesid.estimation.run_data import Array, RunData
from bayesid.simulation import plan_trial_run
from bayesid.trials import Trial

# Pieces that it lasts at least: of one, begin and end are not told apart.
FEWEST_PIECES = 2
# Log evidence of one run below which nothing is said of it: odds of 150 to 1, its times counted.
LEAST_OF_RUN = 5.0


@dataclass(frozen=True, eq=False)
class Stuck:
    """Actuators that may have stuck: events, and the log evidence linear theory gives them together.

    Attributes
    ----------
    ordered : the same events, each at what was ordered when it began
    chosen : logarithm of how many times, values and actuators were tried, of all runs it is told of
    """

    events: tuple[Event, ...] = ()
    ordered: tuple[Event, ...] = ()
    gain: float = 0.0
    chosen: float = 0.0


@dataclass(frozen=True, eq=False)
class _Ordered:
    """One run: an actuator's order, the columns of its pieces, and in which of them it may have stuck.

    Attributes
    ----------
    moved, against : columns of the actuator in its unit, and of its order taken away
    stays : (count,) order when each piece begins, in its unit
    first, last : (k,) pieces of all times that are tried, `last` exclusive
    """

    run: CutRun
    name: str
    t: Array
    order: Array
    moved: Array
    against: Array
    stays: Array
    first: Array
    last: Array


@dataclass(frozen=True, eq=False)
class _Times:
    """What the times tried in a run gain: on average, and the best of them with value and sd in the unit."""

    average: float
    most: float
    at: int
    value: float
    sd: float


def stuck_actuators(sought: Sought, trial: Trial) -> Stuck:
    """The one actuator that gains most if it stuck once in some of the runs; none where no run says so.

    Parameters
    ----------
    trial : the runs as they were logged; in those of `sought` orders may be held already, and are released

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path

    Notes
    -----
    It stays near what was ordered when it stuck (`ABOUT_ORDER`), while the order goes elsewhere; every begin
    and end on the pieces is as probable. The run that gains most is taken, then the next beside it.
    """
    found = [_of_actuator(sought, trial, name) for name in _asked(sought)]
    return max(found, key=lambda one: one.gain, default=Stuck())


def _asked(sought: Sought) -> list[str]:
    """Actuators that act in every run by order alone: of a measured one the log tells where it is."""
    size = units(sought.problem.model)
    out = []
    for name in sought.problem.model.kernel.actuators:
        acts = all(name in p.inputs and name not in p.log.plan.measured for p in sought.paths)
        if acts and name in size:
            out.append(name)
    return out


def _of_actuator(sought: Sought, trial: Trial, name: str) -> Stuck:
    problem, size = sought.problem, units(sought.problem.model)[name]
    logged = {run.name: run for run in trial.identify}
    ordered = [
        orders_of(problem.model, plan_trial_run(problem.model, logged[p.log.name]), name)
        for p in sought.paths
    ]
    cuts = []
    for k, (path, order) in enumerate(zip(sought.paths, ordered, strict=True)):
        taken = [(name, order), (name, orders(problem, k, name) - order)]
        cuts.append(cut(problem, sought.free, k, path, [name], taken))
    kept, most = longest_runs(cuts, 3)
    runs = [fewer(r, sought.known, most) for r in cuts]
    rest = _as_ordered(joined(runs, sought.known, [0, 1, 2], kept))
    begins = np.cumsum([0, *(runs[k].count for k in kept)])
    left = []
    for k, begin in zip(kept, begins[:-1], strict=True):
        one = _ordered(runs[k], sought.paths[k].log, ordered[k], begin + np.array([0, begins[-1]]), size)
        if one.first.size:
            left.append(one)
    found: list[tuple[Event, Event]] = []
    gain, limit = 0.0, problem.model.limit(name)
    chosen = float(np.log(2.0 * len(_asked(sought))))  # the better of two values, and one actuator of all
    while left:
        times = [_best_times(rest, o) for o in left]
        k = max(range(len(left)), key=lambda i: times[i].average)
        if times[k].average < LEAST_OF_RUN:
            break
        one, best = left.pop(k), times[k]
        first, last = int(one.first[best.at]), int(one.last[best.at])
        event = _event(name, one, first, last, best, size, limit)
        found.append((event, replace(event, value=float(size * one.stays[first]))))
        gain += best.average
        # the times that were chosen, and that the value is the best one: the refit has it for sure
        chosen += best.most - best.average + float(np.log(ABOUT_ORDER / best.sd))
        rest = _beside(rest, one, first, last)
    found.sort(key=lambda both: both[0].run)
    return Stuck(tuple(e for e, _ in found), tuple(o for _, o in found), gain, chosen)


def _as_ordered(whole: Joined) -> Joined:
    """The signals but the last, which is taken for sure: what was held is as it was ordered."""
    kept = whole.se.size // 3 * 2
    sure = whole.ss[:, kept:].sum(axis=1)
    return Joined(whole.ss[:kept, :kept], (whole.se - sure)[:kept])


def _ordered(run: CutRun, log: RunData, order: Array, begins: Array, size: float) -> _Ordered:
    t = log.plan.t
    starts = run.start + run.width * np.arange(run.count)
    stays = order[np.maximum(np.searchsorted(t, starts) - 1, 0)]
    first, last = _times_tried(run, t, order, stays, ABOUT_ORDER * size)
    moved, against = begins[:, None] + np.arange(run.count)
    return _Ordered(run, log.name, t, order, moved, against, stays / size, first, last)


def _times_tried(run: CutRun, t: Array, order: Array, stays: Array, about: float) -> tuple[Array, Array]:
    """Pieces between which the order goes away from where it was by more than `about`; never from the start,
    where a free first state would do."""
    piece = np.minimum(((t - t[0]) / run.width).astype(int), run.count - 1)
    low, high = np.full(run.count, np.inf), np.full(run.count, -np.inf)
    np.minimum.at(low, piece, order)
    np.maximum.at(high, piece, order)
    first, last = [], []
    for f in range(1, run.count - FEWEST_PIECES + 1):
        apart = np.maximum.accumulate(np.maximum(stays[f] - low[f:], high[f:] - stays[f]))
        ends = f + 1 + np.flatnonzero(apart > about)
        ends = ends[ends - f >= FEWEST_PIECES]
        first.append(np.full(ends.size, f))
        last.append(ends)
    none = np.zeros(0, dtype=int)
    return np.concatenate([none, *first]), np.concatenate([none, *last])


def _best_times(rest: Joined, one: _Ordered) -> _Times:
    """Log evidence of one unknown, about the order when it stuck, at all times of a run at once."""
    m, a, f, last = one.moved, one.against, one.first, one.last
    s = one.stays[f]
    mm, ma, aa = (_sums(rest.ss[np.ix_(x, y)])(f, last) for x, y in ((m, m), (m, a), (a, a)))
    pull, against = (np.concatenate([[0.0], rest.se[x].cumsum()]) for x in (m, a))
    on_m, on_a = pull[last] - pull[f], against[last] - against[f]
    told = s * on_m + on_a - 0.5 * (s * s * mm + 2.0 * s * ma + aa)
    slope, precision = ABOUT_ORDER * (on_m - s * mm - ma), 1.0 + ABOUT_ORDER**2 * mm
    gains = told + 0.5 * slope * slope / precision - 0.5 * np.log(precision)
    k = int(np.argmax(gains))
    average = float(logsumexp(gains) - np.log(gains.size))
    value = float(s[k] + ABOUT_ORDER * slope[k] / precision[k])
    return _Times(average, float(gains[k]), k, value, float(ABOUT_ORDER / precision[k] ** 0.5))


def _sums(products: Array) -> Callable[[Array, Array], Array]:
    """Sum of (count, count) products over the pieces from f to l, l exclusive, as a function of both."""
    whole = np.zeros((products.shape[0] + 1, products.shape[1] + 1))
    whole[1:, 1:] = products.cumsum(axis=0).cumsum(axis=1)
    return lambda f, to: np.asarray(whole[to, to] - whole[f, to] - whole[to, f] + whole[f, f])


def _beside(rest: Joined, one: _Ordered, first: int, last: int) -> Joined:
    """The rest once the actuator stuck there."""
    sure, free = np.zeros(rest.se.size), np.zeros((rest.se.size, 1))
    sure[one.moved[first:last]], sure[one.against[first:last]] = one.stays[first], 1.0
    free[one.moved[first:last]] = ABOUT_ORDER
    return Joined(rest.ss, rest.se - rest.ss @ sure).beside(free)


def _event(name: str, one: _Ordered, first: int, last: int, best: _Times, size: float, limit: float) -> Event:
    value, width = float(np.clip(size * best.value, -limit, limit)), one.run.width
    start, end = (one.run.start + width * k for k in (first, last))
    apart = float(np.abs(one.order[(one.t >= start) & (one.t <= end)] - value).max(initial=0.0))
    start, end = times_apart(one.t, one.order, value, start, end, width)
    end = min(end, float(one.t[-1]))
    # far from what was ordered linear theory is no more than half right
    far = 0.5 * abs(value - size * float(one.stays[first]))
    sd = float(np.hypot(np.hypot(size * best.sd, far), uncertain_times(apart, start, end, width)))
    place = ACTUATOR_PLACES.get(name, name)
    return Event(one.name, start, end, place, "stuck", None, best.average, value=value, sd=sd, stuck=name)
