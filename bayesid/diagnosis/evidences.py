"""Log evidence of every hypothesis over no effect, refitted or only screened.

Takes refits, the screen and what a free signal gains. Knows what one wrong coefficient has of the prior, and
which refit goes first for it. Else does not weigh: priors are `probabilities`'s business.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR, RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY, ScreenScore, testable

_PREFIX = f"{COEFFICIENT_ERROR}:"


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
    wide = {n: refitted.get(_PREFIX + n, min(v, floor if refitted else v)) for n, v in wide.items()}
    prior = shares_of_wide(wide)
    out[COEFFICIENT_ERROR] = float(logsumexp(list(wide.values()), b=[prior[n] for n in wide]))
    out["outside"] = where.outside - zero(none, where)
    return out


def shares_of_wide(names: Collection[str]) -> dict[str, float]:
    """What each coefficient has of the prior of a wrong one: that of one effect.

    One wrong coefficient, or a prior too narrow as a whole: as probable.
    """
    alone = max(len(set(names) - set(EVERY)), 1)
    return {n: 0.5 / (len(EVERY) if n in EVERY else alone) for n in names}


def effect_first(
    refits: Sequence[RefittedHypothesis], wide: Collection[str], floor: float
) -> list[RefittedHypothesis]:
    """Refits, best first, with an effect before a coefficient that has more evidence and is less probable.

    A coefficient with a wide prior follows what an effect of the same force does, as closely; that it is just
    this one of all coefficients is as much less probable before the data.

    Parameters
    ----------
    wide : names of what was tried with a wider prior
    floor : log evidence above which an effect gains more than chance allows
    """
    out = list(refits)
    if not out or not out[0].widens:
        return out
    share = shares_of_wide(wide).get(out[0].effects[0].removeprefix(_PREFIX), 1.0)
    least = max(out[0].log_evidence + np.log(share), floor)
    for c in out:
        if len(c.effects) == 1 and not c.widens and explains(c) and c.log_evidence > least:
            out.remove(c)
            return [c, *out]
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
