"""How a chain forgets and how its effective size grows, for figures.

Takes draws of independent ensembles. Gives arrays. Does not judge: `convergence` does.
"""

from __future__ import annotations

import numpy as np

from bayesid.estimation.sampling.convergence import effective_size

Array = np.ndarray


def autocorrelation(draws: Array, lags: int) -> Array:
    """(lags, k) autocorrelation of (ensembles, steps, walkers, k) draws, pooled over all walkers."""
    n = draws.shape[1]
    lags = min(lags, n)
    apart = draws - draws.mean(axis=(1, 2), keepdims=True)
    power = np.fft.rfft(apart, 1 << (2 * n - 1).bit_length(), axis=1)
    covariance = np.fft.irfft(np.sum(np.abs(power) ** 2, axis=(0, 2)), axis=0)[:lags]
    covariance /= (n - np.arange(lags))[:, None]
    return np.asarray(covariance / np.maximum(covariance[0], 1e-300))


def ess_growth(draws: Array, kind: str = "bulk", parts: int = 8) -> tuple[Array, Array]:
    """Effective size of the first 1, 2, ... eighths of a chain.

    Returns
    -------
    steps : (parts,) stored steps per ensemble
    sizes : (parts, k)
    """
    n, k = draws.shape[1], draws.shape[3]
    steps = np.unique(np.linspace(n / parts, n, parts).astype(int))
    steps = steps[steps >= 4]
    sizes = np.array([[effective_size(draws[:, :m, :, j], kind) for j in range(k)] for m in steps])
    return steps, sizes.reshape(steps.size, k)
