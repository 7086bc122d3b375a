"""What a run needs before its first step: checked vectors, actuator positions, start, inverse mass matrix.

Takes a `Model`, parameters in SI and a `Plan`. Shared by the single, batch and closed-loop runs.
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.errors import ModelError
from bayesid.kernels import Functions
from bayesid.model import Model
from bayesid.simulate.plan import Plan

Array = np.ndarray

NO_TRACE, NO_LANE_TRACE = np.empty((0, 4, 1)), np.empty(0)
_FIN = {"delta_r": "r", "delta_s": "s", "delta_b": "b"}


def choose(model: Model, par: Array, full: bool | None) -> Functions:
    """The bare functions while every effect is off, unless `full` says otherwise."""
    if full is None:
        full = not model.is_off(par)
    return model.kernel.full if full else model.kernel.bare


def check_parameters(model: Model, plan: Plan, par: Array) -> Array:
    """Parameter vector(s) as the kernels want them.

    The vehicle's own actuator limits are lifted where the position itself was measured.

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
    measured = [_FIN[name] for name in plan.measured if name in _FIN]
    for letter in measured:
        par[..., model.index[f"inverse_rate_{letter}"]] = 1e-9
        par[..., model.index[f"limit_{letter}"]] = 10.0
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


def inverse_mass(model: Model, fun: Functions, pars: Array) -> Array:
    """(b, nv*nv) inverse mass matrices of (b, n) parameter vectors.

    Raises
    ------
    ModelError
        if a mass matrix cannot be inverted
    """
    nv = len(model.kernel.velocities)
    mass = np.zeros((pars.shape[0], nv, nv))
    fun.masses(pars, mass)
    try:
        return np.linalg.inv(mass).reshape(-1, nv * nv)
    except np.linalg.LinAlgError:
        raise ModelError(
            f"mass matrix of {model.vehicle.name!r} with these values cannot be inverted; check mass, "
            "inertia and the acceleration derivatives"
        ) from None


def actuate(
    model: Model, par: Array, plan: Plan, slopes: bool = False, full: bool | None = None
) -> tuple[Array, Array]:
    """Actuator positions held over each step and, if asked, their slopes by the chain's parameters.

    Returns
    -------
    (m, na) [rad, rpm] and (m, na, c), c columns in the order of the kernel's `act_columns`
    """
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    command, slope = _delayed_commands(fun, plan, par, slopes)
    na, nc = command.shape[1], len(fun.act_columns)
    act = np.empty_like(command)
    dact = np.zeros((plan.steps.size if slopes else 1, na, nc))
    memory, carried = np.zeros(fun.act_memory), np.zeros((fun.act_memory, nc))
    fun.actuate(command, slope, plan.steps, par, slopes, True, memory, carried, act, dact)
    return act, dact


def _delayed_commands(fun: Functions, plan: Plan, par: Array, slopes: bool) -> tuple[Array, Array]:
    """Step-mean commands after pure delays, and their slope by the delay."""
    command = plan.command
    slope = np.zeros_like(command) if slopes else np.zeros((1, command.shape[1]))
    for a, ids in fun.act_delays.items():
        delay = float(sum(par[i] for i in ids))
        if not ids or (delay == 0.0 and not slopes):
            continue
        begin = plan.times - delay
        if fun.module.ACTUATORS[a] in plan.measured:
            value, change = _between(plan.knots, plan.levels[:, a], begin + 0.5 * plan.steps)
        else:
            value, change = held_mean(plan.knots, plan.levels[:, a], begin, plan.steps)
        if delay != 0.0:
            command = command.copy() if command is plan.command else command
            command[:, a] = value
        if slopes:
            slope[:, a] = -change
    return command, slope


def held_mean(knots: Array, levels: Array, begin: Array, length: Array) -> tuple[Array, Array]:
    """Mean of a held command over [begin, begin + length], and its derivative by begin.

    The first level counts before the first knot, the last one after the last.
    """
    total = np.concatenate(([0.0], np.cumsum(levels[:-1] * np.diff(knots))))

    def at(s: Array) -> Array:
        return np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 1)

    def integral(s: Array) -> Array:
        i = at(s)
        return np.where(s < knots[0], levels[0] * (s - knots[0]), total[i] + levels[i] * (s - knots[i]))

    end = begin + length
    # a switch exactly at either edge belongs to the interval it begins: look just inside the step before it
    inside = 1e-9 * length
    change = (levels[at(end - inside)] - levels[at(begin - inside)]) / length
    return (integral(end) - integral(begin)) / length, change


def _between(knots: Array, levels: Array, s: Array) -> tuple[Array, Array]:
    """Straight lines between samples, and their slope; level outside."""
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 2)
    rise = np.where((s < knots[0]) | (s > knots[-1]), 0.0, (np.diff(levels) / np.diff(knots))[i])
    return np.interp(s, knots, levels), rise


def require_finite(t: Array, states: Array, names: tuple[str, ...]) -> None:
    """Raise `ModelError` with the time a state leaves the finite numbers."""
    good = np.isfinite(states).all(axis=1)
    if not good.all():
        i = int(np.argmin(good))
        bad = [n for n, v in zip(names, states[i], strict=True) if not math.isfinite(v)]
        raise ModelError(
            f"the simulated vehicle diverges: {', '.join(bad)} not finite from t = {t[i]:.6g} s; "
            "check signs of damping coefficients or narrow the bounds"
        )
