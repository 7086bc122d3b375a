"""A complete vehicle from a data sheet: coefficients by published formulas, each with source and prior width.

Takes: a `Sheet`. Gives a `NewVehicle` in SI, Gertler-Hagen complete, rudder to port.
Does not: replace tests; the widths of [prior] say how far such estimates were off on vehicles with known
ones.
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.model.terms import TERMS
from bayesid.model.vehicles.convention import jacobian, munk_and_coriolis
from bayesid.model.vehicles.new.fins import CONTROLS, X_TAIL, add_fin, movable_fins
from bayesid.model.vehicles.new.hull import Hull, added_mass, body_lift, crossflow, resistance
from bayesid.model.vehicles.new.new_vehicle import NewVehicle
from bayesid.model.vehicles.new.parts import WIDEST, Parts
from bayesid.model.vehicles.new.sheet import Sheet
from bayesid.model.vehicles.vehicle import GRAVITY, CoefficientPrior, Propulsion, Vehicle

KIRCHHOFF = "added mass (Fossen 2021)"
#: what the comments of a file cite, said once at its head
REFERENCES = (
    "Lamb 1932: Hydrodynamics, art. 114, added mass of a spheroid (k1, k2, k')",
    "Newman 1977: Marine hydrodynamics, ch. 4, added mass by strips; times k2 or k' of the spheroid",
    "Blevins 1979: Formulas for natural frequency, in Prestero 2001: added mass of a finned section",
    "Hopkins 1951: NACA RM A51C14, slender-body lift kept to the station of separation; Munk moment within",
    "Whicker and Fehlner 1958: DTMB 933, lift slope and induced drag of control surfaces of low aspect ratio",
    "Hoerner 1965: Fluid-dynamic drag, ch. 3 (cross-flow), eq. 6-28 (form factor), ch. 13 (wake)",
    "ITTC 1957: friction line; Fossen 2021: added-mass Coriolis, sec. 8.1",
)
#: rows in which lift is at work; slender-body theory has the Munk moment in them already
LIFTING = ("Y_v", "Y_r", "N_v", "N_r", "Z_w", "Z_q", "M_w", "M_q", "K_p", "K_v", "K_r", "Y_p", "N_p")
WAKE, DEDUCTION = 0.2, 0.1  # of a single screw behind a torpedo; assumed, Allen et al. 2000 has 0.06 and 0.1


def estimate(sheet: Sheet) -> NewVehicle:
    """The vehicle of a data sheet."""
    hull, parts = sheet.hull, Parts()
    added_mass(hull, parts)
    body_lift(hull, parts)
    crossflow(hull, parts)
    for fin in sheet.fins:
        add_fin(fin, hull, parts)
    wet = sum(2.0 * fin.area * fin.count for fin in sheet.fins)
    resistance(hull, sheet.number("speed"), wet, sheet.number("allowance"), parts)
    for one, other in (("Y_rdot", "N_vdot"), ("Z_qdot", "M_wdot")):
        parts.of[other] = list(parts.of.get(one, []))
    for name, sign in (("Y_r", 1.0), ("Z_q", -1.0)):
        parts.add(name, sign * parts.value("X_udot"), 0.3, KIRCHHOFF)
    _coriolis(parts)
    coef = {row.name: float(f"{parts.value(row.name):.5g}") for row in TERMS if parts.of.get(row.name)}
    coef = {name: value for name, value in coef.items() if value != 0.0}
    propulsion, thrust_note = _propulsion(sheet, -coef["X_u|u|"])
    mass, displaced = sheet.number("mass"), sheet.number("displacement")
    inertia = _inertia(hull, mass)
    limit, plane = (math.radians(sheet.number(key)) for key in ("rudder_max_deg", "plane_max_deg"))
    rate = math.radians(sheet.values["rate_deg_s"] or math.inf) if sheet.values["rate_deg_s"] else math.inf
    of_each = sheet.number("rudder_max_deg"), sheet.values["rate_deg_s"]
    fins = tuple(one for fin in sheet.fins for one in movable_fins(fin, hull, *of_each))
    vehicle = Vehicle(
        name=sheet.name,
        source="estimated from a data sheet by `bayesid vehicle new`; formulas beside each coefficient",
        nondimensional=False, plain_abs=True, planar_only=False, rho=hull.rho, L=hull.length, mass=mass,
        Ixx=inertia[0], Iyy=inertia[1], Izz=inertia[2], Ixy=0.0, Ixz=0.0, Iyz=0.0,
        r_G=(0.0, 0.0, sheet.number("BG")), r_B=(0.0, 0.0, 0.0), W=mass * GRAVITY, B=displaced * GRAVITY,
        limits={"delta_r": limit, "delta_s": plane, "delta_b": plane if "X_dbdb" in coef else math.inf},
        rates=dict.fromkeys(("delta_r", "delta_s", "delta_b"), rate),
        propulsion=propulsion, crossflow=None, coef=coef, fins=fins,
        prior=CoefficientPrior({name: float(f"{parts.relative_sd(name):.2g}") for name in coef}),
        dimensions={"L_oa": hull.length, "diameter": hull.diameter},
    )  # fmt: skip
    notes = _notes(sheet, hull, parts, thrust_note)
    return NewVehicle(vehicle, _comments(parts, coef, hull), notes, REFERENCES)


def _coriolis(parts: Parts) -> None:
    """Rows that added mass brings with it, as well known as the added mass."""
    inertial = {name: parts.value(name) for name in parts.of if name.endswith("dot")}
    rows = {name: value for name, value in munk_and_coriolis(inertial).items() if name not in LIFTING}
    slopes = jacobian(munk_and_coriolis, list(inertial), list(rows))
    # N_vdot = Y_rdot and M_wdot = Z_qdot: one error each
    spread = np.array([0.0 if name in ("N_vdot", "M_wdot") else parts.sd(name) for name in inertial])
    slopes = slopes * np.array([2.0 if name in ("Y_rdot", "Z_qdot") else 1.0 for name in inertial])
    for (name, value), slope in zip(rows.items(), slopes, strict=True):
        parts.add(name, value, float(np.linalg.norm(slope * spread)) / abs(value), KIRCHHOFF)


def _inertia(hull: Hull, mass: float) -> tuple[float, float, float]:
    """(Ixx, Iyy, Izz) of mass spread evenly over the profile, about the origin."""
    area = hull.share**2
    share = area / hull.integral(area)
    along = hull.integral(share * hull.x**2)
    across_y = hull.integral(share * hull.share**2) * hull.breadth**2 / 16.0
    across_z = hull.integral(share * hull.share**2) * hull.height**2 / 16.0
    parts = (across_y + across_z, along + across_z, along + across_y)
    x, y, z = (float(f"{mass * part:.4g}") for part in parts)
    return x, y, z


def _propulsion(sheet: Sheet, drag: float) -> tuple[Propulsion, str]:
    """Thrust that balances drag u|u| at the design speed; a propeller of stated diameter by its pitch."""
    speed, rpm, diameter = sheet.number("speed"), sheet.number("rpm"), sheet.values["propeller_diameter"]
    wanted = drag * speed**2
    if diameter is None:
        return (
            Propulsion("thrust", {"T_ref": float(f"{wanted:.6g}"), "rpm_ref": rpm}),
            "no propeller diameter stated: thrust goes with rpm squared whatever the speed",
        )
    n = rpm / 60.0
    advance = speed * (1.0 - WAKE) / (n * diameter)
    loading = wanted / ((1.0 - DEDUCTION) * sheet.number("rho") * n**2 * diameter**4)
    ratios = np.linspace(0.2, 3.0, 2801)  # pitch over diameter
    give = (0.45 * ratios - 0.03) * (1.0 - advance / (1.1 * ratios))
    pitch = float(ratios[int(np.argmin(np.abs(give - loading)))])
    text = f"a pitch ratio of {pitch:.2f} gives the design speed at {rpm:g} rpm"
    if not 0.4 < pitch < 1.8:
        text += "; propellers have 0.5 to 1.6: check rpm, propeller_diameter and speed, or the resistance"
    start, zero = 0.45 * pitch - 0.03, 1.1 * pitch
    # the residue of the grid goes into the thrust at zero advance
    start *= loading / (start * (1.0 - advance / zero)) if 0.0 < advance < zero else 1.0
    start, zero = float(f"{start:.6g}"), float(f"{zero:.6g}")
    values = {"Kt0": start, "a": zero, "b": 1.0, "w": WAKE, "t": DEDUCTION, "D": diameter, "rpm_ref": rpm}
    return Propulsion("kt", values), text


def _comments(parts: Parts, coef: dict[str, float], hull: Hull) -> dict[tuple[str, str], str]:
    found = {("coef", name): parts.comment(name) for name in coef}
    found |= {
        ("vehicle", "r_G"): "m from the centre of buoyancy, which is the origin; z down",
        ("vehicle", "Ixx"): "kg m2, mass spread evenly over the hull; not known better than 20 %",
        ("vehicle", "L"): f"m; origin {hull.centre:.4g} m from the nose",
        ("vehicle", "W"): "N, of the mass",
        ("vehicle", "B"): "N, of the displacement",
        ("vehicle", "W_equals_B"): "W and B hold as they stand; true: trimmed, both of the mass",
        ("propulsion", "Kt0"): "K_T = Kt0 (1 - J/a), from a pitch ratio as of the Wageningen B series",
        ("propulsion", "w"): "assumed",
        ("propulsion", "t"): "assumed",
        (
            "prior",
            "relative_sd",
        ): "one sigma over |value|; errors of the formulas, parts taken as independent",
    }
    return found


def _notes(sheet: Sheet, hull: Hull, parts: Parts, thrust_note: str) -> tuple[str, ...]:
    notes = [f"Assumed: {text}." for text in sheet.assumed]
    if abs(hull.fit - 1.0) > 0.03:
        notes.append(
            f"The displacement is {hull.fit:.2f} times that of any profile with these ends; check length, "
            "diameter, nose_length, tail_length."
        )
    notes.append(f"Propulsion: {thrust_note}.")
    wide = [name for name in parts.of if parts.of[name] and parts.relative_sd(name) > 1.0]
    if wide:
        notes.append(
            f"Uncertain by more than their own size: {', '.join(wide)} (a width above 1 in [prior])."
        )
    if any(parts.relative_sd(name) > WIDEST for name in wide):
        notes.append(
            "Where parts cancel, even the sign is open; whether the vehicle is straight-line stable is too."
        )
    if any(fin.kind == X_TAIL for fin in sheet.fins):
        notes.append(
            "Fins 1 to 4 of the X tail: clockwise from the upper one on starboard, seen from behind; a "
            "positive angle of each pushes the stern to starboard, as a rudder to port does. Turn "
            "`direction` of those that your vehicle counts the other way."
        )
    if not any(fin.kind in (*CONTROLS, X_TAIL) and not fin.assumed for fin in sheet.fins):
        notes.append("How strong rudder and planes are is a guess: no movable fin is stated.")
    return tuple(notes)
