"""The verdict: one of eight words, with the effects, the set, the reasons and the rule behind it.

Takes `HypothesisComparison`. Gives a frozen `Verdict`. Reads no data and no held-out run; their prediction
(`after_holdout`) and that of runs left out (`after_left_out`) may only take a name away. The rules are in
`rules`, the numbers they compare with in `threshold_table`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import Facts, Grounds, Named, Unnamed, grounds_of, simplest
from bayesid.diagnosis.hypotheses.rules import (
    LEFT_OUT_WORSE,
    NAMING,
    REFUTED,
    WORDS,
    Rule,
    Word,
    deciding,
)
from bayesid.diagnosis.threshold_table import DISAGREEMENT_P_VALUE

__all__ = [
    "NAMING", "REFUTED", "WORDS", "Verdict", "Word", "after_holdout", "after_left_out", "decide", "simplest",
]  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """What the diagnosis says.

    Attributes
    ----------
    word : one of `WORDS`
    effects : names the verdict stands on
    set95 : smallest set of hypotheses with 95 % probability
    confounded : effects the coefficients can absorb, which lie along the fitted coefficient change
    reasons : sentences, numbers included
    rule : name of the rule that decided
    unnamed : effects of the best explanation that are not named though others of it may be, and why
    """

    word: Word
    effects: tuple[str, ...]
    set95: tuple[str, ...]
    confounded: tuple[str, ...]
    reasons: tuple[str, ...]
    rule: str = ""
    unnamed: Mapping[str, Unnamed] = field(default_factory=dict)


def decide(
    problem: DiagnosisProblem, candidates: HypothesisComparison, over_motion: float = math.inf
) -> Verdict:
    """Verdict of a comparison; `over_motion` as of `Facts`."""
    grounds = grounds_of(problem, candidates, over_motion)
    rule = deciding(grounds.facts)
    effects, confounded, set95 = names_of(rule, grounds.named)
    return Verdict(
        rule.word, effects, set95, confounded, _reasons(grounds, rule), rule.name, grounds.named.unnamed
    )


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


def after_left_out(verdict: Verdict, gain: float, error: float, agreement: float | None) -> Verdict:
    """Verdict that knows runs left out: what fails two checks on them is no cause, whatever its evidence.

    A name is not given where the runs disagree about its size and, each left out of the estimate, are
    replayed worse with it than by the simulator as given, by more than one standard error over runs.
    Something acts then that no effect as it is declared explains: an eddy that a wind and a screw's race
    followed run by run.

    Parameters
    ----------
    gain, error : mean logarithm of the rms error of the simulator as given over that with the explanation,
        and its standard error; nan where it was not asked
    agreement : p-value of one effect for all runs; None where it was not asked
    """
    if verdict.word not in NAMING or agreement is None or not agreement < DISAGREEMENT_P_VALUE:
        return verdict
    if not gain < -error:
        return verdict
    reason = (
        f"{' + '.join(verdict.effects)}: runs left out are missed by {math.exp(-gain):.2g} times what the "
        f"simulator as given misses (one standard error {math.exp(-gain - error):.2g} to "
        f"{math.exp(-gain + error):.2g}), and the runs disagree about it (p = {agreement:.2g}); before "
        f"that the verdict was {verdict.word} ({verdict.rule})"
    )
    set95 = ("outside", *(n for n in verdict.set95 if n not in ("none", "outside")))
    return replace(
        verdict, word="outside", effects=(), set95=set95, reasons=(*verdict.reasons, reason),
        rule=LEFT_OUT_WORSE,
    )  # fmt: skip


def names_of(rule: Rule, named: Named) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Effects a rule names, effects it lists as confounded, and the 95 % set it is said with."""
    effects = {
        "nothing": (),
        "rivals": named.rivals,
        "sure": named.sure,
        "best": named.best[:1],
        "coefficient": (COEFFICIENT_ERROR,),
    }[rule.effects]
    confounded = {"nothing": (), "all": named.confounded, "along": named.along}[rule.confounded]
    confounded = tuple(n for n in confounded if n not in effects)  # what is named is not confounded
    # what cannot be told from no effect is no effect
    set95 = named.set95
    if rule.silent and "none" not in set95:
        set95 = ("none", *set95)
    if named.form or rule.silent == "model_form":
        set95 = tuple("model_form" if n == "none" else n for n in set95)
    if rule.word not in ("none", "outside"):
        # one force in two words: no run tells the coefficient from the effect
        both = (COEFFICIENT_ERROR, *named.stand) if named.stand else ()
        set95 = (*set95, *(n for n in both if n not in set95 and n not in effects))
    return effects, confounded, set95


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
    if math.isfinite(f.over_motion):
        out.append(
            f"a free force beside it gains {f.over_motion:+.1f} over a force of the motion and the controls, "
            "of any shape"
        )
    if f.gains:
        out.append(f"after it a free signal would add {f.left:+.1f}")
        if g.runs is not None:
            out.append(
                f"each run predicted from the others: {g.runs.total:+.1f} over no effect; that all runs have "
                f"one and the same effect has p = {g.runs.disagreement:.2g}"
            )
    return (*out, f"decided by: {rule.sentence}")
