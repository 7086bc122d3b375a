"""Where a smooth cost of a few unknowns of very different precision is lowest.

Takes a cost and prior standard deviations. Gives the unknowns. Does not know what they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from bayesid.estimation.run_data import Array

# Distance over the prior sd at which the curvature is probed; step of a slope over the sd it means.
CURVATURE_STEP, SLOPE_STEP = 1e-3, 0.01
# Distance over the prior sd at which the spread an unknown is left with is read.
SPREAD_STEP = 0.2
# Gain [nats] not worth a further step.
LEAST_GAIN = 0.05


def minimise_scaled(
    cost: Callable[[Array], float], start: Array, low: Array, high: Array, spread: Array, steps: int
) -> Array:
    """Unknowns of the lowest cost between bounds.

    Parameters
    ----------
    cost : negative log posterior density [nats]
    start, low, high : (k,) where to begin, and bounds
    spread : (k,) prior standard deviations
    steps : at most this many of a quasi-Newton search (L-BFGS-B; Byrd, Lu, Nocedal and Zhu 1995)

    Notes
    -----
    Each unknown is counted in the standard deviation that the curvature at the start means, at most the
    prior's. In an environment a roll arm is known to 0.002 of the hull's length and an amplitude to a factor:
    with one step for both a slope was that of another hill, and searches ended 50 nats below the top.
    """
    here, probe = cost(start), CURVATURE_STEP * spread
    unit = spread.copy()
    for k in range(start.size):
        move = np.zeros(start.size)
        move[k] = probe[k]
        bend = (cost(start + move) - 2.0 * here + cost(start - move)) / probe[k] ** 2
        if np.isfinite(bend) and bend * spread[k] ** 2 > 1.0:
            unit[k] = max(bend**-0.5, probe[k])
    found = minimize(
        lambda z: cost(start + unit * z),
        np.zeros(start.size),
        method="L-BFGS-B",
        bounds=list(zip((low - start) / unit, (high - start) / unit, strict=True)),
        options={"maxiter": steps, "eps": SLOPE_STEP, "ftol": LEAST_GAIN / max(abs(here), 1.0)},
    )
    return np.clip(start + unit * found.x, low, high)


def spread_left(cost: Callable[[Array], float], at: Array, spread: Array) -> Array:
    """(k,) standard deviations the curvature of a cost leaves each unknown, at most the prior's.

    Each with all others held: a correlated one is known less well.
    """
    here, out = cost(at), spread.copy()
    for k in range(at.size):
        move = np.zeros(at.size)
        move[k] = SPREAD_STEP * spread[k]
        bend = (cost(at + move) - 2.0 * here + cost(at - move)) / move[k] ** 2
        if np.isfinite(bend) and bend > 0.0:
            out[k] = min(bend**-0.5, spread[k])
    return out
