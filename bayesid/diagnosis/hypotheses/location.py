"""The one place where the gap lies, all hypotheses counted.

Takes `HypothesisComparison`. A free signal alone knows no vehicle: what a fast signal on the compass
explains a current may explain as well. Where the cause is known, so is its place.
"""

from __future__ import annotations

import numpy as np
from scipy.special import softmax

from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.equations.model import Model


def locations(candidates: HypothesisComparison, model: Model) -> dict[str, float]:
    """Channel -> probability that the gap lies there.

    What lies outside the catalogue, and the coefficients, go by the evidence of a free signal; an effect by
    the same within the places it can act in.
    """
    names = [p.channel for p in candidates.where.places]
    evidence = np.array([p.evidence for p in candidates.where.places])
    out = dict.fromkeys(names, 0.0)
    for name, probability in candidates.probabilities.items():
        if name == "none" or probability <= 0.0:
            continue
        allowed = model.effects[name].where if name in model.effects else names
        inside = np.array([n in allowed for n in names])
        if not inside.any():
            inside[:] = True
        share = softmax(np.where(inside, evidence, -np.inf))
        for n, s in zip(names, share, strict=True):
            out[n] += probability * float(s)
    return out


def location_of(candidates: HypothesisComparison, model: Model) -> str | None:
    """Most probable place; None where there is no gap."""
    seen = candidates.where.places[0].evidence > candidates.thresholds.named
    if not seen and candidates.probabilities["none"] > 0.05:
        return None
    found = locations(candidates, model)
    return max(found, key=lambda n: found[n])
