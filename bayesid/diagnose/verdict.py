"""The verdict: one of seven words, with the effects, the set and the reasons behind it.

Takes `Candidates`. Gives a frozen `Verdict`. Reads no data and no held-out run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.diagnose.candidate import COEFFICIENT_ERROR, Candidate, explains, idle, pulls
from bayesid.diagnose.crossed import crossed
from bayesid.diagnose.problem import NEAR, Problem
from bayesid.diagnose.weigh import credible_set
from bayesid.diagnose.which import Candidates

# Share of its signature the coefficients absorb from which an effect is hidden.
HIDDEN = 0.98
# Probability of acting from which an effect is named.
SURE = 0.9
# Noncentrality at one prior sd below which an effect of its usual size leaves no trace, see `unseen`.
TRACE = 10.0
# Probability of no effect below which there surely is a gap.
SURELY = 0.01
# Share of what one of several effects explains below which a remainder casts no doubt on its name.
MINOR = 0.1
WORDS = ("none", "effect", "effect_with_remainder", "several", "outside", "coefficients", "ambiguous")


@dataclass(frozen=True)
class Verdict:
    """What the diagnosis says.

    Attributes
    ----------
    word : one of `WORDS`
    effects : names the verdict stands on
    set95 : smallest set of hypotheses with 95 % probability
    hidden : effects the coefficients can absorb, which lie along the fitted coefficient change
    reasons : sentences, numbers included
    """

    word: str
    effects: tuple[str, ...]
    set95: tuple[str, ...]
    hidden: tuple[str, ...]
    reasons: tuple[str, ...]


def judge(problem: Problem, candidates: Candidates) -> Verdict:
    """Verdict of a comparison."""
    probability = candidates.probabilities
    faint = unseen(candidates)
    set95 = credible_set(probability, silent=faint)
    # Known as built, coefficients do not change by themselves: what they could imitate is a change.
    share = np.zeros(len(candidates.ambiguity.names)) if problem.as_built else candidates.ambiguity.absorbed
    absorbed = dict(zip(candidates.ambiguity.names, share, strict=True))
    families = {e.name: e.family for e in problem.model.kernel.effects}
    hidden = tuple(n for n, a in absorbed.items() if a > HIDDEN)
    none = candidates.none
    limit = candidates.thresholds
    best = simplest(candidates)
    gain = best.log_evidence - none.log_evidence
    before = candidates.where.places[0]
    pull = pulls(none.fit, problem)
    conflict = float(np.abs(pull).max()) if pull.size else 0.0
    follows = any(c.fit.chi2 < NEAR for c in (none, *candidates.refits))
    misses = f"; nothing follows the readings, this one misses by {best.fit.chi2**0.5:.3g} times the noise"
    unfollowed = "" if follows else misses
    reasons = [
        f"best explanation {' + '.join(best.effects) or 'none'}: log evidence {gain:+.1f} over no effect "
        f"(by chance {limit.named:.1f} in 1 of 100 trials){unfollowed}",
        f"a free force or signal anywhere would raise it by {before.evidence:+.1f} at best (in "
        f"{before.channel}; by chance at most {limit.remainder:.1f})",
        f"largest coefficient move without an effect: {conflict:.1f} prior sd (by chance "
        f"{limit.conflict:.1f})",
    ]
    # beyond what one of the many free signals tried gains by chance
    outside = before.evidence > limit.remainder and probability["outside"] > 0.5
    if gain < limit.named:
        if outside:
            return Verdict("outside", (), set95, (), tuple(reasons))
        if "none" in set95 and conflict > max(limit.conflict, 3.0) and probability["none"] < 0.5:
            return Verdict("coefficients", (), set95, hidden, tuple(reasons))
        # a free signal that gains no more than chance speaks for nothing
        idly = 0.0 if before.evidence > limit.remainder else probability["outside"]
        if probability["none"] + sum(probability[n] for n in faint) + idly > 0.5:
            said = set95 if "none" in set95 else ("none", *set95)
            return Verdict("none", (), said, (), tuple(reasons))
        return Verdict("ambiguous", _names(set95), set95, (), tuple(reasons))
    left = candidates.where_after.places[0].evidence if candidates.where_after is not None else 0.0
    reasons.append(f"after it a free signal would add {left:+.1f}")
    if outside:
        return Verdict("outside", (), set95, (), tuple(reasons))
    if best.widens:
        if "none" in set95:
            return Verdict(
                "none" if probability["none"] > 0.5 else "ambiguous", (), set95, (), tuple(reasons)
            )
        if _acts(candidates, families, COEFFICIENT_ERROR) < SURE:
            return Verdict("ambiguous", _names(set95), set95, hidden, tuple(reasons))
        return Verdict("coefficients", (COEFFICIENT_ERROR,), set95, hidden, tuple(reasons))
    runs = crossed(best, none, len(problem.coefficients.names))
    rest = left > limit.remainder or runs.disagree or not explains(best)
    reasons.append(
        f"each run predicted from the others: {runs.total:+.1f} over no effect; that all runs have one and "
        f"the same effect has p = {runs.disagreement:.2g}"
    )
    if runs.refuted and explains(best):
        return Verdict("ambiguous", _names(set95), set95, (), tuple(reasons))
    if len(best.effects) > 1:
        # An effect that explains little beside what is left is a part of the remainder; one whose size is
        # nought mends something else.
        shows = left > limit.remainder
        off = idle(best, problem)
        kept = tuple(
            n
            for n in best.effects
            if n not in off and (not shows or left < MINOR * _part(candidates, best, n))
        )
        sure = tuple(n for n in kept if _acts(candidates, families, n) >= SURE)
        if len(sure) > 1:
            return Verdict("several", sure, set95, hidden, tuple(reasons))
        if not sure or absorbed.get(sure[0], 0.0) > HIDDEN:
            return Verdict("ambiguous", _names(set95), set95, hidden, tuple(reasons))
        return Verdict("effect_with_remainder", sure, set95, hidden, tuple(reasons))
    name = best.effects[0]
    if absorbed.get(name, 0.0) > HIDDEN:
        along = tuple(n for n in hidden if candidates.evidence.get(n, -np.inf) > gain - 20.0)
        return Verdict("coefficients", (), set95, along, tuple(reasons))
    if "none" in set95:
        if probability["none"] > 0.5:
            return Verdict("none", (), set95, (), tuple(reasons))
        return Verdict("ambiguous", _names(set95), set95, (), tuple(reasons))
    if _acts(candidates, families, name) < SURE or idle(best, problem):
        return Verdict("ambiguous", _names(set95), set95, (), tuple(reasons))
    word = "effect_with_remainder" if rest else "effect"
    return Verdict(word, (name,), set95, (), tuple(reasons))


def unseen(candidates: Candidates) -> tuple[str, ...]:
    """Effects that these runs would hardly show at their usual size, and do not speak for.

    Their probability is what it was before the data. As an explanation they are no other than "none": what is
    not there to be seen cannot be told from what is too small to be. Where there surely is a gap none of them
    explains it.
    """
    if candidates.probabilities["none"] < SURELY:
        return ()
    return tuple(
        n
        for n, d in zip(candidates.ambiguity.names, candidates.ambiguity.detect, strict=True)
        if d < TRACE and candidates.evidence.get(n, 0.0) <= 0.0
    )


def _acts(candidates: Candidates, families: Mapping[str, str], name: str) -> float:
    """Probability that an effect of a name's family acts, alone or with others."""
    family = families.get(name, name)
    return sum(p for n, p in candidates.inside.items() if families.get(n, n) == family)


def _part(candidates: Candidates, best: Candidate, name: str) -> float:
    """Log evidence that is lost without one of several effects, as far as the refits tell."""
    less = [
        c.log_evidence
        for c in candidates.refits
        if set(c.effects) < set(best.effects) and name not in c.effects
    ]
    return best.log_evidence - max(less, default=candidates.none.log_evidence)


def simplest(candidates: Candidates) -> Candidate:
    """Best explanation; several effects only where they are worth it over the best single one."""
    best = candidates.best
    alone = [c for c in candidates.refits if len(c.effects) == 1]
    if (
        len(best.effects) > 1
        and alone
        and best.log_evidence < alone[0].log_evidence + candidates.thresholds.named
    ):
        return alone[0]
    return best


def _names(set95: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(n for n in set95 if n not in ("none", "outside"))
