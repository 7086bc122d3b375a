"""Is a coefficient set physically sensible? Findings in words, from the numbers alone.

Takes: a `Vehicle`. Gives findings: "warning" for what no real vehicle does, "note" for what to know.
Does not: simulate; turning circles and zig-zags are judged where a simulator is at hand.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.propulsion import MODELS
from bayesid.model.terms.mmg import AIR, AREAS
from bayesid.model.vehicles.convention import munk_and_coriolis
from bayesid.model.vehicles.inertia import mass_problems
from bayesid.model.vehicles.orders import left_to_itself
from bayesid.model.vehicles.stability import Stability, self_propulsion_speed, stability
from bayesid.model.vehicles.units_check import added_mass_out_of_proportion, speed_far_from_stated
from bayesid.model.vehicles.vehicle import GRAVITY, Vehicle, coef_si
from bayesid.words import and_list

#: rows whose sign is known for any body that is damped, of inertia, or steered as the convention says
NEGATIVE = {
    "added mass": ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot"),
    "damping": (
        *(
            "X_u|u|",
            "X_uu",
            "X_u0",
            "Y_v",
            "Y_v|v|",
            "Y_v0",
            "Z_w",
            "Z_w|w|",
            "Z_w0",
            "K_p",
            "K_p|p|",
            "K_p0",
        ),
        *("M_q", "M_q|q|", "M_q0", "N_r", "N_r|r|", "N_r0", "N_|v|r", "M_|w|q"),
    ),
    "damping by the cube": ("Y_vvv", "Z_www", "K_ppp", "M_qqq", "N_rrr"),
    "resistance ahead": ("X_0,U",),
    "drag of a deflected fin": ("X_drdr", "X_dsds", "X_dbdb"),
    "yaw moment of a stern rudder, positive to port": ("N_dr",),
    "pitch moment of a stern plane, positive to bow down": ("M_ds",),
}
POSITIVE = {"thrust deduction": ("t_P",), "wake fraction at the propeller": ("w_P0",)}
#: rows that added mass alone would fix, apart from those that also hold lift and drag
POTENTIAL_TOLERANCE = 0.25
AREA_SHARE = "wind.area_coefficients"
VISCOUS = ("Y_v", "Y_r", "N_v", "N_r", "Z_w", "Z_q", "M_w", "M_q", "N_p", "Y_p", "K_p", "K_r", "K_v")
#: mass over rho L^3, from a racing shell (1.6e-4) to a solid cube (1), and radius of gyration over length,
#: which the built-in vehicles have between .24 and .34, and a body with all its mass at both ends at .5
SLENDER, SOLID = 1e-4, 1.0
GYRATION = (0.08, 0.7)
#: fin, its force and its moment, and the sign by which their ratio is its place x
FINS = (("rudder", "Y_dr", "N_dr", 1.0), ("stern planes", "Z_ds", "M_ds", -1.0))
SYMMETRIC = (("Y_rdot", "N_vdot"), ("Z_qdot", "M_wdot"), ("Y_pdot", "K_vdot"), ("K_rdot", "N_pdot"))


@dataclass(frozen=True)
class Finding:
    """One remark on a set: `level` "warning" or "note", a sentence, and the rows it is about.

    `by_sign` says that it holds only where the sign of each of these rows is told.
    """

    level: str
    text: str
    rows: tuple[str, ...] = ()
    by_sign: bool = False


def drives(row: str, value: float) -> bool:
    """Whether a row of damping has the sign with which it drives the motion it should damp."""
    return value > 0.0 and any(row in names for meaning, names in NEGATIVE.items() if "damping" in meaning)


def check_vehicle(vehicle: Vehicle) -> list[Finding]:
    """Findings on signs, inertia, stability, potential flow, propulsion and priors; may be empty."""
    found = [Finding("warning", text) for text in mass_problems(vehicle)]
    for part in (_size, _added_mass, _inertia, _signs, _fins, _propulsion, _weight, _air):
        found += part(vehicle)
    with suppress(VehicleError, np.linalg.LinAlgError):  # no speed or no mass matrix: said above
        found += _stability(stability(vehicle), vehicle)
    return found + _potential_flow(vehicle) + _prior(vehicle)


def _size(vehicle: Vehicle) -> list[Finding]:
    """Mass and moments of inertia against the length: a unit that is wrong shows by powers of ten."""
    v, found = vehicle, []
    share = v.mass / (v.rho * v.L**3)
    if not SLENDER < share < SOLID:
        text = f"mass = {v.mass:g} kg is {share:.3g} rho L^3 at L = {v.L:g} m"
        block = f"more than a solid block as wide as it is long ({v.rho * v.L**3:.3g} kg)"
        why = block if share >= SOLID else "less than the slenderest boat"
        found.append(Finding("warning", f"{text}, {why}; kg and m are wanted"))
        return found
    names = ("Izz",) if v.planar_only else ("Iyy", "Izz")
    for name in (n for n in names if getattr(v, n) > 0.0):  # else said below
        radius = (getattr(v, name) / v.mass) ** 0.5 / v.L
        if not GYRATION[0] < radius < GYRATION[1]:
            text = f"{name} = {getattr(v, name):g} kg m^2 is a radius of gyration of {radius:.3g} L"
            found.append(
                Finding(
                    "warning",
                    f"{text}; about 0.25 is usual, outside {GYRATION[0]:g} to {GYRATION[1]:g} hardly any",
                )
            )
    return found


def _added_mass(vehicle: Vehicle) -> list[Finding]:
    """Added mass that hardly any body has: numbers in other units than the file states."""
    found = added_mass_out_of_proportion(vehicle)
    return [] if found is None else [Finding("warning", *found)]


def _fins(vehicle: Vehicle) -> list[Finding]:
    """Where the moment of a fin over its force puts it: within the length, and behind the origin."""
    found, si = [], coef_si(vehicle)
    for fin, force, moment, sign in FINS:
        if not si.get(force) or not si.get(moment):
            continue
        x = sign * si[moment] / si[force]
        if not -vehicle.L < x < 0.0:
            where = "ahead of the origin" if x > 0.0 else "further behind than the vehicle is long"
            text = (
                f"{moment} over {force} puts the {fin} at x = {x:.3g} m, {where}; is a sign or a unit wrong?"
            )
            found.append(Finding("warning", text, (force, moment), by_sign=True))
    return found


def _inertia(vehicle: Vehicle) -> list[Finding]:
    v = vehicle
    if v.planar_only:
        return []
    offset = np.array(v.r_G)
    about_origin = np.array([[v.Ixx, -v.Ixy, -v.Ixz], [-v.Ixy, v.Iyy, -v.Iyz], [-v.Ixz, -v.Iyz, v.Izz]])
    about_G = about_origin - v.mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    low, middle, high = np.linalg.eigvalsh(about_G)
    if low <= 0.0 or low + middle < high * (1.0 - 1e-9):
        text = (
            f"principal inertias {low:.4g}, {middle:.4g}, {high:.4g} kg m^2 about G belong to no rigid body"
        )
        return [Finding("warning", f"{text}; the largest may not exceed the sum of the others")]
    return []


def _signs(vehicle: Vehicle) -> list[Finding]:
    found = []
    for rows, sign, has, wants in (
        (NEGATIVE, -1, "positive", "negative"),
        (POSITIVE, 1, "negative", "positive"),
    ):
        for meaning, names in rows.items():
            for name in names:
                if sign * (value := vehicle.coef.get(name, 0.0)) < 0.0:
                    text = f"{name} = {value:g} is {has}; {meaning} should be {wants}"
                    found.append(Finding("warning", text, (name,), by_sign=True))
    return found


def _propulsion(vehicle: Vehicle) -> list[Finding]:
    """Does the boat hold its own reference speed?"""
    found = _same_place(vehicle)
    p = vehicle.propulsion
    drag_rows = [name for name in ("X_uu", "X_u|u|", "X_u0") if vehicle.coef.get(name)]
    if MODELS[p.model].holds_drag and drag_rows:
        text = f"the {p.model} model holds the hull drag and {' and '.join(drag_rows)} adds it again"
        found.append(Finding("warning", text, tuple(drag_rows)))
    torque = next((name for name in ("Kq0", "Q_ref") if p.values.get(name)), None)
    if torque and vehicle.coef.get("K_*"):
        text = f"{torque} and K_* both state the propeller's heeling moment, which then counts twice"
        found.append(Finding("warning", text, ("K_*",)))
    if vehicle.rpm_ref is None:
        return [*found, Finding("note", "rpm_ref is missing, so no reference speed is known")]
    try:
        speed = self_propulsion_speed(vehicle, vehicle.rpm_ref)
    except VehicleError as error:
        return [*found, Finding("warning", str(error))]
    if p.model == "polynomial":
        stated = p.values["uc_per_rpm"] * vehicle.rpm_ref
        if abs(speed / stated - 1.0) > 0.01:
            text = f"runs at {speed:.4g} m/s at rpm_ref while u_c is {stated:.4g} m/s; a + b + c should be 0"
            found.append(Finding("warning", text))
    if text := speed_far_from_stated(vehicle, speed):
        found.append(Finding("warning", text))
    lengths = speed / vehicle.L
    if not 0.005 < lengths < 5.0:
        text = f"reference speed {speed:.4g} m/s is {lengths:.3g} lengths per second, outside 0.005 to 5"
        found.append(Finding("warning", text))
    return found


def _same_place(vehicle: Vehicle) -> list[Finding]:
    """Thrusters that push from one place in one direction: a table that was copied and not changed."""
    found, seen = [], dict[tuple[float, ...], str]()
    for one in vehicle.thrusters:
        key = (*one.at, *one.direction)
        if first := seen.get(key):
            text = f"thrusters {first} and {one.name} push from the same place in the same direction"
            found.append(Finding("warning", f"{text}: is the `at` of one a copy?"))
        seen.setdefault(key, one.name)
    return found


def _weight(vehicle: Vehicle) -> list[Finding]:
    found = []
    for name, value in (("W", vehicle.W), ("B", vehicle.B)):
        ratio = value / (vehicle.mass * GRAVITY)
        if abs(ratio - 1.0) > 0.05:
            found.append(Finding("warning", f"{name} = {value:g} N is {ratio:.3g} times m g"))
    if not vehicle.planar_only and vehicle.r_G[2] * vehicle.W <= vehicle.r_B[2] * vehicle.B:
        text = "the centre of gravity is not below that of buoyancy: the vehicle is unstable in roll at rest"
        found.append(Finding("warning", text, ()))
    return found


def _air(vehicle: Vehicle) -> list[Finding]:
    """What a file that states some of what the air pushes on leaves to be assumed."""
    missing = [name for name in AREAS if name not in vehicle.dimensions]
    if vehicle.areas_stated and any(vehicle.dimensions.get(name) == 0.0 for name in AREAS):
        return [Finding("warning", f"{and_list(AREAS)}: one is 0, where air pushes on the other")]
    if vehicle.areas_stated and AREA_SHARE in vehicle.effects:
        unread = f"{AREA_SHARE} of [effects] is read where no areas are stated: here `gain = 1` lets wind act"
        return [Finding("warning", unread)]
    if vehicle.areas_stated and missing:
        assumed = f"{missing[0]} = {AIR[missing[0]]:g}, of a loaded tanker, is assumed: it is not stated"
        return [Finding("note", assumed)]
    if (
        "air_centroid" in vehicle.dimensions
        and not vehicle.areas_stated
        and vehicle.propulsion.model != "mmg"
    ):
        return [Finding("note", f"air_centroid acts only beside {and_list(AREAS)}, which are not stated")]
    return []


def _stability(result: Stability, vehicle: Vehicle) -> list[Finding]:
    """None of a plane in which thrusters hold the vehicle, as an ROV."""
    found = []
    for name, index, plane in (("G_H", result.G_H, "horizontal"), ("G_V", result.G_V, "vertical")):
        if index is not None and index <= 0.0 and left_to_itself(vehicle, plane == "vertical"):
            text = (
                f"{name} = {index:.3f}: unstable in the {plane} plane without control, at {result.U:.3g} m/s"
            )
            found.append(Finding("note", text))
    growing = [value.real for value in result.vertical if value.real > 1e-9]
    if growing and left_to_itself(vehicle, upright=True):
        time = 1.0 / max(growing)
        text = f"with planes fixed depth motion grows e-fold in {time:.3g} L/U at {result.U:.3g} m/s"
        found.append(Finding("note", text))
    return found


def _potential_flow(vehicle: Vehicle) -> list[Finding]:
    """Rows that added mass alone fixes, and the symmetry of added mass."""
    found = []
    si = coef_si(vehicle)
    for first, second in SYMMETRIC:
        a, b = si.get(first, 0.0), si.get(second, 0.0)
        if abs(a - b) > POTENTIAL_TOLERANCE * max(abs(a), abs(b)):
            text = f"{first} and {second} differ (SI {a:.4g}, {b:.4g}); added mass should be symmetric"
            found.append(Finding("note", text, (first, second)))
    missing, different = [], []
    for name, value in munk_and_coriolis(si).items():
        if name in VISCOUS or (vehicle.planar_only and name not in ("X_vr", "X_rr")):
            continue
        if name not in vehicle.coef:
            missing.append(name)
        elif abs(si[name] - value) > POTENTIAL_TOLERANCE * max(abs(value), abs(si[name])):
            different.append(name)
    if missing:
        text = f"added mass brings {', '.join(missing)}; the set leaves them at 0, so energy is not kept"
        found.append(Finding("note", text, tuple(missing)))
    if different:
        verb = "differs" if len(different) == 1 else "differ"
        text = f"{', '.join(different)} {verb} by more than 25 % from what added mass alone would give"
        found.append(Finding("note", text, tuple(different)))
    return found


def _prior(vehicle: Vehicle) -> list[Finding]:
    prior = vehicle.prior
    if prior is None:
        return [Finding("note", "no [prior]: how well the coefficients are known is not stated")]
    without = [name for name in vehicle.coef if name not in prior.relative_sd and name not in prior.names]
    if without:
        return [Finding("note", f"no prior for {', '.join(without)}", tuple(without))]
    return []
