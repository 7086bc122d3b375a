"""Risks a model may have in replications, from losses on data and losses on data of its own.

After René and Longtin (2025), "Selecting fitted models under epistemic uncertainty using a stochastic process
on quantile functions", Nature Communications (doi 10.1038/s41467-025-64658-7): the hierarchical beta process.
Quantile functions of the loss are drawn about the one seen (q), increment by increment in halves, their
spread set by sqrt(c) |q - q~| where q~ is the quantile function of losses on data of the model itself. The
integral of a quantile function is a risk. Checked against their program (emdcmp 1.1.1). Takes losses; knows
nothing of vehicles.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import simpson
from scipy.special import digamma, polygamma

Array = np.ndarray
HALVINGS = 7  # paths of 2^7 increments
LEAST_VARIANCE, MOST_VARIANCE = 1e-8, 1e4  # beyond, a beta variable is a constant or an alternative
MOST_RATIO = 1e12
MOST_TRIES = 100  # of a pair of ends
MOST_PASSES, ARRIVED, LONGEST_MOVE = 100, 1e-9, 1.0  # of Newton's method, in logarithms
LIMITS = (-30.0, 40.0)


def quantiles(losses: Array) -> tuple[Array, Array]:
    """Probabilities and quantiles of losses (L,), the ends extrapolated as the authors do."""
    ordered = np.sort(losses)
    at = np.arange(1, ordered.size + 1) / (ordered.size + 1)
    grid = np.linspace(0.0, 1.0, 2**HALVINGS + 1)
    out = np.interp(grid, at, ordered)
    if ordered.size > 1:
        out[0] = ordered[0] - at[0] * (ordered[1] - ordered[0]) / (at[1] - at[0])
        out[-1] = ordered[-1] + (1 - at[-1]) * (ordered[-1] - ordered[-2]) / (at[-1] - at[-2])
    return grid, out


def risks(losses: Array, own: Array, c: float, rng: np.random.Generator, count: int = 256) -> Array:
    """(count,) risks in replications.

    Parameters
    ----------
    losses : (L,) on the data
    own : (K,) on data of the model itself
    c : how much of a discrepancy a replication may change
    """
    grid, q = quantiles(losses)
    gap = np.abs(q - quantiles(own)[1])
    paths = np.empty((count, q.size))
    paths[:, [0, -1]] = ends(q, math.sqrt(c) * gap, rng, count)
    for n in range(1, HALVINGS + 1):
        step = 2 ** (HALVINGS - n)
        new = np.arange(step, q.size, 2 * step)
        share = shares(q[new] - q[new - step], q[new + step] - q[new], 2.0 * c * gap[new] ** 2, rng, count)
        paths[:, new] = paths[:, new - step] + share * (paths[:, new + step] - paths[:, new - step])
    return np.asarray(simpson(y=paths, x=grid, axis=1))


def ends(q: Array, sd: Array, rng: np.random.Generator, count: int) -> Array:
    """(count, 2) normal draws of both ends, the first below the last."""
    out = np.empty((count, 2))
    todo = np.arange(count)
    for _ in range(MOST_TRIES):
        out[todo] = rng.normal([q[0], q[-1]], [sd[0], sd[-1]], (todo.size, 2))
        todo = todo[out[todo, 0] >= out[todo, 1]]
        if not todo.size:
            return out
    out[todo] = q[0], q[-1]
    return out


def shares(first: Array, second: Array, variance: Array, rng: np.random.Generator, count: int) -> Array:
    """(count, k) shares of k steps that their first halves take."""
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = np.where(first + second > 0.0, first / (first + second), 0.0)
    out = np.broadcast_to(centre, (count, centre.size)).copy()
    inner = (first > second / MOST_RATIO) & (second > first / MOST_RATIO) & (variance >= LEAST_VARIANCE)
    either = inner & (variance > MOST_VARIANCE)
    out[:, either] = rng.binomial(1, centre[either], (count, int(either.sum())))
    drawn = inner & ~either
    if drawn.any():
        a, b = beta_of(first[drawn] / second[drawn], variance[drawn])
        out[:, drawn] = rng.beta(a, b, (count, a.size))
    return out


def beta_of(ratio: Array, variance: Array) -> tuple[Array, Array]:
    """Beta variables whose two parts have these ratios of centres and half these metric variances.

    psi(a) - psi(b) = ln ratio, psi'(a) + psi'(b) = variance (moments of the simplex: Mateu-Figueras et al.),
    by Newton in the logarithms of a and b from where both are alike.
    """
    start = 0.5 * np.log(2.0 / variance) * np.where(variance < 1.0, 2.0, 1.0)
    x = np.array([start, start])
    for _ in range(MOST_PASSES):
        a, b = np.exp(x)
        slope_a, slope_b = polygamma(1, a), polygamma(1, b)
        whole = slope_a + slope_b
        off = np.array([digamma(a) - digamma(b) - np.log(ratio), np.log(whole) - np.log(variance)])
        if np.abs(off).max() < ARRIVED:
            break
        j = np.array(
            [[a * slope_a, -b * slope_b], [a * polygamma(2, a) / whole, b * polygamma(2, b) / whole]]
        )
        move = np.linalg.solve(np.moveaxis(j, 2, 0), off.T[:, :, None])[:, :, 0].T
        x = np.clip(x - np.clip(move, -LONGEST_MOVE, LONGEST_MOVE), *LIMITS)
    return np.exp(x[0]), np.exp(x[1])
