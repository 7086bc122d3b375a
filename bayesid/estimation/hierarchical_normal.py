"""Normal hierarchical model of the same parameters in several groups of data, in information form.

What group b says alone is a likelihood exp(-z'P_b z/2 + h_b'z) of parameters z in units of their prior:
z_b = mu + delta_b, mu ~ N(0, W^2), delta_b ~ N(0, T) with diagonal T (Gelman et al. 2013, chapter 5). P_b may
be singular and T zero: nothing is divided by either. Linear algebra alone; `hierarchical_fit` integrates over
T.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
# Least eigenvalue of a covariance over its prior's: what rounding leaves of a parameter known exactly.
LEAST_VARIANCE = 1e-14
# Precision lacking, over the prior's, from which a direction counts as cut: a covariance wider than its prior
# by half of this.
CUT = 0.02


@dataclass(frozen=True, eq=False)
class Information:
    """Likelihood exp(-z'P z/2 + h'z).

    Attributes
    ----------
    precision : (k, k), no negative eigenvalue
    score : (k,)
    cut : directions in which the posterior was wider than its prior, so that the data say nothing there
    """

    precision: Array
    score: Array
    cut: int = 0

    def posterior(self, prior_sd: Array) -> tuple[Array, Array]:
        """Mean (k,) and covariance (k, k) under z ~ N(0, prior_sd^2)."""
        inner = np.eye(prior_sd.size) + prior_sd[:, None] * self.precision * prior_sd
        covariance = prior_sd[:, None] * np.linalg.inv(inner) * prior_sd
        return covariance @ self.score, covariance


def information(mean: Array, covariance: Array, prior_mean: Array, prior_sd: Array) -> Information:
    """What the data say alone: a Gaussian posterior without its prior.

    Parameters
    ----------
    mean, covariance : (k,), (k, k) of the posterior
    prior_mean, prior_sd : (k,) of the independent normal prior it was found under
    """
    inside = covariance / np.outer(prior_sd, prior_sd)
    variance, axes = np.linalg.eigh(0.5 * (inside + inside.T))
    whole = 1.0 / np.maximum(variance, LEAST_VARIANCE)
    gained = whole - 1.0
    moved = axes.T @ ((mean - prior_mean) / prior_sd)
    kept = np.maximum(gained, 0.0)
    pull = np.where(gained > 0.0, whole * moved, 0.0)
    precision = (axes * kept) @ axes.T / np.outer(prior_sd, prior_sd)
    score = axes @ pull / prior_sd + precision @ prior_mean
    return Information(0.5 * (precision + precision.T), score, int(np.sum(gained < -CUT)))


def mixed(each: Sequence[Information], weights: Sequence[float], prior_sd: Array) -> Information:
    """One likelihood for several explanations: their mixture under a common prior N(0, prior_sd^2), by its
    mean and covariance, without that prior.

    Parameters
    ----------
    weights : probability of each explanation
    """
    if len(each) == 1:
        return each[0]
    share = np.asarray(weights, dtype=float) / np.sum(weights)
    found = [e.posterior(prior_sd) for e in each]
    means = np.array([m for m, _ in found])
    centre = share @ means
    apart = means - centre
    covariance = np.einsum("e,eij->ij", share, [c for _, c in found]) + (share[:, None] * apart).T @ apart
    return information(centre, covariance, np.zeros_like(prior_sd), prior_sd)


def log_evidence(groups: Sequence[Information], prior_sd: Array, variance: Array) -> Array:
    """Log evidence of the hierarchy, up to a constant of the data.

    Parameters
    ----------
    prior_sd : (k,) W of mu
    variance : (n, k) diagonals of T

    Returns
    -------
    (n,)
    """
    root = np.sqrt(variance)
    k = prior_sd.size
    precision, score = np.zeros((*variance.shape, k)), np.zeros(variance.shape)
    out = np.zeros(variance.shape[0])
    for g in groups:
        inner = np.eye(k) + root[:, :, None] * g.precision * root[:, None, :]
        half = np.linalg.cholesky(inner)
        columns = np.concatenate([root[:, :, None] * g.precision, (root * g.score)[:, :, None]], axis=2)
        solved = np.linalg.solve(half, columns)
        left, right = solved[:, :, :k], solved[:, :, k]
        precision += g.precision - np.swapaxes(left, 1, 2) @ left
        score += g.score - np.einsum("nij,ni->nj", left, right)
        out += 0.5 * np.einsum("ni,ni->n", right, right) - _half_logdet(half)
    half = np.linalg.cholesky(np.eye(k) + prior_sd[:, None] * precision * prior_sd)
    pulled = np.linalg.solve(half, (prior_sd * score)[:, :, None])[:, :, 0]
    return np.asarray(out + 0.5 * np.einsum("ni,ni->n", pulled, pulled) - _half_logdet(half))


def _half_logdet(half: Array) -> Array:
    return np.asarray(np.log(np.diagonal(half, axis1=1, axis2=2)).sum(axis=1))


@dataclass(frozen=True, eq=False)
class GroupPosterior:
    """Posterior at one T.

    Attributes
    ----------
    mean, covariance : (k,), (k, k) of mu
    groups : (b, k) means of z_b
    spread : (k, b, b) covariance of one parameter between groups
    """

    mean: Array
    covariance: Array
    groups: Array
    spread: Array


def group_posterior(groups: Sequence[Information], prior_sd: Array, variance: Array) -> GroupPosterior:
    """Posterior of mu and of every group.

    Parameters
    ----------
    prior_sd : (k,) W of mu
    variance : (k,) diagonal of T
    """
    root, k = np.sqrt(variance), prior_sd.size
    own, keeps = [], []
    precision, score = np.zeros((k, k)), np.zeros(k)
    for g in groups:
        inner = np.eye(k) + root[:, None] * g.precision * root
        d = root[:, None] * np.linalg.inv(inner) * root
        keep = np.eye(k) - d @ g.precision
        own.append(d)
        keeps.append(keep)
        precision += g.precision @ keep
        score += keep.T @ g.score
    inner = np.eye(k) + prior_sd[:, None] * (0.5 * (precision + precision.T)) * prior_sd
    covariance = prior_sd[:, None] * np.linalg.inv(inner) * prior_sd
    mean = covariance @ score
    stack, inside = np.array(keeps), np.array(own)
    means = stack @ mean + np.einsum("bij,bj->bi", inside, [g.score for g in groups])
    spread = np.einsum("aki,ij,bkj->kab", stack, covariance, stack, optimize=True)
    for b, d in enumerate(own):
        spread[:, b, b] += np.diag(d)
    return GroupPosterior(mean, covariance, means, spread)
