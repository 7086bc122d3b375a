"""Periodic forces: find their frequencies in innovations, and the columns a force of a given one has.

Takes standardised innovations and linearised runs. Gives angular frequencies and whitened normal equations
with the force integrated out. Process noise has no memory beyond its correlation time; a force that keeps
time over
many periods (shed vortices, a hunting servo, a sloshing tank, regular waves) is something the equations lack.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import gamma

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations, without
from bayesid.estimation.filter_error.linearise import Linearisation, forces
from bayesid.estimation.filter_error.noise_model import LatentInputs, NoiseModel, force_unit
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.threads import each

# Angular frequencies looked at, in U/L: a vehicle hardly feels faster ones, and a period of more than seven
# lengths is a slow force.
LOWEST_FREQUENCY, HIGHEST_FREQUENCY = 0.9, 6.0
# Probability by chance, over all frequencies, below which a peak is a line; and most lines of a trial.
FALSE_ALARM, MOST_FREQUENCIES = 1e-3, 2
# Frequencies per independent one, and independent ones over which the level of the noise is taken.
OVERSAMPLING, LEVEL_NEIGHBOURS = 4, 12
# Frequencies times samples held at once, 16 bytes each.
MOST_TURNS = 2_000_000
# Prior sd of a periodic force over 1/2 rho L^2 U^2.
PERIODIC_FORCE_SD = 1e-3


def periodic_forces(
    model: Model, paths: Sequence[Linearisation], standard: Sequence[Array]
) -> tuple[tuple[float, ...], float]:
    """Angular frequencies [rad/s] of periodic parts of the innovations, plainest first; and how many
    independent ones were looked at.

    Parameters
    ----------
    paths, standard : runs and their (n, q) standardised innovations

    Notes
    -----
    Ordinates of the periodogram of white noise are exponential; those of all runs and channels are added,
    each over its local median, and the sum is gamma (Bartlett 1955; Fisher's test without its
    normalisation).
    """
    grid, total, count = spectrum(model, paths, standard)
    if not grid.size:
        return (), 0.0
    tries = grid.size / OVERSAMPLING
    found: list[float] = []
    left = total.copy()
    while len(found) < MOST_FREQUENCIES:
        k = int(np.argmax(left))
        if tries * gamma.sf(left[k], count) > FALSE_ALARM:
            break
        found.append(float(grid[k]))
        left[np.abs(np.arange(grid.size) - k) <= 2 * OVERSAMPLING] = 0.0
    return tuple(found), tries


def spectrum(
    model: Model, paths: Sequence[Linearisation], standard: Sequence[Array]
) -> tuple[Array, Array, int]:
    """Angular frequencies [rad/s], sum of the ordinates of all channels and runs, and how many were added."""
    time = model.scales["L"] / model.scales["U"]
    spans = [float(p.log.plan.t[-1] - p.log.plan.t[0]) for p in paths]
    finest = min(float(np.median(np.diff(p.log.plan.t))) for p in paths)
    step = 2 * np.pi / max(spans) / OVERSAMPLING
    grid = np.arange(LOWEST_FREQUENCY / time, min(HIGHEST_FREQUENCY / time, 0.8 * np.pi / finest), step)
    if grid.size < 4 * OVERSAMPLING:
        return np.zeros(0), np.zeros(0), 0
    total, count = np.zeros(grid.size), 0
    for path, z in zip(paths, standard, strict=True):
        valid = path.log.valid
        seen = [j for j in range(z.shape[1]) if valid[:, j].sum() >= 20]
        series = [np.where(valid[:, j], z[:, j] - z[valid[:, j], j].mean(), 0.0) for j in seen]
        for x, power in zip(series, _powers(grid, path.log.plan.t, series), strict=True):
            raw = power / float(x @ x)
            near = median_filter(raw, OVERSAMPLING * LEVEL_NEIGHBOURS, mode="nearest") / np.log(2.0)
            total += raw / np.maximum(near, 1.0)
            count += 1
    if not count:
        return np.zeros(0), np.zeros(0), 0
    return grid, total, count


def _powers(grid: Array, t: Array, series: Sequence[Array]) -> Array:
    """(k, f) squared sizes of the Fourier sums of series at uneven times, some frequencies at once."""
    out = np.empty((len(series), grid.size))
    at_once = max(1, MOST_TURNS // t.size)
    for first in range(0, grid.size, at_once):
        turn = -1j * np.outer(grid[first : first + at_once], t)
        np.exp(turn, out=turn)
        for k, x in enumerate(series):
            out[k, first : first + at_once] = np.abs(turn @ x) ** 2
    return out


def periodic_columns(
    path: Linearisation, frequency: float, inputs: Sequence[str], size: Sequence[float] | Array
) -> tuple[Array, Array]:
    """Extra columns (see `regressor_columns`) of a cosine and a sine of some size in each input, held over
    intervals."""
    t = path.log.plan.t
    middle = 0.5 * (t[1:] + t[:-1])
    where = [path.inputs.index(n) for n in inputs]
    push = path.gamma[:, :, where] * np.asarray(size)
    wave = np.stack([np.cos(frequency * middle), np.sin(frequency * middle)])
    drive = np.einsum("ixa,wi->ixaw", push, wave).reshape(len(middle), push.shape[1], -1)
    n, q = path.resid.shape
    return np.zeros((n, q, drive.shape[2])), drive


def stack_without(
    model: Model,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    frequencies: Sequence[float],
    latent: LatentInputs | None = None,
) -> list[NormalEquations]:
    """`normal_equations.stacked_equations`, periodic forces of unknown size and phase in every axis and run
    integrated out."""
    names = forces(model)
    size = PERIODIC_FORCE_SD * force_unit(model)

    def of_run(path: Linearisation, k: int) -> NormalEquations:
        extra = None
        if frequencies:
            parts = [periodic_columns(path, f, names, size) for f in frequencies]
            extra = (np.concatenate([p[0] for p in parts], 2), np.concatenate([p[1] for p in parts], 2))
        g = run_equations(model, path, free, noise_model, latent, k, extra)
        return without(g, len(free.names))

    return each(of_run, paths, range(len(paths)))
