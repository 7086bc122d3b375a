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
from functools import lru_cache

import numpy as np
from scipy.integrate import simpson
from scipy.optimize import brentq, root
from scipy.special import digamma, polygamma

Array = np.ndarray
HALVINGS = 7  # paths of 2^7 increments
LEAST_VARIANCE, MOST_VARIANCE = 1e-8, 1e4  # beyond, a beta variable is a constant or an alternative
MOST_RATIO = 1e12
MOST_TRIES = 100


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
        for i in range(step, q.size, 2 * step):
            first, second = q[i] - q[i - step], q[i + step] - q[i]
            share = shares(first, second, 2.0 * c * gap[i] ** 2, rng, count)
            paths[:, i] = paths[:, i - step] + share * (paths[:, i + step] - paths[:, i - step])
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


def shares(first: float, second: float, variance: float, rng: np.random.Generator, count: int) -> Array:
    """(count,) shares of a step that its first half takes."""
    if first + second <= 0.0 or first <= second / MOST_RATIO:
        return np.zeros(count)
    if second <= first / MOST_RATIO:
        return np.ones(count)
    ratio = first / second
    if variance < LEAST_VARIANCE:
        return np.full(count, ratio / (1.0 + ratio))
    if variance > MOST_VARIANCE:
        return rng.binomial(1, ratio / (1.0 + ratio), count).astype(float)
    return rng.beta(*beta_of(ratio, variance), count)


@lru_cache(maxsize=100_000)
def beta_of(ratio: float, variance: float) -> tuple[float, float]:
    """Beta variable whose two parts have this ratio of centres, and whose metric variance is half this one.

    psi(a) - psi(b) = ln ratio, psi'(a) + psi'(b) = variance (moments of the simplex: Mateu-Figueras et al.).
    """

    def alike(log_a: float) -> float:
        return math.log(2.0 * float(polygamma(1, math.exp(log_a)))) - math.log(variance)

    start = brentq(alike, -6.0, 21.0)

    def both(x: Array) -> Array:
        a, b = np.exp(x)
        left = digamma(a) - digamma(b) - math.log(ratio)
        return np.array([left, math.log(float(polygamma(1, a) + polygamma(1, b))) - math.log(variance)])

    found = root(both, [start, start], method="hybr")
    a, b = np.exp(np.clip(found.x, -30.0, 40.0))
    return float(a), float(b)
