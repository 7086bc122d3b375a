"""Draws of Gaussians that end at bounds.

Takes mean, covariance and bounds. Gives draws. Knows no parameters or models.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri

Array = np.ndarray
SWEEPS = 50
# Distance [sd] from which a bound is none.
FAR = 1e6
# Least share of the largest variance that a combination keeps.
FLAT = 1e-12


def within_bounds(
    draws: Array, mean: Array, covariance: Array, low: Array, high: Array, rng: np.random.Generator
) -> Array:
    """(n, k) draws of a Gaussian, those outside the bounds replaced by draws of the Gaussian cut there.

    The mean is (k,), or (n, k) where every draw has its own.
    Rejection alone would not end where the estimate is on a bound and its mean beyond. Replaced draws are
    moved by sweeps of a Gibbs sampler. What has no spread stays as drawn.
    """
    sd = np.sqrt(np.diag(covariance))
    if not sd.all():
        moves, out = np.flatnonzero(sd), np.array(draws)
        few = covariance[np.ix_(moves, moves)]
        out[:, moves] = within_bounds(draws[:, moves], mean[..., moves], few, low[moves], high[moves], rng)
        return out
    outside = ~np.all((draws >= low) & (draws <= high), axis=1)
    if not outside.any():
        return draws
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    precision = (vectors / np.maximum(values, FLAT * values[-1])) @ vectors.T
    mean = np.broadcast_to(mean, draws.shape)[outside]
    least, most = (np.clip((b - mean) / sd, -FAR, FAR) for b in (low, high))
    z = np.clip((draws[outside] - mean) / sd, least, most)
    for _ in range(SWEEPS):
        for i in range(sd.size):
            width = 1.0 / np.sqrt(precision[i, i])
            centre = z[:, i] - (z @ precision[i]) / precision[i, i]
            start, end = (least[:, i] - centre) / width, (most[:, i] - centre) / width
            # in the lower tail, where the distribution function tells points apart
            side = np.where(start + end > 0, -1.0, 1.0)
            a, b = np.sort(ndtr([side * start, side * end]), axis=0)
            inside = ndtri(np.clip(a + (b - a) * rng.uniform(size=a.size), 1e-300, 1 - 1e-16))
            z[:, i] = np.clip(centre + side * width * inside, least[:, i], most[:, i])
    out = np.array(draws)
    out[outside] = np.clip(mean + sd * z, low, high)
    return out


def about_each(centres: Array, sd: Array, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """One draw about every row of centres, its components independent and cut at the bounds.

    Parameters
    ----------
    centres : (n, k), within the bounds
    sd : (k,); what has none stays at its centre
    """
    out = np.array(centres)
    moves = np.flatnonzero(sd)
    at, width = centres[:, moves], sd[moves]
    least, most = ndtr((low[moves] - at) / width), ndtr((high[moves] - at) / width)
    drawn = ndtri(least + (most - least) * rng.uniform(size=at.shape))
    out[:, moves] = np.clip(at + width * drawn, low[moves], high[moves])
    return out
