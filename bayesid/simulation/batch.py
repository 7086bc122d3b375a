"""Many parameter vectors of one run, sixteen at a time: states, and gradients of a scalar of the states.

Takes parameter vectors in SI and a `TimePlan`. A diverged vehicle gives non-finite rows, no error.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from bayesid.equations import LANES, Functions
from bayesid.equations.model import Model
from bayesid.simulation.actuation import actuate
from bayesid.simulation.prepare import (
    NO_LANE_TRACE,
    check_parameters,
    check_start,
    choose,
    inverse_mass,
    start,
)
from bayesid.simulation.time_plan import TimePlan

Array = np.ndarray

THREADED_FROM = 128


@dataclass(frozen=True, eq=False)
class _Group:
    """Sixteen vectors as the lane kernels want them: flat, sixteen values per entry.

    index : (16,) the vectors; the last one fills up the lanes
    count : how many of them are asked for
    """

    index: Array
    count: int
    par: Array
    minv: Array
    x0: Array
    act: Array


class _Batch:
    """Checked vectors of one run, cut into groups."""

    def __init__(self, model: Model, pars: Array, plan: TimePlan, x0: Array, full: bool | None) -> None:
        self.model, self.plan = model, plan
        self.pars = check_parameters(model, plan, np.atleast_2d(pars))
        self.fun: Functions = choose(model, self.pars, full)
        self.full = self.fun is model.kernel.full
        x0 = check_start(model, x0)
        self.count = self.pars.shape[0]
        self.starts = np.broadcast_to(x0, (self.count, x0.shape[-1]))
        self.minv = inverse_mass(model, self.fun, self.pars)
        chain = list(self.fun.act_columns)
        self.common = None
        if self.count and np.all(self.pars[:, chain] == self.pars[0, chain]):
            self.common = np.repeat(actuate(model, self.pars[0], plan, full=self.full)[0].ravel(), LANES)

    def begin(self, j: int) -> tuple[Array, Array, Array]:
        return start(self.fun, self.pars[j], self.plan.exogenous[0], self.starts[j])

    def group(self, vectors: Array) -> _Group:
        count = vectors.size
        index = vectors[np.minimum(np.arange(LANES), count - 1)]
        x0 = self.starts[index]
        if len(self.fun.states) > x0.shape[1]:
            x0 = np.array([self.begin(j)[0] for j in index])
        act = self.common
        if act is None:
            one = [actuate(self.model, self.pars[j], self.plan, full=self.full)[0] for j in index]
            act = np.stack(one, axis=2).ravel()
        par, minv = self.pars[index].T.ravel(), self.minv[index].T.ravel()
        return _Group(index, count, par, minv, x0.T.ravel(), act)

    def forward(self, g: _Group, trace: Array) -> Array:
        """(samples, nx, lanes) states of a group."""
        plan, nx = self.plan, len(self.fun.states)
        out = np.empty(plan.t.size * nx * LANES)
        self.fun.lanes(
            g.par, g.minv, g.x0, plan.times, plan.steps, g.act, plan.exogenous, plan.record, out, trace
        )
        return out.reshape(plan.t.size, nx, LANES)

    def each(self, work: Callable[[_Group], None], threads: int) -> None:
        def one(first: int) -> None:
            work(self.group(np.arange(first, min(first + LANES, self.count))))

        if threads > 1 and self.count >= THREADED_FROM:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(one, range(0, self.count, LANES)))
        else:
            for first in range(0, self.count, LANES):
                one(first)


def simulate_batch(
    model: Model, pars: Array, plan: TimePlan, x0: Array, full: bool | None = None, threads: int = 2
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
    batch = _Batch(model, pars, plan, x0, full)
    out = np.empty((batch.count, plan.t.size, len(batch.fun.states)))

    def work(g: _Group) -> None:
        out[g.index[: g.count]] = batch.forward(g, NO_LANE_TRACE)[:, :, : g.count].transpose(2, 0, 1)

    batch.each(work, threads)
    return out


def gradient_batch(
    model: Model,
    pars: Array,
    plan: TimePlan,
    x0: Array,
    cotangent: Callable[[Array], Array],
    full: bool | None = None,
    threads: int = 2,
) -> tuple[Array, Array, Array]:
    """Adjoint for many parameter vectors: the gradient of one scalar of the states per vector.

    Parameters
    ----------
    pars : (b, n) parameter vectors, SI
    x0 : (nx0,) or (b, nx0) initial states
    cotangent : maps (k, samples, nx) states of some vectors to the derivative of each one's scalar by each of
        them, same shape; may be called from several threads
    threads : used from 128 vectors on

    Returns
    -------
    states (b, samples, nx), gradients by parameters (b, n), gradients by x0 (b, nx0)
    """
    batch = _Batch(model, pars, plan, x0, full)
    fun, nx, n0 = batch.fun, len(batch.fun.states), batch.starts.shape[1]
    states = np.empty((batch.count, plan.t.size, nx))
    by_par, by_x0 = np.zeros(batch.pars.shape), np.zeros((batch.count, n0))
    chain = np.array(fun.act_columns, dtype=np.int64)
    na = len(fun.module.ACTUATORS)
    dact = None
    if batch.common is not None and batch.count:
        dact = actuate(model, batch.pars[0], batch.plan, slopes=True, full=batch.full)[1]

    def work(g: _Group) -> None:
        trace = np.empty(plan.steps.size * 4 * fun.traced * LANES)
        here = np.ascontiguousarray(batch.forward(g, trace).transpose(2, 0, 1))
        cot = np.empty((plan.t.size, nx, LANES))
        cot[...] = np.asarray(cotangent(here)).transpose(1, 2, 0)
        gx0, gpar = np.empty((nx, LANES)), np.empty((fun.adjoint_parameters.size, LANES))
        gact = np.empty((plan.steps.size, 2 * na, LANES))
        fun.adjoint_lanes(
            g.par, g.minv, plan.times, plan.steps, g.act, plan.exogenous, plan.record, trace, cot.ravel(),
            gx0.ravel(), gpar.ravel(), gact.ravel(),
        )  # fmt: skip
        for lane, j in enumerate(g.index[: g.count]):
            states[j] = here[lane]
            by_par[j, fun.adjoint_parameters] = gpar[:, lane]
            slope = dact
            if slope is None:
                slope = actuate(model, batch.pars[j], plan, slopes=True, full=batch.full)[1]
            np.add.at(by_par[j], chain, np.einsum("sa,sac->c", gact[:, :, lane], slope))
            by_x0[j] = gx0[:n0, lane]
            if nx > n0:
                _, slope_x, slope_par = batch.begin(j)
                by_par[j] += gx0[n0:, lane] @ slope_par
                by_x0[j] += gx0[n0:, lane] @ slope_x

    batch.each(work, threads)
    return states, by_par, by_x0
