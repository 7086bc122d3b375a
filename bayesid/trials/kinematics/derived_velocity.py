"""Are u and v an instrument's, or the logged track differentiated and filtered?

Takes runs with x, y, psi, u, v. Gives the share of fast changes of u, v that a linear filter of the track's
derivative explains. Does not: tell which filter, or look where the track is too quiet to tell.

Where the derivative of the track has `STRONG` times the power of u, v, motion is at most 1 / `STRONG` of it,
and the rest is noise of the position sensor. An instrument of its own shares the motion alone, so that at
most 1 / `STRONG` of u, v is explained there; a filtered derivative is explained whatever the filter and lag.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import csd, welch

from bayesid.trials.trial import Floats, Run

STRONG = 10.0  # power of the track's derivative over that of u, v
SEGMENT = 64  # samples of a spectrum
FEWEST = 12  # segments: chance explains one over their number
BINS = 4  # frequencies at which the track is strong
# Explained share from which on, and up to which, it is told: in 33 runs of two tanker models whose velocities
# are derived it is 0.51 to 0.77, in 53 campaigns with instruments of their own 0.05 to 0.24.
DERIVED, APART = 0.45, 0.3
UNEVEN = 0.2  # of the step; sampled less evenly a run has no spectrum


def explained_share(run: Run) -> float | None:
    """Share of the fast changes of u, v that the track explains; None where the run does not tell."""
    names = ("x", "y", "psi", "u", "v")
    if not set(names) <= set(run.data):
        return None
    values = np.array([run.data[k] for k in names])
    good = np.flatnonzero(np.isfinite(values).all(axis=0))
    if good.size < SEGMENT * FEWEST // 2:
        return None
    step = np.diff(run.t[good])
    usual = float(np.median(step))
    if not np.all(np.abs(step - usual) < UNEVEN * usual):
        return None
    x, y, psi, u, v = values[:, good]
    middle = 0.5 * (psi[1:] + psi[:-1])
    track = np.diff(x + 1j * y) * np.exp(-1j * middle) / usual
    logged = 0.5 * (u[1:] + u[:-1]) + 0.5j * (v[1:] + v[:-1])
    return _share(track, logged)


def _share(track: np.ndarray, logged: np.ndarray) -> float | None:
    keys = {"nperseg": SEGMENT, "return_onesided": False}
    _, strong = welch(track, **keys)
    frequency, power = welch(logged, **keys)
    _, both = csd(track, logged, **keys)
    at = (strong > STRONG * power) & (power > 0) & (np.abs(frequency) > 0)
    if at.sum() < BINS:
        return None
    return float(np.sum(np.abs(both[at]) ** 2 / strong[at]) / np.sum(power[at]))


def velocity_from_track(runs: Sequence[Run]) -> bool | None:
    """Whether u and v are the logged track differentiated; None where the runs do not tell."""
    shares: Floats = np.array([s for run in runs if (s := explained_share(run)) is not None])
    if not shares.size:
        return None
    middle = float(np.median(shares))
    if middle > DERIVED:
        return True
    return False if middle < APART else None
