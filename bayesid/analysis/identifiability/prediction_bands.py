"""Bands of tracks: what draws of a posterior say about a run, executed or not.

Takes a `Model`, a `TimePlan` and parameter vectors. Gives quantiles over time. Does not add sensor noise: the
band is of the vehicle, not of a reading.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.simulation import TimePlan, simulate_batch

Array = np.ndarray
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class TrackBands:
    """Quantiles of the states over time.

    Attributes
    ----------
    t : (n,) [s]
    states : names (nx,)
    quantiles : (5, n, nx) at `LEVELS`
    diverged : vectors left out because their vehicle diverges
    spread : (n,) half width of the 90 % band of the distance from the median track [m]
    """

    t: Array
    states: tuple[str, ...]
    quantiles: Array
    diverged: int
    spread: Array

    @property
    def end_spread(self) -> float:
        """90 % radius around the median track, largest over the run [m]."""
        return float(self.spread.max())

    def coverage(self, states: Array, names: tuple[str, ...] = ("x", "y", "psi")) -> float:
        """Share of samples of a true track (n, nx) inside the 90 % band, the least of the channels named.

        Samples where the band has no width to speak of (1e-9 of the run's largest value) are left out.
        """
        found = []
        for name in names:
            j = self.states.index(name)
            low, high = self.quantiles[0, :, j], self.quantiles[-1, :, j]
            wide = high - low > 1e-9 * max(float(np.abs(states[:, j]).max()), 1e-12)
            if wide.any():
                inside = (states[:, j] >= low) & (states[:, j] <= high)
                found.append(float(inside[wide].mean()))
        return min(found, default=1.0)


def predict(model: Model, pars: Array, plan: TimePlan, x0: Array, threads: int = 2) -> TrackBands:
    """Bands of one run.

    Parameters
    ----------
    pars : (m, n) full parameter vectors [SI]
    x0 : (nx,) or (m, nx) initial states
    """
    with np.errstate(all="ignore"):
        states = simulate_batch(model, pars, plan, x0, threads=threads)
    good = np.isfinite(states).all(axis=(1, 2))
    kept = states[good][:, :, : len(model.states)]
    quantiles = np.quantile(kept, LEVELS, axis=0)
    x, y = model.states.index("x"), model.states.index("y")
    apart = np.hypot(kept[:, :, x] - quantiles[2, :, x], kept[:, :, y] - quantiles[2, :, y])
    return TrackBands(plan.t, model.states, quantiles, int(np.sum(~good)), np.quantile(apart, 0.9, axis=0))
