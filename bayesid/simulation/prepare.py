"""What a run needs before its first step: checked vectors, start, inverse mass matrix.

Takes a `Model`, parameters in SI and a `TimePlan`. Shared by the single, batch and closed-loop runs.
"""

from __future__ import annotations

import numpy as np

from bayesid.equations import Functions
from bayesid.equations.layout import FIN
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.simulation.time_plan import TimePlan

Array = np.ndarray

NO_TRACE, NO_LANE_TRACE = np.empty((0, 4, 1)), np.empty(0)
LARGEST_STATE = 1e30  # m, rad, m/s: no vehicle gets there, and its square is still a number
LARGEST_ANGLE, TURNS_ROUND = 10.0, 1e9  # rad, of a measured fin and of what may turn right round


def choose(model: Model, par: Array, full: bool | None) -> Functions:
    """The bare functions while every effect is off, unless `full` says otherwise."""
    if full is None:
        full = not model.is_off(par)
    return model.kernel.full if full else model.kernel.bare


def check_parameters(model: Model, plan: TimePlan, par: Array) -> Array:
    """Parameter vector(s) as the kernels want them.

    The vehicle's own actuator limits and lags are lifted where the position itself was measured.

    Raises
    ------
    ModelError
        if the last axis is not as long as the model's parameter vector
    """
    par = np.array(par, dtype=float, order="C")  # numba compiles again for a read-only array
    if par.shape[-1:] != (len(model.kernel.parameters),):
        raise ModelError(
            f"parameters of shape {par.shape}: model of {model.vehicle.name!r} ({model.dof}-DOF) has "
            f"{len(model.kernel.parameters)}; start from model.nominal"
        )
    servos = model.kernel.spec.servos
    for name in (n for n in plan.measured if n in servos):
        par[..., model.index[f"inverse_rate_{servos[name]}"]] = 1e-9
        par[..., model.index[f"servo_lag_{servos[name]}"]] = 0.0
        par[..., model.index[f"limit_{servos[name]}"]] = LARGEST_ANGLE if name in FIN else TURNS_ROUND
    return par


def check_start(model: Model, x0: Array) -> Array:
    """Initial pose and velocity, or one per parameter vector.

    Raises
    ------
    ModelError
        if an entry is not finite or the number of entries is that of another model
    """
    x0 = np.asarray(x0, dtype=float)
    if x0.shape[-1:] != (len(model.states),):
        raise ModelError(
            f"initial state of shape {x0.shape}: a {model.dof}-DOF model starts from "
            f"{', '.join(model.states)}"
        )
    if not np.isfinite(x0).all():
        raise ModelError("initial state is not finite")
    return x0


def start(fun: Functions, par: Array, exogenous: Array, x0: Array) -> tuple[Array, Array, Array]:
    """Whole initial state, and the slopes of the effects' own entries by x0 and by the parameters."""
    nx, n0 = len(fun.states), x0.size
    x = np.zeros(nx)
    x[:n0] = x0
    slope_x, slope_par = np.zeros((nx - n0, n0)), np.zeros((nx - n0, par.size))
    if nx > n0:
        fun.start(x, exogenous, 0.0, par, slope_x, slope_par)
    return x, slope_x, slope_par


def with_own_states(model: Model, states: Array) -> Array:
    """(n, nx) states of the full model: (n, n0) of the bare one, the effects' own at their initial values."""
    fun, still = model.kernel.full, np.zeros(len(model.kernel.exogenous))
    return np.array([start(fun, model.nominal, still, x)[0] for x in np.ascontiguousarray(states)])


def mass_matrices(model: Model, fun: Functions, pars: Array) -> Array:
    """(b, nv, nv) mass matrices, added mass included, of (b, n) parameter vectors."""
    nv = len(model.kernel.velocities)
    mass = np.zeros((pars.shape[0], nv, nv))
    fun.masses(np.array(pars, dtype=float, order="C"), mass)  # as in `check_parameters`
    return mass


def inverse_mass(model: Model, fun: Functions, pars: Array) -> Array:
    """(b, nv*nv) inverse mass matrices of (b, n) parameter vectors.

    Raises
    ------
    ModelError
        if a mass matrix cannot be inverted
    """
    nv = len(model.kernel.velocities)
    try:
        return np.linalg.inv(mass_matrices(model, fun, pars)).reshape(-1, nv * nv)
    except np.linalg.LinAlgError:
        raise ModelError(
            f"mass matrix of {model.vehicle.name!r} with these values cannot be inverted; check mass, "
            "inertia and the acceleration derivatives"
        ) from None


def require_finite(t: Array, states: Array, names: tuple[str, ...]) -> None:
    """Raise `ModelError` with the time a state leaves the numbers a vehicle can have (`LARGEST_STATE`)."""
    good = (np.abs(states) <= LARGEST_STATE).all(axis=1)  # false for nan
    if not good.all():
        i = int(np.argmin(good))
        bad = [n for n, v in zip(names, states[i], strict=True) if not abs(v) <= LARGEST_STATE]
        raise ModelError(
            f"the simulated vehicle diverges: {', '.join(bad)} beyond all bounds from t = {t[i]:.6g} s; "
            "check signs of damping coefficients or narrow the bounds"
        )
