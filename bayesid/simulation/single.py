"""One parameter vector: states, their exact sensitivities, and the adjoint gradient.

Takes a `Model`, parameters in SI, a `TimePlan` and the initial pose and velocity over ground.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.simulation.actuation import actuate
from bayesid.simulation.prepare import (
    NO_TRACE,
    check_parameters,
    check_start,
    choose,
    inverse_mass,
    require_finite,
    start,
)
from bayesid.simulation.time_plan import TimePlan

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Track:
    """States of one simulated run.

    Attributes
    ----------
    t : (n,) [s]
    states : (n, nx) pose and velocity (and effects' own states) at the samples
    names : names of the state columns
    actuators : (m, na) mean actuator positions over the steps
    full : whether the functions with all effects gave them
    """

    t: Array
    states: Array
    names: tuple[str, ...]
    actuators: Array
    full: bool = False

    def __getitem__(self, name: str) -> Array:
        return self.states[:, self.names.index(name)]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """States and exact derivatives by the unknowns.

    Attributes
    ----------
    track : Track
    jacobian : (n, nx, k), [i, j, k] = d state j at sample i / d unknown k
    rate, jacobian_rate : time derivatives of both at the samples, empty unless asked for
    """

    track: Track
    jacobian: Array
    rate: Array
    jacobian_rate: Array


def simulate(model: Model, par: Array, plan: TimePlan, x0: Array, full: bool | None = None) -> Track:
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
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    is_full = fun is model.kernel.full
    act, _ = actuate(model, par, plan, full=is_full)
    x, _, _ = start(fun, par, plan.exogenous[0], check_start(model, x0))
    minv = inverse_mass(model, fun, par[None])[0]
    out = np.empty((plan.t.size, x.size))
    fun.simulate(par, minv, x, plan.times, plan.steps, act, plan.exogenous, plan.record, out, NO_TRACE)
    require_finite(plan.t, out, fun.states)
    return Track(plan.t, out, fun.states, act[:, : len(model.kernel.actuators)], is_full)


def sensitivities(
    model: Model,
    par: Array,
    plan: TimePlan,
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

    Raises
    ------
    ModelError
        if a state leaves the finite numbers; names the time
    """
    free = np.asarray(free, dtype=np.int64)
    par = check_parameters(model, plan, par)
    x0 = check_start(model, x0)
    if full is None:
        full = not model.is_off(par) or not model.effect_off.keys().isdisjoint(free.tolist())
    fun = choose(model, par, full)
    act, dact = actuate(model, par, plan, slopes=True, full=full)
    x, slope_x, slope_par = start(fun, par, plan.exogenous[0], x0)
    n_free, n0, nx, size = free.size, x0.size, x.size, plan.t.size
    n = n_free + (n0 if initial else 0)
    s0 = np.zeros((nx, max(n, 1)))
    s0[n0:, :n_free] = slope_par[:, free]
    if initial:
        s0[:n0, n_free:n] = np.eye(n0)
        s0[n0:, n_free:n] = slope_x
    column = {int(p): c for c, p in enumerate(free)}
    columns = np.array([column.get(int(p), -1) for p in fun.entries[:, 1]], dtype=np.int64)
    act_columns = np.array([column.get(p, -1) for p in fun.act_columns], dtype=np.int64)
    na = len(model.kernel.actuators)
    no_inputs = np.full(na + plan.exogenous.shape[1], -1, dtype=np.int64)
    out, sens = np.empty((size, nx)), np.empty((size, nx, max(n, 1)))
    rate, srate = (np.empty((size if rates else 0, *a.shape[1:])) for a in (out, sens))
    fun.variational(
        par, inverse_mass(model, fun, par[None])[0], x, s0, plan.times, plan.steps, act, dact, plan.exogenous,
        plan.record, fun.entries, columns, act_columns, no_inputs, rate[:0], out, sens, rate, srate,
    )  # fmt: skip
    require_finite(plan.t, out, fun.states)
    return Sensitivity(
        Track(plan.t, out, fun.states, act[:, :na], full), sens[:, :, :n], rate, srate[:, :, :n]
    )


def gradient(
    model: Model,
    par: Array,
    plan: TimePlan,
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

    Raises
    ------
    ModelError
        if a state leaves the finite numbers; names the time
    """
    par = check_parameters(model, plan, par)
    x0 = check_start(model, x0)
    fun = choose(model, par, full)
    act, dact = actuate(model, par, plan, slopes=True, full=fun is model.kernel.full)
    x, slope_x, slope_par = start(fun, par, plan.exogenous[0], x0)
    minv = inverse_mass(model, fun, par[None])[0]
    out = np.empty((plan.t.size, x.size))
    trace = np.empty((plan.steps.size, 4, fun.traced))
    fun.simulate(par, minv, x, plan.times, plan.steps, act, plan.exogenous, plan.record, out, trace)
    require_finite(plan.t, out, fun.states)
    gx0, gpar, gact = np.zeros(x.size), np.zeros(par.size), np.zeros_like(act)
    fun.adjoint(
        par, minv, plan.times, plan.steps, act, plan.exogenous, plan.record, trace,
        np.ascontiguousarray(cotangent(out)), gx0, gpar, gact,
    )  # fmt: skip
    np.add.at(gpar, np.array(fun.act_columns, dtype=np.int64), np.einsum("sa,sac->c", gact, dact))
    gpar += gx0[x0.size :] @ slope_par
    return out, gpar, gx0[: x0.size] + gx0[x0.size :] @ slope_x
