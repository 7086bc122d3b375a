"""Run a manoeuvre, open or closed loop, and the straight run it starts from.

Takes manoeuvres of `bayesid.manoeuvres`. A controller sees the true state at its own instants, and its
commands go through the actuator chain of the model like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.model.vehicles import self_propulsion_speed
from bayesid.simulation.prepare import (
    NO_TRACE,
    check_parameters,
    check_start,
    choose,
    cut,
    inverse_mass,
    require_finite,
    start,
    step_mean,
)
from bayesid.simulation.sensors import observe
from bayesid.simulation.single import Track, simulate
from bayesid.simulation.time_plan import MOVING_STEP_PER_LENGTH, TimePlan, plan_run

Array = np.ndarray


def run_manoeuvre(
    model: Model,
    par: Array,
    manoeuvre: Any,
    x0: Array,
    max_step: float | None = None,
    disturb: Callable[[TimePlan], TimePlan] | None = None,
) -> tuple[Track, dict[str, Array]]:
    """Run a manoeuvre of `bayesid.manoeuvres`, open or closed loop.

    Parameters
    ----------
    disturb : puts wind or latent forces into the plan before it is run

    Returns
    -------
    Track at the manoeuvre's own samples, and the commands given, "delta_r_cmd" [rad], "n_cmd" [rpm] ...

    Raises
    ------
    ModelError
        if a state leaves the finite numbers; names the time
    """
    if hasattr(manoeuvre, "commands"):
        plan = plan_run(model, manoeuvre.t, manoeuvre.commands, max_step=max_step)
        plan = plan if disturb is None else disturb(plan)
        return simulate(model, par, plan, x0), dict(manoeuvre.commands)
    count = round(manoeuvre.duration / manoeuvre.dt)
    t = np.arange(count + 1) * manoeuvre.dt
    if max_step is None:  # where fins will move is not known yet
        max_step = 2 * MOVING_STEP_PER_LENGTH * model.scales["L"] / max(model.scales["U"], 1e-3)
    plan = plan_run(model, t, {}, max_step=max_step)
    plan = plan if disturb is None else disturb(plan)
    par = check_parameters(model, plan, par)
    fun = choose(model, par, None)
    x, _, _ = start(fun, par, plan.exogenous[0], check_start(model, x0))
    minv = inverse_mass(model, fun, par[None])[0]
    decide, names = manoeuvre.controller(), model.kernel.actuators
    delays = {a: delay for a, ids in fun.act_delays.items() if (delay := float(sum(par[i] for i in ids)))}
    na, nc = len(names), len(fun.act_columns)
    memory, carried = np.zeros(fun.act_memory), np.zeros((fun.act_memory, nc))
    none, no_slopes = np.zeros((1, na)), np.zeros((1, na, nc))
    given = np.zeros((count + 1, na))
    out, act = np.empty((count + 1, x.size)), np.empty((plan.steps.size, na))
    out[0] = x
    for i in range(count):
        given[i] = _row(decide(t[i], _twelve(model, x)), names)
        now = slice(plan.record[i], plan.record[i + 1])
        steps, times = plan.steps[now], plan.times[now]
        command = np.repeat(given[i][None], steps.size, axis=0)
        if delays:
            moves = cut(times, steps, command, t[: i + 1], given[: i + 1], delays)
            command, lengths = moves.command, moves.lengths
        else:
            lengths = np.diff(times, append=times[-1] + steps[-1])
        moved = np.empty_like(command)
        fun.actuate(command, none, none, lengths, par, False, i == 0, memory, carried, moved, no_slopes)
        act[now] = step_mean(moves, steps, moved) if delays else moved * lengths[:, None] / steps[:, None]
        last = np.array([steps.size])
        here = out[i + 1 : i + 2]
        fun.simulate(par, minv, x, times, steps, act[now], plan.exogenous[now], last, here, NO_TRACE)
        x = out[i + 1].copy()
    given[count] = given[count - 1]
    require_finite(t, out, fun.states)
    track = Track(t, out, fun.states, act, fun is model.kernel.full)
    return track, {f"{n}_cmd": given[:, a] for a, n in enumerate(names)}


def steady_start(model: Model, rpm: float | None = None, heading: float = 0.0) -> Array:
    """Initial state of a straight run at the self-propulsion speed of given revolutions, 0 for 0.

    Raises
    ------
    VehicleError
        if thrust and drag do not balance
    """
    rpm = rpm if rpm is not None else (model.vehicle.rpm_ref or 0.0)
    out = np.zeros(len(model.states))
    out[model.states.index("psi")] = heading
    out[model.states.index("u")] = self_propulsion_speed(model.vehicle, rpm) if rpm != 0.0 else 0.0
    return out


def carried_by_water(model: Model, par: Array, x0: Array) -> Array:
    """An initial state of a vehicle in still water, in the water as the parameters have it move at that time.

    A vehicle that begins at rest beside a current would swing before any order is given.
    """
    flowing = [e for e in model.kernel.effects if e.flow]
    acts = {model.index[e.key(p.name)]: p.off for e in flowing for p in e.parameters}
    if not any(par[i] != off for i, off in acts.items()):
        return x0
    bare = np.array(par)  # sensors of their own must not read the water
    for i, off in model.effect_off.items():
        if i not in acts:
            bare[i] = off
    t = np.array([0.0, 1e-3])
    own = dict(zip(model.states, x0, strict=True))
    states = np.array([own.get(name, 0.0) for name in model.kernel.full.states])
    read = observe(model, bare, plan_run(model, t, {}), np.tile(states, (2, 1)), full=True)[0]
    out, channels = np.array(x0), model.kernel.channels
    for name in ("u", "v", "w"):
        if name in channels and f"{name}_water" in channels:
            out[model.states.index(name)] += (
                read[channels.index(name)] - read[channels.index(f"{name}_water")]
            )
    return out


def _row(given: Mapping[str, float], names: tuple[str, ...]) -> Array:
    return np.array([float(given.get(f"{n}_cmd", given.get(n, 0.0))) for n in names])


def _twelve(model: Model, x: Array) -> Array:
    """State in the 12-entry order of `notation.STATES`, zeros out of the plane."""
    if model.dof == 6:
        return x[:12]
    out = np.zeros(12)
    out[[0, 1, 5, 6, 7, 11]] = x[:6]
    return out
