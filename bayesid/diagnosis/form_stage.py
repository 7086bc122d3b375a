"""The hypotheses of a problem, with a model form in each of them where the runs ask for one.

Takes a `DiagnosisProblem`. Gives `Compared`: the problem, with the form if it has one, and its hypotheses.
Leaves out no reading (`exclusions`) and does not decide.

A form is asked for beside the best single effect where it gains 20 nats more there than any second effect
would, and else beside the best of all, so that two effects that explain everything are not taken for one. An
effect that is itself a shape of a form counts as an effect there: only what a form gains beyond it is the
form's. It is tried once: hypotheses with a form cost as much as all others together.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.comparison import (
    HypothesisComparison,
    SingleEffects,
    compare,
    single_effects,
    weigh,
    without_effects,
)
from bayesid.diagnosis.hypotheses.facts import like_a_form, simplest
from bayesid.diagnosis.hypotheses.form_part import form_gain
from bayesid.diagnosis.hypotheses.form_search import SoughtForm, sought_form
from bayesid.diagnosis.hypotheses.localisation import SENSORS, Localisation
from bayesid.diagnosis.hypotheses.push_aside import with_push_aside
from bayesid.diagnosis.hypotheses.refit import remainder
from bayesid.diagnosis.hypotheses.search import gains_beside
from bayesid.diagnosis.threshold_table import FORM_EVIDENCE
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import FilterErrorFit

Notify = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Compared:
    """A problem and its hypotheses.

    `unable` says what could not be tried, and why, `formless` are refits of the problem without the form it
    has, `uncut` is the problem with the readings of brief events, `dependence` is what a force that is left
    depends on beside the motion, `over_motion` by how much a free force gains more than one of the motion (as
    of `Facts`).
    """

    problem: DiagnosisProblem
    candidates: HypothesisComparison
    unable: str | None = None
    formless: tuple[RefittedHypothesis, ...] = ()
    uncut: DiagnosisProblem | None = None
    dependence: Dependence | None = None
    over_motion: float = math.inf


def compared(
    problem: DiagnosisProblem,
    notify: Notify,
    seed: int,
    base: FilterErrorFit | None = None,
    earlier: RefittedHypothesis | None = None,
) -> Compared:
    """Hypotheses of a problem, with a form in each where the runs ask for one.

    Parameters
    ----------
    base : the fit without any effect, where it is there already
    earlier : best explanation in another environment, which is tried in this one as well
    """
    single = single_effects(problem, notify, seed, base)
    leading = single.leading
    notify("whether the equations lack a force that depends on the motion")
    left = remainder(problem, leading) if leading.effects else without_effects(problem, single)
    sought = sought_form(problem, leading, _period(left, single.thresholds.remainder))
    known = {leading.effects: left}
    needed = sought if sought is not None and sought.needed else None
    asked = needed is not None and needed.beyond > _further(problem, single) + FORM_EVIDENCE
    unable = None
    if needed is not None and asked:
        found, unable = _with_form(problem, needed, leading, single, notify, seed, earlier)
        if found is not None:
            return found
    candidates = weigh(problem, single, notify, known, earlier)
    beside = _beside(candidates)
    if beside.effects != leading.effects or (needed is not None and not asked):
        left = candidates.where_after or candidates.where
        sought = sought_form(problem, beside, _period(left, candidates.thresholds.remainder))
        if sought is not None and sought.needed:
            if not asked:
                before = simplest(candidates)
                found, unable = _with_form(problem, sought, before, single, notify, seed, earlier)
                if found is not None:
                    return found
            candidates = replace(candidates, form_instead=sought.beyond)
    seen = _seen(problem, candidates, beside, sought)
    return Compared(problem, replace(candidates, form_seen=seen), unable)


def force_left(found: Compared) -> float:
    """Log evidence of a free force that the best explanation leaves, which acts in all runs all the time."""
    candidates, best = found.candidates, simplest(found.candidates)
    after = candidates.where_after if best is candidates.best else None
    if after is None:
        after = candidates.where if best is candidates.none else remainder(found.problem, best)
    return max((p.evidence for p in after.places if p.channel not in SENSORS), default=0.0)


def _seen(
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    beside: RefittedHypothesis,
    sought: SoughtForm | None,
) -> float:
    """What a form that is not taken gains beside the explanation [nats].

    In place of those of its effects that are shapes of a form, which is then seen in them; beyond an effect
    that is a cause.
    """
    if sought is None or not sought.predicts:
        return 0.0
    shapes = like_a_form(candidates, beside, problem.model)
    return max(sought.gain if shapes else sought.beyond, 0.0)


def _with_form(
    problem: DiagnosisProblem,
    needed: SoughtForm,
    before: RefittedHypothesis,
    single: SingleEffects,
    notify: Notify,
    seed: int,
    earlier: RefittedHypothesis | None,
) -> tuple[Compared | None, str | None]:
    """The same with a form; nothing where the refits do not bear it out, and why it could not be tried."""
    notify("the same with a force that depends on the motion and that the equations lack")
    try:
        wider = problem.with_form(needed.form)
        candidates = compare(wider, notify, seed, known=single, earlier=earlier)
    except BayesidError as error:
        return None, f"the hypotheses could not be compared with a model form ({error})"
    after = candidates.best
    # an effect that may itself be part of a form need not be beaten, only equalled
    rival = any(problem.model.effects[n].as_form for n in before.effects if not before.widens)
    least = before.log_evidence + (0.0 if rival else float(FORM_EVIDENCE))
    # what does not arrive gives way to what does, and to what does not only where that gains as much
    if after.log_evidence < least and (explains(before) or not explains(after)):
        return None, None
    if form_gain(wider, after) < FORM_EVIDENCE:  # the runs do not agree about it
        return None, None
    asked = with_push_aside(wider, candidates)
    return Compared(wider, asked, formless=(single.none, *single.refits)), None


def _further(problem: DiagnosisProblem, single: SingleEffects) -> float:
    """What one more effect would gain beside the best single one [nats]."""
    leading = single.leading
    if leading.effects:
        scores = gains_beside(problem, leading, list(single.effects))
    else:
        scores = list(single.scores)
    return max((s.gain for s in scores), default=-np.inf)


def _beside(candidates: HypothesisComparison) -> RefittedHypothesis:
    """Best explanation that is no wider prior: that is another account of what a form is for."""
    best = simplest(candidates)
    if not best.widens:
        return best
    others = [c for c in candidates.refits if not c.widens and explains(c)]
    return max([candidates.none, *others], key=lambda c: c.log_evidence)


def _period(left: Localisation, by_chance: float) -> float | None:
    """Period of what is left in the forces, where a periodic force gains most."""
    first = left.places[0]
    return first.period if first.channel[0] in "YN" and first.evidence > by_chance else None
