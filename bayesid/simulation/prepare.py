"""What a run needs before its first step: checked vectors, actuator positions, start, inverse mass matrix.

Takes a `Model`, parameters in SI and a `TimePlan`. Shared by the single, batch and closed-loop runs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

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


def actuate(
    model: Model, par: Array, plan: TimePlan, slopes: bool = False, full: bool | None = None
) -> tuple[Array, Array]:
    """Actuator positions held over each step and, if asked, their slopes by the chain's parameters.

    Returns
    -------
    (m, na) [rad, rpm] and (m, na, c), c columns in the order of the kernel's `act_columns`
    """
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    act, _ = _chain(fun, plan, par, _moves(fun, plan, par, False), False)
    if not slopes:
        return act, np.zeros((1, act.shape[1], len(fun.act_columns)))
    return act, _chain(fun, plan, par, _moves(fun, plan, par, True), True)[1]


@dataclass(frozen=True, eq=False)
class Moves:
    """Commands over pieces of steps: a step is cut where a delayed command switches.

    A servo at its rate limit does not feel the mean of a command over a step, only when it begins to move;
    with uncut steps a delay shorter than one would be lost.

    Attributes
    ----------
    owner : (k,) the step a piece belongs to
    lengths : (k,) [s]
    command : (k, na) held over each piece
    delay_slope, stretch : (k, na) derivatives of command and lengths by the delay of each actuator
    """

    owner: Array
    lengths: Array
    command: Array
    delay_slope: Array
    stretch: Array


def cut(
    times: Array, steps: Array, command: Array, knots: Array, levels: Array, delays: Mapping[int, float]
) -> Moves:
    """Pieces of steps with commands `delays` later; the first and last level count outside the knots."""
    edges = np.append(times, times[-1] + steps[-1])
    born = np.full(edges.size, -1)
    for a, delay in delays.items():
        switches = knots[1:][np.diff(levels[:, a]) != 0.0] + delay
        switches = switches[(switches > edges[0]) & (switches < edges[times.size])]
        edges, born = np.append(edges, switches), np.append(born, np.full(switches.size, a))
    order = np.argsort(edges, kind="stable")
    edges, born = edges[order], born[order]
    lengths = np.diff(edges)
    kept = lengths > 1e-12 * steps[0]
    middle = edges[:-1] + 0.5 * lengths
    owner = np.searchsorted(times, middle, side="right") - 1
    out, stretch = command[owner], np.zeros((middle.size, command.shape[1]))
    for a, delay in delays.items():
        at = np.searchsorted(knots, middle - delay, side="right") - 1
        out[:, a] = levels[np.clip(at, 0, knots.size - 1), a]
        stretch[:, a] = np.diff((born == a).astype(float))
    return Moves(
        owner[kept], lengths[kept], out[kept], np.zeros((int(kept.sum()), out.shape[1])), stretch[kept]
    )


def _moves(fun: Functions, plan: TimePlan, par: Array, slopes: bool) -> Moves:
    """Commands of a plan after pure delays; with `slopes` no switch falls on the edge of a step."""
    na = plan.command.shape[1]
    delays = {a: float(sum(par[i] for i in ids)) for a, ids in fun.act_delays.items() if ids}
    held = {a: d for a, d in delays.items() if fun.module.ACTUATORS[a] not in plan.measured}
    if slopes:  # seen from the side of longer delays, a hair beyond the edge
        held = {a: d + 1e-7 * float(plan.steps.min()) for a, d in held.items()}
    held = {a: d for a, d in held.items() if d != 0.0}
    nothing = np.zeros((plan.steps.size, na))
    moves = Moves(np.arange(plan.steps.size), plan.steps, plan.command, nothing, nothing)
    if held:
        moves = cut(plan.times, plan.steps, plan.command, plan.knots, plan.levels, held)
    command, slope = moves.command, moves.delay_slope
    for a in delays.keys() - held.keys():
        if fun.module.ACTUATORS[a] in plan.measured and (slopes or delays[a] != 0.0):
            middle = plan.times[moves.owner] - delays[a] + 0.5 * plan.steps[moves.owner]
            value, change = _between(plan.knots, plan.levels[:, a], middle)
            command, slope = command.copy(), slope.copy()
            command[:, a], slope[:, a] = value, -change
    return replace(moves, command=command, delay_slope=slope)


def _chain(fun: Functions, plan: TimePlan, par: Array, moves: Moves, slopes: bool) -> tuple[Array, Array]:
    """Positions, their mean over each step, and slopes."""
    (k, na), nc = moves.command.shape, len(fun.act_columns)
    act, dact = np.empty((k, na)), np.zeros((k if slopes else 1, na, nc))
    memory, carried = np.zeros(fun.act_memory), np.zeros((fun.act_memory, nc))
    fun.actuate(
        np.ascontiguousarray(moves.command), moves.delay_slope, moves.stretch, moves.lengths, par, slopes,
        True, memory, carried, act, dact,
    )  # fmt: skip
    if k == plan.steps.size:
        return act, dact
    mean = step_mean(moves, plan.steps, act)
    if slopes:
        whole = step_mean(moves, plan.steps, dact)
        for a, ids in fun.act_delays.items():
            change = np.add.reduceat(moves.stretch[:, a] * act[:, a], _first(moves)) / plan.steps
            for i in ids:
                whole[:, a, fun.act_columns.index(i)] += change
        dact = whole
    return mean, dact


def _first(moves: Moves) -> Array:
    return np.flatnonzero(np.diff(moves.owner, prepend=-1))


def step_mean(moves: Moves, steps: Array, values: Array) -> Array:
    """Means over whole steps of values over pieces."""
    trailing = (1,) * (values.ndim - 1)
    weighted = values * moves.lengths.reshape(-1, *trailing)
    return np.add.reduceat(weighted, _first(moves), axis=0) / steps.reshape(-1, *trailing)


def _between(knots: Array, levels: Array, s: Array) -> tuple[Array, Array]:
    """Straight lines between samples, and their slope; level outside."""
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 2)
    rise = np.where((s < knots[0]) | (s > knots[-1]), 0.0, (np.diff(levels) / np.diff(knots))[i])
    return np.interp(s, knots, levels), rise


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
