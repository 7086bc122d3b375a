"""A push to one side in place of a cause, where every hypothesis has a model form.

Takes a problem with a form and its hypotheses. Gives the hypotheses, the push among them where it explains
more.

A side force and a yaw moment of the hull are no part of a form and, beside one, no cause: a single screw
behind a hull of other equations pushes as much (`Effect.as_form` "alone"). What pushes to one side as well,
such as a rudder out of line, is not surely the cause either where such a push explains more in its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from bayesid.diagnosis.data.problem import DiagnosisProblem, fit_with
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains, weighted_hypothesis
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import acts
from bayesid.diagnosis.threshold_table import EVEN_ODDS, NAMING_PROBABILITY
from bayesid.errors import ModelError


def with_push_aside(problem: DiagnosisProblem, candidates: HypothesisComparison) -> HypothesisComparison:
    """Hypotheses in which a push has half the probability of each effect in whose place it explains more,
    and which explains nothing beside it.

    No more than half: a form may be a part of what it gains.
    """
    best = candidates.best
    if problem.form is None or not explains(best) or best.widens:
        return candidates
    effects = problem.model.effects
    families = {e.name: e.family for e in effects.values()}
    pushes = [e.name for e in effects.values() if e.as_form == "alone" and e.acts_in(problem.model.dof)]
    for name in best.effects:
        # sensors are judged by kinematics, and what is no force gives none
        likely = acts(candidates, families, name) >= NAMING_PROBABILITY
        if not likely or effects[name].port not in ("force", "input"):
            continue
        for push in pushes:
            rival = _refitted(problem, tuple(push if n == name else n for n in best.effects))
            if rival is None or not rival.log_evidence > best.log_evidence:
                continue
            # what the effect still explains beside the push is its own
            both = _refitted(problem, (*best.effects, push))
            if both is None or both.log_evidence < rival.log_evidence + candidates.thresholds.named:
                return _shared(candidates, rival, name, push)  # a push has one place
    return candidates


def _refitted(problem: DiagnosisProblem, names: tuple[str, ...]) -> RefittedHypothesis | None:
    """An explanation; None where it does not follow the log."""
    try:
        found = weighted_hypothesis(
            problem, names, fit_with(problem, tuple(problem.model.effects[n] for n in names))
        )
    except ModelError:
        return None
    return found if explains(found) else None


def _shared(
    candidates: HypothesisComparison, rival: RefittedHypothesis, name: str, push: str
) -> HypothesisComparison:
    """Hypotheses with half of what an effect has given to a push in its place, and its refit second."""
    sets: dict[tuple[str, ...], float] = {}
    for names, p in candidates.sets.items():
        moved = tuple(sorted(push if n == name else n for n in names))
        for to, share in ((names, 1.0 - EVEN_ODDS), (moved, EVEN_ODDS)):
            sets[to] = sets.get(to, 0.0) + p * share

    def halved(table: Mapping[str, float]) -> dict[str, float]:
        given = EVEN_ODDS * table.get(name, 0.0)
        return {**table, name: table.get(name, 0.0) - given, push: table.get(push, 0.0) + given}

    return replace(
        candidates,
        refits=(candidates.refits[0], rival, *candidates.refits[1:]),
        probabilities=halved(candidates.probabilities),
        inside=halved(candidates.inside),
        sets=sets,
    )
