"""Gross events: a stuck rudder, a collision, a navigation that jumps, a sensor that freezes.

Takes windows of a `DiagnosisProblem` that are predicted far worse than the rest. Gives dated `Event`s with
the channel that went wrong, and runs without them. Does not decide whether an effect explains them first
(`exclusions` asks only about what the best explanation of the whole trial leaves).

An event is rare. What acts in most windows, or in more than `MOST_TIME_SHARE` of the time, is a gap and
stays in the data.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import LinAlgError
from scipy.stats import chi2

from bayesid.diagnosis.data.event import Event, blanked, released, without_readings
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.data.windows import WINDOW_LENGTHS, Window, cut, window_equations, windows
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.localisation import channel_sets, units
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import linearise, linearise_runs
from bayesid.estimation.filter_error.noise_model import LatentInputs
from bayesid.estimation.filter_error.read_run import LONGER_STEPS, filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import RunData
from bayesid.trials import Run, Trial, window
from bayesid.words import counted

# Misfit of an event's windows over the median of all; misfit of a piece that has nothing left to hide.
GROSS_MISFIT, CLEAN_MISFIT = 10.0, 3.0
# Share of the time above which it is no event; probability of one false window in a clean trial.
MOST_TIME_SHARE, FALSE_ALARM = 0.1, 1e-4
MOST_EVENTS = 8
# Force with which the fit of a short piece begins, over 1/2 rho L^2 U^2, and its passes: enough to arrive at
# the real environment, under which the piece is judged.
PIECE_FORCE_LEVEL, PIECE_ITERATIONS = 0.003, 16
Notify = Callable[[str], None]


@dataclass(frozen=True)
class Span:
    """Neighbouring gross windows of one run: its position, first and last sample, misfit over the median.

    `usual` is that median, per reading.
    """

    run: int
    first: int
    last: int
    misfit: float
    usual: float


def find_events(
    problem: DiagnosisProblem, trial: Trial, best: RefittedHypothesis, notify: Notify = lambda text: None
) -> tuple[Event, ...]:
    """Events the best explanation of the whole trial leaves.

    Windows are judged at that explanation where it arrived, along the readings' own path where it did not.
    """
    if explains(best):
        spans = suspects(problem, best.fit)
    else:
        spans = suspects(problem) or (suspects(problem, best.fit) if best.fit.converged else ())
    if not spans:
        return ()
    notify(f"events: {counted(len(spans), 'short piece')} predicted far worse than the rest")
    return identify_events(problem, trial, spans)


def suspects(problem: DiagnosisProblem, fitted: FilterErrorFit | None = None) -> tuple[Span, ...]:
    """Gross windows, neighbours joined; empty where there are too many to be events.

    Parameters
    ----------
    fitted : judge what this fit leaves at its own parameters; default the nominal model led along the data,
        coefficients free within their prior
    """
    model, noise_model = problem.model, problem.environment.noise_model
    if fitted is None:
        free = problem.coefficients
        paths = linearise_runs(model, problem.logs, problem.path, free.where)
        found = windows(model, paths, free, noise_model)
    else:
        found = windows(
            model,
            linearise_runs(model, problem.logs, fitted.points, NO_PARAMETERS.where),
            NO_PARAMETERS,
            noise_model,
        )
    spans = _joined(found)
    spent = sum(_seconds(problem.logs[s.run], s) for s in spans)
    return spans if spent <= MOST_TIME_SHARE * sum(float(np.ptp(log.plan.t)) for log in problem.logs) else ()


def _joined(found: Sequence[Window]) -> tuple[Span, ...]:
    if len(found) < 4:
        return ()
    usual = float(np.median([w.ratio for w in found]))
    level = max(usual, 1.0)
    out: list[Span] = []
    for w in found:
        if w.ratio < GROSS_MISFIT * usual or chi2.sf(w.chi2 / level, w.used) > FALSE_ALARM / len(found):
            continue
        if out and out[-1].run == w.run and out[-1].last >= w.first:
            out[-1] = replace(out[-1], last=w.last, misfit=max(out[-1].misfit, w.ratio / usual))
        else:
            out.append(Span(w.run, w.first, w.last, w.ratio / usual, usual))
    return tuple(out)


def _seconds(log: RunData, span: Span) -> float:
    """Time a span stands for: half of each end window lies outside the event on average."""
    t = log.plan.t
    return 0.5 * float(t[min(span.last, t.size) - 1] - t[span.first])


def identify_events(problem: DiagnosisProblem, trial: Trial, spans: Sequence[Span]) -> tuple[Event, ...]:
    """Kind, channel and dates of the `MOST_EVENTS` grossest spans.

    The simplest fault whose removal makes the neighbourhood ordinary is kept: one channel, a shifted
    position, the motion itself. Its dates are the tightest that still do.
    """
    runs = {run.name: without_readings(run, problem.outliers) for run in trial.identify}
    out = []
    for span in sorted(spans, key=lambda s: -s.misfit)[:MOST_EVENTS]:
        event = _identified(problem, runs[problem.logs[span.run].name], span)
        if event is not None:
            out.append(event)
    return tuple(sorted(out, key=lambda e: (e.run, e.start)))


def _identified(problem: DiagnosisProblem, run: Run, span: Span) -> Event | None:
    log = problem.logs[span.run]
    scale = problem.model.scales["L"] / problem.model.scales["U"]
    t = log.plan.t
    begin, stop = float(t[span.first]), float(t[min(span.last, t.size) - 1])
    around = window(run, begin - WINDOW_LENGTHS * scale, stop + WINDOW_LENGTHS * scale)
    usual = max(1.0, span.usual)
    groups = [g for g in (("x", "y"), ("z",)) if all(c in problem.channels for c in g)]
    groups += [(c,) for c in problem.channels if c not in ("x", "y", "z")]
    whole = Event(run.name, begin, stop, "", "motion", span.misfit)
    rest = _misfit(problem, around, whole)
    if not rest[0] <= CLEAN_MISFIT * usual * rest[1]:
        return None

    def agrees(event: Event) -> bool:
        """Whether the readings an event gives back, beside the whole span, agree with the rest."""
        found, used = _misfit(problem, around, event)
        back = max(used - rest[1], 0)
        return found - rest[0] <= usual * (back + 5.0 * np.sqrt(2.0 * back) + 10.0)

    simple = [replace(whole, kind="sensor", channel=",".join(g)) for g in groups]
    if groups[0] == ("x", "y"):
        simple.append(replace(whole, kind="jump", channel="x,y"))
    possible = [_dated(e, agrees, 0.25 * scale) for e in simple if agrees(e)]
    possible = possible or [_dated(whole, agrees, 0.25 * scale)]
    event = min(possible, key=lambda e: e.end - e.start)
    if event.kind == "motion":
        channel, gain = _channel(problem, span, event)
        event = replace(event, channel=channel, evidence=gain)
    return event


def _misfit(problem: DiagnosisProblem, run: Run, event: Event) -> tuple[float, int]:
    """Chi-square and readings of a short run on its own without an event; infinite if there is no fit."""
    model, free, real = problem.model, problem.coefficients, problem.environment.noise_model
    try:
        log = log_without(problem, run, (event,))
        done = fit(
            model, [log], free, real, initial_noise_scale=PIECE_FORCE_LEVEL, iterations=PIECE_ITERATIONS
        )
        g = window_equations(model, linearise(model, log, done.points[0], free.where), free, real)
        return float(g.ee - g.se @ posterior(g).mean), g.used
    except (ModelError, LinAlgError, ValueError):
        return float("inf"), 0


def _dated(event: Event, agrees: Callable[[Event], bool], finest: float) -> Event:
    """The event with the latest start and then the earliest end whose given-back readings agree."""
    for side in ("start", "end"):
        good, bad = getattr(event, side), event.end if side == "start" else event.start
        while abs(bad - good) > finest:
            middle = 0.5 * (good + bad)
            tried = replace(event, **{side: middle})
            if agrees(tried):
                good, event = middle, tried
            else:
                bad = middle
    return event


def _channel(problem: DiagnosisProblem, span: Span, event: Event) -> tuple[str, float]:
    """Input or force that shows a motion event best, and its gain in log evidence."""
    model, scale = problem.model, problem.model.scales["L"] / problem.model.scales["U"]
    free, size = problem.coefficients, units(model)
    log = problem.logs[span.run]
    t = log.plan.t
    margin = int(np.ceil(WINDOW_LENGTHS * scale / np.median(np.diff(t))))
    first, last = max(0, span.first - margin), min(t.size, span.last + margin)
    path = cut(linearise(model, log, problem.path[span.run], free.where), first, last)
    inside = (path.log.plan.t >= event.start) & (path.log.plan.t <= event.end)
    noise_model = problem.environment.noise_model
    none = posterior(window_equations(model, path, free, noise_model)).log_evidence
    found = {}
    for name, (inputs, channels) in channel_sets(problem).items():
        if not inputs or channels or name == "current":
            continue
        latent = LatentInputs(inputs, (), tuple(size[n] for n in inputs), scale, (inside,))
        found[name] = posterior(window_equations(model, path, free, noise_model, latent)).log_evidence
    best = max(found, key=lambda n: found[n])
    return best, float(max(found[best] - none, 0.0))


def log_without(problem: DiagnosisProblem, run: Run, events: Sequence[Event]) -> RunData:
    """Log of a run whose events hold no readings and let go of the state they disturbed."""
    noise = {c: s for log in problem.logs for c, s in zip(log.channels, log.sigma, strict=True)}
    model, left = problem.model, blanked(run, events)
    return released(model, filter_error_run(model, left, noise, problem.channels, LONGER_STEPS), events)
