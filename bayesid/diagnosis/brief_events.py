"""Events that are not gross: a free force, allowed in a short time of one run only, gains beyond chance.

Takes an explanation and its problem. Gives dated `Event`s. A force that depends on the motion comes back
whenever the motion does, and a gap that lasts is found where it lies (`localisation`): what is left in a
short time only is neither, unless the motion of that time was flown once: a force of the motion and the
controls, of any shape, is asked for instead. Leaves nothing out (`exclusions`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.linalg import LinAlgError
from scipy.special import logsumexp

from bayesid.diagnosis.actuator_event import ACTUATOR_PLACES, actuator_event
from bayesid.diagnosis.cut_runs import (
    ELSEWHERE,
    BriefSignal,
    CutRun,
    Joint,
    Sought,
    at_noise_scales,
    prior_root,
)
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.event_search import MOST_EVENTS, MOST_TIME_SHARE
from bayesid.diagnosis.force_of_motion import force_of_motion
from bayesid.diagnosis.hypotheses.localisation import SENSORS, SIGNAL_AMPLITUDES, channel_sets, units
from bayesid.diagnosis.threshold_table import BRIEF_EVENT_EVIDENCE, CAUSE_OVER_MOTION
from bayesid.estimation.run_data import Array

# Pieces that an event lasts.
LASTS = (2, 4, 6, 8, 12, 16)
# Errors of sensors that may stand beside events.
MOST_ERRORS = 8
# Standard deviations from which a mean of the signal is told.
TOLD = 2.0


def brief_events(sought: Sought, least: Callable[[], float], tight: bool = False) -> tuple[Event, ...]:
    """Events beside an explanation; none where together they gain less than what would do instead of them.

    Parameters
    ----------
    least : log evidence that they have to gain together, asked for where they gain enough by themselves
    tight : with the times of what they look like, not with all that a free signal takes; that they are no
        force of the motion was decided before

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path

    Notes
    -----
    Signals of `LASTS` pieces, each with the prior of a first-order Gauss-Markov process, in every place and
    run; parameters of the explanation are integrated out. The one that gains most is kept, then the next
    beside it, while each gains `BRIEF_EVENT_EVIDENCE`. None is an event where all together last more than
    `MOST_TIME_SHARE` of the time: what lasts is a gap. An error of a sensor is asked for as well and stands
    beside the rest, but is no event while it is not gross: heading of a vehicle that rolls begins with one.
    """
    problem, runs = sought.problem, sought.runs
    gone = sum(e.end - e.start for e in problem.events if e.kind == "motion")
    most = MOST_TIME_SHARE * sum(r.count * r.width for r in runs) - gone
    errors: list[BriefSignal] = []
    motions: list[BriefSignal] = []
    while len(motions) < MOST_EVENTS and len(errors) < MOST_ERRORS:
        one = _largest(sought, Joint(runs, sought.known, [*errors, *motions]))
        if one is None or one.gain < BRIEF_EVENT_EVIDENCE:
            break
        (errors if one.place in SENSORS else motions).append(one)
        if sum((f.last - f.first) * runs[f.run].width for f in motions) > most:
            return ()
    by_motion = cache(lambda: _by_motion(sought, errors))
    while motions:
        kept = _repeatable(sought, errors, motions)
        if (
            kept >= BRIEF_EVENT_EVIDENCE * len(motions)
            and kept > least()
            and (tight or kept >= by_motion() + CAUSE_OVER_MOTION)
        ):
            share = kept / sum(f.gain for f in motions)
            return tuple(
                replace(e, evidence=share * e.evidence) for e in _told(sought, errors, motions, tight)
            )
        motions.pop()
    return ()


def _largest(sought: Sought, joint: Joint) -> BriefSignal | None:
    """The signal that gains most of all, its choice among them counted."""
    tried, best = 0, None
    for run in sought.runs:
        count, one = _largest_of(sought, run, *joint.rest(run.run))
        tried += count
        if one is not None and (best is None or one.gain > best.gain):
            best = one
    chosen = float(np.log(max(tried, 1)))
    return None if best is None else replace(best, gain=best.gain - chosen, chosen=chosen)


def _largest_of(sought: Sought, run: CutRun, ss: Array, se: Array) -> tuple[int, BriefSignal | None]:
    """How many signals were tried in a run, and the one that gains most."""
    tried, best = 0, None
    scales = sought.problem.model.scales
    width = round(run.width * scales["U"] / scales["L"], 6)
    for place, (inputs, channels) in channel_sets(sought.problem).items():
        if place in ELSEWHERE:
            continue
        rows = np.array([sought.signals.index(n) for n in (*inputs, *channels)])
        for lasts in (n for n in LASTS if n <= run.count):
            starts = np.arange(run.count - lasts + 1)
            at = rows[None, :, None] * run.count + starts[:, None, None] + np.arange(lasts)
            at = at.reshape(starts.size, -1)
            one = prior_root(rows.size, lasts, width)
            products = one.T @ ss[at[:, :, None], at[:, None, :]] @ one
            for amplitude in SIGNAL_AMPLITUDES:
                gains = _gains(amplitude**2 * products, amplitude * se[at] @ one)
                tried += starts.size
                k = int(np.argmax(gains))
                if best is None or gains[k] > best.gain:
                    best = BriefSignal(float(gains[k]), run.run, place, k, k + lasts, at[k], amplitude * one)
    return tried, best


def _gains(products: Array, pull: Array) -> Array:
    """(w,) log evidence of signals from (w, m, m) products of their columns and (w, m) with the residual."""
    h = products + np.eye(products.shape[1])
    try:
        low = np.linalg.cholesky(h)
    except LinAlgError:
        return np.full(len(h), -np.inf)
    moved = np.linalg.solve(low, pull[:, :, None])[:, :, 0]
    return 0.5 * (moved**2).sum(axis=1) - np.log(np.diagonal(low, axis1=1, axis2=2)).sum(axis=1)


def _repeatable(sought: Sought, errors: Sequence[BriefSignal], motions: Sequence[BriefSignal]) -> float:
    """What motions gain together, less their choice, where a measured environment may differ between runs by
    its own repeatability."""
    with_, without = [], []
    for weight, runs in at_noise_scales(sought):
        with_.append(weight + Joint(runs, sought.known, [*errors, *motions]).log_evidence)
        without.append(weight + Joint(runs, sought.known, errors).log_evidence)
    return float(logsumexp(with_) - logsumexp(without)) - sum(f.chosen for f in motions)


def _by_motion(sought: Sought, errors: Sequence[BriefSignal]) -> float:
    """What a force of the motion and the controls, of any shape, gains instead of motions, in the environment
    as it is."""
    runs, known = sought.runs, sought.known
    with_force = force_of_motion(sought).log_evidence(runs, known, errors)
    return with_force - Joint(runs, known, errors).log_evidence


def _told(
    sought: Sought, errors: Sequence[BriefSignal], motions: Sequence[BriefSignal], tight: bool
) -> tuple[Event, ...]:
    """Events by run and time: what overlaps is one, an actuator that stuck where that does as well."""
    out, size, sets = [], units(sought.problem.model), channel_sets(sought.problem)
    for together in _joined(motions):
        first, run = max(together, key=lambda f: f.gain), sought.runs[together[0].run]
        others = [*errors, *(f for f in motions if f not in together)]
        name = sought.problem.logs[run.run].name
        begins, ends = min(f.first for f in together), max(f.last for f in together)
        start, end = (run.start + run.width * k for k in (begins, ends))
        gain = sum(f.gain for f in together)
        event = Event(name, start, end, first.place, "motion", None, gain, brief=True, opens=begins == 0)
        alike = actuator_event(
            sought.problem, sought.free, sought.paths[run.run], sought.runs, others,
            replace(first, first=begins, last=ends, gain=gain, chosen=sum(f.chosen for f in together)),
        )  # fmt: skip
        names = sets[first.place][0]
        if alike is not None:
            place = ACTUATOR_PLACES.get(alike.actuator, first.place)
            if not tight:
                start, end = min(start, alike.start), max(end, alike.end)
            else:
                start, end = alike.start, alike.end
            event = replace(event, start=start, end=end, channel=place)
            stuck = alike.actuator if alike.sticks else None
            if stuck or alike.actuator in ACTUATOR_PLACES:  # else it is no value of the place
                event = replace(event, value=alike.value, sd=alike.sd, stuck=stuck)
        elif len(together) == 1 and len(names) == 1:
            joint = Joint(sought.runs, sought.known, [*others, first])
            value, sd = (size[names[0]] * x for x in joint.average(first, joint.parts[-1]))
            if abs(value) > TOLD * sd:
                event = replace(event, value=value, sd=sd)
        out.append(event)
    return tuple(sorted(out, key=lambda e: (e.run, e.start)))


def _joined(motions: Sequence[BriefSignal]) -> list[list[BriefSignal]]:
    """Signals of one run that overlap or touch, together."""
    out: list[list[BriefSignal]] = []
    for f in sorted(motions, key=lambda f: (f.run, f.first)):
        if out and out[-1][0].run == f.run and f.first <= max(g.last for g in out[-1]):
            out[-1].append(f)
        else:
            out.append([f])
    return out
