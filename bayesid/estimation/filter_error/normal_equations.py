"""Whitened products of the columns of free parameters, run by run.

Takes paths. Knows neither the fit nor which parameter is a coefficient and which belongs to an effect.
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import NoiseModel, whitened
from bayesid.estimation.parameters import GaussianPrior


def stacked_equations(
    model: Model, paths: Sequence[Linearisation], free: GaussianPrior, noise_model: NoiseModel
) -> list[NormalEquations]:
    """Whitened normal matrix of every run, residual relative to the prior mean, columns per prior sd."""
    out = []
    for k, path in enumerate(paths):
        w = whitened(model, path, free.mean - path.point.par[free.where], free.sd, noise_model, run=k)
        out.append(normal_equations(w.resid, w.columns, w.logdet, w.used))
    return out
