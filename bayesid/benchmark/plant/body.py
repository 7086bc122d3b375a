"""A vehicle turned into the numbers the compiled motion reads: rows of products, masses, propulsion.

Takes: a `Vehicle`, coefficients in the units of its file, degrees of freedom, `settings`.
Does not: share code with the model the plant is to check; coefficient names are read anew here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.errors import ModelError
from bayesid.model.vehicles import Vehicle

LETTERS = ("u", "v", "w", "p", "q", "r", "Rv", "Rw", "sv", "sw", "|u|", "|v|", "|w|", "|p|", "|q|", "|r|",
           "dr", "ds", "db", "1")  # fmt: skip
AXES = "XYZKMN"
VELOCITIES = "uvwpqr"
PLAIN, RUDDER, PLANE, LIFT_V, LIFT_R, DRAG = range(6)
MAX_FACTORS = 4
RATE_LIMIT = 1e6  # rad/s, stands for none

_TOKEN = re.compile(r"\|[uvwpqr]\||d[rsb]|[uvwpqr]")
_NUMBERS = ("rho", "L", "U0", "n_ref", "height", "m", "xG", "yG", "zG", "xB", "yB", "zB", "W", "B",
            "Ix", "Iy", "Iz", "Ixy", "Ixz", "Iyz", "uu", "un", "nn", "n1", "kt", "kt_a", "kt_b", "wake",
            "deduction", "D", "dr_max", "dr_rate", "ds_max", "ds_rate", "plain_abs", "planar", "strip_y",
            "strip_z", "stations", "Y_dr", "N_dr", "slosh_m", "q_ref",
            "kq", "kq_a", "kq_b")  # fmt: skip
_KIND = np.dtype([(name, "f8") for name in _NUMBERS])


@dataclass(frozen=True, eq=False)
class Body:
    """Numbers of one vehicle: `number` a record, rows (axis, kind, factors, SI value), 6x6 matrices."""

    number: np.void
    axis: np.ndarray
    kind: np.ndarray
    factors: np.ndarray
    value: np.ndarray
    added: np.ndarray
    inverse: np.ndarray

    @property
    def packed(self) -> tuple:
        return (self.number, self.axis, self.kind, self.factors, self.value, self.added, self.inverse)


def factors_of(name: str) -> tuple[str, ...]:
    """The product a coefficient multiplies, e.g. Y_v|r| -> sv Rv |r|; N_dr -> u u dr.

    Gertler and Hagen (1967): rows are quadratic in velocity, filled up with u; a final 0 means not.
    """
    axis, arguments = name[0], name[2:]
    bare = arguments.endswith("0")
    stem = arguments.removesuffix("0")
    if stem == "*":
        return ("u", "u")
    tokens = _TOKEN.findall(stem)
    if axis not in AXES or name[1:2] != "_" or "".join(tokens) != stem or not tokens:
        raise ModelError(f"the plant does not know the coefficient {name!r}")
    moving = [t for t in tokens if t[0] != "d"]
    fins = [t for t in tokens if t[0] == "d"]
    if len(moving) < 2 and not bare:
        moving = ["u"] * (2 - len(moving)) + moving
    if len(moving) == 2 and "u" not in moving:
        for flow, speed, sign in (("v", "Rv", "sv"), ("w", "Rw", "sw")):
            if f"|{flow}|" in moving:
                moving = [speed if t == f"|{flow}|" else t for t in moving]
            elif flow in moving and any(t[0] == "|" for t in moving):
                moving = [sign, speed, *(t for t in moving if t != flow)]
        if moving == ["w", "w"] and axis in "ZM":
            moving = ["|w|", "Rw"]
    return (*moving, *fins)


def _kind(name: str, factors: tuple[str, ...]) -> int:
    if name[0] in "YN" and factors.count("dr") == 1:
        return RUDDER
    if name[0] in "ZM" and factors.count("ds") == 1:
        return PLANE
    if name in ("Y_v", "N_v"):
        return LIFT_V
    if name in ("Y_r", "N_r"):
        return LIFT_R
    return DRAG if name in ("X_u|u|", "X_uu") else PLAIN  # roughness raises what goes with speed squared


def _scale(vehicle: Vehicle, name: str, factors: tuple[str, ...]) -> float:
    """SI over the file's unit: 1/2 rho L^k, k = 2 or 3 plus one per angular velocity (plus accelerations)."""
    if not vehicle.nondimensional:
        return 1.0
    power = 2 if name[0] in "XYZ" else 3
    if name.endswith("dot"):
        power += 1 if name[2] in "uvw" else 2
    power += sum(f.strip("|") in ("p", "q", "r") for f in factors)
    return 0.5 * vehicle.rho * vehicle.L**power


def build(vehicle: Vehicle, coef: Mapping[str, float], dof: int, gap: np.void) -> Body:
    """Numbers of the vehicle with its mass properties changed as `gap` says; coefficients in file units."""
    b = _numbers(vehicle, dof, gap)
    rows: list[tuple[int, int, list[int], float]] = []
    added = np.zeros((6, 6))
    for name, value in coef.items():
        if name.endswith("dot"):
            si = value * _scale(vehicle, name, ())
            si *= 1.0 + {"X_udot": gap["e_x"], "Y_vdot": gap["e_y"], "N_rdot": gap["e_n"]}.get(name, 0.0)
            added[AXES.index(name[0]), VELOCITIES.index(name[2])] = si
            continue
        factors = factors_of(name)
        si = value * _scale(vehicle, name, factors)
        if name in ("Y_dr", "N_dr"):
            b[name] = si
        index = [LETTERS.index(f) for f in factors] + [LETTERS.index("1")] * (MAX_FACTORS - len(factors))
        rows.append((AXES.index(name[0]), _kind(name, factors), index, si))
    mass = mass_matrix(b) - added
    if gap["slosh"]:
        # the mass that is free to move sideways pushes on the hull only through its spring
        x = gap["slosh_x"]
        mass[np.ix_((1, 5), (1, 5))] -= b["slosh_m"] * np.array([[1.0, x], [x, x * x]])
    kept = [0, 1, 5] if dof == 3 else list(range(6))
    inverse = np.zeros((6, 6))
    inverse[np.ix_(kept, kept)] = np.linalg.inv(mass[np.ix_(kept, kept)])
    axis, kind, factors_index, values = (list(column) for column in zip(*rows, strict=True))
    return Body(
        b,
        np.array(axis, np.int64),
        np.array(kind, np.int64),
        np.array(factors_index, np.int64),
        np.array(values),
        added,
        inverse,
    )


def _numbers(vehicle: Vehicle, dof: int, gap: np.void) -> np.void:
    b = np.zeros(1, _KIND)[0]
    b["rho"], b["L"], b["m"] = vehicle.rho, vehicle.L, vehicle.mass
    b["Ix"], b["Iy"], b["Iz"] = vehicle.Ixx, vehicle.Iyy, vehicle.Izz
    b["Ixy"], b["Ixz"], b["Iyz"] = vehicle.Ixy, vehicle.Ixz, vehicle.Iyz
    b["xG"], b["yG"], b["zG"] = vehicle.r_G
    b["xB"], b["yB"], b["zB"] = vehicle.r_B
    if vehicle.planar_only:  # floats level, so its buoyancy acts where its weight does
        b["xB"], b["yB"] = vehicle.r_G[0], vehicle.r_G[1]
    b["W"], b["B"] = vehicle.W, vehicle.B
    b["plain_abs"], b["planar"] = float(vehicle.plain_abs), float(dof == 3)
    b["n_ref"] = vehicle.rpm_ref or math.nan
    _propulsion(b, vehicle)
    for fin, key in (("delta_r", "dr"), ("delta_s", "ds")):
        b[f"{key}_max"] = min(vehicle.limits.get(fin, math.inf), math.pi)
        b[f"{key}_rate"] = min(vehicle.rates.get(fin, math.inf), RATE_LIMIT)
    b["height"] = vehicle.dimensions.get("diameter", 0.0) or 0.1 * vehicle.L
    if vehicle.crossflow is not None:
        strips = vehicle.crossflow
        b["stations"] = strips.sections
        b["strip_y"], b["strip_z"] = strips.Cdy * strips.height, strips.Cdz * strips.width
        if not vehicle.dimensions.get("diameter", 0.0):
            b["height"] = strips.height
    b["U0"] = cruising_speed(vehicle, b["n_ref"])
    b["xG"] += gap["x_g"]
    b["yG"] += gap["y_g"]
    if gap["ballast"]:
        # trapped water: inertia without weight, spread like the hull's own mass about its own centre
        share, x = gap["ballast"], gap["ballast_x"]
        hull, water = (np.array([place, b["yG"], b["zG"]]) for place in (b["xG"], x))
        own = _inertia_of(b) - vehicle.mass * _point(hull)
        _set_inertia(b, _inertia_of(b) + share * (own + vehicle.mass * _point(water)))
        _neutral(b, vehicle, share, x)
    b["slosh_m"] = gap["slosh"] * vehicle.mass
    return b


def _point(r: np.ndarray) -> np.ndarray:
    """(3, 3) inertia of a unit mass at r about the origin."""
    return float(r @ r) * np.eye(3) - np.outer(r, r)


def _inertia_of(b: np.void) -> np.ndarray:
    """(3, 3) inertia about the origin; products enter with a minus."""
    return np.array(
        [[b["Ix"], -b["Ixy"], -b["Ixz"]], [-b["Ixy"], b["Iy"], -b["Iyz"]], [-b["Ixz"], -b["Iyz"], b["Iz"]]]
    )


def _set_inertia(b: np.void, inertia: np.ndarray) -> None:
    b["Ix"], b["Iy"], b["Iz"] = np.diag(inertia)
    b["Ixy"], b["Ixz"], b["Iyz"] = -inertia[0, 1], -inertia[0, 2], -inertia[1, 2]


def _neutral(b: np.void, vehicle: Vehicle, share: float, x: float) -> None:
    """Mass and its centre with trapped water at (x, y_G, z_G), whose weight and buoyancy cancel."""
    before = np.array([b["xG"], b["yG"], b["zG"]])
    water = np.array([x, before[1], before[2]])
    after = (before + share * water) / (1.0 + share)
    weight, buoyancy = float(b["W"]), float(b["B"])
    centre = np.array([b["xB"], b["yB"], b["zB"]])
    total = buoyancy + share * weight
    b["xB"], b["yB"], b["zB"] = (buoyancy * centre + share * weight * water) / total
    b["xG"], b["yG"], b["zG"] = after
    b["m"] = vehicle.mass * (1.0 + share)
    b["W"], b["B"] = weight * (1.0 + share), total


def _propulsion(b: np.void, vehicle: Vehicle) -> None:
    p, half = vehicle.propulsion.values, 0.5 * vehicle.rho * vehicle.L**2
    b["q_ref"] = p.get("Q_ref", 0.0)
    match vehicle.propulsion.model:
        case "polynomial":
            k = p["uc_per_rpm"]
            b["uu"], b["un"], b["nn"] = half * p["a"], half * p["b"] * k, half * p["c"] * k * k
        case "nps":
            b["uu"], b["nn"] = -half * p["Cd0"], half * p["Cd0"] * p["k"] ** 2
        case "thrust":
            b["nn"] = p["T_ref"] / p["rpm_ref"] ** 2
        case "linear_thrust":
            b["n1"] = p["T_max"] / p["rpm_max"]
        case "kt":
            b["kt"], b["kt_a"], b["kt_b"], b["D"] = p["Kt0"], p["a"], p["b"], p["D"]
            b["wake"], b["deduction"] = p["w"], p["t"]
            b["kq"], b["kq_a"], b["kq_b"] = p.get("Kq0", 0.0), p.get("Kq_a", math.inf), p.get("Kq_b", 1.0)
        case other:
            raise ModelError(f"the plant does not know the propulsion model {other!r}")


def mass_matrix(b: np.void) -> np.ndarray:
    """(6, 6) what multiplies the accelerations in the rigid-body equations [kg, kg m, kg m^2]."""
    m, x, y, z = b["m"], b["xG"], b["yG"], b["zG"]
    return np.array(
        [
            [m, 0.0, 0.0, 0.0, m * z, -m * y],
            [0.0, m, 0.0, -m * z, 0.0, m * x],
            [0.0, 0.0, m, m * y, -m * x, 0.0],
            [0.0, -m * z, m * y, b["Ix"], -b["Ixy"], -b["Ixz"]],
            [m * z, 0.0, -m * x, -b["Ixy"], b["Iy"], -b["Iyz"]],
            [-m * y, m * x, 0.0, -b["Ixz"], -b["Iyz"], b["Iz"]],
        ]
    )


def cruising_speed(vehicle: Vehicle, rpm: float) -> float:
    """Speed [m/s] at which thrust and straight-ahead drag of the file balance at `rpm`."""
    b = np.zeros(1, _KIND)[0]
    b["rho"] = vehicle.rho
    _propulsion(b, vehicle)
    half = 0.5 * vehicle.rho * vehicle.L**2 if vehicle.nondimensional else 1.0
    quadratic = half * (vehicle.coef.get("X_u|u|", 0.0) + vehicle.coef.get("X_uu", 0.0)) + b["uu"]
    linear = vehicle.coef.get("X_u0", 0.0)
    low, high = 0.0, 50.0
    for _ in range(80):
        u = 0.5 * (low + high)
        pull = b["un"] * u * rpm + b["nn"] * rpm**2 + b["n1"] * rpm
        if b["D"]:
            rps = rpm / 60.0
            advance = u * (1.0 - b["wake"]) / (rps * b["D"])
            pull = (1 - b["deduction"]) * b["rho"] * rps**2 * b["D"] ** 4
            pull *= b["kt"] * (1.0 - (advance / b["kt_a"]) ** b["kt_b"])
        low, high = (u, high) if pull + quadratic * u * u + linear * u > 0.0 else (low, u)
    return 0.5 * (low + high)
