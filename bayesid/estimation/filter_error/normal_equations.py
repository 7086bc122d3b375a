"""Free parameters with Gaussian priors, and the whitened products of their columns.

Takes paths. Knows neither the fit nor which parameter is a coefficient and which belongs to an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import NoiseModel, whitened
from bayesid.estimation.filter_error.run_readings import Array


@dataclass(frozen=True, eq=False)
class FreeParameters:
    """Free parameters with Gaussian priors, all in SI and in the order of `names`."""

    names: tuple[str, ...]
    where: Array
    mean: Array
    sd: Array
    low: Array

    def __add__(self, other: FreeParameters) -> FreeParameters:
        return FreeParameters(
            (*self.names, *other.names),
            np.concatenate([self.where, other.where]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.sd, other.sd]),
            np.concatenate([self.low, other.low]),
        )


NO_PARAMETERS = FreeParameters((), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def stacked_equations(
    model: Model, paths: Sequence[Linearisation], free: FreeParameters, noise_model: NoiseModel
) -> list[NormalEquations]:
    """Whitened normal matrix of every run, residual relative to the prior mean, columns per prior sd."""
    out = []
    for k, path in enumerate(paths):
        w = whitened(model, path, free.mean - path.point.par[free.where], free.sd, noise_model, run=k)
        out.append(normal_equations(w.resid, w.columns, w.logdet, w.used))
    return out
