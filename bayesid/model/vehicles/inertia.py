"""Mass matrices of a vehicle, and whether they could belong to a body at all.

Takes: a `Vehicle`. Gives (6, 6) arrays about the body origin, order u v w p q r.
Does not: write equations of motion.
"""

from __future__ import annotations

import numpy as np

from bayesid.model.notation import AXES, VELOCITY
from bayesid.model.terms import term
from bayesid.model.vehicles.vehicle import Vehicle, coef_si


def rigid_body_mass(vehicle: Vehicle) -> np.ndarray:
    """(6, 6) rigid-body mass matrix about the body origin [kg, kg m, kg m^2]; I_xy = +integral xy dm."""
    mass = np.zeros((6, 6))
    x, y, z = vehicle.r_G
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    mass[:3, :3] = vehicle.mass * np.eye(3)
    mass[:3, 3:] = -vehicle.mass * cross
    mass[3:, :3] = vehicle.mass * cross
    v = vehicle
    mass[3:, 3:] = [[v.Ixx, -v.Ixy, -v.Ixz], [-v.Ixy, v.Iyy, -v.Iyz], [-v.Ixz, -v.Iyz, v.Izz]]
    return mass


def added_mass(vehicle: Vehicle) -> np.ndarray:
    """(6, 6) added-mass matrix, minus the acceleration derivatives [kg, kg m, kg m^2]; not symmetrised."""
    matrix = np.zeros((6, 6))
    for name, value in coef_si(vehicle).items():
        row = term(name)
        if row.is_inertia:
            matrix[AXES.index(row.axis), VELOCITY.index(row.arguments.removesuffix("dot"))] = -value
    return matrix


def planar_part(matrix: np.ndarray) -> np.ndarray:
    """(3, 3) surge-sway-yaw block of a (6, 6) matrix."""
    return matrix[np.ix_((0, 1, 5), (0, 1, 5))]


def mass_problems(vehicle: Vehicle) -> list[str]:
    """Total inertia that could not be accelerated: the symmetric part must be positive definite."""
    body, total = rigid_body_mass(vehicle), rigid_body_mass(vehicle) + added_mass(vehicle)
    for matrix, what in ((body, "rigid-body mass matrix"), (total, "mass matrix with added mass")):
        block = planar_part(matrix) if vehicle.planar_only else matrix
        scale = np.sqrt(np.abs(np.diag(block)))
        if np.any(np.diag(block) <= 0.0):
            axis = "XYN" if vehicle.planar_only else "XYZKMN"
            worst = axis[int(np.argmin(np.diag(block)))]
            return [f"{what}: its {worst} entry is not positive; check mass, inertias and {worst}_..dot"]
        with np.errstate(all="ignore"):  # entries of wildly different size overflow, and are refused
            scaled = 0.5 * (block + block.T) / scale[:, None] / scale[None, :]
        smallest = np.linalg.eigvalsh(scaled)[0] if np.isfinite(scaled).all() else -np.inf
        if not smallest > 1e-12:
            return [
                f"{what} is not positive definite (smallest scaled eigenvalue {smallest:.3g}); "
                "check r_G, inertias and the coupled acceleration derivatives"
            ]
    return []
