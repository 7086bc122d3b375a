"""The speed at which the propulsors of a vehicle, as ordered, balance its drag.

Takes a model, parameters and orders. Does not simulate a run.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.model.vehicles.orders import missing_actuators, spread
from bayesid.simulation.batch import simulate_batch
from bayesid.simulation.time_plan import plan_run

Array = np.ndarray
# Times a speed is halved in the search for the one at which thrust and drag balance.
MOST_HALVINGS = 40


def balanced_speed(model: Model, pars: Array, orders: Mapping[str, float], heading: float = 0.0) -> Array:
    """Speed at which each vehicle neither gains nor loses way, straight ahead, rudder amidships.

    Parameters
    ----------
    pars : (m, n_par) or (n_par,) parameters of the vehicles [SI]
    orders : channel -> orders of the propulsors, "n_cmd" [rpm], "n_port_cmd" [rpm], "azimuth_bow_cmd" [rad]
        ...; those of fins are left out, and what is not ordered stands still
    heading : [rad]

    Returns
    -------
    (m,) array                 [m/s]; 0 where nothing that is ordered pushes ahead or astern

    Raises
    ------
    ModelError
        if a vehicle has no such speed below three times the nominal one
    """
    pars = np.atleast_2d(pars)
    s = model.scales
    orders = _of_propulsors(model, orders)
    if not _pushes(model, orders):
        return np.zeros(len(pars))
    where = model.states.index("u")
    dt = 0.01 * s["L"] / s["U"]
    plan = plan_run(model, np.array([0.0, dt]), {name: np.full(2, value) for name, value in orders.items()})
    low, high = np.zeros(len(pars)), np.full(len(pars), 3.0 * s["U"] * max(1.0, _faster(model, orders)))

    def gains(u: Array) -> Array:
        x0 = np.zeros((len(pars), len(model.states)))
        x0[:, where], x0[:, model.states.index("psi")] = u, heading
        return simulate_batch(model, pars, plan, x0, threads=1)[:, 1, where] > u

    if gains(high).any() or not gains(low + 1e-3 * s["U"]).all():
        raise ModelError(
            f"{model.vehicle.name}: thrust and drag do not balance at {_words(orders)}; give a speed"
        )
    for _ in range(MOST_HALVINGS):
        middle = 0.5 * (low + high)
        up = gains(middle)
        low, high = np.where(up, middle, low), np.where(up, high, middle)
    return 0.5 * (low + high)


def _of_propulsors(model: Model, orders: Mapping[str, float]) -> dict[str, float]:
    """Orders of the propeller and of every named thruster of the vehicle."""
    signals = [signal for thruster in model.vehicle.thrusters for signal in thruster.signals]
    own = [] if "n" in missing_actuators(model.vehicle) else ["n"]
    names = [f"{signal}_cmd" for signal in (*own, *signals)]
    every = spread(model.vehicle, orders)
    return {name: float(every[name]) for name in names if name in every}


def _pushes(model: Model, orders: Mapping[str, float]) -> bool:
    """Whether a propulsor that turns pushes along the hull; one that is turned about may."""
    along = {
        f"{t.signal}_cmd" for t in model.vehicle.thrusters if t.direction[0] != 0.0 or len(t.signals) > 1
    } | {"n_cmd"}
    return any(orders.get(name) for name in along)


def _faster(model: Model, orders: Mapping[str, float]) -> float:
    usual = model.vehicle.rpm_ref
    turning = [abs(value) for name, value in orders.items() if name.startswith("n_")]
    return max(turning, default=0.0) / usual if usual else 1.0


def _words(orders: Mapping[str, float]) -> str:
    """Orders as they are typed; one number where all shafts turn alike."""
    turning = {n.removesuffix("_cmd"): v for n, v in orders.items() if n.startswith("n_")}
    if set(turning) == {"n"} or len(turning) > 1 == len(set(turning.values())):
        return f"{next(iter(turning.values())):g} rpm"
    return ", ".join(f"{name} = {value:g} rpm" for name, value in turning.items())
