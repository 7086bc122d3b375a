"""Linear maps along one run: state to state and inputs to state over each sample interval, state to readings.

Takes a `Model`, parameters in SI and a `Plan`. Gives arrays a Kalman filter can use. Does not filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from bayesid.model import Model
from bayesid.simulate.plan import Plan
from bayesid.simulate.prepare import actuate, check_parameters, check_start, choose, inverse_mass, start
from bayesid.simulate.single import Track

Array = np.ndarray


def interval_maps(
    model: Model, par: Array, plan: Plan, x0: Array, inputs: Sequence[str], full: bool | None = None
) -> tuple[Array, Array]:
    """Derivatives of the state at the next sample by the state at this one and by inputs held between them.

    Parameters
    ----------
    inputs : names among the kernel's actuators and exogenous inputs

    Returns
    -------
    (n-1, nx, nx) and (n-1, nx, len(inputs)), inputs per SI unit (rpm for n)
    """
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    act, dact = actuate(model, par, plan, slopes=True, full=full)
    x, _, _ = start(fun, par, plan.exogenous[0], check_start(model, x0))
    nx, n = x.size, len(inputs)
    position = {name: nx + i for i, name in enumerate(inputs)}
    names = (*model.kernel.actuators, *model.kernel.exogenous)
    columns = np.array([position.get(name, -1) for name in names], dtype=np.int64)
    no_parameters = np.full(fun.entries.shape[0], -1, dtype=np.int64)
    no_chain = np.full(len(fun.act_columns), -1, dtype=np.int64)
    out, maps = np.empty((plan.steps.size + 1, nx)), np.empty((plan.steps.size, nx, nx + n))
    fun.transition(
        par, inverse_mass(model, fun, par[None])[0], x, plan.times, plan.steps, act, dact, plan.exogenous, fun.rows,
        fun.entries, no_parameters, no_chain, columns, n, out, maps,
    )  # fmt: skip
    return _compose(maps, plan.record, nx)


@njit(cache=True, nogil=True)
def _compose(maps: Array, record: Array, nx: int) -> tuple[Array, Array]:
    """Maps over sample intervals from maps over steps."""
    n, m = record.size - 1, maps.shape[2]
    phi, gamma = np.empty((n, nx, nx)), np.empty((n, nx, m - nx))
    for i in range(n):
        a, b = np.eye(nx), np.zeros((nx, m - nx))
        for s in range(record[i], record[i + 1]):
            f = np.ascontiguousarray(maps[s, :, :nx])
            a = f @ a
            b = f @ b + maps[s, :, nx:]
        phi[i], gamma[i] = a, b
    return phi, gamma


def reading_slopes(model: Model, par: Array, plan: Plan, track: Track) -> Array:
    """(n, channels, nx) derivative of every reading by the state at its sample (sensor delays left out)."""
    fun = model.kernel.full if track.full else model.kernel.bare
    n, nc = plan.t.size, len(model.kernel.channels)
    obs, dx = np.empty((n, nc)), np.zeros((n, nc, track.states.shape[1]))
    dpar = np.zeros((n, max(len(fun.sensor_entries), 1)))
    exo = plan.exogenous[np.minimum(plan.record, plan.steps.size - 1)]
    par = np.ascontiguousarray(par, dtype=float)
    fun.sense(np.ascontiguousarray(track.states), exo, plan.t - plan.t[0], par, True, obs, dx, dpar)
    return dx
