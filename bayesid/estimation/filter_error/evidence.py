"""Gaussian evidence of a whitened linear model, its posterior, and what columns explain.

Takes whitened residual and columns with unit-normal unknowns. Pure linear algebra; knows nothing of vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_factor, cho_solve

from bayesid.errors import ModelError

Array = np.ndarray
# Sum of squares of which rounding takes more than one nat: e'e and g'H^-1 g then differ by rounding alone.
LARGEST = 1.0 / np.finfo(float).eps
NOT_LINEARISABLE = "the simulation along the estimated path diverges and cannot be linearised"


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Products of whitened columns: enough for any evidence without going back to the data.

    Attributes
    ----------
    ss : (k, k) columns' columns
    se : (k,) columns' residual
    ee : residual squared
    logdet : log determinant of the residual's covariance
    used : number of readings
    """

    ss: Array
    se: Array
    ee: float
    logdet: float
    used: int

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(
            self.ss + other.ss,
            self.se + other.se,
            self.ee + other.ee,
            self.logdet + other.logdet,
            self.used + other.used,
        )

    def __sub__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(
            self.ss - other.ss,
            self.se - other.se,
            self.ee - other.ee,
            self.logdet - other.logdet,
            self.used - other.used,
        )

    def given(self, columns: Array, values: Array) -> NormalEquations:
        """Products with the residual that known values of some columns leave, (k,) and as many."""
        moved = self.ss[:, columns] @ values
        less = float(values @ (2.0 * self.se[columns] - moved[columns]))
        return NormalEquations(self.ss, self.se - moved, self.ee - less, self.logdet, self.used)

    def pick(self, columns: Array) -> NormalEquations:
        """normal matrix of some of the columns."""
        return NormalEquations(
            self.ss[np.ix_(columns, columns)], self.se[columns], self.ee, self.logdet, self.used
        )


def normal_equations(resid: Array, columns: Array, logdet: float, used: int) -> NormalEquations:
    """Products of whitened residual and columns.

    Along a path that diverges they overflow; `posterior` refuses what is not finite.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return NormalEquations(columns.T @ columns, columns.T @ resid, float(resid @ resid), logdet, used)


@dataclass(frozen=True, eq=False)
class GaussianPosterior:
    """Gaussian posterior of unit-normal unknowns and the log evidence."""

    mean: Array
    covariance: Array
    log_evidence: float


def posterior(g: NormalEquations) -> GaussianPosterior:
    """Posterior and log evidence of e = S z + noise with z ~ N(0, I) and whitened noise.

    log Z = -1/2 [e'e - g'H^-1 g] - 1/2 log|Sigma| - 1/2 log|H| - n/2 log 2 pi, H = I + S'S, g = S'e.

    Raises
    ------
    ModelError
        if a product is not finite, or so large that rounding leaves no evidence or no positive definite H
    """
    k = g.se.size
    constant = -0.5 * g.used * np.log(2 * np.pi)
    if not (np.isfinite(g.ss).all() and np.isfinite(g.se).all() and g.ee < LARGEST):
        raise ModelError(NOT_LINEARISABLE)
    if k == 0:
        return GaussianPosterior(np.zeros(0), np.zeros((0, 0)), -0.5 * (g.ee + g.logdet) + constant)
    h = np.eye(k) + g.ss
    try:
        factor = cho_factor(h, lower=True)
    except LinAlgError:
        raise ModelError(NOT_LINEARISABLE) from None
    mean = cho_solve(factor, g.se)
    logdet_h = 2.0 * float(np.log(np.diag(factor[0])).sum())
    log_z = -0.5 * (g.ee - float(g.se @ mean)) - 0.5 * g.logdet - 0.5 * logdet_h + constant
    return GaussianPosterior(mean, cho_solve(factor, np.eye(k)), log_z)


def without(g: NormalEquations, keep: int) -> NormalEquations:
    """normal matrix of the first `keep` columns with the unit-normal unknowns of the others integrated
    out."""
    if g.se.size == keep:
        return g
    a, b = slice(None, keep), slice(keep, None)
    factor = cho_factor(np.eye(g.se.size - keep) + g.ss[b, b], lower=True)
    half = cho_solve(factor, np.column_stack([g.ss[b, a], g.se[b]]))
    return NormalEquations(
        g.ss[a, a] - g.ss[a, b] @ half[:, :-1],
        g.se[a] - g.ss[a, b] @ half[:, -1],
        g.ee - float(g.se[b] @ half[:, -1]),
        g.logdet + 2.0 * float(np.log(np.diag(factor[0])).sum()),
        g.used,
    )
