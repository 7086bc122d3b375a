"""What a diagnosis leaves out, and the hypotheses compared on the rest: one loop until nothing more is found.

Takes a trial and a model. Gives the `DiagnosisProblem` without what is excluded and its
`HypothesisComparison`. Does not decide.

Two kinds are excluded. Single readings that contradict the fit without any effect (innovation outliers):
before anything is known a path may bend a little, and one yaw rate off by ten sigma is a possible motion;
under the measured environment it is not. Events: short pieces that the best explanation of the whole trial
predicts far worse than the rest, a model form included, or else in which a free force gains beside it. Last,
orders are held where an actuator stuck for longer (`stuck_stage`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

from numpy.linalg import LinAlgError

from bayesid.diagnosis.brief_events import brief_events
from bayesid.diagnosis.cut_runs import Sought, sought_in
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.outliers import Found, stripped
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.dependence_stage import dependence_beside, over_motion
from bayesid.diagnosis.environment_stage import in_its_environment
from bayesid.diagnosis.event_search import find_events
from bayesid.diagnosis.events_counted import with_events
from bayesid.diagnosis.form_stage import Compared, compared, force_left
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.stuck_stage import held_where_stuck
from bayesid.equations.model import Model
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.run_data import RunData
from bayesid.trials import Trial
from bayesid.words import counted

Notify = Callable[[str], None]


# What a first look leaves out, for the notes of its diagnosis.
FIRST_LOOK = (
    "a first look: actuators that stick, what acts for a short time and forces with the place or a period "
    "were not looked for"
)
SAME_SEA = ", nor another environment beside the explanation"
WITHOUT_QUICK = "; without --quick they are"


@dataclass(frozen=True)
class Excluded:
    """Events, and single readings (run, time [s], channel), that a diagnosis leaves out."""

    events: tuple[Event, ...] = ()
    readings: Found = ()


@dataclass(frozen=True)
class _Left:
    """What the best explanation leaves: events, else what a force depends on; `over_motion` as of
    `Facts`; `untried` is why neither could be looked for."""

    events: tuple[Event, ...] = ()
    dependence: Dependence | None = None
    over_motion: float = math.inf
    untried: str | None = None


def compare_without(
    model: Model,
    trial: Trial,
    notify: Notify = lambda text: None,
    as_built: float | None = None,
    seed: int = 0,
    first_look: bool = False,
) -> Compared:
    """Hypotheses of a trial once everything to be excluded is.

    Each pass fits and asks for one kind: outliers first, as a few wrong yaw rates doubled the environment
    measured, events last, as an effect may explain what looks like one; brief ones after gross ones. Without
    the events outliers are sought anew. So there are six passes at most, one more where a trial without its
    outliers fails: then they count.

    Parameters
    ----------
    first_look : the hypotheses are compared once, without what comes after: no events, no actuator that
        sticks, no environment beside the best explanation where straight runs told one

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    excluded = Excluded()
    whole: Compared | None = None
    uncut: DiagnosisProblem | None = None
    kept: str | None = None  # why outliers are not left out
    while True:
        try:
            problem = build_problem(model, trial, notify, as_built, excluded.events, excluded.readings)
            notify("fit without any effect")
            problem, base = _begun(problem)
            outliers = () if excluded.readings or kept else innovation_outliers(problem, base)
            if outliers:
                notify(f"once more without {counted(len(outliers), 'reading')} that all others contradict")
                excluded = Excluded(excluded.events, (*problem.outliers, *outliers))
                continue
            found = compared(problem, notify, seed, base)
            if not first_look or problem.environment.source == "assumed":
                found = in_its_environment(found, notify, seed)
        except BayesidError as error:
            if whole is None:
                if not excluded.readings:
                    raise
                many = counted(len(excluded.readings), "reading")
                kept = (
                    f"without {many} that all others contradict the trial could not be diagnosed ({error}); "
                    "the verdict counts them"
                )
                notify(kept)
                excluded = Excluded()
                continue
            more = tuple(e for e in excluded.events if e not in whole.problem.events)
            unable = f"the trial without {_named(more)} could not be diagnosed ({error}); they are counted"
            over, untried = _over_motion(whole)
            told = "; ".join(filter(None, (whole.unable, unable, untried)))
            return replace(whole, unable=told, over_motion=over)
        if kept:
            found = replace(found, unable="; ".join(filter(None, (found.unable, kept))))
        if first_look:
            over, untried = _over_motion(found)
            sea = "" if problem.environment.source == "assumed" else SAME_SEA
            look = FIRST_LOOK + sea + WITHOUT_QUICK
            told = "; ".join(filter(None, (found.unable, untried, look)))
            return replace(found, unable=told, over_motion=over)
        left = _left(found, trial, excluded.events, notify)
        if left.untried:
            found = replace(found, unable="; ".join(filter(None, (found.unable, left.untried))))
        counted_in = with_events(found.candidates, excluded.events, left.dependence)
        whole = replace(
            found,
            candidates=counted_in,
            uncut=uncut,
            dependence=left.dependence,
            over_motion=left.over_motion,
        )
        if not left.events:
            return held_where_stuck(whole, model, trial, notify, as_built, seed)
        uncut = found.problem if any(e.brief for e in left.events) else None
        notify(f"the same without {_named(left.events)}")
        excluded = Excluded((*excluded.events, *left.events))


def _begun(problem: DiagnosisProblem) -> tuple[DiagnosisProblem, FilterErrorFit]:
    """The fit without any effect, along the readings where the path of the nominal model cannot be gone on
    from, and the problem along the path that could.

    Raises
    ------
    ModelError
        if neither can; names the runs
    """
    try:
        return problem, fit_with(problem, ()).released()
    except ModelError:
        read = problem.along_readings()
    try:
        return read, fit_with(read, ()).released()
    except ModelError as error:
        runs = [log.name for log in read.logs if not _can_follow(read.model, log, read)] or ["these runs"]
        raise ModelError(
            f"the vehicle as given cannot be simulated along the readings of {', '.join(runs)} "
            f"({error}); `bayesid trial check` says what they contradict, and a shorter --resample (or none) "
            "helps where they are too far apart for its fastest motion"
        ) from None


def _can_follow(model: Model, log: RunData, problem: DiagnosisProblem) -> bool:
    start = [point for point, other in zip(problem.path, problem.logs, strict=True) if other is log]
    try:
        fit(model, [log], problem.coefficients, problem.environment.noise_model, start=start, iterations=4)
    except ModelError:
        return False
    return True


def innovation_outliers(problem: DiagnosisProblem, base: FilterErrorFit) -> Found:
    """Readings that contradict the fit without any effect, (run, time [s], channel) each.

    Only where that fit leaves residuals of the size of the noise: what a gap does to single readings is not
    to be taken away.
    """
    if not explains(RefittedHypothesis((), base.log_evidence, base)):
        return ()
    return stripped(problem.model, problem.logs, base.points, problem.environment.noise_model)[1]


def _left(found: Compared, trial: Trial, known: Sequence[Event], notify: Notify) -> _Left:
    """Further events the best explanation leaves, else what the rest depends on, and why neither could be
    looked for.

    Gross events first; then, once, brief ones that gain more than a free force that acts in all runs and all
    the time, or more than a model form does.
    """
    best, what, depends = simplest(found.candidates), "brief events", None
    if not known and (gross := find_events(found.problem, trial, best, notify)):
        return _Left(gross)
    try:
        sought = sought_in(found.problem, best.fit.free, best.fit.followed)
        if not any(e.brief for e in known) and (brief := _brief(found, best, sought)):
            return _Left(brief)
        what = "forces with the place or a period"
        depends = dependence_beside(found, best, sought)
        what = "a force of the motion of any shape"
        return _Left((), depends, over_motion(found, sought))
    except (BayesidError, LinAlgError, ValueError, MemoryError) as error:
        return _Left(dependence=depends, untried=f"{what} could not be looked for ({error})")


def _over_motion(found: Compared) -> tuple[float, str | None]:
    """`over_motion` of what is not gone on from, or why it could not be told."""
    best = simplest(found.candidates)
    try:
        return over_motion(found, sought_in(found.problem, best.fit.free, best.fit.followed)), None
    except (BayesidError, LinAlgError, ValueError, MemoryError) as error:
        return math.inf, f"a force of the motion of any shape could not be looked for ({error})"


def _brief(found: Compared, best: RefittedHypothesis, sought: Sought) -> tuple[Event, ...]:
    if brief := brief_events(sought, cache(lambda: force_left(found))):  # costs as much as the search
        return brief
    if found.problem.form is None or not found.formless:
        return ()
    formless = max(found.formless, key=lambda c: c.log_evidence)
    more = best.log_evidence - formless.log_evidence
    return brief_events(sought_in(found.problem, formless.fit.free, formless.fit.followed), lambda: more)


def _named(events: Sequence[Event]) -> str:
    return ", ".join(f"{e.run} {e.start:.0f}-{e.end:.0f} s" for e in events)
