"""What a diagnosis leaves out, and the hypotheses compared on the rest: one loop until nothing more is found.

Takes a trial and a model. Gives the `DiagnosisProblem` without what is excluded and its
`HypothesisComparison`. Does not decide.

Two kinds are excluded. Single readings that contradict the fit without any effect (innovation outliers):
before anything is known a path may bend a little, and one yaw rate off by ten sigma is a possible motion;
under the measured environment it is not. Events: short pieces that the best explanation of the whole trial
predicts far worse than the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.outliers import Found, stripped
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.event_search import find_events, with_events
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison, compare
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.hypotheses.form_part import form_gain
from bayesid.diagnosis.hypotheses.form_search import needed_form
from bayesid.diagnosis.threshold_table import FORM_EVIDENCE
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.trials import Trial

Notify = Callable[[str], None]


@dataclass(frozen=True)
class Excluded:
    """Events, and single readings (run, time [s], channel), that a diagnosis leaves out."""

    events: tuple[Event, ...] = ()
    readings: Found = ()


@dataclass(frozen=True, eq=False)
class Compared:
    """A problem and its hypotheses; `unable` says what could not be tried, and why."""

    problem: DiagnosisProblem
    candidates: HypothesisComparison
    unable: str | None = None


def compare_without(
    model: Model,
    trial: Trial,
    notify: Notify = lambda text: None,
    as_built: float | None = None,
    seed: int = 0,
) -> Compared:
    """Hypotheses of a trial once everything to be excluded is.

    Each pass fits and asks for one kind: outliers first, as a few wrong yaw rates doubled the environment
    measured, events last, as an effect may explain what looks like one. Without the events outliers are
    sought anew. So there are four passes at most.

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    excluded, whole = Excluded(), None
    while True:
        try:
            problem = build_problem(model, trial, notify, as_built, excluded.events, excluded.readings)
            notify("fit without any effect")
            base = fit_with(problem, ())
            outliers = () if excluded.readings else innovation_outliers(problem, base)
            if outliers:
                notify(f"once more without {len(outliers)} reading(s) that all others contradict")
                excluded = Excluded(excluded.events, (*problem.outliers, *outliers))
                continue
            candidates = compare(problem, notify, seed, base)
        except BayesidError as error:
            if whole is None:
                raise
            return Compared(
                whole.problem,
                whole.candidates,
                f"the trial without {_named(excluded.events)} could not be diagnosed ({error}); the verdict "
                f"counts them",
            )
        if excluded.events:
            with_them = Compared(problem, with_events(candidates, excluded.events))
            return _with_form(with_them, notify, seed)
        whole = Compared(problem, candidates)
        events = find_events(problem, trial, simplest(candidates), notify)
        if not events:
            return _with_form(whole, notify, seed)
        notify(f"the same without {_named(events)}")
        excluded = Excluded(events)


def _with_form(found: Compared, notify: Notify, seed: int) -> Compared:
    """The hypotheses with a model form in each, where the runs ask for one beside the best explanation."""
    problem, candidates = found.problem, found.candidates
    form = needed_form(problem, candidates)
    if form is None:
        return found
    notify("the same with a force that depends on the motion and that the equations lack")
    wider = problem.with_form(form)
    try:
        again = compare(wider, notify, seed)
    except BayesidError as error:
        return replace(found, unable=f"the hypotheses could not be compared with a model form ({error})")
    before, after = simplest(candidates), simplest(again)
    # an effect that may itself be part of a form need not be beaten, only equalled
    rival = any(problem.model.effects[n].as_form for n in before.effects if not before.widens)
    least = before.log_evidence + (0.0 if rival else float(FORM_EVIDENCE))
    if explains(before) and after.log_evidence < least:
        return found
    if form_gain(wider, after) < FORM_EVIDENCE:  # the runs do not agree about it
        return found
    return replace(found, problem=wider, candidates=with_events(again, problem.events))


def innovation_outliers(problem: DiagnosisProblem, base: FilterErrorFit) -> Found:
    """Readings that contradict the fit without any effect, (run, time [s], channel) each.

    Only where that fit leaves residuals of the size of the noise: what a gap does to single readings is not
    to be taken away.
    """
    if not explains(RefittedHypothesis((), base.log_evidence, base)):
        return ()
    return stripped(problem.model, problem.logs, base.points, problem.environment.noise_model)[1]


def _named(events: Sequence[Event]) -> str:
    return ", ".join(f"{e.run} {e.start:.0f}-{e.end:.0f} s" for e in events)
