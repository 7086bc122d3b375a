"""The hypotheses once more with the orders of an actuator held where it may have stuck.

Takes `Compared`. Gives `Compared`, with events of kind "stuck" where they are needed. Does not decide what
they mean.

An actuator that sticks for long in many runs does not show in any free signal: coefficients, a form and the
environment bend to it: of five simulated rudders that jam for 5 to 57 % of every run they left 0 to 31
nats. The times linear theory finds beside them were right all the same. Whether it stuck is decided by what
all hypotheses, refitted with the orders held, explain better than before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from numpy.linalg import LinAlgError

from bayesid.diagnosis.actuator_event import ALIKE, AWAY
from bayesid.diagnosis.cut_runs import linearised, sought_in
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.dependence_stage import dependence_beside, over_motion
from bayesid.diagnosis.environment_stage import in_its_environment
from bayesid.diagnosis.events_counted import with_events
from bayesid.diagnosis.failed_checks import MOST_RUNS
from bayesid.diagnosis.form_stage import Compared, compared, force_left
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.stuck_search import Stuck, stuck_actuators
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER, STUCK_EVIDENCE, STUCK_TRIED
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.trials import Trial
from bayesid.words import counted, first_few

Notify = Callable[[str], None]
# Refits with further orders held: what was found lets more be seen.
MOST_ROUNDS = 3
# What ends a search, not a diagnosis.
FAILURES = (BayesidError, LinAlgError, ValueError, MemoryError)


def held_where_stuck(
    found: Compared, model: Model, trial: Trial, notify: Notify, as_built: float | None, seed: int
) -> Compared:
    """The same hypotheses with an actuator held where it stuck, as often as that explains more.

    Parameters
    ----------
    found : hypotheses of a trial, everything else that is excluded left out
    as_built : relative sd of the coefficients if an earlier clean identification fixed them

    Notes
    -----
    The readings that count are the same before and after, and each has the environment beside its best
    explanation: the two log evidences compare. It has to explain `ALIKE` of what it and a free force beside
    it do: in a swell that a helmsman answers, a rudder that did nothing would look a little like it.
    """
    before, chosen, others = found, 0.0, found.problem.events
    newer: Stuck | None = None
    unable: list[str] = []
    for _ in range(MOST_ROUNDS):
        try:
            stuck, newer = _suspected(found, trial), None
            if stuck.gain < STUCK_TRIED:
                break
            if _same(stuck.events, found.problem.events, model):
                newer = stuck
                break
            notify(f"the same with an actuator held in {counted(len(stuck.events), 'run')}")
            events, problem, base = _held(found, others, stuck, model, trial, notify, as_built)
            again = in_its_environment(compared(problem, notify, seed, base), notify, seed)
        except FAILURES as error:
            unable.append(f"an actuator that stuck could not be looked for any further ({error})")
            break
        best = simplest(again.candidates)
        gain = best.log_evidence - simplest(found.candidates).log_evidence + chosen - stuck.chosen
        if not gain >= STUCK_EVIDENCE:
            newer = stuck if gain > -LINEARISATION_SCATTER else None
            break
        total = gain + sum(e.evidence for e in found.problem.events if e.kind == "stuck")
        told = [replace(e, evidence=total * e.evidence / stuck.gain) for e in events]
        problem = replace(again.problem, events=(*others, *told))
        # brief events are told as they were found: their problem has the orders as logged
        found = replace(again, problem=problem, unable=_noted(again.unable, found.unable))
        chosen = stuck.chosen
    if found is not before:
        judged, said = _told(found, newer)
        unable += said
        found = before if judged is None else judged
    return replace(found, unable=_noted(found.unable, *unable))


def _told(found: Compared, newer: Stuck | None) -> tuple[Compared | None, list[str]]:
    """What was held with its events counted, or nothing where a free force beside it does as much; and what
    could not be asked."""
    said = []
    gained = sum(e.evidence for e in found.problem.events if e.kind == "stuck")
    try:
        left = force_left(found)
    except FAILURES as error:
        return None, [f"an actuator that may have stuck could not be judged ({error})"]
    if gained < ALIKE * (gained + left):
        runs = first_few(sorted({e.run for e in found.problem.events if e.kind == "stuck"}), MOST_RUNS)
        return None, [
            f"an actuator that sticks in {runs} would explain {gained:.0f} nats, but a force that acts all "
            f"the time explains {left:.0f} beside it: it is not told"
        ]
    best, depends, what = simplest(found.candidates), None, "forces with the place or a period"
    try:
        sought = sought_in(found.problem, best.fit.free, best.fit.followed)
        depends = dependence_beside(found, best, sought)
        what = "a force of the motion of any shape"
        found = replace(found, over_motion=over_motion(found, sought))
    except FAILURES as error:
        said.append(f"{what} could not be looked for ({error})")
    if newer is not None:
        found = _as_seen_last(found, newer)
    counted_in = with_events(found.candidates, found.problem.events, depends)
    return replace(found, candidates=counted_in, dependence=depends), said


def _noted(*texts: str | None) -> str | None:
    """Notes as one, each once."""
    return "; ".join(dict.fromkeys(t for t in texts if t)) or None


def _as_seen_last(found: Compared, stuck: Stuck) -> Compared:
    """The same actuators told as they look beside the explanation with them held: before, it followed a part
    of them itself."""
    again = {(e.run, e.stuck): e for e in stuck.events}
    held = [e for e in found.problem.events if e.kind == "stuck"]
    if not held or again.keys() != {(e.run, e.stuck) for e in held}:
        return found
    told = tuple(
        replace(again[e.run, e.stuck], evidence=e.evidence) if e.kind == "stuck" else e
        for e in found.problem.events
    )
    return replace(found, problem=replace(found.problem, events=told))


def _held(
    found: Compared,
    others: tuple[Event, ...],
    stuck: Stuck,
    model: Model,
    trial: Trial,
    notify: Notify,
    as_built: float | None,
) -> tuple[tuple[Event, ...], DiagnosisProblem, FilterErrorFit]:
    """Where linear theory says that it stuck or at what was ordered then, whichever leaves less: the events,
    the problem and the fit without any effect."""
    tried = []
    for events in (stuck.events, stuck.ordered):
        problem = build_problem(
            model, trial, notify, as_built, (*others, *events), found.problem.outliers, False
        )
        tried.append((events, problem, fit_with(problem, ()).released()))
    return max(tried, key=lambda one: one[2].log_evidence)


def _same(new: Sequence[Event], old: Sequence[Event], model: Model) -> bool:
    """Whether an actuator is held as before, but for a length of travel and `AWAY` of where it stuck or its
    standard deviation."""
    length = model.scales["L"] / model.scales["U"]
    before = sorted((e for e in old if e.kind == "stuck"), key=lambda e: e.run)
    return len(new) == len(before) and all(
        (a.run, a.stuck) == (b.run, b.stuck)
        and max(abs(a.start - b.start), abs(a.end - b.end)) < length
        and abs((a.value or 0.0) - (b.value or 0.0)) <= max(AWAY * abs(b.value or 0.0), a.sd or 0.0)
        for a, b in zip(new, before, strict=True)
    )


def _suspected(found: Compared, trial: Trial) -> Stuck:
    """Beside the best explanation, or beside the best without a form, which follows what lasts."""
    best = simplest(found.candidates)
    beside = [(found.problem, best)]
    if found.formless:
        beside.append((found.problem, max(found.formless, key=lambda c: c.log_evidence)))
    tried = [stuck_actuators(linearised(p, c.fit.free, c.fit.followed), trial) for p, c in beside]
    return max(tried, key=lambda one: one.gain)
