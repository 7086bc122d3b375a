"""Straight-line stability of a vehicle: G_H, G_V, eigenvalues and self-propulsion speed, in closed form.

Takes: a `Vehicle`, and a speed where the set has rows without the factor u. SI inside.
Does not: simulate, or look at large motions; crossflow strips vanish to first order and are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.propulsion import propulsion_force
from bayesid.model.ship_forces import rudder_slopes
from bayesid.model.vehicles.inertia import added_mass, rigid_body_mass
from bayesid.model.vehicles.vehicle import Vehicle, coef_si

FASTEST = 1000.0  # m/s, the end of the search for a self-propulsion speed


@dataclass(frozen=True)
class Stability:
    """Linear behaviour of a straight run.

    Parameters
    ----------
    U : speed [m/s] through the water
    G_H, G_V : stability indices, positive = stable without controls; None where the set lacks the plane
    horizontal, vertical : eigenvalues times L/U (sway-yaw; heave-pitch with hydrostatics: w, q, theta)
    """

    U: float
    G_H: float | None
    G_V: float | None
    horizontal: tuple[complex, ...]
    vertical: tuple[complex, ...]


def self_propulsion_speed(vehicle: Vehicle, rpm: float) -> float:
    """Steady speed [m/s] of a straight run at a positive shaft speed [rpm], to the last bit of a float.

    Raises
    ------
    VehicleError
        if thrust and drag do not balance at any speed up to 1000 m/s
    """
    si, p = coef_si(vehicle), vehicle.propulsion
    quadratic, linear = sum(si.get(name, 0.0) for name in ("X_u|u|", "X_uu", "X_0,U")), si.get("X_u0", 0.0)
    values = {**p.values, **si} if p.model == "mmg" else p.values

    def surge(u: float) -> float:
        thrust = propulsion_force(p.model, values, vehicle.rho, vehicle.L, u, rpm)
        return float(thrust) + ahead(u) + (quadratic * u + linear) * u

    def ahead(u: float) -> float:
        """Of thrusters that push ahead, all at these revolutions."""
        out = 0.0
        for t in vehicle.main_shafts:
            m = min(max(rpm - t.dead_band, 0.0), t.limit)
            out += t.direction[0] * (t.T_nn * m + t.T_un * t.direction[0] * u) * m
        return out

    if not (rpm > 0.0 and surge(0.0) > 0.0):
        raise VehicleError(f"{vehicle.name}: no thrust ahead at {rpm:g} rpm; check [propulsion]")
    slow, fast = 0.0, 0.1
    while surge(fast) > 0.0:
        slow, fast = fast, 2.0 * fast
        if fast > FASTEST:
            raise VehicleError(
                f"{vehicle.name}: thrust at {rpm:g} rpm exceeds drag at every speed; give X_u|u|"
            )
    # bisection: importing a root finder would cost the command line half a second
    while slow < (middle := 0.5 * (slow + fast)) < fast:
        slow, fast = (middle, fast) if surge(middle) > 0.0 else (slow, middle)
    return fast


def usual_speed(vehicle: Vehicle) -> float:
    """Speed [m/s] of the straight run at rpm_ref, else U_ref.

    Raises
    ------
    VehicleError
        if the file names neither rpm_ref nor U_ref
    """
    if vehicle.rpm_ref is not None:
        return self_propulsion_speed(vehicle, vehicle.rpm_ref)
    if vehicle.U_ref is not None:
        return vehicle.U_ref
    raise VehicleError(f"{vehicle.name}: give rpm_ref in [propulsion] or U_ref in [vehicle], or pass a speed")


def stability(vehicle: Vehicle, U: float | None = None) -> Stability:
    """Indices and eigenvalues at speed U [m/s], by default that of rpm_ref.

    G_H = 1 - N_v (Y_r - m)/(Y_v (N_r - m x_G)), G_V = 1 - M_w (Z_q + m)/(Z_w (M_q - m x_G)), in SI with
    Y_v + Y_v0/U and so on (equations of motion of Gertler and Hagen 1967, linearised).

    Raises
    ------
    VehicleError
        if U is not given and no speed follows from the file
    """
    speed = usual_speed(vehicle) if U is None else U
    if not speed > 0.0:
        raise VehicleError(
            f"{vehicle.name}: stability of a straight run needs a positive speed, not {speed:g}"
        )
    rows = coef_si(vehicle)
    rudder = _rudder_slopes(vehicle, rows, speed)

    def slope(axis: str, velocity: str) -> float:
        """d force / d velocity at speed U, over U."""
        straight = (f"{axis}_{velocity}", f"{axis}_{velocity},U", f"{axis}_|u|{velocity}")
        steady = sum(rows.get(name, 0.0) for name in straight) + rudder.get(axis + velocity, 0.0)
        return steady + rows.get(f"{axis}_{velocity}0", 0.0) / speed

    mass, x_G, z_G = vehicle.mass, vehicle.r_G[0], vehicle.r_G[2]
    Y_v, Y_r, N_v, N_r = slope("Y", "v"), slope("Y", "r"), slope("N", "v"), slope("N", "r")
    total = rigid_body_mass(vehicle) + added_mass(vehicle)
    turn = speed * np.array([[Y_v, Y_r - mass], [N_v, N_r - mass * x_G]])
    scale = vehicle.L / speed
    horizontal = np.linalg.eigvals(np.linalg.solve(total[np.ix_((1, 5), (1, 5))], turn)) * scale
    G_V, vertical = None, np.array([])
    if not vehicle.planar_only:
        Z_w, Z_q, M_w, M_q = slope("Z", "w"), slope("Z", "q"), slope("M", "w"), slope("M", "q")
        G_V = _index(M_w, Z_q + mass, Z_w, M_q - mass * x_G)
        dive = speed * np.array([[Z_w, Z_q + mass], [M_w, M_q - mass * x_G]])
        state = np.zeros((3, 3))
        state[:2, :2] = np.linalg.solve(total[np.ix_((2, 4), (2, 4))], dive)
        # level trim; r_B at the origin or not, the pitch moment per radian is -(z_G W - z_B B)
        stiff = np.array([0.0, -(z_G * vehicle.W - vehicle.r_B[2] * vehicle.B)])
        state[:2, 2] = np.linalg.solve(total[np.ix_((2, 4), (2, 4))], stiff)
        state[2, 1] = 1.0
        vertical = np.linalg.eigvals(state) * scale
    return Stability(
        U=speed,
        G_H=_index(N_v, Y_r - mass, Y_v, N_r - mass * x_G),
        G_V=G_V,
        horizontal=_ordered(horizontal),
        vertical=_ordered(vertical),
    )


def _rudder_slopes(vehicle: Vehicle, si: Mapping[str, float], speed: float) -> dict[str, float]:
    """d(rudder force)/d(v or r) over U of a ship whose rudder stands behind a propeller."""
    if vehicle.propulsion.model != "mmg" or vehicle.rpm_ref is None:
        return {}
    values = {**vehicle.propulsion.values, **si, "rho": vehicle.rho, "L": vehicle.L, "U_ref": speed}
    return {name: float(slope) for name, slope in rudder_slopes(values, speed, vehicle.rpm_ref).items()}


def _index(arm: float, lever: float, damping: float, turning: float) -> float | None:
    """1 - arm lever/(damping turning), or None where the set has no damping in the plane."""
    product = damping * turning
    return None if product == 0.0 else 1.0 - arm * lever / product


def _ordered(eigenvalues: np.ndarray) -> tuple[complex, ...]:
    """Least damped first."""
    return tuple(
        sorted((complex(value) for value in eigenvalues), key=lambda value: (-value.real, value.imag))
    )
