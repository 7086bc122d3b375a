"""Accelerations a model gives at stated states and actuator positions, and their slopes by parameters.

Takes a `Model`, parameters in SI and points of a path, which need not obey the equations. Gives arrays.
Does not integrate.
"""

from __future__ import annotations

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.simulation.prepare import inverse_mass, mass_matrices

Array = np.ndarray


def rates_on(
    model: Model, par: Array, states: Array, actuators: Array, free: Array
) -> tuple[Array, Array, Array]:
    """Rates of the bare model's velocities at each point on its own.

    Parameters
    ----------
    states : (n, nx) pose and velocity over ground, order of `model.states`; still water
    actuators : (n, na) positions, order of `model.kernel.actuators` [rad, rpm]
    free : (p,) positions of parameters

    Returns
    -------
    (n, nv) velocity rates, (n, nv, p) their slopes by the parameters, (nv, nv) mass matrix with added mass

    Raises
    ------
    ModelError
        if a rate is not finite; names the first point
    """
    fun = model.kernel.bare
    par = np.array(par, dtype=float, order="C")
    path = np.array(states, dtype=float, order="C")
    n, nx = path.shape
    p = len(free)
    column = {int(q): c for c, q in enumerate(free)}
    columns = np.array([column.get(int(q), -1) for q in fun.entries[:, 1]], dtype=np.int64)
    na, ne = actuators.shape[1], len(model.kernel.exogenous)
    none = np.full(len(fun.act_columns), -1, dtype=np.int64)
    width = max(p, 1)
    out, sens = np.empty((n, nx)), np.empty((n, nx, width))
    rate, slope = np.empty((n, nx)), np.empty((n, nx, width))
    # one step per point, too short to matter: the kernel records the rate at its start
    fun.variational(
        par, inverse_mass(model, fun, par[None])[0], path[0], np.zeros((nx, width)), np.zeros(n),
        np.full(n, 1e-9), np.hstack([actuators, np.zeros((n, na))]), np.zeros((1, 2 * na, none.size)),
        np.zeros((n, ne)), np.arange(n), fun.entries, columns, none, np.full(na + ne, -1, dtype=np.int64),
        path, out, sens, rate, slope,
    )  # fmt: skip
    moving = [model.states.index(name) for name in model.kernel.velocities]
    good = np.isfinite(rate).all(axis=1)
    if not good.all():
        raise ModelError(f"no finite acceleration at point {int(np.argmin(good))} of {n}; check the states")
    return rate[:, moving], slope[:, moving, :p], mass_matrices(model, fun, par[None])[0]
