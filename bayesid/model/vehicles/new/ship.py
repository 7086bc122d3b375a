"""A planar ship by the MMG method from its data sheet: published formulas, each with source and prior width.

Takes: a `ShipSheet`. Gives a `NewVehicle` in primes over L d, rudder to port.
Does not: replace captive tests; the widths of [prior] say how far such estimates were off on two tankers.
"""

from __future__ import annotations

import math
from dataclasses import replace

from bayesid.model.terms import TERMS
from bayesid.model.vehicles.new.hull import VISCOSITY
from bayesid.model.vehicles.new.new_vehicle import NewVehicle
from bayesid.model.vehicles.new.parts import WIDEST, Parts
from bayesid.model.vehicles.new.ship_sheet import ShipSheet
from bayesid.model.vehicles.stability import self_propulsion_speed
from bayesid.model.vehicles.vehicle import GRAVITY, CoefficientPrior, Propulsion, Vehicle

MOTORA, ZHOU = "Motora's charts as fitted by Zhou (1983)", "m_x of Zhou (1983)"
DATABASE = "Yoshimura and Masumoto 2012"
KIJIMA, FUJII, HIRANO = "Kijima 1990", "Fujii and Tuda 1961", "Hirano 1980"
RESISTANCE = "ITTC-57, form factor of Watanabe, wetted area of Mumford"
PITCH = "of the pitch ratio as of the Wageningen B series"
SHIP_REFERENCES = (
    "Yasukawa and Yoshimura 2015: the MMG standard method, J Mar Sci Technol 20, 37-52",
    "Yoshimura and Masumoto 2012: hydrodynamic database and manoeuvring prediction, MARSIM (hull, rudder)",
    "Motora 1959, as fitted by Zhou 1983: added mass and moment of inertia",
    "Kijima et al. 1990: manoeuvring performance with loading condition, J SNAJ 168 (a_H, x_H)",
    "Fujii and Tuda 1961: lift slope of a rudder; Hirano 1980: wake in a turn",
    "ITTC 1957: friction line; Taylor: wake 0.5 C_b - 0.05, thrust deduction 0.6 of it",
)
#: roughness and appendages over a smooth hull; places of propeller and rudder over L; slowest and fastest
#: shaft speed searched [rpm]
ALLOWANCE, AT_STERN, RPM_RANGE = 1.15, -0.5, (0.1, 1e5)
IN_TURN = 4.0  # exponent of the wake in a turn over beta_P^2
# logarithm of thrust over resistance from which the speed is not held, and the wake has no more to give
NOT_HELD, NOT_SHARED = 0.02, 0.01
MOST_MISSING = 2.5  # factor of the thrust from which rpm, pitch or speed is taken to be wrong


def estimate_ship(sheet: ShipSheet) -> NewVehicle:
    """The ship of a data sheet."""
    parts = Parts()
    _added_mass(sheet, parts)
    _hull(sheet, parts)
    _resistance(sheet, parts)
    _stern(sheet, parts)
    note = _propeller(sheet, parts)
    coef = {row.name: float(f"{parts.value(row.name):.4g}") for row in TERMS if parts.of.get(row.name)}
    coef = {name: value for name, value in coef.items() if value != 0.0}
    length, mass, x_G = (sheet.number(key) for key in ("length", "mass", "x_G"))
    rate = sheet.values["rate_deg_s"]
    propulsion = {
        "D_P": sheet.number("propeller_diameter"), "H_R": sheet.number("rudder_span"),
        "A_R": sheet.number("rudder_area"), "x_R": AT_STERN, "rpm_ref": sheet.values["rpm"] or 1.0,
    }  # fmt: skip
    vehicle = Vehicle(
        name=sheet.name,
        source="estimated from a ship's data sheet by `bayesid vehicle new`; formulas beside each row",
        nondimensional=True, plain_abs=False, planar_only=True, rho=sheet.number("rho"), L=length,
        mass=mass, Ixx=0.0, Iyy=0.0, Izz=float(f"{mass * (sheet.number('k_zz') ** 2 + x_G**2):.5g}"),
        Ixy=0.0, Ixz=0.0, Iyz=0.0, r_G=(x_G, 0.0, 0.0), r_B=(x_G, 0.0, 0.0), W=mass * GRAVITY,
        B=mass * GRAVITY,
        limits={"delta_r": math.radians(sheet.number("rudder_max_deg")), "delta_s": math.inf,
                "delta_b": math.inf},
        rates=dict.fromkeys(("delta_r", "delta_s", "delta_b"), math.radians(rate) if rate else math.inf),
        propulsion=Propulsion("mmg", propulsion), crossflow=None, coef=coef,
        prior=CoefficientPrior({name: float(f"{parts.relative_sd(name):.2g}") for name in coef}),
        U_ref=sheet.number("speed"), dimensions=_dimensions(sheet),
    )  # fmt: skip
    if sheet.values["rpm"] is None:
        rpm = _balanced_rpm(vehicle, sheet.number("speed"))
        vehicle.propulsion.values["rpm_ref"] = float(f"{rpm:.4g}")
        note = f"{note}; {rpm:.0f} rpm hold the design speed"
    return NewVehicle(vehicle, _comments(parts, coef), _notes(sheet, parts, note), SHIP_REFERENCES)


def _dimensions(sheet: ShipSheet) -> dict[str, float]:
    out = {"prime_draught": sheet.number("draught")}
    for key, area in (("air_front", "air_front_area"), ("air_side", "air_side_area")):
        if (value := sheet.values[area]) is not None:
            out[key] = float(f"{value / sheet.number('length') ** 2:.4g}")
    return out


def _ratios(sheet: ShipSheet) -> tuple[float, float, float, float, float]:
    """(Lpp/B, T/B, 2 T/Lpp, C_b, C_b B/Lpp)."""
    length, breadth, draught = (sheet.number(key) for key in ("length", "breadth", "draught"))
    block = sheet.block
    return length / breadth, draught / breadth, 2.0 * draught / length, block, block * breadth / length


def _prime_mass(sheet: ShipSheet) -> float:
    """Mass over 1/2 rho L^2 d."""
    length, draught = sheet.number("length"), sheet.number("draught")
    return sheet.number("mass") / (0.5 * sheet.number("rho") * length**2 * draught)


def _added_mass(sheet: ShipSheet, parts: Parts) -> None:
    slender, flat, _, block, _ = _ratios(sheet)
    mass, deep = _prime_mass(sheet), flat * slender
    ahead = 0.01 * (
        0.398 + 11.97 * block * (1 + 3.73 * flat) - 2.89 * block * slender * (1 + 1.13 * flat)
        + 0.175 * block * slender**2 * (1 + 0.541 * flat) - 1.107 * slender * flat
    )  # fmt: skip
    across = (
        0.882 - 0.54 * block * (1 - 1.6 * flat) - 0.156 * (1 - 0.673 * block) * slender
        + 0.826 * deep * (1 - 0.678 * flat) - 0.638 * block * deep * (1 - 0.669 * flat)
    )  # fmt: skip
    radius = 0.01 * (33 - 76.85 * block * (1 - 0.784 * block) + 3.43 * slender * (1 - 0.63 * block))
    # outside the charts the polynomials run away
    ahead, across, radius = (
        min(max(ahead, 0.02), 0.15),
        min(max(across, 0.4), 1.3),
        min(max(radius, 0.12), 0.3),
    )
    parts.add("X_udot", -ahead * mass, 0.4, ZHOU)
    parts.add("Y_vdot", -across * mass, 0.15, MOTORA)
    parts.add("N_rdot", -(radius**2) * mass, 0.25, MOTORA)


def _hull(sheet: ShipSheet, parts: Parts) -> None:
    """Rows over U; widths [prime] are about how far published sets of two tankers lie from the formulas."""
    slender, _, aspect, block, full = _ratios(sheet)
    m_x, m_y = -parts.value("X_udot"), -parts.value("Y_vdot")
    x_G = sheet.number("x_G") / sheet.number("length")
    rows = {
        "X_vv": (1.15 * full - 0.18, 0.04),
        # X_beta r - m_y' of the database: beta = -v, and the rigid-body side of the equations has m v r alone
        "X_vr": (1.91 * full - 0.08, 0.1),
        "X_rr": (-0.085 * full + 0.008 - x_G * m_y, 0.02),
        "X_vvvv,U": (1.1 - 6.68 * full, 0.5),
        "Y_v,U": (-(0.5 * math.pi * aspect + 1.4 * full), 0.07),
        "Y_r,U": (m_x + 0.5 * full, 0.03),
        "Y_vvv,U": (-(0.185 * slender + 0.48), 0.5),
        "Y_vvr,U": (-0.75, 1.0),
        "Y_vrr,U": (-(0.26 * (1 - block) * slender + 0.11), 0.25),
        "Y_rrr,U": (-0.051, 0.05),
        "N_v,U": (-aspect, 0.02),
        "N_r,U": (-0.54 * aspect + aspect**2, 0.008),
        "N_vvv,U": (0.69 * block - 0.66, 0.1),
        "N_vvr,U": (1.55 * full - 0.76, 0.25),
        "N_vrr,U": (0.098 - 0.075 * (1 - block) * slender, 0.06),
        "N_rrr,U": (0.25 * full - 0.056, 0.01),
    }
    for name, (value, sd) in rows.items():
        parts.add(name, value, sd / abs(value), DATABASE)
    parts.add("Y_r", -m_x, 0.4, "-m_x'")


def _resistance(sheet: ShipSheet, parts: Parts) -> None:
    slender, flat, _, block, _ = _ratios(sheet)
    length, draught = sheet.number("length"), sheet.number("draught")
    reynolds = max(sheet.number("speed") * length / VISCOSITY, 1e5)
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    form = 1.0 + max(25.6 * block * slender**-2 * math.sqrt(flat) - 0.095, 0.05)
    wetted = 1.7 * length * draught + sheet.number("displacement_volume") / draught
    value = -ALLOWANCE * form * friction * wetted / (length * draught)
    parts.add("X_0,U", value, 0.25, f"{RESISTANCE}, times {ALLOWANCE:g} for what sticks out")


def _stern(sheet: ShipSheet, parts: Parts) -> None:
    """Propeller and rudder behind the hull."""
    _, _, _, block, full = _ratios(sheet)
    wake = 0.5 * block - 0.05
    ratio = sheet.number("rudder_span") ** 2 / sheet.number("rudder_area")
    numbers = {
        "w_P0": (wake, 0.35, "Taylor"),
        "t_P": (0.6 * wake, 0.25, "Taylor"),
        "x_P": (AT_STERN, 0.3, "place of the propeller"),
        "c_P": (IN_TURN * wake, 0.6, f"{HIRANO}: w_P = w_P0 exp(-4 beta_P^2), to second order"),
        "kappa": (0.5, 0.25, "assumed"),
        "epsilon": (1.05, 0.2, "assumed; 0.9 to 1.3 in published sets"),
        "f_alpha": (6.13 * ratio / (2.25 + ratio), 0.12, FUJII),
        "gamma_plus": (2.06 * full + 0.14, 0.35, DATABASE),
        "gamma_minus": (2.06 * full + 0.14, 0.35, DATABASE),
        "l_R": (-0.9, 0.25, DATABASE),
        "t_R": (0.39, 0.4, DATABASE),
        "a_H": (max(0.627 * block - 0.153, 0.05), 0.3, f"{KIJIMA}, line of his diagram"),
        "x_H": (-0.45, 0.2, KIJIMA),
    }
    for name, (value, sd, source) in numbers.items():
        parts.add(name, value, sd, source)


def _propeller(sheet: ShipSheet, parts: Parts) -> str:
    """K_T of the propeller. Where rpm alone is stated its pitch holds the design speed; where pitch is too,
    resistance and wake share what is missing to it.
    """
    pitch, rpm = sheet.values["pitch_ratio"], sheet.values["rpm"]
    told = ""
    if rpm is not None and pitch is None:
        ratios = [0.3 + 0.001 * k for k in range(1701)]
        pitch = min(ratios, key=lambda p: abs(math.log(_held(sheet, parts, p, rpm))))
        if abs(math.log(_held(sheet, parts, pitch, rpm))) < NOT_HELD:
            told = f"a pitch ratio of {pitch:.2f} holds the design speed at {rpm:g} rpm"
        else:
            told = (
                f"no pitch ratio from {ratios[0]:g} to {ratios[-1]:g} holds the design speed at {rpm:g} rpm, "
                f"{pitch:.2f} is nearest: check rpm, propeller_diameter and speed; the speed is not held"
            )
    elif rpm is not None and pitch is not None:
        told = _shared(sheet, parts, pitch, rpm)
    assert pitch is not None
    start = 0.45 * pitch - 0.03
    parts.add("k_0", start, 0.12, f"K_T {PITCH}")
    parts.add("k_1", -start / (1.1 * pitch), 0.25, f"slope of K_T {PITCH}")
    return told or f"pitch ratio {pitch:.2f}"


def _held(sheet: ShipSheet, parts: Parts, pitch: float, rpm: float) -> float:
    """Thrust less deduction over resistance at the design speed; next to 0 for a propeller that brakes."""
    speed, diameter, n = sheet.number("speed"), sheet.number("propeller_diameter"), rpm / 60.0
    area = 0.5 * sheet.number("length") * sheet.number("draught")
    advance = speed * (1.0 - parts.value("w_P0")) / (n * diameter)
    thrust = (1.0 - parts.value("t_P")) * n**2 * diameter**4 * _thrust(pitch, advance)
    return max(thrust / (-parts.value("X_0,U") * area * speed**2), 1e-3)


def _shared(sheet: ShipSheet, parts: Parts, pitch: float, rpm: float) -> str:
    """Half of the logarithm of what is missing to the design speed goes to the resistance, the rest to the
    wake: neither formula is known better than the other.
    """
    ratio = _held(sheet, parts, pitch, rpm)
    if not 1.0 / MOST_MISSING < ratio < MOST_MISSING:
        return (
            f"at {rpm:g} rpm the propeller would overcome {ratio:.2f} times the resistance of the formulas: "
            "check rpm, pitch_ratio, propeller_diameter and speed; the design speed is not held"
        )
    source = f"and the propeller at {rpm:g} rpm, half each"
    drag = parts.of.pop("X_0,U")[0]
    parts.add("X_0,U", drag.value * math.sqrt(ratio), 0.2, f"{drag.source} {source}")
    usual = parts.of.pop("w_P0")[0]

    def missing(wake: float) -> float:
        parts.of["w_P0"] = [replace(usual, value=wake)]
        return abs(math.log(_held(sheet, parts, pitch, rpm)))

    wake = min((0.05 + 0.001 * k for k in range(701)), key=missing)
    share = f"half to the wake ({wake:.2f})"
    if missing(wake) > NOT_SHARED:
        parts.add("X_0,U", parts.value("X_0,U") * (_held(sheet, parts, pitch, rpm) - 1.0), 0.0, source)
        share = f"to the wake what it has ({wake:.2f}), the rest to the resistance again"
    parts.of["w_P0"] = [replace(usual, value=wake, source=f"{usual.source} {source}")]
    parts.of["c_P"] = [replace(row, value=IN_TURN * wake) for row in parts.of["c_P"]]
    return (
        f"at {rpm:g} rpm and the design speed the propeller overcomes {ratio:.2f} times the resistance of "
        f"the formulas; half of what is missing is given to the resistance, {share}"
    )


def _thrust(pitch: float, advance: float) -> float:
    """K_T of a pitch ratio at an advance ratio."""
    return (0.45 * pitch - 0.03) * (1.0 - advance / (1.1 * pitch))


def _balanced_rpm(vehicle: Vehicle, speed: float) -> float:
    """Shaft speed [rpm] at which the ship runs straight at this speed [m/s]."""
    low, high = (math.log(x) for x in RPM_RANGE)
    for _ in range(60):
        middle = 0.5 * (low + high)
        slower = self_propulsion_speed(vehicle, math.exp(middle)) < speed
        low, high = (middle, high) if slower else (low, middle)
    return math.exp(0.5 * (low + high))


def _comments(parts: Parts, coef: dict[str, float]) -> dict[tuple[str, str], str]:
    found = {("coef", name): parts.comment(name) for name in coef}
    return found | {
        ("vehicle", "r_G"): "m from midship, which is the origin",
        ("vehicle", "Izz"): "kg m2, about midship: m (k_zz^2 + x_G^2)",
        ("vehicle", "L"): "m between perpendiculars",
        (
            "prior",
            "relative_sd",
        ): "one sigma over |value|: how far two published tankers lie from the formulas",
    }


def _notes(sheet: ShipSheet, parts: Parts, propeller: str) -> tuple[str, ...]:
    notes = [f"Assumed: {text}." for text in sheet.assumed]
    notes.append(f"Propulsion: {propeller}.")
    wide = [name for name in parts.of if parts.relative_sd(name) > 1.0]
    if wide:
        notes.append(
            f"Uncertain by more than their own size: {', '.join(wide)} (a width above 1 in [prior])."
        )
    if any(parts.relative_sd(name) > WIDEST for name in wide):
        notes.append("Where parts cancel, even the sign is open.")
    notes.append(
        "Whether a full ship is stable on course is decided by small differences: a fit to one zig-zag moves "
        "more than these formulas know."
    )
    return tuple(notes)
