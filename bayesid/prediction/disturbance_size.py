"""How large a disturbance and how large errors of the channels make the errors of predicted runs as they are.

Takes runs predicted from others: errors of the mean, the variance that coefficients, start and sensor noise
give them, and the variance a disturbance of each axis adds per square of its size. Gives the sizes of largest
predictive density (logarithmic score; Gneiting and Raftery 2007). Does not simulate.

Errors by a force grow as the hull answers it, those of a channel are as large from the first reading on: a
velocity that is the filtered derivative of a track, a sensor with a lever arm the file has not. The variance
is linear in the squares of all sizes, so that one simulation per axis tells all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

Array = np.ndarray
LEAST, MOST = 1e-7, 3e-3  # size of the disturbance over 1/2 rho L^2 U^2
# Error of a channel over the rms error of its first readings: least, where the search begins, most. Errors
# of its own are there from the first reading on; what grows later is not one of them.
CHANNEL, FIRST_SHARE = (1e-2, 0.3, 1.0), 0.1
# Gain in log density per reading and channel from which the errors of a channel are believed.
CHANNEL_GAIN = 0.03


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One run beside its prediction; readings after the lead-in only.

    Attributes
    ----------
    channels : (q,) names
    error : (n, q) reading minus mean, nan where not read
    fixed : (n, q) variance of coefficients, start and sensor noise
    per_axis : (a, n, q) variance that a disturbance of size 1 on each axis adds
    """

    channels: tuple[str, ...]
    error: Array
    fixed: Array
    per_axis: Array


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of largest predictive density.

    Attributes
    ----------
    level : (a,) disturbance of each axis over 1/2 rho L^2 U^2
    channel : channel -> sd of errors of its own beyond its noise [SI]; only those the runs ask for
    density : mean log density of a reading, channels and runs weighing alike
    """

    level: Array
    channel: dict[str, float]
    density: float


@dataclass(frozen=True, eq=False)
class _Readings:
    """All readings of all runs in one row: square error, variances, weight, place of the channel."""

    square: Array
    fixed: Array
    per_axis: Array
    weight: Array
    channel: Array
    names: tuple[str, ...]


def best_sizes(runs: Sequence[PredictedRun]) -> Sizes:
    """Sizes of largest predictive density over runs, errors of channels where they gain `CHANNEL_GAIN`."""
    r = _stacked(runs)
    count = r.per_axis.shape[0]
    own: list[int] = []
    level, density = _fitted(r, own)
    scale = np.array([_first_error(runs, name) for name in r.names])
    # every channel at once, then those taken back that are not missed
    everything = list(range(len(r.names)))
    whole, best = _fitted(r, everything, scale)
    if best - density > CHANNEL_GAIN / len(r.names):
        level, own, density = whole, everything, best
        for j in everything:
            less = [i for i in own if i != j]
            found, value = _fitted(r, less, scale)
            if density - value <= CHANNEL_GAIN / len(r.names):
                level, own, density = found, less, value
    errors = {r.names[j]: float(np.exp(s) * scale[j]) for j, s in zip(own, level[count:], strict=True)}
    return Sizes(np.exp(level[:count]), errors, density)


def _first_error(runs: Sequence[PredictedRun], channel: str) -> float:
    """Rms error of the first readings of a channel."""
    first = []
    for run in runs:
        if channel in run.channels:
            error = run.error[:, run.channels.index(channel)]
            error = error[np.isfinite(error)]
            first.append(error[: max(1, int(FIRST_SHARE * error.size))])
    return max(float(np.sqrt(np.mean(np.concatenate(first) ** 2))), 1e-300)


def _stacked(runs: Sequence[PredictedRun]) -> _Readings:
    names = tuple(dict.fromkeys(c for run in runs for c in run.channels))
    square, fixed, per_axis, weight, channel = [], [], [], [], []
    for run in runs:
        seen = [np.flatnonzero(np.isfinite(run.error[:, j])) for j in range(len(run.channels))]
        read = sum(bool(rows.size) for rows in seen)
        for j, rows in enumerate(seen):
            if rows.size:
                square.append(run.error[rows, j] ** 2)
                fixed.append(run.fixed[rows, j])
                per_axis.append(run.per_axis[:, rows, j])
                weight.append(np.full(rows.size, 1.0 / (rows.size * read * len(runs))))
                channel.append(np.full(rows.size, names.index(run.channels[j])))
    return _Readings(
        np.concatenate(square),
        np.maximum(np.concatenate(fixed), 1e-300),
        np.concatenate(per_axis, axis=1),
        np.concatenate(weight),
        np.concatenate(channel),
        names,
    )


def _fitted(r: _Readings, own: Sequence[int], scale: Array | None = None) -> tuple[Array, float]:
    """Logarithms of the sizes of all axes and of the errors of some channels over `scale`; the density."""
    count = r.per_axis.shape[0]
    grown = [r.per_axis]
    if scale is not None:
        grown.append(
            np.array([np.where(r.channel == j, scale[j] ** 2, 0.0) for j in own]).reshape(-1, r.channel.size)
        )
    parts = np.vstack(grown)

    def cost(x: Array) -> tuple[float, Array]:
        square = np.exp(2.0 * x)
        variance = r.fixed + square @ parts
        miss = r.square / variance
        slope = parts @ (r.weight * (1.0 - miss) / variance) * square
        return 0.5 * float(r.weight @ (np.log(variance) + miss)), slope

    low = np.log([LEAST] * count + [CHANNEL[0]] * len(own))
    high = np.log([MOST] * count + [CHANNEL[2]] * len(own))
    best = None
    for start in (1e-5, 1e-4):
        x0 = np.log([start] * count + [CHANNEL[1]] * len(own))
        found = minimize(cost, x0, jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)))
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return np.asarray(best.x), -float(best.fun) - 0.5 * float(np.log(2 * np.pi))
