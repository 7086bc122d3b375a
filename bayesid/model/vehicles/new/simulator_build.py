"""From what a simulator states to a vehicle: added mass, damping, fins and thrusters become rows of the
force table.

Takes: `Stated`, in x forward, y starboard, z down. Gives a `NewVehicle`. Does not: read files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.notation import AXES, VELOCITY
from bayesid.model.terms import TERMS
from bayesid.model.vehicles.convention import munk_and_coriolis
from bayesid.model.vehicles.new.fins import Fin, add_fin
from bayesid.model.vehicles.new.hull import Hull
from bayesid.model.vehicles.new.new_vehicle import NewVehicle
from bayesid.model.vehicles.new.parts import Parts
from bayesid.model.vehicles.vehicle import (
    GRAVITY,
    INERTIA,
    CoefficientPrior,
    Crossflow,
    Propulsion,
    Vehicle,
)

CODED_SD = 0.3  # relative: simulators carry numbers over from other vehicles, or tune them by eye
ROWS = frozenset(row.name for row in TERMS)


@dataclass(frozen=True)
class StatedFin:
    """kind "rudder" or "stern_plane"; lift [N per (m/s)^2 and rad]; x [m] ahead of the origin."""

    kind: str
    lift: float
    x: float


@dataclass
class Stated:
    """What a simulator's file states.

    Parameters
    ----------
    added : (6, 6) added-mass matrix, positive
    coef : rows of the force table beside those of `added`, in SI
    thrust : N per rpm^2, of all propellers ahead
    inertia : Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity, products as integrals
    coriolis : whether the simulator adds what the added mass brings along
    """

    name: str
    source: str
    rho: float = 1025.0
    length: float | None = None
    breadth: float | None = None
    height: float | None = None
    mass: float | None = None
    inertia: tuple[float, ...] = ()
    cog: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cob: tuple[float, float, float] = (0.0, 0.0, 0.0)
    added: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    coef: dict[str, float] = field(default_factory=dict)
    coriolis: bool = True
    fins: list[StatedFin] = field(default_factory=list)
    thrust: float | None = None
    propulsion: Propulsion | None = None
    crossflow: Crossflow | None = None
    limits: dict[str, float] = field(default_factory=dict)
    speed: float | None = None
    rpm: float | None = None
    notes: list[str] = field(default_factory=list)


def build(stated: Stated) -> NewVehicle:
    """The vehicle.

    Raises
    ------
    VehicleError
        once, with everything the file lacks and the option that gives it
    """
    lacks = [
        f"no {what} in the file; give --{option}"
        for what, option, value in (("mass", "mass", stated.mass), ("length", "length", stated.length))
        if value is None
    ]
    if not np.any(stated.added):
        lacks.append("no added mass in the file; a data sheet (--sheet) can estimate it")
    if lacks or stated.mass is None or stated.length is None:
        raise VehicleError("\n".join([f"{stated.name}: not enough for a vehicle:", *lacks]))
    notes = list(stated.notes)
    inertia: dict[str, Any] = dict(zip(INERTIA, _inertia(stated, notes), strict=True))
    coef = _coefficients(stated)
    parts = _fins(stated, coef, notes)
    coef = {row.name: coef[row.name] for row in TERMS if coef.get(row.name)}
    vehicle = Vehicle(
        name=stated.name, source=stated.source, nondimensional=False, plain_abs=True, planar_only=False,
        rho=stated.rho, L=stated.length, mass=stated.mass,
        **inertia,
        r_G=stated.cog, r_B=stated.cob, W=stated.mass * GRAVITY, B=stated.mass * GRAVITY,
        limits={f"delta_{k}": stated.limits.get(f"delta_{k}", math.radians(30.0)) for k in "rsb"},
        rates=dict.fromkeys(("delta_r", "delta_s", "delta_b"), math.inf),
        propulsion=_propulsion(stated, coef, notes), crossflow=stated.crossflow, coef=coef,
        prior=CoefficientPrior({name: max(CODED_SD, parts.get(name, 0.0)) for name in coef}),
        dimensions={"L_oa": stated.length, "diameter": _section(stated)},
    )  # fmt: skip
    comments = {
        ("vehicle", "B"): "N, trimmed: that of the mass",
        ("vehicle", "Ixx"): "kg m2 about the body origin",
        ("prior", "relative_sd"): "assumed: simulators carry numbers over from other vehicles, or tune them",
    }
    return NewVehicle(vehicle, comments, tuple(notes))


def _section(stated: Stated) -> float:
    return math.sqrt((stated.breadth or 0.0) * (stated.height or 0.0))


def _coefficients(stated: Stated) -> dict[str, float]:
    coef = {
        f"{AXES[i]}_{VELOCITY[j]}dot": -float(stated.added[i, j])
        for i in range(6)
        for j in range(6)
        if stated.added[i, j] != 0.0
    }
    unknown = [name for name in coef if name not in ROWS]
    for name in unknown:
        del coef[name]
    if unknown:
        stated.notes.append(f"Left out: {', '.join(unknown)}; the force table has no such rows.")
    extra = munk_and_coriolis(coef) if stated.coriolis else {}
    for source in (extra, stated.coef):
        for name, value in source.items():
            coef[name] = coef.get(name, 0.0) + value
    return coef


def _fins(stated: Stated, coef: dict[str, float], notes: list[str]) -> dict[str, float]:
    """Adds the fins; where none is stated, usual ones. Returns relative sds of what was assumed."""
    for kind, axis, moment, velocity, rate, control, sign in (
        ("rudder", "Y", "N", "v", "r", "dr", 1.0), ("stern_plane", "Z", "M", "w", "q", "ds", -1.0),
    ):  # fmt: skip
        its = [fin for fin in stated.fins if fin.kind == kind]
        if not its:
            continue
        for fin in its:
            arm = sign * fin.x
            for name, value in (
                (f"{axis}_{velocity}", -fin.lift), (f"{moment}_{velocity}", -fin.lift * arm),
                (f"{axis}_{rate}", -fin.lift * arm), (f"{moment}_{rate}", -fin.lift * arm**2),
                (f"{axis}_{control}", sign * fin.lift), (f"{moment}_{control}", sign * fin.lift * arm),
            ):  # fmt: skip
                coef[name] = coef.get(name, 0.0) + value
    missing = [
        kind
        for kind, control in (("rudder", "N_dr"), ("stern_plane", "M_ds"))
        if not coef.get(control) and not any(fin.kind == kind for fin in stated.fins)
    ]
    if not missing or stated.length is None or stated.mass is None:
        return {}
    section = math.sqrt((stated.breadth or 0.14 * stated.length) * (stated.height or 0.14 * stated.length))
    hull = Hull(stated.length, section, section, stated.mass / stated.rho, stated.rho)
    parts = Parts()
    for kind in missing:
        add_fin(
            Fin(kind, 0.025 * stated.length * section, 0.45 * section, 0.96 * stated.length, 2, 1.0, True),
            hull,
            parts,
        )
    wide = {}
    for name in parts.of:
        if not name.endswith("dot") and not name.startswith("K") and "|" not in name:
            coef[name] = coef.get(name, 0.0) + parts.value(name)
            wide[name] = parts.relative_sd(name)
    notes.insert(
        0,
        f"Assumed: the file states no {' and no '.join(k.replace('_', ' ') for k in missing)}; a pair "
        "of usual "
        "size (5 % of length times diameter) is put at the stern; give yours in a data sheet or edit "
        "*_dr, *_ds.",
    )
    return wide


def _inertia(stated: Stated, notes: list[str]) -> tuple[float, ...]:
    """About the body origin (parallel axes), from about the centre of gravity."""
    assert stated.mass is not None and stated.length is not None
    if not stated.inertia or not all(value > 0.0 for value in stated.inertia[:3]):
        radius = 0.25 * (stated.breadth or 0.14 * stated.length)
        long = 0.24 * stated.length
        notes.append(
            "No inertia in the file: radii of gyration of 0.24 L and a quarter of the breadth assumed."
        )
        about: tuple[float, ...] = (
            stated.mass * radius**2,
            stated.mass * long**2,
            stated.mass * long**2,
            0.0,
            0.0,
            0.0,
        )
    else:
        about = tuple(stated.inertia)
    x, y, z = stated.cog
    m = stated.mass
    shift = (y * y + z * z, x * x + z * z, x * x + y * y, x * y, x * z, y * z)
    return tuple(float(a + m * s) for a, s in zip(about, shift, strict=True))


def _propulsion(stated: Stated, coef: dict[str, float], notes: list[str]) -> Propulsion:
    if stated.propulsion is not None:
        return stated.propulsion
    speed = stated.speed or 1.5
    drag = -(coef.get("X_u|u|", 0.0) * speed + coef.get("X_u0", 0.0)) * speed
    if drag <= 0.0:
        raise VehicleError(
            f"{stated.name}: the file states no drag ahead (X_u|u| or X_u0); it would not stop"
        )
    if stated.thrust:
        rpm = math.sqrt(drag / stated.thrust)
        notes.append(f"rpm_ref = {rpm:.0f} is what gives {speed:g} m/s by the thrusters of the file.")
    else:
        section = math.sqrt((stated.breadth or 0.1) * (stated.height or 0.1))
        rpm = stated.rpm or 60.0 * 1.4 * speed / (0.7 * section)
        notes.append(
            f"No propeller in the file: thrust balances drag at {speed:g} m/s and {rpm:.0f} rpm (assumed; "
            "--speed, --rpm)."
        )
    return Propulsion("thrust", {"T_ref": drag, "rpm_ref": rpm})
