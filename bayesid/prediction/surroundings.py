"""What acts around the vehicle in a diagnosed model, with its size: current, wind, a steady force.

Takes a `DiagnosedModel`. Gives sentences. Knows no effect by name: a declaration says whether it is fixed to
the earth. Such an effect is no property of the vehicle: what it makes of a manoeuvre depends on the course.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.diagnosis.plain_words import sentence
from bayesid.diagnosis.result_parts import Effect as FoundEffect
from bayesid.diagnosis.result_parts import Value
from bayesid.diagnosis.size_names import contract, in_sentence
from bayesid.equations.model import Model
from bayesid.model.effects import Effect

Array = np.ndarray
LEAST_SHARE = 0.005  # of the draws, from which an effect is told


@dataclass(frozen=True)
class Surrounding:
    """One effect: its name, share of the draws that have it, and itself in a sentence."""

    effect: str
    share: float
    says: str


def surroundings(found: DiagnosedModel) -> tuple[Surrounding, ...]:
    """Effects fixed to the earth, in the order of the model, each of the mean size in draws that have it."""
    model = found.model
    weights = [h.weight for h in found.hypotheses]
    pars = []
    for h in found.hypotheses:
        par = model.nominal.copy()
        par[model.positions(h.names)] = h.mean
        pars.append(par)
    out = []
    for effect in model.effects.values():
        if not effect.fixed_to_earth:
            continue
        having = [(w, par) for w, par in zip(weights, pars, strict=True) if _acts(model, effect, par)]
        share = sum(w for w, _ in having)
        if share >= LEAST_SHARE:
            mean = np.average([par for _, par in having], axis=0, weights=[w for w, _ in having])
            out.append(Surrounding(effect.name, float(share / sum(weights)), _says(model, effect, mean)))
    return tuple(out)


def _acts(model: Model, effect: Effect, par: Array) -> bool:
    """Whether what its sentence tells of it is there; any parameter, where the sentence tells none."""
    told = in_sentence(effect)
    return any(
        par[model.index[effect.key(p.name)]] != p.off for p in effect.parameters if p.name in told or not told
    )


def _says(model: Model, effect: Effect, par: Array) -> str:
    values = {
        p.name: Value(float(par[model.index[effect.key(p.name)]]), 0.0, p.unit) for p in effect.parameters
    }
    return sentence(FoundEffect(effect.name, 1.0, contract(effect.name, values), says=effect.says))
