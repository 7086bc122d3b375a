"""Many parameter vectors of one run, sixteen at a time.

Takes parameter vectors in SI and a `Plan`. Gives states; a diverged vehicle gives non-finite rows, no error.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from bayesid.kernels import LANES
from bayesid.model import Model
from bayesid.simulate.plan import Plan
from bayesid.simulate.prepare import (
    NO_LANE_TRACE,
    actuate,
    check_parameters,
    check_start,
    choose,
    inverse_mass,
    start,
)

Array = np.ndarray

THREADED_FROM = 128


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
    pars = check_parameters(model, plan, np.atleast_2d(pars))
    fun = choose(model, pars, full)
    is_full = fun is model.kernel.full
    b, nx = pars.shape[0], len(fun.states)
    x0 = check_start(model, x0)
    starts = np.broadcast_to(x0, (b, x0.shape[-1]))
    out = np.empty((b, plan.t.size, nx))
    minv = inverse_mass(model, fun, pars)
    chain = list(fun.act_columns)
    common = None
    if b and np.all(pars[:, chain] == pars[0, chain]):
        common = np.repeat(actuate(model, pars[0], plan, full=is_full)[0][:, :, None], LANES, axis=2).ravel()

    def work(first: int) -> None:
        k = min(LANES, b - first)
        index = first + np.minimum(np.arange(LANES), k - 1)  # the last vector fills up the lanes
        lane_x = np.stack([start(fun, pars[j], plan.exogenous[0], starts[j])[0] for j in index], axis=1)
        act = common
        if act is None:
            act = np.stack([actuate(model, pars[j], plan, full=is_full)[0] for j in index], axis=2).ravel()
        flat = np.empty(plan.t.size * nx * LANES)
        fun.lanes(
            pars[index].T.ravel(), minv[index].T.ravel(), lane_x.ravel(), plan.times, plan.steps, act,
            plan.exogenous, plan.record, flat, NO_LANE_TRACE,
        )  # fmt: skip
        out[first : first + k] = flat.reshape(plan.t.size, nx, LANES)[:, :, :k].transpose(2, 0, 1)

    groups = range(0, b, LANES)
    if threads > 1 and b >= THREADED_FROM:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, groups))
    else:
        for first in groups:
            work(first)
    return out
