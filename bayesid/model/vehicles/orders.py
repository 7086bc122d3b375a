"""Which actuators steer and drive a vehicle, and which of them one order moves together.

The order `delta_r_cmd` is that of the rudder, `delta_s_cmd` and `delta_b_cmd` those of the planes at stern
and bow, `n_cmd` that of the shaft. A vehicle without these may have named ones in their place: rudders or
planes that are alike but for the side they are on, fins of an X or a V, which are both, and shafts that push
ahead. These orders are then orders of all of them.
Takes: a `Vehicle`, and orders by channel. Does not: read logs, or turn a vehicle by its thrusters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from typing import Any

import numpy as np

from bayesid.model.actuators import UNLIMITED, Fin
from bayesid.model.propulsion import MODELS, propulsion_rows
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.words import and_list

NEAR_CENTRE = 0.05  # of the length, from which on a fin has an arm that turns the vehicle
# Fins of an X or a V: least ratio of the smaller to the larger share of their force, to the side and down.
DIAGONAL = 0.5
AHEAD = 0.98  # least share ahead of the direction of a thruster that turns by its place across alone


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


def obeyed(vehicle: Vehicle) -> tuple[str, ...]:
    """Of the orders "delta_r", "delta_s", "delta_b", "n" those that something of a vehicle obeys."""
    missing = missing_actuators(vehicle)
    if vehicle.actuators and not has_rows(vehicle, "db"):
        missing = missing | {"delta_b"}
    named = {name for name, columns in together(vehicle).items() if columns}
    return tuple(name for name in ("delta_r", "delta_s", "delta_b", "n") if name not in missing - named)


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
    the shaft before them), or a single one, and the fins of an X or a V; empty for a vehicle that has
    `delta_r`, and where several fins that are not alike could be meant.
    """
    if has_rudder(vehicle):
        return {}
    crossed = _crossed(vehicle)
    steer = [f for f in vehicle.fins if _sideways(f) and side_of(f, vehicle.L) and f not in crossed]
    return {fin.signals[0]: side_of(fin, vehicle.L) for fin in (*_alike(steer), *crossed)}


def planes_together(vehicle: Vehicle, bow: bool = False) -> dict[str, float]:
    """Named planes that `delta_s_cmd` orders: column -> 1, or -1 where a positive angle pushes down.

    As `rudders_together`, of fins that push up or down; none for a vehicle that has no depth.

    Parameters
    ----------
    bow : those before the centre, which `delta_b_cmd` orders
    """
    if vehicle.planar_only or not vehicle.actuators or has_rows(vehicle, "db" if bow else "ds"):
        return {}
    crossed = [fin for fin in _crossed(vehicle) if (fin.at[0] > 0.0) == bow]
    upright = [f for f in vehicle.fins if abs(f.direction[2]) > abs(f.direction[1]) and f not in crossed]
    ends = [f for f in upright if abs(f.at[0]) > NEAR_CENTRE * vehicle.L and (f.at[0] > 0.0) == bow]
    return {fin.signals[0]: -math.copysign(1.0, fin.direction[2]) for fin in (*_alike(ends), *crossed)}


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


def thrusters_turning(vehicle: Vehicle) -> dict[str, float]:
    """Speed of a thruster -> the side to which it turns a vehicle, 1 to port, -1 to starboard.

    Only of one that nothing else steers: no rudder, and thrusters that push straight ahead, on both sides;
    empty for any other.
    """
    fixed = [t for t in vehicle.thrusters if t.direction[0] > AHEAD and len(t.signals) == 1]
    if has_rudder(vehicle) or has_propeller(vehicle) or len(fixed) < len(vehicle.actuators):
        return {}
    sides = {t.signal: math.copysign(1.0, t.at[1]) for t in fixed if abs(t.at[1]) > 0.0}
    return sides if {1.0, -1.0} == set(sides.values()) else {}


def has_fins(vehicle: Vehicle, upright: bool = False) -> bool:
    """Whether a vehicle has any rudder, with `delta_r` or an order of its own.

    Parameters
    ----------
    upright : asked of planes in the place of rudders, at the stern or the bow
    """
    if upright:
        rows = has_rows(vehicle, "ds") or has_rows(vehicle, "db")
        return rows or any(abs(fin.direction[2]) > 0.0 for fin in vehicle.fins)
    return has_rudder(vehicle) or any(abs(fin.direction[1]) > 0.0 for fin in vehicle.fins)


def left_to_itself(vehicle: Vehicle, upright: bool = False) -> bool:
    """Whether stability of a straight run matters: a vehicle with fins, or with thrusters that push ahead
    alone. One without fins that is pushed sideways (up or down where `upright`), as an ROV, is held by that.
    """
    axis = 2 if upright else 1
    across = any(abs(thruster.direction[axis]) > NEAR_CENTRE for thruster in vehicle.thrusters)
    return has_fins(vehicle, upright) or not across


def rudder_limits(vehicle: Vehicle) -> tuple[float, float]:
    """Largest angle [rad] and rate [rad/s] of the rudder, named ones too; inf where the file states none."""
    together = rudders_together(vehicle)
    if not together:
        return vehicle.limits.get("delta_r", math.inf), vehicle.rates.get("delta_r", math.inf)
    fins = [fin for fin in vehicle.fins if fin.signals[0] in together]
    limits = (min(getattr(fin, key) for fin in fins) for key in ("max_deg", "rate_deg_s"))
    angle, rate = (math.inf if limit >= UNLIMITED else math.radians(limit) for limit in limits)
    return angle, rate


def has_planes(vehicle: Vehicle) -> bool:
    """Whether an order of stern planes, `delta_s_cmd`, moves anything: rows of `delta_s` or named planes."""
    return any(name.endswith("ds") for name in vehicle.coef) or bool(planes_together(vehicle))


def plane_limit(vehicle: Vehicle) -> float:
    """Largest angle [rad] of the stern planes, named ones too; inf where the file states none."""
    together = planes_together(vehicle)
    limits = [fin.max_deg for fin in vehicle.fins if fin.signals[0] in together]
    if not limits:
        return vehicle.limits.get("delta_s", math.inf)
    return math.inf if min(limits) >= UNLIMITED else math.radians(min(limits))


def spread(
    vehicle: Vehicle, orders: Mapping[str, Any], measured: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Orders with those of the named rudders, planes and shafts that a common order moves together.

    Parameters
    ----------
    orders : channel with `_cmd` -> number or (n,) array [rad, rpm]
    measured : positions by channel; the common order says nothing of what is ordered or measured by its own
        name

    Notes
    -----
    A fin of an X obeys the orders of rudder and planes, which add up.
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
                # from 0.0, so that there is no -0.0
                out[f"{name}_cmd"] = out.get(f"{name}_cmd", 0.0) + sign * orders[f"{common}_cmd"]
    return out


def gathered(vehicle: Vehicle, inputs: Mapping[str, Any], ending: str = "_cmd") -> dict[str, Any]:
    """Inputs with what the named rudders, planes and shafts of a vehicle do on average, as `delta_r`, `n` ...

    Parameters
    ----------
    inputs : channel -> number or (n,) array [rad, rpm]; `delta_r` positive to port
    ending : "_cmd" of orders, "" of measured positions
    """
    return gathered_by(together(vehicle), inputs, ending)


def gathered_by(
    common_orders: Mapping[str, Mapping[str, float]], inputs: Mapping[str, Any], ending: str = "_cmd"
) -> dict[str, Any]:
    """`gathered` of a vehicle whose `together` is at hand."""
    out = dict(inputs)
    planes = {*common_orders.get("delta_s", ()), *common_orders.get("delta_b", ())}
    shared = planes & set(common_orders.get("delta_r", ()))
    for common, signs in common_orders.items():
        there = [sign * inputs[name + ending] for name, sign in signs.items() if name + ending in inputs]
        apart = len(there) == len(signs) or not shared & set(signs)  # some fins of an X mix both orders
        if there and apart and common + ending not in inputs:
            out[common + ending] = np.mean(there, axis=0)
    return out


def own_orders(vehicle: Vehicle, orders: Mapping[str, Any]) -> dict[str, Any]:
    """Orders by the columns a vehicle has: named rudders, planes and shafts in place of the common orders,
    none that nothing obeys."""
    named, its = together(vehicle), obeyed(vehicle)
    common = {f"{n}_cmd" for n in ("delta_r", "delta_s", "delta_b", "n") if named.get(n) or n not in its}
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
    """Common order, "delta_r", "delta_s", "delta_b" or "n" -> the columns it moves, with signs; none without
    named actuators."""
    if not vehicle.actuators:
        return {}
    planes = {"delta_s": planes_together(vehicle), "delta_b": planes_together(vehicle, bow=True)}
    shafts = dict.fromkeys(shafts_together(vehicle), 1.0)
    return {"delta_r": rudders_together(vehicle), **planes, "n": shafts}


def _sideways(fin: Fin) -> bool:
    return abs(fin.direction[1]) > abs(fin.direction[2])


def _crossed(vehicle: Vehicle) -> list[Fin]:
    """Fins of an X or a V at one end: each steers and dives, and together rudder and planes are apart."""
    aslant = [
        fin for fin in vehicle.fins
        if side_of(fin, vehicle.L)
        and DIAGONAL * abs(fin.direction[1]) < abs(fin.direction[2]) < abs(fin.direction[1]) / DIAGONAL
    ]  # fmt: skip
    for end in (-1.0, 1.0):
        fins = [fin for fin in aslant if end * fin.at[0] > 0.0]
        ends = [fin.at[0] for fin in fins]
        apart = sum(side_of(fin, vehicle.L) * math.copysign(1.0, fin.direction[2]) for fin in fins)
        if len(fins) > 1 and max(ends) - min(ends) <= NEAR_CENTRE * vehicle.L and apart == 0.0:
            return fins
    return []


def _alike(fins: Sequence[Fin]) -> Sequence[Fin]:
    """The only two or more that are alike but for their side, or the only one; none where others could be
    meant."""
    groups: dict[tuple[object, ...], list[Fin]] = {}
    for fin in fins:
        (x, _, z), (ahead, aside, down) = fin.at, fin.direction
        direction = (ahead, abs(aside), abs(down))
        rest = replace(fin, name="", at=(x, 0.0, abs(z)), direction=direction, behind=None)
        groups.setdefault(astuple(rest), []).append(fin)
    several = [group for group in groups.values() if len(group) > 1]
    if len(several) == 1:
        return several[0]
    return fins if len(fins) == 1 else ()
