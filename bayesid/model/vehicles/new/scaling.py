"""A known vehicle at another length, mass and speed: geometric similarity, mass ratio on the inertial rows.

Takes: a `Vehicle` and the new numbers. Gives a `NewVehicle`. Does not: correct for Reynolds number.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from bayesid.errors import VehicleError
from bayesid.model.actuators import UNLIMITED
from bayesid.model.terms import term
from bayesid.model.vehicles.convention import munk_and_coriolis
from bayesid.model.vehicles.new.new_vehicle import NewVehicle
from bayesid.model.vehicles.stability import usual_speed
from bayesid.model.vehicles.vehicle import CoefficientPrior, Crossflow, Propulsion, Vehicle

SIMILAR_SD = 0.15  # relative, of a coefficient of a vehicle of the same shape, beside the original's own
#: powers of (length, speed, rpm) by which the numbers of a propulsion model scale
PROPULSION: dict[str, dict[str, tuple[int, int, int]]] = {
    "polynomial": {"uc_per_rpm": (0, 1, -1)},
    "nps": {"k": (0, 1, -1)},
    "thrust": {"T_ref": (2, 2, 0), "Q_ref": (3, 2, 0)},
    "linear_thrust": {"T_max": (2, 2, 0), "rpm_max": (0, 0, 1)},
    "kt": {"D": (1, 0, 0)},
    "mmg": {"D_P": (1, 0, 0), "H_R": (1, 0, 0), "A_R": (2, 0, 0)},
    "quadratic": {
        "X_prop_u|u|": (2, 0, 0),
        "X_prop_un": (2, 1, -1),
        "X_prop_n|n|": (2, 2, -2),
        "X_prop_n": (2, 2, -1),
    },
}
DENSE = ("T_ref", "Q_ref", "T_max", "X_prop_u|u|", "X_prop_un", "X_prop_n|n|", "X_prop_n")


def scaled(
    vehicle: Vehicle,
    length: float | None = None,
    mass: float | None = None,
    speed: float | None = None,
    rho: float | None = None,
    name: str | None = None,
) -> NewVehicle:
    """The vehicle at another size.

    Parameters
    ----------
    length : m; default the vehicle's own
    mass : kg, with the displacement; default the cube of the length (and the density)
    speed : m/s at rpm_ref; default Froude's, with the root of the length. The advance ratio stays.
    rho : kg/m^3

    Raises
    ------
    VehicleError
        if a number is not positive, or the vehicle states no usual speed
    """
    for what, value in (("length", length), ("mass", mass), ("speed", speed), ("rho", rho)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise VehicleError(f"{what} must be a positive number, not {value:g}")
    size = 1.0 if length is None else length / vehicle.L
    dense = 1.0 if rho is None else rho / vehicle.rho
    usual = usual_speed(vehicle)
    new_speed = usual * math.sqrt(size) if speed is None else speed
    faster = new_speed / usual
    similar_mass = vehicle.mass * size**3 * dense
    heavier = 1.0 if mass is None else mass / similar_mass
    rpm = faster / size
    in_file = 1.0 if vehicle.nondimensional else dense
    coef = {}
    for key, value in vehicle.coef.items():
        row = term(key)
        factor = 1.0
        if row.is_number:
            coef[key] = value
            continue
        if not vehicle.nondimensional:
            factor = size**row.length_power * faster ** (2 - row.velocity_power)
        coef[key] = value * factor * in_file
    coef = _heavier(coef, heavier)
    prior = _prior(vehicle, coef, heavier)
    inertia = size**2 * similar_mass / vehicle.mass * heavier
    crossflow = vehicle.crossflow and Crossflow(
        vehicle.crossflow.Cdy,
        vehicle.crossflow.Cdz,
        vehicle.crossflow.height * size,
        vehicle.crossflow.width * size,
        vehicle.crossflow.sections,
    )
    new_mass = similar_mass * heavier
    result = replace(
        vehicle,
        name=name or f"{vehicle.name}, scaled to {vehicle.L * size:.4g} m",
        source=f"scaled by `bayesid vehicle new` from: {vehicle.source}",
        rho=vehicle.rho * dense,
        L=vehicle.L * size,
        mass=new_mass,
        **{key: getattr(vehicle, key) * inertia for key in ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")},
        r_G=(vehicle.r_G[0] * size, vehicle.r_G[1] * size, vehicle.r_G[2] * size),
        r_B=(vehicle.r_B[0] * size, vehicle.r_B[1] * size, vehicle.r_B[2] * size),
        W=vehicle.W * new_mass / vehicle.mass,
        B=vehicle.B * new_mass / vehicle.mass,
        rates={fin: rate * faster / size for fin, rate in vehicle.rates.items()},
        propulsion=_propulsion(vehicle.propulsion, size, faster, rpm, dense),
        thrusters=tuple(_actuator(one, size, faster, rpm, dense) for one in vehicle.thrusters),
        fins=tuple(_actuator(one, size, faster, rpm, dense) for one in vehicle.fins),
        crossflow=crossflow,
        coef=coef,
        prior=prior,
        U_ref=None if vehicle.U_ref is None else vehicle.U_ref * faster,
        dimensions={
            key: value * (1.0 if key.startswith("air") else size / faster if key == "wind_average" else size)
            for key, value in vehicle.dimensions.items()
            if key != "scale"
        },
        validation={},
        confidence={},
        sources={},
    )
    rule = "Froude's speed (root of the length)" if speed is None else "a speed as stated"
    notes = [
        f"Scaled from {vehicle.name}: length times {size:.4g}, speed times {faster:.4g} ({rule}: "
        f"{new_speed:.4g} "
        f"m/s), shaft speed times {rpm:.4g} (the advance ratio stays), density times {dense:.4g}.",
    ]
    if abs(heavier - 1.0) > 1e-9:
        notes.append(
            f"The mass is {heavier:.4g} times that of a similar vehicle: inertia, added mass and what "
            "it brings "
            "(Munk moment, Coriolis rows) go with it, lift and drag do not; their widths are larger for it."
        )
    notes.append("Friction is that of the original: its coefficient falls with Reynolds number (ITTC-57).")
    comments = {("prior", "relative_sd"): "of a vehicle of similar shape, not of a measured one"}
    return NewVehicle(result, comments, tuple(notes))


def _heavier(coef: dict[str, float], factor: float) -> dict[str, float]:
    """Inertial rows, and the part of the others that comes from them, times a factor."""
    if factor == 1.0:
        return coef
    inertial = {key: value for key, value in coef.items() if key.endswith("dot")}
    brought = munk_and_coriolis(inertial)
    return {
        key: value * factor if key in inertial else value + (factor - 1.0) * brought.get(key, 0.0)
        for key, value in coef.items()
    }


def _prior(vehicle: Vehicle, coef: dict[str, float], heavier: float) -> CoefficientPrior:
    known = dict(vehicle.prior.relative_sd) if vehicle.prior else {}
    if vehicle.prior and vehicle.prior.covariance is not None:
        for k, key in enumerate(vehicle.prior.names):
            if vehicle.coef.get(key):
                known[key] = math.sqrt(float(vehicle.prior.covariance[k, k])) / abs(vehicle.coef[key])
    # of the change of mass, lift and drag may follow none or all
    extra = math.hypot(SIMILAR_SD, 0.5 * math.log(heavier))
    return CoefficientPrior(
        {key: float(f"{math.hypot(known.get(key, 0.0), extra):.2g}") for key in coef if coef[key]}
    )


def _actuator(one: Any, size: float, faster: float, rpm: float, dense: float) -> Any:
    """A similar actuator at the same advance ratio: forces by rho n^2 D^4, rho u n D^3 and rho u^2 D^2."""
    x, y, z = one.at
    time = size / faster
    factors = {
        "T_nn": dense * size**4, "T_un": dense * size**3, "F_nn": dense * size**4, "F_uu": dense * size**2,
        "D_uu": dense * size**2, "dead_band": rpm, "limit": rpm, "turn_rate_deg_s": 1 / time,
        "nozzle_rate_deg_s": 1 / time, "rate_deg_s": 1 / time, "bucket_rate": 1 / time, "turn_lag": time,
        "nozzle_lag": time, "bucket_lag": time, "lag": time,
    }  # fmt: skip
    scaled = {
        key: min(value * factor, UNLIMITED)
        for key, factor in factors.items()
        if isinstance(value := getattr(one, key, None), float)
    }
    return replace(one, at=(x * size, y * size, z * size), **scaled)


def _propulsion(old: Propulsion, size: float, faster: float, rpm: float, dense: float) -> Propulsion:
    powers = PROPULSION[old.model]
    values = {}
    for key, value in old.values.items():
        a, b, c = powers.get(key, (0, 0, 1) if key == "rpm_ref" else (0, 0, 0))
        values[key] = value * size**a * faster**b * rpm**c * (dense if key in DENSE else 1.0)
    return Propulsion(old.model, values)
