"""What a vehicle file lacks for which command.

Takes: a `Vehicle`. Gives sentences per command. Does not: judge the numbers that are there (`check`).
"""

from __future__ import annotations

import math

from bayesid.errors import VehicleError
from bayesid.model.propulsion import MODELS, propulsion_rows
from bayesid.model.vehicles.stability import usual_speed
from bayesid.model.vehicles.vehicle import ASSUMED_RELATIVE_SD, Vehicle
from bayesid.words import and_list, first_few

COMMANDS = ("simulate", "fit", "diagnose", "design")


def lacking(vehicle: Vehicle) -> dict[str, list[str]]:
    """Command -> what it misses, one sentence each; an empty list where nothing is missing."""
    found: dict[str, list[str]] = {command: [] for command in COMMANDS}
    coef, prior = vehicle.coef, vehicle.prior

    def say(text: str, *commands: str) -> None:
        for command in commands:
            found[command].append(text)

    if vehicle.rpm_ref is None:
        say(
            "no usual shaft speed: give rpm_ref in [propulsion], or manoeuvres with n=...",
            "simulate",
            "design",
        )
    try:
        usual_speed(vehicle)
    except VehicleError as error:
        if vehicle.rpm_ref is not None:
            say(str(error).partition(": ")[2], *COMMANDS)
    for axis, moment, fin, plane in (("Y", "N", "dr", "rudder"), ("Z", "M", "ds", "stern plane")):
        if (plane == "stern plane" and vehicle.planar_only) or not _has_rows(vehicle, fin):
            continue
        if not coef.get(f"{moment}_{fin}"):
            what = f"{moment}_{fin} is missing: the {plane} does not turn the vehicle"
            say(what, *(COMMANDS if plane == "rudder" else ("simulate", "design")))
        elif not coef.get(f"{axis}_{fin}"):
            say(f"{axis}_{fin} is missing: the {plane} gives a moment and no force", "simulate")
    sway = (
        ("Y_v", "Y_v0", "Y_v|v|", "Y_v,U", "Y_|u|v"),
        ("N_r", "N_r0", "N_r|r|", "N_|v|r", "N_r,U", "N_|u|r"),
    )
    for rows, word in zip(sway, ("sway", "yaw"), strict=True):
        if not any(coef.get(row) for row in rows) and vehicle.crossflow is None:
            say(f"none of {', '.join(rows)}: nothing damps {word}", "simulate", "fit", "diagnose")
    stated = set(prior.relative_sd) | set(prior.names) if prior is not None else set()
    without = [row for row in coef if row not in stated]
    if without:
        shown = first_few(without, 6)
        what = (
            f"no prior for {'any coefficient' if len(without) == len(coef) else shown}: "
            f"{100 * ASSUMED_RELATIVE_SD:.0f} % is assumed (--prior, or relative_sd in [prior])"
        )
        say(what, "fit", "diagnose", "design")
    if not has_rudder(vehicle):
        what = f"it {without_rudder(vehicle)}: order its actuators by tables of your own"
        say(f"{what}, design has none for them", "design")
        return found
    if not math.isfinite(vehicle.limits.get("delta_r", math.inf)):
        say(
            "no largest rudder angle: give dr_max_deg in [control], else 35 deg is taken",
            "design",
        )
    if not math.isfinite(vehicle.rates.get("delta_r", math.inf)):
        say("no rudder rate: give rate_deg_s in [control], else the rudder jumps", "simulate", "diagnose")
    return found


def has_rudder(vehicle: Vehicle) -> bool:
    """Whether `delta_r` turns it; one with actuators of its own has none unless its file gives rows of it."""
    return not vehicle.actuators or any(name.endswith("dr") for name in vehicle.coef)


def named_rudders(vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the fins of [actuators.NAME] that push sideways."""
    return tuple(fin.name for fin in vehicle.fins if abs(fin.direction[1]) > abs(fin.direction[2]))


def without_rudder(vehicle: Vehicle) -> str:
    """What a vehicle of which `has_rudder` is false has in its place; stands after its name."""
    names = named_rudders(vehicle)
    if not names:
        return "has no rudder"
    if len(names) == 1:
        return f"has no rudder delta_r, its rudder {names[0]} has orders of its own"
    return f"has no rudder delta_r, its rudders {and_list(names)} have orders of their own"


def has_propeller(vehicle: Vehicle) -> bool:
    """Whether any force of the file depends on the shaft speed n; thrusters have their own."""
    p = vehicle.propulsion
    rows = propulsion_rows(p.model, p.values, vehicle.rho, vehicle.L)
    return MODELS[p.model].rows is None or any(v for k, v in rows.items() if "n" in k[7:])


def missing_actuators(vehicle: Vehicle) -> set[str]:
    """Of "delta_r", "delta_s", "n", what a vehicle with actuators of its own does not have."""
    if not vehicle.actuators:
        return set()
    there = {"delta_r": has_rudder(vehicle), "delta_s": _has_rows(vehicle, "ds"), "n": has_propeller(vehicle)}
    return {name for name, has in there.items() if not has}


def _has_rows(vehicle: Vehicle, fin: str) -> bool:
    """Whether the file should hold rows of a fin: a rudder in a race has numbers, named ones need none."""
    mmg = vehicle.propulsion is not None and vehicle.propulsion.model == "mmg"
    return not (mmg and fin == "dr") and (
        not vehicle.actuators or any(name.endswith(fin) for name in vehicle.coef)
    )
