"""A likelihood with the curvature of an honest covariance: an affine map of its argument.

Takes a `FitProblem`, an estimate, and mean and covariance of a posterior whose errors are not those the
likelihood assumes. Gives the map. Does not sample. The prior stays outside.

A likelihood of white noise, or a power of it, has the curvature H; memory of the residuals and runs that
differ give the posterior another covariance S. With T' H T = S^-1 - P the likelihood l(z + T (x - z)) beside
a prior of precision P has the covariance S (Chandler and Bate 2007, Biometrika 94(1); Ribatet, Cooley and
Davison 2012, Statistica Sinica 22(2)). They adjust about the mode of the likelihood; where readings leave
directions open it has none, so this is about the estimate, and a linear term keeps the mode there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesid.estimation.likelihood.composite import inverse
from bayesid.estimation.likelihood.run_information import run_information
from bayesid.estimation.output_error import FitProblem

Array = np.ndarray
# Share of a direction's information below which the map leaves it as it is.
OPEN = 1e-8


@dataclass(frozen=True, eq=False)
class LikelihoodAdjustment:
    """l(x) becomes l(centre + matrix (x - centre)) + tilt . (x - centre).

    Attributes
    ----------
    centre : (k,) parameters [SI]
    matrix : (k, k)
    tilt : (k,) [1/SI]
    """

    centre: Array
    matrix: Array
    tilt: Array

    def argument(self, x: Array) -> Array:
        """(..., k) parameters at which the likelihood is asked."""
        return np.asarray(self.centre + (x - self.centre) @ self.matrix.T)

    def added(self, x: Array) -> Array:
        """(...,) linear term."""
        return np.asarray((x - self.centre) @ self.tilt)


def likelihood_adjustment(
    problem: FitProblem, z: Array, mean: Array, covariance: Array, fixed_start: bool = False
) -> LikelihoodAdjustment:
    """Adjustment with which prior and likelihood have this mean and covariance where the problem is linear.

    Where the covariance leaves a combination less sure than the prior, the likelihood has no curvature and
    the width is that of the prior: no likelihood widens a prior. The estimate stays the mode there too.

    Parameters
    ----------
    problem : whose likelihood is adjusted
    z : its unknowns at the estimate
    mean, covariance : (k,), (k, k) of the parameters [SI]
    fixed_start : initial states stay at the estimate instead of being integrated out

    Raises
    ------
    ModelError
        if the simulated vehicle diverges at z
    """
    k = len(problem.params.names)
    scale = problem.scale[:k]
    about, unknowns = (_started(problem, z), z[:k]) if fixed_start else (problem, z)
    h, g = np.zeros((k, k)), np.zeros(k)
    for info in run_information(about, unknowns):
        h, g = h + info.information, g + info.score
    resid, slopes = problem.params.prior_residuals(z[:k])
    slopes = slopes * scale
    p, pull = slopes.T @ slopes, -slopes.T @ resid
    whole = h + p
    size = np.sqrt(np.diag(whole))
    values, vectors = np.linalg.eigh(whole / np.outer(size, size))
    values = np.maximum(values, 1e-12 * values[-1])
    basis = vectors / np.sqrt(values) / size[:, None]  # basis' whole basis = 1
    back = np.sqrt(values)[:, None] * vectors.T * size
    asked = inverse(covariance / np.outer(scale, scale))
    told = asked @ ((mean - z[:k]) / scale) - pull  # score the likelihood must have at the estimate
    own = basis.T @ h @ basis
    values, vectors = np.linalg.eigh(basis.T @ (asked - p) @ basis)
    kept = vectors * (values > 0)
    wanted = (kept * values) @ kept.T
    root = _root(own + OPEN * np.eye(k))
    inner = _root(root @ (wanted + OPEN * np.eye(k)) @ root)
    matrix = basis @ np.linalg.solve(root, np.linalg.solve(root, inner).T) @ back
    tilt = told - matrix.T @ g
    return LikelihoodAdjustment(np.array(z[:k]), matrix * np.outer(scale, 1.0 / scale), tilt / scale)


def _started(problem: FitProblem, z: Array) -> FitProblem:
    """The problem with initial states fixed at the estimate."""
    starts = problem.split(z)[1]
    runs = tuple(
        replace(run, x0=x0, initial=(), initial_sd=np.zeros(0))
        for run, x0 in zip(problem.runs, starts, strict=True)
    )
    return replace(problem, runs=runs)


def _root(matrix: Array) -> Array:
    """Symmetric root of a positive matrix."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)
