"""Are intervals as wide as they say? Ranks of the truth among posterior draws, coverage, and their bands.

Takes draws and truths of many replicates whose truths came from the prior. Simulation-based calibration after
Talts et al. (2018) with simultaneous bands after Saeilynoja, Buerkner & Vehtari (2022). Does not sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

Array = np.ndarray


def rank_of(draws: Array, truth: Array, count: int) -> Array:
    """(k,) how many of `count` draws, taken at equal distances from (n, k), are below the truth: 0..count."""
    picked = draws[np.linspace(0, draws.shape[0] - 1, count).astype(np.int64)]
    return np.asarray(np.sum(picked < truth, axis=0))


def inside(draws: Array, truth: Array, level: float) -> Array:
    """(k,) whether the central interval of (n, k) draws holds the truth."""
    edge = 0.5 * (1 - level)
    low, high = np.quantile(draws, [edge, 1 - edge], axis=0)
    return np.asarray((low <= truth) & (truth <= high))


@dataclass(frozen=True, eq=False)
class RankBands:
    """Where the empirical distribution of uniform ranks stays with probability `level`, all unknowns at once.

    at : (count + 1,) ranks; low, high : (count + 1,) share of replicates with that rank or a smaller one
    """

    at: Array
    low: Array
    high: Array
    level: float

    def holds(self, shares: Array) -> Array:
        """(k,) whether (k, count + 1) distributions stay within."""
        return np.asarray(np.all((shares >= self.low) & (shares <= self.high), axis=1))


def distribution(ranks: Array, count: int) -> Array:
    """(k, count + 1) share of (n, k) ranks at or below each rank."""
    grid = np.arange(count + 1)
    return np.asarray((ranks[:, :, None] <= grid).mean(axis=0))


def bands(
    replicates: int, unknowns: int, count: int, level: float = 0.95, trials: int = 2000, seed: int = 0
) -> RankBands:
    """Simultaneous bands for uniform ranks, by simulation.

    A pointwise binomial level is chosen so that with probability `level` no point of any of the unknowns'
    distributions leaves its interval; unknowns are taken as independent, which makes the bands a little wide.
    """
    rng = np.random.default_rng(seed)
    grid = np.arange(count + 1)
    share = (grid + 1) / (count + 1)
    hits = np.arange(replicates + 1)
    below = binom.cdf(hits[:, None], replicates, share)
    above = binom.sf(hits[:, None] - 1, replicates, share)
    tail = np.minimum(below, above)  # (replicates + 1, count + 1)
    worst = np.empty(trials)
    for i in range(trials):
        ranks = rng.integers(0, count + 1, (unknowns, replicates))
        sums = np.stack([np.cumsum(np.bincount(r, minlength=count + 1)) for r in ranks])
        worst[i] = tail[sums[:, :-1], grid[:-1]].min()
    gamma = float(np.quantile(worst, 1 - level))
    allowed = tail >= gamma
    low = np.argmax(allowed, axis=0) / replicates
    high = (replicates - np.argmax(allowed[::-1], axis=0)) / replicates
    low[-1] = high[-1] = 1.0
    return RankBands(grid, low, high, level)


def coverage(hits: Array) -> dict[str, float]:
    """Pooled share of (n, k) hits, with a standard error that takes a replicate as one observation."""
    each = hits.mean(axis=1)
    error = float(np.std(each, ddof=1) / np.sqrt(each.size)) if each.size > 1 else float("nan")
    return {"share": float(hits.mean()), "standard_error": error, "replicates": int(each.size)}
