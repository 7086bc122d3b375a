"""Sensors: readings of simulated states, with their exact sensitivities.

Takes states (and their rates where a sensor is late) of a run. Gives one column per channel of the kernel.
A late sensor shows the state of `delay` ago, a cubic between samples; before the first sample the vehicle is
taken to have moved on a straight line of its states.
"""

from __future__ import annotations

import numpy as np

from bayesid.equations import Functions
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.simulation.prepare import choose
from bayesid.simulation.single import Sensitivity
from bayesid.simulation.time_plan import TimePlan

Array = np.ndarray


def observe(
    model: Model,
    par: Array,
    plan: TimePlan,
    states: Array,
    rate: Array | None = None,
    full: bool | None = None,
) -> Array:
    """Readings of every channel of the kernel from simulated states.

    Parameters
    ----------
    states : (n, nx) states at the samples
    rate : (n, nx) their time derivatives, used only where a sensor delay is not zero; differences otherwise

    Returns
    -------
    (n, channels) in the order of `model.kernel.channels`
    """
    par = np.array(par, dtype=float, order="C")
    fun = choose(model, par, full)
    if states.shape[1] != len(fun.states):  # states of the other set of functions: theirs are the sensors
        fun = model.kernel.full if fun is model.kernel.bare else model.kernel.bare
    obs, _, _ = read_channels(fun, par, plan, states, False)
    for channel, ids in fun.delays.items():
        delay = float(sum(par[i] for i in ids))
        if delay != 0.0:
            if rate is None:
                rate = np.gradient(states, plan.t, axis=0, edge_order=2 if plan.t.size > 2 else 1)
            earlier, _ = _hermite(plan.t, states, rate, plan.t - delay)
            obs[:, channel] = read_channels(fun, par, plan, earlier, False)[0][:, channel]
    return obs


def observe_sensitivity(
    model: Model, par: Array, plan: TimePlan, result: Sensitivity, free: Array, full: bool | None = None
) -> tuple[Array, Array]:
    """Readings and their derivatives by the unknowns of a `Sensitivity`.

    Parameters
    ----------
    result : of `sensitivities`, with rates if a delay is not zero or among the unknowns
    free : (k,) the parameter positions `result` was made for
    full : by default as in `result`

    Returns
    -------
    (n, channels) and (n, channels, unknowns)

    Raises
    ------
    ModelError
        if a late sensor lacks the rates of the states
    """
    par = np.array(par, dtype=float, order="C")
    fun = choose(model, par, result.track.full if full is None else full)
    states, n = result.track.states, plan.t.size
    column = {int(p): c for c, p in enumerate(np.asarray(free))}
    entries = [(e, int(c), column[int(p)]) for e, (c, p) in enumerate(fun.sensor_entries) if int(p) in column]
    obs, dx, dpar = read_channels(fun, par, plan, states, True)
    jac = np.einsum("icx,ixk->ick", dx, result.jacobian)
    for e, c, k in entries:
        jac[:, c, k] += dpar[:, e]
    for channel, ids in fun.delays.items():
        delay = float(sum(par[i] for i in ids))
        wanted = [column[i] for i in ids if i in column]
        if delay == 0.0 and not wanted:
            continue
        if not result.rate.size:
            raise ModelError("a late sensor needs rates: call sensitivities(..., rates=True)")
        at = plan.t - delay
        earlier, speed = _hermite(plan.t, states, result.rate, at)
        slopes, _ = _hermite(plan.t, result.jacobian.reshape(n, -1), result.jacobian_rate.reshape(n, -1), at)
        late, late_dx, late_dpar = read_channels(fun, par, plan, earlier, True)
        obs[:, channel] = late[:, channel]
        jac[:, channel] = np.einsum("ix,ixk->ik", late_dx[:, channel], slopes.reshape(result.jacobian.shape))
        for e, c, k in entries:
            if c == channel:
                jac[:, c, k] += late_dpar[:, e]
        for k in wanted:
            jac[:, channel, k] -= np.einsum("ix,ix->i", late_dx[:, channel], speed)
    return obs, jac


def read_channels(
    fun: Functions, par: Array, plan: TimePlan, states: Array, slopes: bool
) -> tuple[Array, Array, Array]:
    """Readings, their slopes by the states, and by the parameters (sparse, `fun.sensor_entries`)."""
    n, nc = plan.t.size, len(fun.module.CHANNELS)
    obs = np.empty((n, nc))
    dx = np.zeros((n if slopes else 1, nc, states.shape[1]))
    dpar = np.zeros((n if slopes else 1, max(len(fun.sensor_entries), 1)))
    exo = plan.exogenous[np.minimum(plan.record, plan.steps.size - 1)]
    fun.sense(np.ascontiguousarray(states), exo, plan.t - plan.began, par, slopes, obs, dx, dpar)
    return obs, dx, dpar


def _hermite(t: Array, values: Array, rates: Array, at: Array) -> tuple[Array, Array]:
    """Cubic Hermite values and rates at given times; straight lines before the first sample."""
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
