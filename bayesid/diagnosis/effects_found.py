"""The effects an answer stands on: probability, sizes with intervals, what may act in their place.

Takes a comparison of hypotheses and its verdict. Does not decide.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.effect_draws import EffectDraws, choice
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, parameter_table
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import acts
from bayesid.diagnosis.hypotheses.sizes import sizes_told
from bayesid.diagnosis.hypotheses.verdict import Verdict
from bayesid.diagnosis.plain_words import Z95
from bayesid.diagnosis.result_parts import SURELY_MOVED, Effect, InPlaceOf, Value
from bayesid.diagnosis.size_names import UNTOLD, contract, in_sentence, meanings, said_of
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.fit import FilterErrorFit

LEAST_SHARE = 0.1  # of a coefficient, from which an effect within what was stated is told
ALIKE = 0.1  # of a deviation, within which two sizes are the same
WORTH_TELLING = 0.05  # probability from which an effect of the same family is told beside the one named


def effects_found(
    model: Model,
    problem: DiagnosisProblem,
    c: HypothesisComparison,
    verdict: Verdict,
    best: RefittedHypothesis,
    drawn: EffectDraws | None,
) -> tuple[Effect, ...]:
    """What the verdict stands on, or what is more probable than not where it names nothing."""
    fitted, table = parameter_table(best.fit, problem), sizes_told(problem, c, best)
    silent = unseen(best.fit)

    def own(key: str) -> bool:
        """Whether a size is that of this explanation and its equations, as draws are."""
        return key in fitted and abs(table[key][0] - fitted[key][0]) <= ALIKE * table[key][1]

    named = verdict.effects
    if not named and verdict.word in ("ambiguous", "coefficients"):
        named = tuple(n for n in best.effects if n in model.effects and c.inside.get(n, 0.0) > 0.5)
    families, out = {e.name: e.family for e in model.kernel.effects}, []
    for name in named:
        effect = model.effects.get(name)
        parameters = effect.parameters if effect is not None else ()
        keys = {p.name: (effect.key(p.name), p.unit) for p in parameters} if effect is not None else {}
        told = [p for p, (key, _) in keys.items() if key in table and key not in silent]
        says = said_of(effect, model, told) if effect is not None else ""
        needed = in_sentence(effect, says) if effect is not None else frozenset()
        values = {
            # draws are of this explanation and its equations, not of others or of kinematics alone
            p: _value(*table[key], unit, _interval(drawn if own(key) else None, key, table[key][1]))
            for p, (key, unit) in keys.items()
            if key in table and (key not in silent or p in needed)
        }
        out.append(
            Effect(
                name,
                float(min(1.0, acts(c, families, name))),
                contract(name, values, {p.name: p.assumed for p in parameters}),
                meanings(parameters),
                effect.magnitude if effect is not None else "",
                says,
                {n: float(model.nominal[model.index[n]]) for n in effect.adjust if n in model.index}
                if effect is not None
                else {},
                _in_its_place(c, families, name),
            )
        )
    return tuple(out)


def in_place_of(
    model: Model, c: HypothesisComparison, verdict: Verdict, acting: Mapping[str, float]
) -> tuple[InPlaceOf, ...]:
    """What stands for a coefficient elsewhere than stated, where the verdict does not name it: for one
    certainly off where the verdict has room for that, and else where its size is told for sure.
    """
    # where coefficients are the answer, also what would be the best explanation
    off = {"none": (), "outside": (), "coefficients": c.off}.get(verdict.word, c.stand)
    small = [s for s in c.within if abs(s.size) > max(SURELY_MOVED * s.sd, LEAST_SHARE)]
    out = []
    for s in (*off, *(s for s in small if s.effect not in {o.effect for o in off})):
        effect = model.effects[s.effect]
        (size,) = effect.parameters
        value = _value(s.size, s.sd, size.unit, (None, None))
        told = Effect(s.effect, acting.get(s.effect, 0.0), {size.name: value}, says=effect.says)
        if s.effect not in verdict.effects:
            out.append(InPlaceOf(told, s.coefficient, s.moved, s in off))
    return tuple(out)


def unseen(fitted: FilterErrorFit) -> frozenset[str]:
    """Parameters of which a fit knows no more than their prior: of a wind that is nowhere measured, the areas
    the measured one acts on."""
    free = fitted.free
    return frozenset(
        n for n, sd, prior in zip(free.names, fitted.sd, free.sd, strict=True) if sd > UNTOLD * prior
    )


def _in_its_place(c: HypothesisComparison, families: dict[str, str], name: str) -> dict[str, float]:
    """Others of the family of an effect, as probable as a reader should know."""
    family = families.get(name)
    return {
        n: float(min(1.0, p))
        for n, p in c.inside.items()
        if n != name and p >= WORTH_TELLING and family is not None and families.get(n) == family
    }


def _value(value: float, sd: float, unit: str, drawn: tuple[float | None, float | None]) -> Value:
    """A size with the interval to use: of the draws, else by its deviation where that is finite."""
    if drawn == (None, None) and math.isfinite(value) and math.isfinite(sd):
        drawn = (value - Z95 * sd, value + Z95 * sd)
    return Value(value, sd, unit, *drawn)


def _interval(drawn: EffectDraws | None, key: str, sd: float) -> tuple[float | None, float | None]:
    """95 % interval of the draws where it is the one to use.

    As far as the runs differ where they differ more than the draws do (`sd`): draws know no force that the
    equations lack, and count no run as one.
    """
    if drawn is None or key not in drawn.parameters or choice(drawn) != "draws":
        return None, None
    of = drawn.parameters[key]
    wider = max(sd / of.sd, 1.0) if of.sd > 0 else 1.0
    return of.mean - wider * (of.mean - of.low95), of.mean + wider * (of.high95 - of.mean)
