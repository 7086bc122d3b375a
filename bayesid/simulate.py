"""Run a model: states, readings and their exact sensitivities for one or many parameter vectors.

Takes a `Model`, a `Plan` (time steps and inputs of one run) and parameters in SI. Gives arrays.
Does not read files, choose parameters or judge a fit.

Signal order: command -> actuator chain -> forces in moving water -> state -> sensors. RK4 with fixed steps, actuator
positions held at their mean over each step, commands held between their samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.errors import ModelError
from bayesid.kernels import LANES, Functions
from bayesid.model import Model

Array = np.ndarray

# Step in units of L/U: RK4 on the built-in sets then keeps a 10-minute track within a millimetre per hull length.
STEP_PER_LENGTH = 0.08
_INPUTS = ("delta_r", "delta_s", "delta_b", "n")
THREADED_FROM = 128


@dataclass(frozen=True, eq=False)
class Plan:
    """Time grid and inputs of one run, ready for the kernels.

    Attributes
    ----------
    t : (n,) sample times [s]
    times, steps : (m,) start [s from the first sample] and length [s] of every RK4 step
    record : (n,) number of steps done when sample i is taken
    command : (m, na) commanded actuator positions, mean over the step, without any delay [rad, rpm]
    exogenous : (m, ne) measured wind and latent inputs, held over each step
    knots, levels : (k,) and (k, na) switching times and values of the held commands
    measured : names of actuators whose measured position is used instead of the command
    """

    t: Array
    times: Array
    steps: Array
    record: Array
    command: Array
    exogenous: Array
    knots: Array
    levels: Array
    measured: tuple[str, ...] = ()


def plan_run(
    model: Model,
    t: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array] | None = None,
    exogenous: Mapping[str, Array] | None = None,
    max_step: float | None = None,
) -> Plan:
    """Time grid and inputs for a run.

    Parameters
    ----------
    model : Model
    t : (n,) sample times [s], increasing, not necessarily regular
    inputs : commands "delta_r_cmd" [rad], "n_cmd" [rpm] ... at the samples, held until the next; missing ones are 0
    measured : actuator positions "delta_r", "n" ... at the samples, linear in between; they replace the command
    exogenous : "wind_speed" [m/s] and "wind_from" [rad]
    max_step : longest RK4 step [s]; default 0.08 L/U

    Raises
    ------
    ModelError
        if times do not increase or an input is not finite
    """
    t = np.asarray(t, dtype=float)
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise ModelError("a run needs at least two increasing sample times")
    scale = model.scales
    longest = max_step or STEP_PER_LENGTH * scale["L"] / max(scale["U"], 1e-3)
    gaps = np.diff(t)
    count = np.maximum(1, np.ceil(gaps / longest - 1e-9)).astype(np.int64)
    steps = np.repeat(gaps / count, count)
    record = np.concatenate(([0], np.cumsum(count)))
    start = np.repeat(t[:-1], count) + steps * (np.arange(steps.size) - np.repeat(record[:-1], count))
    names = model.kernel.actuators
    measured = {k: v for k, v in (measured or {}).items() if k in names}
    command = np.zeros((steps.size, len(names)))
    levels = np.zeros((t.size, len(names)))
    owner = np.repeat(np.arange(t.size - 1), count)
    for a, name in enumerate(names):
        if name in measured:
            values = _filled(measured[name], name)
            levels[:, a] = values
            command[:, a] = np.interp(start + 0.5 * steps, t, values)
        elif f"{name}_cmd" in inputs:
            values = _filled(inputs[f"{name}_cmd"], f"{name}_cmd")
            levels[:, a] = values
            command[:, a] = values[owner]
    exo = np.zeros((steps.size, len(model.kernel.exogenous)))
    if exogenous and "wind_speed" in exogenous and "wind_from" in exogenous:
        speed = _filled(exogenous["wind_speed"], "wind_speed")
        towards = _filled(exogenous["wind_from"], "wind_from") + math.pi
        middle = start + 0.5 * steps
        for name, values in (("wind_north", speed * np.cos(towards)), ("wind_east", speed * np.sin(towards))):
            exo[:, model.kernel.exogenous.index(name)] = np.interp(middle, t, values)
    return Plan(t, start - t[0], steps, record, command, exo, t - t[0], levels, tuple(measured))


def plan_trial_run(model: Model, run: Any, max_step: float | None = None) -> Plan:
    """Plan of a logged run (`trials.Run`): measured actuators where logged, commands otherwise."""
    return plan_run(model, run.t, run.commands, run.measured_inputs, run.exogenous, max_step)


def _filled(values: Array, name: str) -> Array:
    """Input with missing samples held from the last good one."""
    values = np.array(values, dtype=float)
    good = np.isfinite(values)
    if not good.any():
        raise ModelError(f"input {name} has no finite value")
    if not good.all():
        last = np.maximum.accumulate(np.where(good, np.arange(values.size), -1))
        last[last < 0] = np.argmax(good)
        values = values[last]
    return values


# ---- one parameter vector -------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Track:
    """States of one simulated run.

    Attributes
    ----------
    t : (n,) [s]
    states : (n, nx) pose and velocity (and effects' own states) at the samples
    names : names of the state columns
    actuators : (m, na) actuator positions held over the steps
    """

    t: Array
    states: Array
    names: tuple[str, ...]
    actuators: Array

    def __getitem__(self, name: str) -> Array:
        return self.states[:, self.names.index(name)]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """States and exact derivatives: `jacobian[i, j, k]` = d state j at sample i / d unknown k."""

    track: Track
    jacobian: Array
    rate: Array
    jacobian_rate: Array


def _functions(model: Model, par: Array, full: bool | None) -> Functions:
    if full is None:
        full = not model.is_off(par)
    return model.kernel.full if full else model.kernel.bare


def _parameters(model: Model, plan: Plan, par: Array) -> Array:
    """Parameter vector with the vehicle's own actuator limits opened where the position itself was measured."""
    par = np.ascontiguousarray(par, dtype=float)
    letters = {"delta_r": "r", "delta_s": "s", "delta_b": "b"}
    opened = [letters[n] for n in plan.measured if n in letters]
    if opened:
        par = par.copy()
        for letter in opened:
            par[..., model.index[f"inverse_rate_{letter}"]] = 1e-9
            par[..., model.index[f"limit_{letter}"]] = 10.0
    return par


def _commands(fun: Functions, plan: Plan, par: Array, slopes: bool) -> tuple[Array, Array]:
    """Step-mean commands after pure delays, and their slope by the delay."""
    command = plan.command
    slope = np.zeros_like(command) if slopes else np.zeros((1, command.shape[1]))
    for a, ids in fun.act_delays.items():
        delay = float(sum(par[i] for i in ids))
        if not ids or (delay == 0.0 and not slopes):
            continue
        value, change = _delayed(plan, a, delay)
        if delay != 0.0:
            command = command.copy() if command is plan.command else command
            command[:, a] = value
        if slopes:
            slope[:, a] = change
    return command, slope


def _delayed(plan: Plan, a: int, delay: float) -> tuple[Array, Array]:
    """Mean of a held command over each step, seen `delay` later, and its derivative by the delay."""
    knots, levels = plan.knots, plan.levels[:, a]
    total = np.concatenate(([0.0], np.cumsum(levels[:-1] * np.diff(knots))))

    def integral(s: Array) -> Array:
        i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 1)
        return np.where(s < 0, levels[0] * s, total[i] + levels[i] * (s - knots[i]))

    def value(s: Array) -> Array:
        i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 1)
        return levels[i]

    begin, end = plan.times - delay, plan.times + plan.steps - delay
    # The step a switch falls in belongs to the interval that begins at it: take values just inside the step.
    inside = 1e-9 * plan.steps
    return (integral(end) - integral(begin)) / plan.steps, -(
        value(end - inside) - value(begin - inside)
    ) / plan.steps


def actuate(
    model: Model, par: Array, plan: Plan, slopes: bool = False, full: bool | None = None
) -> tuple[Array, Array]:
    """Actuator positions held over each step and, if asked, their slopes by the chain's parameters.

    Returns
    -------
    (m, na) [rad, rpm] and (m, na, c), c columns in the order of the kernel's `act_columns`
    """
    fun = _functions(model, par, full)
    par = _parameters(model, plan, par)
    command, delay_slope = _commands(fun, plan, par, slopes)
    na, nc = command.shape[1], max(len(fun.act_columns), 1)
    act = np.empty_like(command)
    dact = np.zeros((plan.steps.size if slopes else 1, na, nc))
    memory, carried = np.zeros(max(fun.act_memory, 1)), np.zeros((max(fun.act_memory, 1), nc))
    fun.actuate(command, delay_slope, plan.steps, par, slopes, True, memory, carried, act, dact)
    return act, dact


def _inverse_mass(fun: Functions, pars: Array) -> Array:
    """(b, nv*nv) inverse mass matrices of (b, n) parameter vectors."""
    nv = int(np.count_nonzero(fun.rows >= 0)) if False else fun.mass(pars[0]).shape[0]
    out = np.empty((pars.shape[0], nv * nv))
    fun.inverses(pars, out)
    return out


def _start(fun: Functions, par: Array, plan: Plan, x0: Array) -> tuple[Array, Array, Array]:
    nx = len(fun.states)
    x = np.zeros(nx)
    x[: x0.size] = x0
    extra = nx - x0.size
    slope_x, slope_par = np.zeros((extra, x0.size)), np.zeros((extra, par.size))
    if extra:
        fun.start(x, plan.exogenous[0], 0.0, par, slope_x, slope_par)
    return x, slope_x, slope_par


def simulate(model: Model, par: Array, plan: Plan, x0: Array, full: bool | None = None) -> Track:
    """States of one run.

    Parameters
    ----------
    model : Model
    par : (n,) parameter vector, SI
    plan : Plan
    x0 : (6,) or (12,) pose and velocity over ground at the first sample [m, rad, m/s, rad/s]
    full : run the kernel with all effects even if they are off (default: only if one is on)

    Raises
    ------
    ModelError
        if a state leaves the finite numbers; names the time
    """
    fun = _functions(model, par, full)
    par = _parameters(model, plan, np.asarray(par, dtype=float))
    act, _ = actuate(model, par, plan, full=fun is model.kernel.full)
    x, _, _ = _start(fun, par, plan, np.asarray(x0, dtype=float))
    out = np.empty((plan.t.size, x.size))
    fun.simulate(
        par,
        _inverse_mass(fun, par[None])[0],
        x,
        plan.times,
        plan.steps,
        act,
        plan.exogenous,
        plan.record,
        out,
    )
    _require_finite(plan.t, out, fun.states)
    return Track(plan.t, out, fun.states, act)


def _require_finite(t: Array, states: Array, names: tuple[str, ...]) -> None:
    good = np.isfinite(states).all(axis=1)
    if not good.all():
        i = int(np.argmin(good))
        bad = [n for n, v in zip(names, states[i], strict=True) if not math.isfinite(v)]
        raise ModelError(
            f"the simulated vehicle diverges: {', '.join(bad)} not finite from t = {t[i]:.6g} s; "
            "check signs of damping coefficients or narrow the bounds"
        )


def sensitivities(
    model: Model,
    par: Array,
    plan: Plan,
    x0: Array,
    free: Array,
    initial: bool = True,
    full: bool | None = None,
    rates: bool = False,
) -> Sensitivity:
    """States of one run with exact derivatives by parameters and initial state.

    Parameters
    ----------
    free : (k,) positions of the wanted parameters; columns 0..k-1 of the Jacobian, per SI unit
    initial : append one column per entry of x0
    rates : also give time derivatives at the samples (needed by delayed sensors)
    """
    free = np.asarray(free, dtype=np.int64)
    off = np.array(sorted(model.effect_off), dtype=np.int64)
    if full is None:
        full = not model.is_off(np.asarray(par)) or bool(np.isin(free, off).any())
    fun = _functions(model, par, full)
    par = _parameters(model, plan, np.asarray(par, dtype=float))
    x0 = np.asarray(x0, dtype=float)
    act, dact = actuate(model, par, plan, slopes=True, full=full)
    x, slope_x, slope_par = _start(fun, par, plan, x0)
    n_free, nx = free.size, x.size
    n = n_free + (x0.size if initial else 0)
    s0 = np.zeros((nx, max(n, 1)))
    column = {int(p): c for c, p in enumerate(free)}
    if initial:
        s0[: x0.size, n_free : n_free + x0.size] = np.eye(x0.size)
        s0[x0.size :, n_free : n_free + x0.size] = slope_x
    s0[x0.size :, :n_free] = slope_par[:, free]
    columns = np.array([column.get(int(p), -1) for p in fun.entries[:, 1]], dtype=np.int64)
    act_columns = np.array([column.get(p, -1) for p in fun.act_columns], dtype=np.int64)
    none = np.full(act.shape[1] + plan.exogenous.shape[1], -1, dtype=np.int64)
    size = plan.t.size
    out, sens = np.empty((size, nx)), np.empty((size, nx, max(n, 1)))
    rate = np.empty((size if rates else 0, nx))
    srate = np.empty((size if rates else 0, nx, max(n, 1)))
    minv = _inverse_mass(fun, par[None])[0]
    fun.variational(
        par, minv, x, s0, plan.times, plan.steps, act, dact, plan.exogenous, plan.record, fun.rows, fun.entries,
        columns, act_columns, none, out, sens, rate, srate,
    )  # fmt: skip
    _require_finite(plan.t, out, fun.states)
    return Sensitivity(Track(plan.t, out, fun.states, act), sens[:, :, :n], rate, srate[:, :, :n])


def gradient(
    model: Model,
    par: Array,
    plan: Plan,
    x0: Array,
    cotangent: Callable[[Array], Array],
    full: bool | None = None,
) -> tuple[Array, Array, Array]:
    """Adjoint: states, and the gradient of a scalar of the states by every parameter and by x0.

    Parameters
    ----------
    cotangent : maps the (n, nx) states to the scalar's derivative by each of them, same shape

    Returns
    -------
    states (n, nx), gradient by parameters (n_par,), gradient by x0
    """
    fun = _functions(model, par, full)
    par = _parameters(model, plan, np.asarray(par, dtype=float))
    x0 = np.asarray(x0, dtype=float)
    act, dact = actuate(model, par, plan, slopes=True, full=fun is model.kernel.full)
    x, slope_x, slope_par = _start(fun, par, plan, x0)
    minv = _inverse_mass(fun, par[None])[0]
    out = np.empty((plan.t.size, x.size))
    fun.simulate(par, minv, x, plan.times, plan.steps, act, plan.exogenous, plan.record, out)
    _require_finite(plan.t, out, fun.states)
    gx0, gpar, gact = np.zeros(x.size), np.zeros(par.size), np.zeros_like(act)
    fun.adjoint(
        par, minv, x, plan.times, plan.steps, act, plan.exogenous, plan.record,
        np.ascontiguousarray(cotangent(out)), gx0, gpar, gact,
    )  # fmt: skip
    if fun.act_columns:
        np.add.at(gpar, np.array(fun.act_columns), np.einsum("sa,sac->c", gact, dact))
    gpar += gx0[x0.size :] @ slope_par
    return out, gpar, gx0[: x0.size] + gx0[x0.size :] @ slope_x


# ---- many parameter vectors -----------------------------------------------------------------------------------------
def simulate_batch(
    model: Model, pars: Array, plan: Plan, x0: Array, full: bool | None = None, threads: int = 2
) -> Array:
    """States of one run for many parameter vectors.

    Parameters
    ----------
    pars : (b, n) parameter vectors, SI
    x0 : (nx0,) or (b, nx0) initial states
    threads : used from 128 vectors on

    Returns
    -------
    (b, samples, nx); rows of a diverged vehicle hold non-finite numbers
    """
    fun = _functions(model, pars, full)
    pars = _parameters(model, plan, np.atleast_2d(np.asarray(pars, dtype=float)))
    b, nx = pars.shape[0], len(fun.states)
    starts = np.broadcast_to(np.asarray(x0, dtype=float), (b, np.shape(x0)[-1]))
    groups = [slice(i, min(i + LANES, b)) for i in range(0, b, LANES)]
    out = np.empty((b, plan.t.size, nx))
    moving = sorted(
        {p for p in fun.act_columns}
        | {model.index[k] for k in model.index if k.startswith(("inverse_rate", "limit"))}
    )
    shared = bool(np.all(pars[:, moving] == pars[0, moving]))
    is_full = fun is model.kernel.full
    act0 = actuate(model, pars[0], plan, full=is_full)[0]
    common = np.ascontiguousarray(np.repeat(act0[:, :, None], LANES, axis=2)).ravel() if shared else None
    minv_all = _inverse_mass(fun, pars)

    def work(group: slice) -> None:
        k = group.stop - group.start
        index = np.minimum(np.arange(LANES), k - 1) + group.start
        lane_par = np.ascontiguousarray(pars[index].T).ravel()
        lane_minv = np.ascontiguousarray(minv_all[index].T).ravel()
        lane_x = np.empty((nx, LANES))
        for lane, j in enumerate(index):
            lane_x[:, lane] = _start(fun, pars[j], plan, starts[j])[0] if nx > starts.shape[1] else starts[j]
        if common is not None:
            act = common
        else:
            act = np.stack([actuate(model, pars[j], plan, full=is_full)[0] for j in index], axis=2).ravel()
        flat = np.empty(plan.t.size * nx * LANES)
        fun.lanes(
            lane_par,
            lane_minv,
            lane_x.ravel(),
            plan.times,
            plan.steps,
            act,
            plan.exogenous,
            plan.record,
            flat,
        )
        out[group] = flat.reshape(plan.t.size, nx, LANES)[:, :, :k].transpose(2, 0, 1)

    if threads > 1 and b >= THREADED_FROM:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, groups))
    else:
        for group in groups:
            work(group)
    return out


# ---- sensors --------------------------------------------------------------------------------------------------------
def observe(
    model: Model, par: Array, plan: Plan, states: Array, rate: Array | None = None, full: bool | None = None
) -> Array:
    """Readings of every channel of the kernel from simulated states.

    Parameters
    ----------
    states : (n, nx) states at the samples
    rate : (n, nx) their time derivatives, needed only where a sensor delay is not zero

    Returns
    -------
    (n, channels) in the order of `model.kernel.channels`
    """
    obs, _, _ = _sense(model, par, plan, states, rate, False, full)
    return obs


def observe_sensitivity(
    model: Model, par: Array, plan: Plan, result: Sensitivity, free: Array, full: bool | None = None
) -> tuple[Array, Array]:
    """Readings and their derivatives by the unknowns of a `Sensitivity`.

    Returns
    -------
    (n, channels) and (n, channels, unknowns)
    """
    fun = (
        model.kernel.full
        if result.track.states.shape[1] == len(model.kernel.full.states) and full is not False
        else model.kernel.bare
    )
    if result.track.states.shape[1] == len(model.kernel.bare.states) == len(model.kernel.full.states):
        fun = _functions(model, par, full)
    obs, dx, dpar = _sense(
        model,
        par,
        plan,
        result.track.states,
        result.rate if result.rate.size else None,
        True,
        fun is model.kernel.full,
    )
    jac = np.einsum("icx,ixk->ick", dx, result.jacobian)
    column = {int(p): c for c, p in enumerate(np.asarray(free))}
    for e, (channel, p) in enumerate(fun.sensor_entries):
        if int(p) in column:
            jac[:, channel, column[int(p)]] += dpar[:, e]
    for channel, ids in fun.delays.items():
        delay = float(sum(par[i] for i in ids))
        wanted = [column[i] for i in ids if i in column]
        if delay != 0.0 or wanted:
            shifted_x, shifted_rate = _hermite(plan.t, result.track.states, result.rate, plan.t - delay)
            flat = result.jacobian.reshape(plan.t.size, -1)
            shifted_s, _ = _hermite(
                plan.t, flat, result.jacobian_rate.reshape(plan.t.size, -1), plan.t - delay
            )
            shifted_s = shifted_s.reshape(result.jacobian.shape)
            late, late_dx, late_dpar = _evaluate(fun, par, plan, shifted_x, True)
            obs[:, channel] = late[:, channel]
            jac[:, channel] = np.einsum("ix,ixk->ik", late_dx[:, channel], shifted_s)
            for e, (c, p) in enumerate(fun.sensor_entries):
                if c == channel and int(p) in column:
                    jac[:, channel, column[int(p)]] += late_dpar[:, e]
            for k in wanted:
                jac[:, channel, k] -= np.einsum("ix,ix->i", late_dx[:, channel], shifted_rate)
    return obs, jac


def _sense(
    model: Model, par: Array, plan: Plan, states: Array, rate: Array | None, slopes: bool, full: bool | None
) -> tuple[Array, Array, Array]:
    fun = _functions(model, par, full)
    if states.shape[1] != len(fun.states):
        fun = model.kernel.full if states.shape[1] == len(model.kernel.full.states) else model.kernel.bare
    par = np.ascontiguousarray(par, dtype=float)
    obs, dx, dpar = _evaluate(fun, par, plan, states, slopes)
    if not slopes:
        for channel, ids in fun.delays.items():
            delay = float(sum(par[i] for i in ids))
            if delay != 0.0:
                if rate is None:
                    rate = np.gradient(states, plan.t, axis=0, edge_order=2)
                shifted, _ = _hermite(plan.t, states, rate, plan.t - delay)
                obs[:, channel] = _evaluate(fun, par, plan, shifted, False)[0][:, channel]
    return obs, dx, dpar


def _evaluate(
    fun: Functions, par: Array, plan: Plan, states: Array, slopes: bool
) -> tuple[Array, Array, Array]:
    n, nc = plan.t.size, len(fun.module.CHANNELS)
    obs = np.empty((n, nc))
    dx = np.zeros((n if slopes else 1, nc, states.shape[1]))
    dpar = np.zeros((n if slopes else 1, max(len(fun.sensor_entries), 1)))
    at = np.minimum(plan.record, plan.steps.size - 1)
    fun.sense(
        np.ascontiguousarray(states), plan.exogenous[at], plan.t - plan.t[0], par, slopes, obs, dx, dpar
    )
    return obs, dx, dpar


def _hermite(t: Array, values: Array, rates: Array, at: Array) -> tuple[Array, Array]:
    """Cubic Hermite values and rates at given times; straight lines outside the samples."""
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, t.size - 2)
    h = (t[i + 1] - t[i])[:, None]
    s = np.clip((at - t[i])[:, None] / h, 0.0, 1.0)
    v0, v1, r0, r1 = values[i], values[i + 1], rates[i], rates[i + 1]
    out = (
        (1 + 2 * s) * (1 - s) ** 2 * v0
        + s * (1 - s) ** 2 * h * r0
        + s * s * (3 - 2 * s) * v1
        + s * s * (s - 1) * h * r1
    )
    slope = 6 * s * (s - 1) * (v0 - v1) / h + (1 - s) * (1 - 3 * s) * r0 + s * (3 * s - 2) * r1
    early = at < t[0]
    if early.any():
        out[early] = values[0] + rates[0] * (at[early] - t[0])[:, None]
        slope[early] = rates[0]
    return out, slope


# ---- closed loop ----------------------------------------------------------------------------------------------------
def fly(
    model: Model, par: Array, manoeuvre: Any, x0: Array, max_step: float | None = None
) -> tuple[Track, dict[str, Array]]:
    """Run a manoeuvre of `bayesid.manoeuvres`, open or closed loop.

    Returns
    -------
    Track at the manoeuvre's own samples, and the commands given, "delta_r_cmd" [rad], "n_cmd" [rpm] ...
    """
    if hasattr(manoeuvre, "commands"):
        plan = plan_run(model, manoeuvre.t, manoeuvre.commands, max_step=max_step)
        return simulate(model, par, plan, x0), dict(manoeuvre.commands)
    count = int(round(manoeuvre.duration / manoeuvre.dt))
    t = np.arange(count + 1) * manoeuvre.dt
    decide = manoeuvre.controller()
    names = model.kernel.actuators
    fun = _functions(model, par, None)
    par = np.ascontiguousarray(par, dtype=float)
    given = np.zeros((count + 1, len(names)))
    first = _commands_row(decide(t[0], _twelve(model, np.asarray(x0))), names)
    given[0] = first
    whole = plan_run(
        model, t, {f"{n}_cmd": np.full(t.size, first[a]) for a, n in enumerate(names)}, max_step=max_step
    )
    x, _, _ = _start(fun, par, whole, np.asarray(x0, dtype=float))
    minv = _inverse_mass(fun, par[None])[0]
    memory, carried = (
        np.zeros(max(fun.act_memory, 1)),
        np.zeros((max(fun.act_memory, 1), max(len(fun.act_columns), 1))),
    )
    out, acts = np.empty((count + 1, x.size)), []
    out[0] = x
    step = np.zeros((1, len(names)))
    empty = np.zeros((1, len(names), max(len(fun.act_columns), 1)))
    for i in range(count):
        a, b = whole.record[i], whole.record[i + 1]
        if i:
            given[i] = _commands_row(decide(t[i], _twelve(model, x)), names)
        levels = replace(whole, levels=np.where(np.arange(t.size)[:, None] <= i, given, given[i]))
        command, _ = (
            _commands(
                fun, replace(levels, command=np.repeat(given[i][None], whole.steps.size, axis=0)), par, False
            )
            if any(par[j] for ids in fun.act_delays.values() for j in ids)
            else (np.repeat(given[i][None], b, axis=0), step)
        )
        act = np.empty((b - a, len(names)))
        fun.actuate(
            np.ascontiguousarray(command[a:b]),
            step,
            whole.steps[a:b],
            par,
            False,
            i == 0,
            memory,
            carried,
            act,
            empty,
        )
        piece = np.empty((1, x.size))
        record = np.array([b - a], dtype=np.int64)
        fun.simulate(
            par, minv, x, whole.times[a:b], whole.steps[a:b], act, whole.exogenous[a:b], record, piece
        )
        x = piece[0].copy()
        out[i + 1] = x
        acts.append(act)
    given[count] = given[count - 1]
    _require_finite(t, out, fun.states)
    track = Track(t, out, fun.states, np.concatenate(acts))
    return track, {f"{n}_cmd": given[:, a] for a, n in enumerate(names)}


def _commands_row(given: Mapping[str, float], names: tuple[str, ...]) -> Array:
    return np.array([float(given.get(f"{n}_cmd", given.get(n, 0.0))) for n in names])


def _twelve(model: Model, x: Array) -> Array:
    """State in the 12-entry order of `notation.STATES`, zeros out of the plane."""
    if model.dof == 6:
        return x[:12]
    out = np.zeros(12)
    out[[0, 1, 5, 6, 7, 11]] = x[:6]
    return out


def steady_start(model: Model, rpm: float | None = None, heading: float = 0.0) -> Array:
    """Initial state of a straight run at the self-propulsion speed of given revolutions."""
    from bayesid.model import self_propulsion_speed

    n = rpm if rpm is not None else (model.vehicle.rpm_ref or 0.0)
    speed = self_propulsion_speed(model.vehicle, n)
    names = model.states
    out = np.zeros(len(names))
    out[names.index("psi")] = heading
    out[names.index("u")] = speed
    return out
