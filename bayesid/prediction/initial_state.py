"""Where a prediction begins: draws of first state and disturbance, given the first readings of a run.

Takes a diagnosed model and the lead-in of a log, or a shaft speed. Does not predict.

The draws come from a simulation smoother (Durbin and Koopman 2002): a state and a disturbance are drawn from
their prior, their readings taken off the log, and the smoothed rest is added. State and disturbance then have
the covariance the lead-in leaves them, and the disturbance goes on after it from where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import Linearisation, linearise
from bayesid.estimation.filter_error.noise_model import Filter, NoiseModel, filter_settings
from bayesid.estimation.filter_error.regressor_columns import known
from bayesid.estimation.filter_error.smoother import smooth
from bayesid.estimation.run_data import Array, RunData
from bayesid.model.vehicles.orders import missing_actuators, spread
from bayesid.simulation import plan_run, simulate_batch

# Times a speed is halved in the search for the one at which thrust and drag balance.
MOST_HALVINGS = 40


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


def balanced_speed(model: Model, pars: Array, orders: Mapping[str, float], heading: float = 0.0) -> Array:
    """Speed at which each vehicle neither gains nor loses way, straight ahead, rudder amidships.

    Parameters
    ----------
    pars : (m, n_par) or (n_par,) parameters of the vehicles [SI]
    orders : channel -> orders of the propulsors, "n_cmd" [rpm], "n_port_cmd" [rpm], "azimuth_bow_cmd" [rad]
        ...; those of fins are left out, and what is not ordered stands still
    heading : [rad]

    Returns
    -------
    (m,) array                 [m/s]; 0 where nothing that is ordered pushes ahead or astern

    Raises
    ------
    ModelError
        if a vehicle has no such speed below three times the nominal one
    """
    pars = np.atleast_2d(pars)
    s = model.scales
    orders = _of_propulsors(model, orders)
    if not _pushes(model, orders):
        return np.zeros(len(pars))
    where = model.states.index("u")
    dt = 0.01 * s["L"] / s["U"]
    plan = plan_run(model, np.array([0.0, dt]), {name: np.full(2, value) for name, value in orders.items()})
    low, high = np.zeros(len(pars)), np.full(len(pars), 3.0 * s["U"] * max(1.0, _faster(model, orders)))

    def gains(u: Array) -> Array:
        x0 = np.zeros((len(pars), len(model.states)))
        x0[:, where], x0[:, model.states.index("psi")] = u, heading
        return simulate_batch(model, pars, plan, x0, threads=1)[:, 1, where] > u

    if gains(high).any() or not gains(low + 1e-3 * s["U"]).all():
        raise ModelError(
            f"{model.vehicle.name}: thrust and drag do not balance at {_words(orders)}; give a speed"
        )
    for _ in range(MOST_HALVINGS):
        middle = 0.5 * (low + high)
        up = gains(middle)
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    return 0.5 * (low + high)


def _of_propulsors(model: Model, orders: Mapping[str, float]) -> dict[str, float]:
    """Orders of the propeller and of every named thruster of the vehicle."""
    signals = [signal for thruster in model.vehicle.thrusters for signal in thruster.signals]
    own = [] if "n" in missing_actuators(model.vehicle) else ["n"]
    names = [f"{signal}_cmd" for signal in (*own, *signals)]
    every = spread(model.vehicle, orders)
    return {name: float(every[name]) for name in names if name in every}


def _pushes(model: Model, orders: Mapping[str, float]) -> bool:
    """Whether a propulsor that turns pushes along the hull; one that is turned about may."""
    along = {
        f"{t.signal}_cmd" for t in model.vehicle.thrusters if t.direction[0] != 0.0 or len(t.signals) > 1
    } | {"n_cmd"}
    return any(orders.get(name) for name in along)


def _faster(model: Model, orders: Mapping[str, float]) -> float:
    usual = model.vehicle.rpm_ref
    turning = [abs(value) for name, value in orders.items() if name.startswith("n_")]
    return max(turning, default=0.0) / usual if usual else 1.0


def _words(orders: Mapping[str, float]) -> str:
    """Orders as they are typed; one number where all shafts turn alike."""
    turning = {n.removesuffix("_cmd"): v for n, v in orders.items() if n.startswith("n_")}
    if set(turning) == {"n"} or len(turning) > 1 == len(set(turning.values())):
        return f"{next(iter(turning.values())):g} rpm"
    return ", ".join(f"{name} = {value:g} rpm" for name, value in turning.items())
