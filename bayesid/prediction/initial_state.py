"""Where a prediction begins: draws of first state and disturbance, given the first readings of a run.

Takes a diagnosed model and the lead-in of a log. Does not predict.

The draws come from a simulation smoother (Durbin and Koopman 2002): a state and a disturbance are drawn from
their prior, their readings taken off the log, and the smoothed rest is added. State and disturbance then have
the covariance the lead-in leaves them, and the disturbance goes on after it from where it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import Linearisation, linearise
from bayesid.estimation.filter_error.noise_model import Filter, NoiseModel, filter_settings
from bayesid.estimation.filter_error.regressor_columns import known
from bayesid.estimation.filter_error.smoother import smooth
from bayesid.estimation.run_data import Array, RunData


@dataclass(frozen=True, eq=False)
class InitialState:
    """One draw: first state, disturbance force over the lead-in's intervals, slow error at its samples."""

    x0: Array
    force: Array
    drift: Array


def initial_states(
    model: Model,
    log: RunData,
    free: Array,
    mean: Array,
    pars: Array,
    noise_model: NoiseModel,
    rng: np.random.Generator,
) -> list[InitialState]:
    """One beginning per parameter vector.

    Parameters
    ----------
    log : lead-in of the run
    free : positions of the free parameters
    mean : (n_par,) parameters about which the lead-in is linearised
    pars : (draws, n_par) drawn parameters

    Raises
    ------
    ModelError
        if the lead-in cannot be followed
    """
    settled = followed(model, log, mean, noise_model, iterations=8)
    path = linearise(model, log, settled.points[0], free)
    f = filter_settings(model, path, noise_model)
    out = []
    for par in pars:
        state, force, drift = _draw(path, f, par[free] - mean[free], rng)
        out.append(InitialState(state[0, : len(model.states)], force[:-1], drift))
    return out


def _draw(
    path: Linearisation, f: Filter, step: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """States (n, nx), disturbance (n, nf) and slow errors (n, nd) given the readings."""
    log = path.log
    n, q = log.readings.shape
    nx, nf, nd = f.start.size, f.variance_f.size, f.variance_d.size
    force = coloured_noise(f.decay_f, np.sqrt(f.variance_f), rng)
    drift = coloured_noise(f.decay_d, np.sqrt(f.variance_d), rng)
    state = np.empty((n, nx))
    state[0] = np.sqrt(f.start) * rng.standard_normal(nx)
    for i in range(n - 1):
        state[i + 1] = path.phi[i] @ state[i] + f.gamma[i] @ force[i]
    seen = np.einsum("iqx,ix->iq", path.slope, state) + drift @ f.drift.T
    seen += np.sqrt(f.variance) * rng.standard_normal((n, q))
    resid, drive, first = known(path, step)
    m = nx + nf + nd
    mean, variance = np.empty((n, m)), np.empty((n, m))
    standard, alone = np.empty((n, q)), np.empty((n, q))
    smooth(
        np.where(log.valid, resid - seen, 0.0), drive, first, log.valid, path.slope, f.variance, path.phi,
        f.gamma, f.decay_f, f.variance_f, f.drift, f.decay_d, f.variance_d, f.start, mean, variance, standard,
        alone,
    )  # fmt: skip
    return (
        path.point.states + state + mean[:, :nx],
        force + mean[:, nx : nx + nf],
        drift + mean[:, nx + nf :],
    )


def coloured_noise(decay: Array, sd: Array, rng: np.random.Generator, first: Array | None = None) -> Array:
    """Ornstein-Uhlenbeck samples (n, k).

    Parameters
    ----------
    decay : (n-1, k) correlation of each sample with the next
    sd : (k,) stationary standard deviations
    first : (k,) first sample; drawn if not given
    """
    n, k = decay.shape[0] + 1, sd.size
    out = rng.standard_normal((n, k)) * sd
    if first is not None:
        out[0] = first
    out[1:] *= np.sqrt(1.0 - decay**2)
    _remember(decay, out)
    return out


@njit(cache=True, error_model="numpy")
def _remember(decay: Array, out: Array) -> None:
    """Add to each sample what is left of the one before."""
    for i in range(decay.shape[0]):
        for j in range(out.shape[1]):
            out[i + 1, j] += decay[i, j] * out[i, j]
