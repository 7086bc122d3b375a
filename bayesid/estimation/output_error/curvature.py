"""What the curvature at a point tells: how far the cost can still fall, and how sure the estimates are.

Takes a `FitProblem` and unknowns, or its Jacobian. Does not search.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from bayesid.estimation.output_error.elimination import eliminated
from bayesid.estimation.output_error.flat_directions import singular_values
from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
ROUNDING = 1e-13  # relative to the readings: below it residuals are arithmetic, not misfit


def predicted_gain(problem: FitProblem, z: Array) -> tuple[float, bool]:
    """Decrease of the cost a Gauss-Newton step within the bounds would bring, and whether residuals are at
    rounding.

    Initial states, which have no bounds, take what they can; directions without curvature (relative 1e-12)
    bring nothing.
    """
    left, k = eliminated(problem, z, problem.triangles(z)), len(problem.params.names)
    size = sum(float(np.nansum((r.readings / r.sigma) ** 2)) for r in problem.runs)
    zero = left.squares <= (10 * ROUNDING) ** 2 * size
    q, s, vt = np.linalg.svd(left.jac, full_matrices=False)
    keep = s > 1e-12 * max(s.max(initial=0.0), 1e-300)
    matrix, target = s[keep, None] * vt[keep], -(q.T @ left.resid)[keep]
    low, high = ((limit - z)[:k] / problem.scale[:k] for limit in (problem.low, problem.high))
    low, high = np.minimum(low, -1e-12), np.maximum(high, 1e-12)
    step = lsq_linear(matrix, target, (low, high), method="bvls" if np.isfinite(low).any() else "trf").x
    by_parameters = float(target @ target - np.sum((matrix @ step - target) ** 2))
    return max(0.5 * (by_parameters + left.squares_of_states), 0.0), zero


def root_of_covariance(jac: Array) -> Array:
    """(k, k) root of the inverse of J^T J by singular values; directions flat to rounding get the sd of the
    rounding level."""
    values, vt = singular_values(jac)
    floor = 1e-12 * max(values.max(), 1e-300)
    return np.asarray(vt.T / np.maximum(values, floor))
