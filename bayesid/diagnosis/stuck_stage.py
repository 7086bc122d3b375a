"""The hypotheses once more with the orders of an actuator held where it may have stuck.

Takes `Compared`. Gives `Compared`, with events of kind "stuck" where they are needed. Does not decide what
they mean.

An actuator that sticks for long in many runs is hidden from any free signal: coefficients, a form and the
environment bend to it, and in 12 simulated rudders that jam they left 0 to 30 nats of 4 to 580 times what the
vehicle's own equations missed. The times linear theory finds beside them were right all the same. Whether it
stuck is decided by what all hypotheses, refitted with the orders held, explain better than before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from numpy.linalg import LinAlgError

from bayesid.diagnosis.actuator_event import ALIKE, AWAY
from bayesid.diagnosis.cut_runs import sought_in
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.dependence_stage import dependence_beside
from bayesid.diagnosis.environment_stage import in_its_environment
from bayesid.diagnosis.events_counted import with_events
from bayesid.diagnosis.form_stage import Compared, compared, force_left
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.stuck_search import Stuck, stuck_actuators
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER, STUCK_EVIDENCE, STUCK_TRIED
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.trials import Trial
from bayesid.words import counted

Notify = Callable[[str], None]
# Refits with further orders held: what was found lets more be seen.
MOST_ROUNDS = 3


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
    stuck, worse = Stuck(), False
    for _ in range(MOST_ROUNDS):
        try:
            stuck = _suspected(found, trial)
            if stuck.gain < STUCK_TRIED or _same(stuck.events, found.problem.events, model):
                break
            notify(f"the same with an actuator held in {counted(len(stuck.events), 'run')}")
            events, problem, base = _held(found, others, stuck, model, trial, notify, as_built)
            again = in_its_environment(compared(problem, notify, seed, base), notify, seed)
            best = simplest(again.candidates)
            gain = best.log_evidence - simplest(found.candidates).log_evidence + chosen - stuck.chosen
            if not gain >= STUCK_EVIDENCE:
                worse = not gain > -LINEARISATION_SCATTER
                break
            total = gain + sum(e.evidence for e in found.problem.events if e.kind == "stuck")
            told = [replace(e, evidence=total * e.evidence / stuck.gain) for e in events]
            again = replace(again, problem=replace(again.problem, events=(*others, *told)))
            sought = sought_in(again.problem, best.fit.free, best.fit.followed)
            depends = dependence_beside(again, best, sought)
        except (BayesidError, LinAlgError, ValueError, MemoryError) as error:
            unable = f"an actuator that stuck could not be looked for ({error})"
            return replace(found, unable="; ".join(filter(None, (found.unable, unable))))
        counted_in = with_events(again.candidates, again.problem.events, depends)
        found = replace(again, candidates=counted_in, uncut=found.uncut, dependence=depends)
        chosen = stuck.chosen
    gained = sum(e.evidence for e in found.problem.events if e.kind == "stuck")
    if gained < ALIKE * (gained + force_left(found)):
        return before
    return found if worse else _as_seen_last(found, stuck)


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
        tried.append((events, problem, fit_with(problem, ())))
    return max(tried, key=lambda one: one[2].log_evidence)


def _same(new: Sequence[Event], old: Sequence[Event], model: Model) -> bool:
    """Whether an actuator is held as before, but for a length of travel and `AWAY` of where it stuck."""
    length = model.scales["L"] / model.scales["U"]
    before = sorted((e for e in old if e.kind == "stuck"), key=lambda e: e.run)
    return len(new) == len(before) and all(
        (a.run, a.stuck) == (b.run, b.stuck)
        and max(abs(a.start - b.start), abs(a.end - b.end)) < length
        and abs((a.value or 0.0) - (b.value or 0.0)) < AWAY * abs(b.value or 0.0)
        for a, b in zip(new, before, strict=True)
    )


def _suspected(found: Compared, trial: Trial) -> Stuck:
    """Beside the best explanation, or beside the best without a form, which follows what lasts."""
    best = simplest(found.candidates)
    beside = [(found.problem, best)]
    if found.formless:
        beside.append((found.problem, max(found.formless, key=lambda c: c.log_evidence)))
    tried = [stuck_actuators(sought_in(p, c.fit.free, c.fit.followed), trial) for p, c in beside]
    return max(tried, key=lambda one: one.gain)
