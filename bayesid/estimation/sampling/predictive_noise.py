"""What sensors and an unknown start add to a simulated run in a predictive draw: the noise the density has.

Takes a `TrialDensity` and points in natural units. Gives random numbers in SI units. Does not simulate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bayesid.estimation.sampling.residual_sums import ResidualSums
from bayesid.estimation.sampling.trial_posterior import TrialDensity, width

Array = np.ndarray


def sensor_noise(
    density: TrialDensity, v: Array, run: Any, j: int, row: Any, rng: np.random.Generator
) -> Array:
    """(b, n) noise of channel `j` of a run, as in the density: white, Student-t or autoregressive.

    Autoregressive noise starts afresh where neighbouring readings are not linked, as in the likelihood;
    between readings that are missing it stays white.
    """
    name, channel = run.channels[j], row[j]
    level = density._level(v, run, name)[:, None]
    shape = (len(v), run.n)
    if density.choice.student is not None:
        return np.asarray(level * rng.standard_t(density.choice.student, shape))
    noise = rng.standard_normal(shape)
    if width(density._phi):
        phi = correlation(density, v, name)
        fresh = np.sqrt(1.0 - phi**2)
        for now, before in channel.links.T:
            noise[:, now] = phi * noise[:, before] + fresh * noise[:, now]
    return np.asarray(level * noise)


def correlation(density: TrialDensity, v: Array, name: str) -> Array:
    """(b,) correlation of neighbouring errors of a channel."""
    return np.asarray(v[:, density._phi.start + density.channels.index(name)])


def start_moves(
    density: TrialDensity, v: Array, run: Any, row: Any, values: list[Array], offset: Array,
    rng: np.random.Generator, prior: bool,
) -> Array | None:  # fmt: skip
    """(b, m) draws of the change of an integrated initial state about the estimate; None without one.

    Parameters
    ----------
    values : per channel (b, n) simulated readings
    offset : (m,) centre of the prior minus estimate
    prior : whether to draw from the prior of the start alone
    """
    m = row[0].slopes.shape[1]
    if not m:
        return None
    count = len(values[0])
    if prior:
        return np.asarray(offset + rng.standard_normal((count, m)) * run.initial_sd)
    precision = np.diag(1.0 / run.initial_sd**2)
    right = np.repeat((-precision @ offset)[None], count, axis=0)
    bent = np.repeat(precision[None], count, axis=0)
    memory = width(density._phi) > 0
    for name, channel, simulated in zip(run.channels, row, values, strict=True):
        phi = correlation(density, v, name) if memory else None
        sums = ResidualSums.of(channel, channel.residuals(simulated.copy()), memory)
        _, mixed, slopes = sums.at(phi)
        weight = 1.0 / (density._level(v, run, name) ** 2 * channel.tau)
        right = right + weight[:, None] * mixed
        bent = bent + weight[:, None, None] * slopes
    root = np.linalg.cholesky(np.linalg.inv(bent))
    best = -np.linalg.solve(bent, right[:, :, None])[:, :, 0]
    return np.asarray(best + np.einsum("bij,bj->bi", root, rng.standard_normal((count, m))))
