"""Intervals of counts and of means, and what it takes to meet a bar.

Takes counts or values. Gives 95 % intervals. Knows nothing of effects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import beta

LEVEL = 0.95
DRAWS = 2000


def clopper(hits: int, count: int, level: float = LEVEL) -> tuple[float, float]:
    """Exact binomial interval (Clopper and Pearson 1934); (0, 1) without cases."""
    if count == 0:
        return 0.0, 1.0
    tail = (1.0 - level) / 2.0
    low = 0.0 if hits == 0 else float(beta.ppf(tail, hits, count - hits + 1))
    high = 1.0 if hits == count else float(beta.ppf(1.0 - tail, hits + 1, count - hits))
    return low, high


def bootstrap(
    values: Sequence[float] | np.ndarray,
    statistic: Callable[..., np.ndarray],
    seed: int = 0,
    level: float = LEVEL,
) -> tuple[float, float]:
    """Percentile interval of `statistic(draws, axis=1)`; nan without values."""
    x = np.asarray(values, dtype=float)
    if x.size == 0:
        return math.nan, math.nan
    picks = np.random.default_rng(seed).integers(0, x.size, (DRAWS, x.size))
    low, high = np.quantile(statistic(x[picks], axis=1), ((1 - level) / 2, (1 + level) / 2))
    return float(low), float(high)
