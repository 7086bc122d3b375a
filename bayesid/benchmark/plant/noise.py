"""Process and sensor noise of a run: correlated forces, drifting navigation, white noise, outliers, gaps.

Takes: levels and a random generator. Gives arrays; the same generator state gives the same arrays.
Does not: decide levels (`campaign`).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter


def ornstein_uhlenbeck(rng: np.random.Generator, count: int, spacing: float, tau: float) -> np.ndarray:
    """(count,) samples of unit variance and correlation exp(-|dt|/tau), exact at the grid points."""
    keep = math.exp(-spacing / tau)
    drive = rng.standard_normal(count)
    drive[1:] *= math.sqrt(1.0 - keep * keep)
    return lfilter([1.0], [1.0, -keep], drive)


def process_forces(
    rng: np.random.Generator, duration: float, amplitude: np.ndarray, tau: float
) -> tuple[np.ndarray, float]:
    """(k, 5) forces X Y N Z M [N, N m] on a grid, and its spacing [s]."""
    spacing = tau / 20.0
    count = math.ceil(duration / spacing) + 2
    return np.stack([a * ornstein_uhlenbeck(rng, count, spacing, tau) for a in amplitude], axis=1), spacing


def measured(
    rng: np.random.Generator,
    t: np.ndarray,
    clean: dict[str, np.ndarray],
    sigma: dict[str, float],
    drift: tuple[float, float] = (0.0, 1.0),
    outliers: float = 0.0,
    gaps: bool = False,
) -> dict[str, np.ndarray]:
    """Channels of `sigma` with white noise; drift is (sd [m], tau [s]) of the horizontal position.

    `outliers` is the share of samples of each channel thrown 8 to 25 sigma off; `gaps` blanks the position in
    two windows.
    """
    out = {}
    dt = float(t[1] - t[0])
    for name, sd in sigma.items():
        values = clean[name] + sd * rng.standard_normal(t.size)
        if name in ("x", "y") and drift[0] > 0.0:
            values += drift[0] * ornstein_uhlenbeck(rng, t.size, dt, drift[1])
        if outliers > 0.0:
            hit = rng.random(t.size) < outliers
            values += hit * rng.choice([-1.0, 1.0], t.size) * rng.uniform(8.0, 25.0, t.size) * sd
        out[name] = values
    if gaps:
        for _ in range(2):
            length = int(rng.uniform(0.03, 0.08) * t.size)
            first = int(rng.integers(1, t.size - length - 1))
            for name in ("x", "y"):
                if name in out:
                    out[name][first : first + length] = np.nan
    return out
