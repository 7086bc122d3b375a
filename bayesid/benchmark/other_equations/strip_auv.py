"""A small AUV by lift and strips, six degrees of freedom: fins that stall, cross-flow strips, Munk moments.

Numbers of the REMUS 100: Prestero (2001), Verification of a six-degree of freedom simulation model,
MIT/WHOI: hull after Myring (his table 2.1), fins and cross-flow (table 4.1), added mass (appendix B), body
lift after Hoerner. Blend into flat-plate lift beyond stall: Beard and McLain (2012), section 4.2. Where this
file and Prestero differ: neutral buoyancy; fins half as large again, stalling at 26 degrees, as with his the
vehicle hunts on a straight course; a propeller with advance ratio (assumed, his thrust and torque at 1500
rpm).
Takes: state, rudder angle (positive turns to port), shaft speed [1/s], causes. Depth is held on board.
Does not: step in time.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

STRIPS = 24
NUMBERS = {
    "rho": 1030.0, "L": 1.33, "diameter": 0.191, "m": 30.48, "z_G": 0.0196, "I_x": 0.177,
    "I_y": 3.45, "I_z": 3.45, "a_x": 0.93, "a_y": 35.5, "a_z": 35.5, "a_p": 0.0704, "a_q": 4.88,
    "a_r": 4.88, "a_yr": -1.93, "a_zq": 1.93, "drag": 1.62, "body_lift": 1.24, "x_cp": -0.321,
    "C_dc": 1.1, "K_pp": 0.13, "S_fin": 1.0e-2, "x_fin": -0.638, "r_fin": 0.13, "lift_slope": 3.12,
    "fin_drag": 0.02, "induced": 0.12, "stall": 0.45, "D_P": 0.14, "k_0": 0.040, "k_1": -0.0555,
    "k_Q": 0.01575, "plane_max": 0.237, "depth": 5.0,
}  # fmt: skip


def auv_numbers(**changed: float) -> np.void:
    """REMUS-like numbers as a record for `rates`, with the hull's breadth at its strips."""
    values = NUMBERS | changed
    more = [("breadth", "f8", (STRIPS,)), ("place", "f8", (STRIPS,)), ("inverse", "f8", (6, 6))]
    kind = [*((name, "f8") for name in values), *more, ("mass", "f8", (6, 6))]
    out = np.zeros(1, np.dtype(kind))[0]
    for name, value in values.items():
        out[name] = value
    edges = np.linspace(-0.5, 0.5, STRIPS + 1) * values["L"]
    out["place"] = 0.5 * (edges[1:] + edges[:-1])
    out["breadth"] = [2.0 * _myring(0.5 * values["L"] - x, values["L"]) for x in out["place"]]
    out["mass"] = _mass(values)
    out["inverse"] = np.linalg.inv(out["mass"])
    return out


def _myring(back: float, length: float) -> float:
    """Radius [m] at a distance behind the nose; a = .191, b = .654, c = .541 m, n = 2, theta = 25 degrees."""
    a, b, d, theta, tail, nose = 0.191, 0.654, 0.191, 0.4363, 0.0368, 0.0165
    s = back * (1.386 - tail - nose) / length + nose  # offsets of nose and tail are cut off
    c = 0.541
    if s < a:
        return 0.5 * d * math.sqrt(max(1.0 - ((s - a) / a) ** 2, 0.0))
    if s < a + b:
        return 0.5 * d
    e = s - a - b
    second, third = 1.5 * d / c**2 - math.tan(theta) / c, d / c**3 - math.tan(theta) / c**2
    return max(0.5 * d - second * e**2 + third * e**3, 0.0)


def _mass(n: dict[str, float]) -> np.ndarray:
    """(6, 6) rigid-body and added mass about the centre of buoyancy."""
    m, z = n["m"], n["z_G"]
    rigid = np.diag([m, m, m, n["I_x"], n["I_y"], n["I_z"]])
    rigid[0, 4] = rigid[4, 0] = m * z
    rigid[1, 3] = rigid[3, 1] = -m * z
    added = np.diag([n["a_x"], n["a_y"], n["a_z"], n["a_p"], n["a_q"], n["a_r"]])
    added[1, 5] = added[5, 1] = n["a_yr"]
    added[2, 4] = added[4, 2] = n["a_zq"]
    return rigid + added


def cruise_rps(numbers: np.void, speed: float) -> float:
    """Shaft speed [1/s] at which thrust balances axial and fin drag on a straight course: a quadratic."""
    b = numbers
    drag = b["drag"] * speed**2 + 4 * 0.5 * b["rho"] * b["S_fin"] * b["fin_drag"] * speed**2
    a2, a1 = b["k_0"] * b["D_P"] ** 4, b["k_1"] * speed * b["D_P"] ** 3
    return float((-a1 + math.sqrt(a1 * a1 + 4.0 * a2 * drag / b["rho"])) / (2.0 * a2))


@njit(cache=True)
def lift_of(alpha, slope, stall):
    """Lift coefficient: linear, blended into that of a flat plate beyond the stall angle."""
    steep = 15.0
    one, two = math.exp(-steep * (alpha - stall)), math.exp(steep * (alpha + stall))
    sigma = (1.0 + one + two) / ((1.0 + one) * (1.0 + two))
    plate = 2.0 * math.sin(alpha) * abs(math.sin(alpha)) * math.cos(alpha)
    return (1.0 - sigma) * slope * alpha + sigma * plate


@njit(cache=True)
def _fin(ahead, across, angle, b):
    """Force ahead and across [N] of one fin whose angle drives it towards positive `across`."""
    flow = math.atan2(across, ahead)
    C_L = lift_of(angle - flow, b.lift_slope, b.stall)
    C_D = b.fin_drag + b.induced * C_L * C_L
    q = 0.5 * b.rho * b.S_fin * (ahead * ahead + across * across)
    c, s = math.cos(flow), math.sin(flow)
    return q * (-C_L * s - C_D * c), q * (C_L * c - C_D * s)


@njit(cache=True)
def _fluid(u, v, w, p, q, r, delta, plane, rps, b, g, F):
    """Drag, body lift, strips, fins and propeller into F."""
    F[:] = 0.0
    F[0] = -b.drag * (1.0 + g.fouling) * u * abs(u)
    lift = 0.5 * b.rho * b.diameter**2 * b.body_lift * u
    F[1] -= lift * v
    F[5] -= lift * v * b.x_cp
    F[2] -= lift * w
    F[4] += lift * w * b.x_cp
    h = b.L / STRIPS
    for k in range(STRIPS):
        y, z = v + b.place[k] * r, w - b.place[k] * q
        d = 0.5 * b.rho * b.C_dc * b.breadth[k] * h * math.sqrt(y * y + z * z)
        F[1] -= d * y
        F[5] -= d * y * b.place[k]
        F[2] -= d * z
        F[4] += d * z * b.place[k]
    F[3] -= b.K_pp * p * abs(p)
    for side in (-1.0, 1.0):
        arm = side * b.r_fin
        X, Y = _fin(u + arm * q, v + b.x_fin * r - arm * p, delta, b)  # upper and lower
        F[0] += X
        F[1] += Y
        F[3] -= arm * Y
        F[4] += arm * X
        F[5] += b.x_fin * Y
        X, Z = _fin(u - arm * r, w - b.x_fin * q + arm * p, -plane, b)  # port and starboard
        F[0] += X
        F[2] += Z
        F[3] += arm * Z
        F[4] -= b.x_fin * Z
        F[5] -= arm * X
    speed = max(rps, 1e-3)
    T = b.rho * speed * b.D_P**3 * (b.k_0 * speed * b.D_P + b.k_1 * u) * (1.0 - g.thrust_loss)
    F[0] += T
    F[3] -= b.rho * speed * speed * b.D_P**5 * b.k_Q
    F[1] += g.side_force * T
    F[5] += g.side_force * T * -0.5 * b.L


@njit(cache=True)
def auv_rates(t, x, delta, rps, sea, b, g, out):
    """Time derivative of x y z phi theta psi u v w p q r (through the water) into `out`.

    Parameters
    ----------
    sea : (3,) force X, Y [N] and moment N [N m]
    b, g : numbers of the vehicle, causes
    """
    sph, cph, sth, cth = math.sin(x[3]), math.cos(x[3]), math.sin(x[4]), math.cos(x[4])
    sps, cps = math.sin(x[5]), math.cos(x[5])
    u, v, w, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11]
    # the vehicle's own autopilot holds the depth: a look-ahead gives the pitch to ask for
    pitch = min(max(math.atan((x[2] - b.depth) / (3.0 * b.L)), -0.2), 0.2)
    plane = min(max(1.0 * (x[4] - pitch) + 0.5 * b.L / 1.5 * q, -b.plane_max), b.plane_max)
    F = np.empty(6)
    _fluid(u, v, w, p, q, r, delta, plane, rps, b, g, F)
    bottom = 1.0 + g.bottom * 0.5 * (1.0 + math.sin((x[0] * g.bottom_n + x[1] * g.bottom_e) * g.bottom_k))
    F[1] *= bottom
    swell = g.swell * math.sin(g.swell_w * t + g.swell_p)
    F[0] += sea[0] + swell * (g.swell_n * cps + g.swell_e * sps)
    F[1] += sea[1] + swell * (g.swell_e * cps - g.swell_n * sps)
    F[5] += sea[2]
    weight = 9.81 * b.m * b.z_G
    F[3] -= weight * cth * sph
    F[4] -= weight * sth
    # momentum of body and water in a turning frame (Kirchhoff): Coriolis, centripetal and Munk moments
    P = np.empty(6)
    for i in range(6):
        P[i] = 0.0
        for j in range(6):
            P[i] += b.mass[i, j] * x[6 + j]
    F[0] -= q * P[2] - r * P[1]
    F[1] -= r * P[0] - p * P[2]
    F[2] -= p * P[1] - q * P[0]
    F[3] -= q * P[5] - r * P[4] + v * P[2] - w * P[1]
    F[4] -= r * P[3] - p * P[5] + w * P[0] - u * P[2]
    F[5] -= p * P[4] - q * P[3] + u * P[1] - v * P[0]
    out[0] = (
        cps * cth * u + (cps * sth * sph - sps * cph) * v + (cps * sth * cph + sps * sph) * w + g.current_n
    )
    out[1] = (
        sps * cth * u + (sps * sth * sph + cps * cph) * v + (sps * sth * cph - cps * sph) * w + g.current_e
    )
    out[2] = -sth * u + cth * sph * v + cth * cph * w
    out[3] = p + (q * sph + r * cph) * sth / cth
    out[4] = q * cph - r * sph
    out[5] = (q * sph + r * cph) / cth
    for i in range(6):
        out[6 + i] = 0.0
        for j in range(6):
            out[6 + i] += b.inverse[i, j] * F[j]
