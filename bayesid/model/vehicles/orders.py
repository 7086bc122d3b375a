"""Which actuators steer and drive a vehicle, and which of them one order moves together.

The order `delta_r_cmd` is that of the rudder, `n_cmd` that of the shaft. A vehicle without these two may have
named ones in their place: rudders that are alike but for the side they are on, and shafts that push ahead.
The two orders are then orders of all of these.
Takes: a `Vehicle`, and orders by channel. Does not: read logs, or turn a vehicle by its thrusters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import astuple, replace
from typing import Any

import numpy as np

from bayesid.model.actuators import UNLIMITED, Fin
from bayesid.model.propulsion import MODELS, propulsion_rows
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.words import and_list

NEAR_CENTRE = 0.05  # of the length, from which on a fin has an arm that turns the vehicle


def has_rudder(vehicle: Vehicle) -> bool:
    """Whether `delta_r` turns it; one with actuators of its own has none unless its file gives rows of it."""
    return not vehicle.actuators or any(name.endswith("dr") for name in vehicle.coef)


def has_rows(vehicle: Vehicle, fin: str) -> bool:
    """Whether the file should hold rows of a fin: a rudder in a race has numbers, named ones need none."""
    mmg = vehicle.propulsion is not None and vehicle.propulsion.model == "mmg"
    return not (mmg and fin == "dr") and (
        not vehicle.actuators or any(name.endswith(fin) for name in vehicle.coef)
    )


def has_propeller(vehicle: Vehicle) -> bool:
    """Whether any force of the file depends on the shaft speed n; thrusters have their own."""
    p = vehicle.propulsion
    rows = propulsion_rows(p.model, p.values, vehicle.rho, vehicle.L)
    return MODELS[p.model].rows is None or any(v for k, v in rows.items() if "n" in k[7:])


def missing_actuators(vehicle: Vehicle) -> set[str]:
    """Of "delta_r", "delta_s", "n", what a vehicle with actuators of its own does not have."""
    if not vehicle.actuators:
        return set()
    there = {"delta_r": has_rudder(vehicle), "delta_s": has_rows(vehicle, "ds"), "n": has_propeller(vehicle)}
    return {name for name, has in there.items() if not has}


def named_rudders(vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the fins of [actuators.NAME] that push sideways."""
    return tuple(fin.name for fin in vehicle.fins if _sideways(fin))


def side_of(fin: Fin, length: float) -> float:
    """What makes a positive angle of a fin one of `delta_r`, to port: 1, -1 if it turns the other way.

    0 for a fin within `NEAR_CENTRE` of the vehicle's length [m], which hardly turns it.
    """
    arm = fin.at[0] * fin.direction[1]
    return 0.0 if abs(arm) <= NEAR_CENTRE * length else -math.copysign(1.0, arm)


def rudders_together(vehicle: Vehicle) -> dict[str, float]:
    """Named rudders that `delta_r_cmd` orders: column -> 1, or -1 where a positive angle turns to starboard.

    Two or more fins that push sideways, off the centre, and are alike but for the side they are on (and for
    the shaft before them), or a single one; empty for a vehicle that has `delta_r`, and where several fins
    that are not alike could be meant.
    """
    if has_rudder(vehicle):
        return {}
    steer = [fin for fin in vehicle.fins if _sideways(fin) and side_of(fin, vehicle.L)]
    alike: dict[tuple[object, ...], list[Fin]] = {}
    for fin in steer:
        (x, _, z), (ahead, aside, down) = fin.at, fin.direction
        direction = (ahead, abs(aside), abs(down))
        rest = replace(fin, name="", at=(x, 0.0, z), direction=direction, behind=None)
        alike.setdefault(astuple(rest), []).append(fin)
    several = [fins for fins in alike.values() if len(fins) > 1]
    chosen = several[0] if len(several) == 1 else steer if len(steer) == 1 else []
    return {fin.signals[0]: side_of(fin, vehicle.L) for fin in chosen}


def shafts_together(vehicle: Vehicle) -> tuple[str, ...]:
    """Columns of the named shafts that `n_cmd` orders: those that push ahead, of a vehicle without `n`.

    One that turns round (azimuth, nozzle, bucket) is none of them beside shafts that do not.
    """
    if not vehicle.thrusters or has_propeller(vehicle):
        return ()
    fixed = [thruster for thruster in vehicle.main_shafts if len(thruster.signals) == 1]
    return tuple(thruster.signal for thruster in fixed or vehicle.main_shafts)


def steers(vehicle: Vehicle) -> bool:
    """Whether an order of the rudder, `delta_r_cmd`, turns it, by `delta_r` or by named rudders."""
    return has_rudder(vehicle) or bool(rudders_together(vehicle))


def rudder_limits(vehicle: Vehicle) -> tuple[float, float]:
    """Largest angle [rad] and rate [rad/s] of the rudder, named ones too; inf where the file states none."""
    together = rudders_together(vehicle)
    if not together:
        return vehicle.limits.get("delta_r", math.inf), vehicle.rates.get("delta_r", math.inf)
    fins = [fin for fin in vehicle.fins if fin.signals[0] in together]
    limits = (min(getattr(fin, key) for fin in fins) for key in ("max_deg", "rate_deg_s"))
    angle, rate = (math.inf if limit >= UNLIMITED else math.radians(limit) for limit in limits)
    return angle, rate


def spread(
    vehicle: Vehicle, orders: Mapping[str, Any], measured: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Orders with those of the named rudders and shafts that `delta_r_cmd` and `n_cmd` move together.

    Parameters
    ----------
    orders : channel with `_cmd` -> number or (n,) array [rad, rpm]
    measured : positions by channel; the common order says nothing of what is ordered or measured by its own
        name
    """
    return spread_by(together(vehicle), orders, measured)


def spread_by(
    common_orders: Mapping[str, Mapping[str, float]],
    orders: Mapping[str, Any],
    measured: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """`spread` of a vehicle whose `together` is at hand: for orders given step by step."""
    out = dict(orders)
    for common, signs in common_orders.items():
        for name, sign in signs.items():
            if f"{common}_cmd" in orders and f"{name}_cmd" not in orders and name not in (measured or {}):
                out[f"{name}_cmd"] = sign * orders[f"{common}_cmd"] + 0.0  # 0.0 in place of -0.0
    return out


def gathered(vehicle: Vehicle, inputs: Mapping[str, Any], ending: str = "_cmd") -> dict[str, Any]:
    """Inputs with what the named rudders and shafts of a vehicle do on average, as `delta_r` and `n`.

    Parameters
    ----------
    inputs : channel -> number or (n,) array [rad, rpm]; `delta_r` positive to port
    ending : "_cmd" of orders, "" of measured positions
    """
    out = dict(inputs)
    for common, signs in together(vehicle).items():
        there = [sign * inputs[name + ending] for name, sign in signs.items() if name + ending in inputs]
        if there and common + ending not in inputs:
            out[common + ending] = np.mean(there, axis=0)
    return out


def own_orders(vehicle: Vehicle, orders: Mapping[str, Any]) -> dict[str, Any]:
    """Orders by the columns a vehicle has: named rudders and shafts in place of `delta_r_cmd` and `n_cmd`."""
    common = {f"{name}_cmd" for name, signs in together(vehicle).items() if signs}
    return {name: values for name, values in spread(vehicle, orders).items() if name not in common}


def without_rudder(vehicle: Vehicle) -> str:
    """What a vehicle of which `steers` is false has in its place; stands after its name."""
    names = named_rudders(vehicle)
    if not names:
        return "has no rudder"
    turning = [fin.name for fin in vehicle.fins if fin.name in names and side_of(fin, vehicle.L)]
    if not turning:
        its = f"its rudder {names[0]} hardly turns" if len(names) == 1 else "its rudders hardly turn"
        return f"has no rudder delta_r, {its} it"
    return (
        f"has no rudder delta_r, its rudders {and_list(names)} are not all alike and have orders of their own"
    )


def together(vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """Common order, "delta_r" or "n" -> the columns it moves, with signs; none without named actuators."""
    if not vehicle.actuators:
        return {}
    return {"delta_r": rudders_together(vehicle), "n": dict.fromkeys(shafts_together(vehicle), 1.0)}


def _sideways(fin: Fin) -> bool:
    return abs(fin.direction[1]) > abs(fin.direction[2])
