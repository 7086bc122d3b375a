"""The Python Vehicle Simulator (Fossen): a torpedo-shaped vehicle from the parameters of its class.

Takes: the attributes of such a class, exported as JSON or TOML. Gives a `Stated`. Does not: run it.

Its equations (class remus100): Lamb's added mass without the Munk moment in yaw, linear damping by time
constants, lift and drag of the hull in the vertical plane only, cross-flow drag of strips in the horizontal
plane only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.vehicles.new.hull import lamb
from bayesid.model.vehicles.new.simulator_build import Stated
from bayesid.model.vehicles.vehicle import Crossflow, Propulsion

#: numbers that stand inside the methods of remus100 and are no attributes
INSIDE = {"D_prop": 0.14, "t_prop": 0.1, "KT_0": 0.4566, "KT_max": 0.1798, "Ja_max": 0.6632, "wake": 0.056}
CYLINDER = 1.1976  # 2-D cross-flow drag coefficient at B/2T = 0.5 of its Hoerner table
OSWALD = 0.7
EXPORT = (
    'python -c "import json, numpy as np; from python_vehicle_simulator.vehicles import remus100; '
    "print(json.dumps({k: np.asarray(v).tolist() for k, v in vars(remus100()).items() "
    'if not isinstance(v, str)}, default=str))" > remus100.json'
)


def read_python_simulator(tree: Mapping[str, Any], name: str) -> Stated:
    """What the class states, at its largest shaft speed.

    Raises
    ------
    VehicleError
        if an attribute is missing or no number
    """

    def number(key: str, default: float | None = None) -> float:
        value = tree.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise VehicleError(f"{name}: {key} is {value!r}; export the attributes of the class: {EXPORT}")
        return float(value)

    length, diameter, rho = number("L"), number("diam"), number("rho", 1026.0)
    a, b = 0.5 * length, 0.5 * diameter
    mass = 4.0 / 3.0 * math.pi * rho * a * b**2
    inertia = (0.4 * mass * b**2, 0.2 * mass * (a**2 + b**2))
    if "MRB" in tree:
        matrix = np.array(tree["MRB"], dtype=float)
        mass = float(matrix[0, 0])
    k1, k2, k_r = lamb(length, diameter)
    added = np.diag([k1 * mass, k2 * mass, k2 * mass, 0.3 * inertia[0], k_r * inertia[1], k_r * inertia[1]])
    if "MA" in tree:
        added = np.array(tree["MA"], dtype=float)
    r_G = tuple(float(v) for v in tree.get("r_bg", (0.0, 0.0, 0.02)))
    r_B = tuple(float(v) for v in tree.get("r_bb", (0.0, 0.0, 0.0)))
    stated = Stated(
        str(tree.get("name", "Python Vehicle Simulator, remus100")),
        f"Python Vehicle Simulator (Fossen), read by `bayesid vehicle new` from {name}",
        rho=rho, length=length, breadth=diameter, height=diameter, mass=mass,
        inertia=(inertia[0], inertia[1], inertia[1], 0.0, 0.0, 0.0),
        cog=(r_G[0], r_G[1], r_G[2]), cob=(r_B[0], r_B[1], r_B[2]), added=added,
    )  # fmt: skip
    full_speed = number("nMax", 1525.0)
    inside = {key: number(key, value) for key, value in INSIDE.items()}
    zero = inside["KT_0"] * inside["Ja_max"] / (inside["KT_0"] - inside["KT_max"])
    stated.propulsion = Propulsion(
        "kt",
        {"Kt0": inside["KT_0"], "a": zero, "b": 1.0, "w": inside["wake"], "t": inside["t_prop"],
         "D": inside["D_prop"], "rpm_ref": full_speed},
    )  # fmt: skip
    stated.crossflow = Crossflow(CYLINDER, 0.0, diameter, diameter, 21)
    area, drag = (
        number("S", 0.7 * length * diameter),
        number("CD_0", 0.42 * math.pi * b**2 / (0.7 * length * diameter)),
    )
    aspect = diameter**2 / area
    slope = math.pi * aspect / (1.0 + math.sqrt(1.0 + (0.5 * aspect) ** 2))
    pressure = 0.5 * rho * area
    speed = _speed(inside, rho, pressure * drag, full_speed)
    total = added + np.diag([mass, mass, mass, *_about_origin(inertia, mass, r_G)])
    fade = math.exp(-3.0 * speed)
    stiff = mass * 9.81 * (r_G[2] - r_B[2])
    damping = {
        "X_u0": total[0, 0] / number("T_surge", 20.0) * fade,
        "Y_v0": total[1, 1] / number("T_sway", 20.0) * fade,
        "Z_w0": total[2, 2] / number("T_heave", number("T_sway", 20.0)),
        "K_p0": 2.0 * number("zeta_roll", 0.3) * math.sqrt(max(stiff, 0.0) * total[3, 3]),
        "M_q0": 2.0 * number("zeta_pitch", 0.8) * math.sqrt(max(stiff, 0.0) * total[4, 4]),
        "N_r0": total[5, 5] / number("T_yaw", 5.0) * fade,
    }
    rudder = 0.5 * rho * number("A_r") * number("CL_delta_r")
    plane = 0.5 * rho * number("A_s") * number("CL_delta_s")
    stated.coef = {
        **{key: -value for key, value in damping.items()},
        "X_u|u|": -pressure * drag,
        "X_ww": pressure * (slope - slope**2 / (math.pi * OSWALD * aspect)),
        "Z_w": -pressure * (slope + drag),
        # the Munk moment is taken out of added-mass Coriolis there, as coded: CA[4][0], [4][3], [5][0],
        # [5][1] = 0
        "N_v": -(added[0, 0] - added[1, 1]),
        "M_w": -added[2, 2],
        "M_rp": -added[5, 5],
        "Y_dr": rudder, "N_dr": number("x_r", -a) * rudder, "X_drdr": -rudder,
        "Z_ds": plane, "M_ds": number("x_s", -a) * plane, "X_dsds": -plane,
    }  # fmt: skip
    stated.limits = {"delta_r": number("deltaMax_r", 0.5236), "delta_s": number("deltaMax_s", 0.5236)}
    stated.notes += [
        f"Linear damping of surge, sway and yaw fades with exp(-3 U) there; its value at {speed:.2f} "
        "m/s is used.",
        "Left out: the lag of fins and shaft (T_delta, T_n: effects rudder_lag and the like), the "
        "propeller's "
        "torque.",
        "There force and moment of the stern plane have signs that fit no force at the stern; the "
        "moment is kept, "
        "positive plane pitches the bow down.",
    ]
    return stated


def _about_origin(
    inertia: tuple[float, float], mass: float, r_G: tuple[float, ...]
) -> tuple[float, float, float]:
    x, y, z = r_G
    return (
        inertia[0] + mass * (y * y + z * z),
        inertia[1] + mass * (x * x + z * z),
        inertia[1] + mass * (x * x + y * y),
    )


def _speed(inside: Mapping[str, float], rho: float, drag: float, rpm: float) -> float:
    """Speed at which thrust balances drag u^2."""
    n, d = rpm / 60.0, inside["D_prop"]
    slope = (inside["KT_0"] - inside["KT_max"]) / inside["Ja_max"]
    full = (1.0 - inside["t_prop"]) * rho * d**4
    linear = full * slope * (1.0 - inside["wake"]) / d * n
    constant = full * inside["KT_0"] * n * n
    return (-linear + math.sqrt(linear**2 + 4.0 * drag * constant)) / (2.0 * drag)
