"""Log evidence of every hypothesis over no effect, refitted or only screened.

Takes refits, the screen and what a free signal gains. Does not weigh: priors are `probabilities`'s business.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR, RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY, ScreenScore, testable


def evidences(
    problem: DiagnosisProblem,
    none: RefittedHypothesis,
    refits: Sequence[RefittedHypothesis],
    scores: Sequence[ScreenScore],
    wide: dict[str, float],
    where: Localisation,
) -> dict[str, float]:
    """Log evidence over none of every name; effects that were not refitted keep their screen, capped by
    the refits.
    """
    out: dict[str, float] = {}
    refitted = {c.effects[0]: over_none(c, none, where) for c in refits if len(c.effects) == 1}
    sound = [over_none(c, none, where) for c in refits if len(c.effects) == 1 and explains(c)]
    floor = min(sound) if sound else max(refitted.values(), default=0.0)
    top = max((s.gain for s in scores), default=0.0)
    for score in scores:
        # the screen's distance from its best holds where no refit explains the data
        out[score.name] = refitted.get(
            score.name, min(score.gain, floor if sound else floor - top + score.gain)
        )
    for effect in problem.model.causes:
        out.setdefault(effect.name, 0.0 if testable(problem, effect) else -np.inf)
    prefix = f"{COEFFICIENT_ERROR}:"
    wide = {n: refitted.get(prefix + n, min(v, floor if refitted else v)) for n, v in wide.items()}
    # one wrong coefficient, or a prior too narrow as a whole: as probable
    prior = {n: 0.5 / len(EVERY) if n in EVERY else 0.5 / max(len(wide) - len(EVERY), 1) for n in wide}
    out[COEFFICIENT_ERROR] = float(logsumexp(list(wide.values()), b=[prior[n] for n in wide]))
    out["outside"] = where.outside - zero(none, where)
    return out


def zero(none: RefittedHypothesis, where: Localisation) -> float:
    """Log evidence of no effect: the better of its two linearisations."""
    return max(none.log_evidence, where.base)


def over_none(candidate: RefittedHypothesis, none: RefittedHypothesis, where: Localisation) -> float:
    """Log evidence of a refit over no effect.

    The worse linearisation of no effect must not speak for a refit that itself leaves the data unexplained:
    that one is measured against the better.
    """
    return candidate.log_evidence - (none.log_evidence if explains(candidate) else zero(none, where))
