"""What straight runs have in common is not process noise: find it, so that the environment is measured
without it.

Takes straight runs and a first measurement of their environment. Gives the same runs with the common force
known. Process noise differs from run to run; a force that comes back at the same time after the start
belongs to
the vehicle, and counted as process noise it would hide the gap it makes (pure error of replicates; Box and
Draper 1987, chapter 4). Does not measure (see `noise_identification`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import stacked_equations
from bayesid.estimation.filter_error.linearise import Linearisation, with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel, mixing, smoothed
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array, RunData

# Correlation of two runs' disturbances, over its standard deviation, that chance exceeds in 1 % of the axes.
# To take process noise for a repeated force costs little: half of it is taken, and that is put right.
COMMON_CORRELATION = 2.3
# Correlation time from which a disturbance may be no process noise [L/U]; 95 of 100 clean campaigns stay
# below 4.3.
SLOW_TAU = 4.0


def slow(model: Model, noise_model: NoiseModel) -> bool:
    """Whether a disturbance is so slow that it may be no process noise; a fast one is it too often."""
    return noise_model.force_tau >= SLOW_TAU * model.scales["L"] / model.scales["U"]


def without_repeats(
    model: Model, paths: Sequence[Linearisation], free: GaussianPrior, noise_model: NoiseModel
) -> tuple[list[RunData], Array] | None:
    """Runs whose inputs hold the force they have in common, and which axes have one; None where none has.

    Parameters
    ----------
    paths : straight runs linearised under `noise_model`; one alone has nothing in common

    Notes
    -----
    Forces are compared over the square of each run's speed, by time since its start, after what the
    coefficients can explain.
    """
    if len(paths) < 2:
        return None
    forces = disturbances(model, paths, free, noise_model)
    square = [float(np.median(p.point.states[:, model.kernel.full.states.index("u")])) ** 2 for p in paths]
    starts = [p.log.plan.t[:-1] - p.log.plan.t[0] for p in paths]
    last = min(t[-1] for t in starts)
    grid = starts[0][starts[0] <= last]
    same = np.array(
        [
            [np.interp(grid, t, f[:, a]) / max(q, 1e-12) for a in range(f.shape[1])]
            for t, f, q in zip(starts, forces, square, strict=True)
        ]
    )
    keep = np.exp(-np.diff(grid) / noise_model.force_tau)
    fresh = same[:, :, 1:] - keep * same[:, :, :-1]
    runs = range(len(paths))
    pairs = [(i, k) for i in runs for k in runs if i < k]
    axes = np.array(
        [
            np.mean([agreement(fresh[i, a], fresh[k, a]) for i, k in pairs]) > COMMON_CORRELATION
            for a in range(same.shape[1])
        ]
    )
    if not axes.any():
        return None
    common = same.mean(axis=0)
    common = (common - common.mean(axis=1, keepdims=True)) * axes[:, None]
    logs = []
    for path, t, q in zip(paths, starts, square, strict=True):
        force = q * np.array([np.interp(t, grid, c, right=0.0) for c in common]).T
        logs.append(replace(path.log, plan=with_forces(model, path.log.plan, force)))
    return logs, axes


def disturbances(
    model: Model, paths: Sequence[Linearisation], free: GaussianPrior, noise_model: NoiseModel
) -> list[Array]:
    """Per run (n-1, nf), smoothed disturbance [N, N m] with the coefficients where the runs put them."""
    equations = stacked_equations(model, paths, free, noise_model)
    values = free.mean + free.sd * posterior(sum(equations[1:], equations[0])).mean
    mix = mixing(model, noise_model)
    out = []
    for path in paths:
        sm = smoothed(model, path, values - path.point.par[free.where], noise_model, variances=False)
        first = path.point.states.shape[1]
        out.append(sm.mean[:-1, first : first + mix.shape[0]] @ mix.T)
    return out


def agreement(a: Array, b: Array) -> float:
    """Correlation of two series over its standard deviation if they were independent (Bartlett 1946)."""
    a, b = a - a.mean(), b - b.mean()
    scale = np.sqrt(float(a @ a) * float(b @ b))
    if scale == 0.0:
        return 0.0
    lags = min(a.size // 4, 200)
    own = [np.correlate(x, x, "full")[x.size - 1 : x.size + lags] / float(x @ x) for x in (a, b)]
    variance = (1.0 + 2.0 * float((own[0][1:] * own[1][1:]).sum())) / a.size
    return float(a @ b) / scale / np.sqrt(max(variance, 1.0 / a.size))
