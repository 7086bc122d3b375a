"""What a vehicle file lacks for which command.

Takes: a `Vehicle`. Gives sentences per command. Does not: judge the numbers that are there (`check`).
"""

from __future__ import annotations

import math

from bayesid.errors import VehicleError
from bayesid.model.vehicles.orders import has_rows, rudder_limits, rudders_together, steers, without_rudder
from bayesid.model.vehicles.stability import usual_speed
from bayesid.model.vehicles.vehicle import ASSUMED_RELATIVE_SD, Vehicle
from bayesid.words import first_few

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
        if (plane == "stern plane" and vehicle.planar_only) or not has_rows(vehicle, fin):
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
    if not steers(vehicle):
        what = f"it {without_rudder(vehicle)}: order its actuators by tables of your own"
        say(f"{what}, design has none for them", "design")
        return found
    (angle, rate), named = rudder_limits(vehicle), rudders_together(vehicle)
    table = f"[actuators.{next(iter(named)).removeprefix('delta_')}]" if named else "[control]"
    if not math.isfinite(angle):
        key = "max_deg" if named else "dr_max_deg"
        say(f"no largest rudder angle: give {key} in {table}, else 35 deg is taken", "design")
    if not math.isfinite(rate):
        say(f"no rudder rate: give rate_deg_s in {table}, else the rudder jumps", "simulate", "diagnose")
    return found
