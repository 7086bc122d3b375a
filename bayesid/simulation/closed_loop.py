"""Run a manoeuvre, open or closed loop, and the straight run it starts from.

Takes manoeuvres of `bayesid.manoeuvres`. A controller sees the true state at its own instants, and its
commands go through the actuator chain of the model like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from bayesid.equations.model import Model
from bayesid.model.notation import ORDER_TIMES
from bayesid.model.vehicles import self_propulsion_speed
from bayesid.model.vehicles.orders import gathered, spread, spread_by, together
from bayesid.simulation.actuation import cut, run_chains
from bayesid.simulation.prepare import (
    NO_TRACE,
    check_parameters,
    check_start,
    choose,
    inverse_mass,
    require_finite,
    start,
)
from bayesid.simulation.sensors import observe
from bayesid.simulation.single import Track, simulate
from bayesid.simulation.time_plan import TimePlan, plan_run

Array = np.ndarray
DUE_WITHIN = 1e-9  # how nearly an order is given when it is due, over the interval


def run_manoeuvre(
    model: Model,
    par: Array,
    manoeuvre: Any,
    x0: Array,
    max_step: float | None = None,
    disturb: Callable[[TimePlan], TimePlan] | None = None,
    exact: bool = False,
) -> tuple[Track, dict[str, Array]]:
    """Run a manoeuvre of `bayesid.manoeuvres`, open or closed loop.

    Parameters
    ----------
    disturb : puts wind or latent forces into the plan before it is run
    exact : a law that says how far its next order is away (`past`) gives it when it is due, not at the next
        of its own instants: what is measured of a zig-zag then does not depend on its step. A log of such
        commands cannot be replayed sample by sample

    Returns
    -------
    Track at the manoeuvre's own samples, and the commands given, "delta_r_cmd" [rad], "n_cmd" [rpm] ...; of
    a vehicle with named rudders or shafts in their place theirs, and these two as their mean; with `exact`
    also `ORDER_TIMES`, since when the commands of a sample are given [s]

    Raises
    ------
    ModelError
        if a state leaves the finite numbers; names the time
    """
    if hasattr(manoeuvre, "commands"):
        plan = plan_run(model, manoeuvre.t, manoeuvre.commands, max_step=max_step)
        plan = plan if disturb is None else disturb(plan)
        orders = spread(model.vehicle, manoeuvre.commands)
        return simulate(model, par, plan, x0), gathered(model.vehicle, orders)
    count = round(manoeuvre.duration / manoeuvre.dt)
    t = np.arange(count + 1) * manoeuvre.dt
    plan = plan_run(model, t, {}, max_step=max_step)
    plan = plan if disturb is None else disturb(plan)
    loop = _Loop(model, check_parameters(model, plan, par), plan)
    decide, names = manoeuvre.controller(), model.kernel.actuators
    past = getattr(decide, "past", None) if exact else None
    x = loop.begin(check_start(model, x0))
    given, since = np.zeros((count + 1, len(names))), t.copy()
    out, act = np.empty((count + 1, x.size)), np.zeros((plan.steps.size, len(names)))
    out[0] = x
    common = together(model.vehicle)
    for i in range(count):
        given[i] = row = _row(decide(t[i], _twelve(model, x)), names, common)
        reached = loop.over(i, x, row)
        if past is not None and past(t[i + 1], _twelve(model, reached.x)) > 0.0:

            def beyond(when: float, i: int = i, x: Array = x, row: Array = row) -> float:
                return float(past(when, _twelve(model, loop.over(i, x, row, end=when).x)))

            due = _due(beyond, t[i], t[i + 1])
            if due < t[i + 1]:
                reached = loop.over(i, x, row, end=due)
                loop.keep(reached, act)
                row = _row(decide(due, _twelve(model, reached.x)), names, common)
                given[i + 1], since[i + 1] = row, due
                reached = loop.over(i, reached.x, row, begin=due)
        loop.keep(reached, act)
        x = out[i + 1] = reached.x
    given[count] = row
    require_finite(t, out, loop.fun.states)
    track = Track(t, out, loop.fun.states, act, loop.fun is model.kernel.full)
    commands = {f"{n}_cmd": given[:, a] for a, n in enumerate(names)}
    return track, commands | {ORDER_TIMES: since} if exact else commands


def _due(beyond: Callable[[float], float], begin: float, end: float) -> float:
    """When an order is due within an interval, a hair after it; the end where the interval begins with it."""
    hair = DUE_WITHIN * (end - begin)
    if beyond(begin + hair) >= 0.0:
        return end
    try:
        due = float(brentq(beyond, begin + hair, end, xtol=hair)) + 2.0 * hair
    except (ValueError, RuntimeError):  # a vehicle on its way out of all bounds; the run tells
        return end
    return due if due < end - hair and beyond(due) >= 0.0 else end


class _Reached(NamedTuple):
    """State at the end of an interval, mean positions of the actuators over its steps, what they remember."""

    x: Array
    steps: slice
    share: Array
    act: Array
    memory: Array
    carried: Array
    knot: tuple[float, Array]


class _Loop:
    """A run that goes on interval by interval, each from what was kept of the one before."""

    def __init__(self, model: Model, par: Array, plan: TimePlan) -> None:
        self.fun = fun = choose(model, par, None)
        self._par, self._plan = par, plan
        self._minv = inverse_mass(model, fun, par[None])[0]
        self._delays = {
            a: delay for a, ids in fun.act_delays.items() if (delay := float(sum(par[i] for i in ids)))
        }
        na, nc = len(model.kernel.actuators), len(fun.act_columns)
        self._memory, self._carried = np.zeros(fun.act_memory), np.zeros((fun.act_memory, nc))
        self._knots, self._levels = np.zeros(2 * plan.t.size), np.zeros((2 * plan.t.size, na))
        self._kept = 0

    def begin(self, x0: Array) -> Array:
        """Initial state of the equations."""
        return start(self.fun, self._par, self._plan.exogenous[0], x0)[0]

    def over(
        self, i: int, x: Array, row: Array, begin: float | None = None, end: float | None = None
    ) -> _Reached:
        """The run over interval i of the plan, or from `begin` to `end` within it [s], commands held."""
        plan, fun, n = self._plan, self.fun, self._kept
        now = slice(plan.record[i], plan.record[i + 1])
        low, steps = plan.times[now], plan.steps[now]
        if begin is not None or end is not None:
            begin, end = self._t(i) if begin is None else begin, self._t(i + 1) if end is None else end
            high = np.minimum(low + steps, end)
            low = np.maximum(low, begin)
            inside = np.flatnonzero(high > low)
            now = slice(now.start + inside[0], now.start + inside[-1] + 1)
            low, steps = low[inside], (high - low)[inside]
        else:
            begin = self._t(i)
        command = np.repeat(row[None], steps.size, axis=0)
        self._knots[n], self._levels[n] = begin, row
        count = np.ceil(steps / plan.piece - 1e-9).astype(np.int64) if plan.piece else None
        known = self._knots[: n + 1], self._levels[: n + 1]
        pieces = cut(low, steps, command, count, self._delays, *known)
        memory, carried = self._memory.copy(), self._carried.copy()
        act, _ = run_chains(fun, self._par, pieces, steps.size, False, memory, carried, restart=n == 0)
        here = np.empty((1, x.size))
        fun.simulate(
            self._par, self._minv, x, low, steps, act, plan.exogenous[now], np.array([steps.size]), here,
            NO_TRACE,
        )  # fmt: skip
        mean = act[:, : row.size]
        return _Reached(here[0], now, steps / plan.steps[now], mean, memory, carried, (begin, row))

    def _t(self, i: int) -> float:
        """Sample time [s since the run began]."""
        return float(self._plan.t[i] - self._plan.began)

    def keep(self, reached: _Reached, act: Array) -> None:
        """Go on from there; `act` gets the mean positions over the steps of the plan."""
        act[reached.steps] += reached.share[:, None] * reached.act
        self._memory, self._carried = reached.memory, reached.carried
        self._knots[self._kept], self._levels[self._kept] = reached.knot
        self._kept += 1


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


def _row(
    given: Mapping[str, float], names: tuple[str, ...], common: Mapping[str, Mapping[str, float]]
) -> Array:
    orders = spread_by(common, given)
    return np.array([float(orders.get(f"{n}_cmd", orders.get(n, 0.0))) for n in names])


def _twelve(model: Model, x: Array) -> Array:
    """State in the 12-entry order of `notation.STATES`, zeros out of the plane."""
    if model.dof == 6:
        return x[:12]
    out = np.zeros(12)
    out[[0, 1, 5, 6, 7, 11]] = x[:6]
    return out
