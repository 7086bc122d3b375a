"""The verdict: one of eight words, with the effects, the set, the reasons and the rule behind it.

Takes `HypothesisComparison`. Gives a frozen `Verdict`. Reads no data and no held-out run, whose prediction
may only take a name away (`after_holdout`); the rules are in `rules`, the numbers they compare with in
`threshold_table`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import Facts, Grounds, Named, grounds_of, simplest
from bayesid.diagnosis.hypotheses.rules import NAMING, WORDS, Rule, Word, deciding

__all__ = ["NAMING", "REFUTED", "WORDS", "Verdict", "Word", "after_holdout", "decide", "simplest"]


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
    rule : name of the rule that decided
    """

    word: Word
    effects: tuple[str, ...]
    set95: tuple[str, ...]
    hidden: tuple[str, ...]
    reasons: tuple[str, ...]
    rule: str = ""


def decide(problem: DiagnosisProblem, candidates: HypothesisComparison) -> Verdict:
    """Verdict of a comparison."""
    grounds = grounds_of(problem, candidates)
    rule = deciding(grounds.facts)
    effects, hidden, set95 = names_of(rule, grounds.named)
    return Verdict(rule.word, effects, set95, hidden, _reasons(grounds, rule), rule.name)


REFUTED = "refuted by held-out runs"


def after_holdout(verdict: Verdict, worse: Sequence[str]) -> Verdict:
    """Verdict that knows held-out runs: a name under which their prediction gets worse is not given.

    Parameters
    ----------
    worse : horizons over which the error grows
    """
    if verdict.word not in NAMING or not worse:
        return verdict
    reason = (
        f"{' + '.join(verdict.effects)} predicts the held-out runs worse over {', '.join(worse)} than the "
        f"re-tuned coefficients do; before they were read the verdict was {verdict.word} ({verdict.rule})"
    )
    return replace(verdict, word="ambiguous", reasons=(*verdict.reasons, reason), rule=REFUTED)


def names_of(rule: Rule, named: Named) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Effects a rule names, effects it lists as hidden, and the 95 % set it is said with."""
    effects = {
        "nothing": (),
        "rivals": named.rivals,
        "sure": named.sure,
        "best": named.best[:1],
        "coefficient": (COEFFICIENT_ERROR,),
    }[rule.effects]
    hidden = {"nothing": (), "all": named.hidden, "along": named.along}[rule.hidden]
    hidden = tuple(n for n in hidden if n not in effects)  # what is named is not hidden
    # what cannot be told from no effect is no effect
    set95 = named.set95
    if rule.or_none and "none" not in set95:
        set95 = ("none", *set95)
    if named.form:
        set95 = tuple("model_form" if n == "none" else n for n in set95)
    return effects, hidden, set95


def _reasons(g: Grounds, rule: Rule) -> tuple[str, ...]:
    f: Facts = g.facts
    unfollowed = (
        ""
        if g.follows
        else f"; nothing follows the readings, this one misses by {g.misfit:.3g} times the noise"
    )
    out = [
        f"best explanation {' + '.join(g.named.best) or 'none'}: log evidence {f.gain:+.1f} over no effect "
        f"(by chance {f.gain_by_chance:.1f} in 1 of 100 trials){unfollowed}",
        f"a free force or signal anywhere would raise it by {f.free:+.1f} at best (in "
        f"{g.place}; by chance at most {f.free_by_chance:.1f})",
        f"largest coefficient move without an effect: {f.conflict:.1f} prior sd (by chance "
        f"{f.conflict_by_chance:.1f})",
    ]
    if f.gains:
        out.append(f"after it a free signal would add {f.left:+.1f}")
        if g.runs is not None:
            out.append(
                f"each run predicted from the others: {g.runs.total:+.1f} over no effect; that all runs have "
                f"one and the same effect has p = {g.runs.disagreement:.2g}"
            )
    return (*out, f"decided by: {rule.sentence}")
