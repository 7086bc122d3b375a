"""Equations of motion written out once more, by hand and in plain numpy, to test the generated ones against.

From Gertler and Hagen (1967) and Fossen (2021) in vector form: rigid body by Newton-Euler,
with cross products, rows spelt out as products. Shares nothing with `bayesid.equations`; reads only SI
coefficients and mass properties. Six degrees of freedom; held in the plane by `planar`.
"""

import numpy as np

from bayesid.model.propulsion import propulsion_force
from bayesid.model.vehicles import coef_si


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rigid_body(mass, r_G, inertia):
    """Mass matrix (6, 6) and the function nu -> C(nu) nu, `inertia` and both of them about the origin."""
    r_G = np.asarray(r_G, dtype=float)
    matrix = np.block([[mass * np.eye(3), -mass * skew(r_G)], [mass * skew(r_G), inertia]])

    def coriolis(nu):
        v, omega = nu[:3], nu[3:]
        centripetal = np.cross(omega, v + np.cross(omega, r_G))
        force = mass * centripetal
        moment = np.cross(omega, inertia @ omega) + mass * np.cross(r_G, np.cross(omega, v))
        return np.concatenate([force, moment])

    return matrix, coriolis


def inertia_of(vehicle):
    v = vehicle
    return np.array([[v.Ixx, -v.Ixy, -v.Ixz], [-v.Ixy, v.Iyy, -v.Iyz], [-v.Ixz, -v.Iyz, v.Izz]])


def rotation(phi, theta, psi):
    """Body to north-east-down, yaw, then pitch, then roll."""
    c, s = np.cos, np.sin
    yaw = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    pitch = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    roll = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    return yaw @ pitch @ roll


ACCELERATION = {
    "X": {"udot": 0},
    "Y": {"vdot": 1, "pdot": 3, "rdot": 5},
    "Z": {"wdot": 2, "qdot": 4},
    "K": {"vdot": 1, "pdot": 3, "rdot": 5},
    "M": {"wdot": 2, "qdot": 4},
    "N": {"vdot": 1, "pdot": 3, "rdot": 5},
}


def added_mass(coef):
    matrix = np.zeros((6, 6))
    for i, axis in enumerate("XYZKMN"):
        for name, j in ACCELERATION[axis].items():
            matrix[i, j] = -coef.get(f"{axis}_{name}", 0.0)
    return matrix


def side(velocity, band):
    """Sign, rounded where the velocity is less than a tenth (w: a hundredth) of the cross-flow speed."""
    if abs(velocity) >= band:
        return np.sign(velocity)
    x = velocity / band
    return (15 * x - 10 * x**3 + 3 * x**5) / 8


def hull_forces(coef, nu, fins, plain_abs=False):
    """The rows without acceleration, axis by axis as in equations 4.1 to 4.6 and the further rows."""
    u, v, w, p, q, r = nu
    dr, ds, db = fins
    R = np.hypot(v, w)
    Rv, Rw = (abs(v), abs(w)) if plain_abs else (R, R)
    sv, sw = side(v, 0.1 * Rv), side(w, 0.01 * Rw)
    g = coef.get
    X = (
        g("X_qq", 0) * q**2 + g("X_rr", 0) * r**2 + g("X_rp", 0) * r * p + g("X_pp", 0) * p**2
        + g("X_vr", 0) * v * r + g("X_wq", 0) * w * q + g("X_vp", 0) * v * p
        + g("X_uu", 0) * u**2 + g("X_u|u|", 0) * u * abs(u) + g("X_u0", 0) * u
        + g("X_vv", 0) * v**2 + g("X_ww", 0) * w**2 + g("X_vvvv", 0) * v**4
        + u**2 * (g("X_drdr", 0) * dr**2 + g("X_dsds", 0) * ds**2 + g("X_dbdb", 0) * db**2)
        + u * (g("X_qds", 0) * q * ds + g("X_wds", 0) * w * ds)
        + u * (g("X_rdr", 0) * r * dr + g("X_vdr", 0) * v * dr)
    )  # fmt: skip
    Y = (
        g("Y_p|p|", 0) * p * abs(p) + g("Y_pq", 0) * p * q + g("Y_qr", 0) * q * r
        + g("Y_r|r|", 0) * r * abs(r)
        + g("Y_vq", 0) * v * q + g("Y_wp", 0) * w * p + g("Y_wr", 0) * w * r
        + g("Y_r", 0) * u * r + g("Y_p", 0) * u * p + g("Y_|r|dr", 0) * u * abs(r) * dr
        + g("Y_v|r|", 0) * sv * Rv * abs(r) + g("Y_|v|r", 0) * Rv * r
        + g("Y_*", 0) * u**2 + g("Y_v", 0) * u * v + g("Y_v|v|", 0) * v * Rv + g("Y_vw", 0) * v * w
        + g("Y_dr", 0) * u**2 * dr + g("Y_v0", 0) * v + g("Y_r0", 0) * r
        + g("Y_vvv", 0) * v**3 + g("Y_vvr", 0) * v**2 * r + g("Y_vrr", 0) * v * r**2 + g("Y_rrr", 0) * r**3
        + g("Y_drdrdr", 0) * u**2 * dr**3 + u * (g("Y_vdrdr", 0) * v + g("Y_rdrdr", 0) * r) * dr**2
        + (g("Y_vvdr", 0) * v**2 + g("Y_vrdr", 0) * v * r + g("Y_rrdr", 0) * r**2) * dr
    )  # fmt: skip
    Z = (
        g("Z_pp", 0) * p**2 + g("Z_rr", 0) * r**2 + g("Z_rp", 0) * r * p + g("Z_q|q|", 0) * q * abs(q)
        + g("Z_vr", 0) * v * r + g("Z_vp", 0) * v * p + g("Z_q", 0) * u * q
        + g("Z_|q|ds", 0) * u * abs(q) * ds + g("Z_w|q|", 0) * sw * Rw * abs(q)
        + g("Z_*", 0) * u**2 + g("Z_w", 0) * u * w + g("Z_w|w|", 0) * w * Rw + g("Z_|w|", 0) * u * abs(w)
        + g("Z_ww", 0) * abs(w * Rw) + g("Z_vv", 0) * v**2
        + u**2 * (g("Z_ds", 0) * ds + g("Z_db", 0) * db) + g("Z_w0", 0) * w + g("Z_q0", 0) * q
    )  # fmt: skip
    K = (
        g("K_qr", 0) * q * r + g("K_pq", 0) * p * q + g("K_p|p|", 0) * p * abs(p)
        + g("K_p", 0) * u * p + g("K_r", 0) * u * r + g("K_vq", 0) * v * q
        + g("K_wp", 0) * w * p + g("K_wr", 0) * w * r
        + g("K_*", 0) * u**2 + g("K_v", 0) * u * v + g("K_v|v|", 0) * v * Rv + g("K_vw", 0) * v * w
        + g("K_dr", 0) * u**2 * dr + g("K_p0", 0) * p
    )  # fmt: skip
    M = (
        g("M_pp", 0) * p**2 + g("M_rr", 0) * r**2 + g("M_rp", 0) * r * p + g("M_q|q|", 0) * q * abs(q)
        + g("M_vr", 0) * v * r + g("M_vp", 0) * v * p + g("M_q", 0) * u * q
        + g("M_|q|ds", 0) * u * abs(q) * ds + g("M_|w|q", 0) * Rw * q
        + g("M_*", 0) * u**2 + g("M_w", 0) * u * w + g("M_w|w|", 0) * w * Rw + g("M_|w|", 0) * u * abs(w)
        + g("M_ww", 0) * abs(w * Rw) + g("M_vv", 0) * v**2
        + u**2 * (g("M_ds", 0) * ds + g("M_db", 0) * db) + g("M_w0", 0) * w + g("M_q0", 0) * q
    )  # fmt: skip
    N = (
        g("N_pq", 0) * p * q + g("N_qr", 0) * q * r + g("N_r|r|", 0) * r * abs(r)
        + g("N_wr", 0) * w * r + g("N_wp", 0) * w * p + g("N_vq", 0) * v * q
        + g("N_p", 0) * u * p + g("N_r", 0) * u * r + g("N_|r|dr", 0) * u * abs(r) * dr
        + g("N_|v|r", 0) * Rv * r + g("N_v|r|", 0) * sv * Rv * abs(r)
        + g("N_*", 0) * u**2 + g("N_v", 0) * u * v + g("N_v|v|", 0) * v * Rv + g("N_vw", 0) * v * w
        + g("N_dr", 0) * u**2 * dr + g("N_v0", 0) * v + g("N_r0", 0) * r
        + g("N_vvv", 0) * v**3 + g("N_vvr", 0) * v**2 * r + g("N_vrr", 0) * v * r**2 + g("N_rrr", 0) * r**3
        + g("N_drdrdr", 0) * u**2 * dr**3 + u * (g("N_vdrdr", 0) * v + g("N_rdrdr", 0) * r) * dr**2
        + (g("N_vvdr", 0) * v**2 + g("N_vrdr", 0) * v * r + g("N_rrdr", 0) * r**2) * dr
    )  # fmt: skip
    return np.array([X, Y, Z, K, M, N])


def strip_drag(vehicle, nu):
    """Trapezoid over the stations of the length (vehicles' README form of Healey and Lienard 1993)."""
    c = vehicle.crossflow
    x = np.linspace(-0.5, 0.5, c.sections) * vehicle.L
    a, b = nu[1] + x * nu[5], nu[2] - x * nu[4]
    speed = np.hypot(a, b)
    pressure = 0.5 * vehicle.rho * (c.Cdy * c.height * a**2 + c.Cdz * c.width * b**2)
    share = np.divide(pressure, speed, out=np.zeros_like(x), where=speed > 0)
    integral = np.trapezoid
    Y, N = -integral(share * a, x), -integral(share * a * x, x)
    Z, M = -integral(share * b, x), integral(share * b * x, x)
    return np.array([0.0, Y, Z, 0.0, M, N])


def restoring(vehicle, phi, theta):
    """Weight at G and buoyancy at B, both vertical, as force and moment about the origin."""
    down = rotation(phi, theta, 0.0).T @ np.array([0.0, 0.0, 1.0])
    force = (vehicle.W - vehicle.B) * down
    moment = np.cross(vehicle.r_G, vehicle.W * down) + np.cross(vehicle.r_B, -vehicle.B * down)
    return np.concatenate([force, moment])


def make_rate(vehicle, planar=False, current=(0.0, 0.0, 0.0), met=(0.0, 0.0, 0.0)):
    """rate(state12, fins, n, extra) in the order x y z phi theta psi u v w p q r, in a current [m/s].

    `met` is the change of the current along the vehicle's way [m/s2, north east down] in water that is steady
    but uneven; `extra` (6,) is a further wrench in body axes."""
    coef = coef_si(vehicle)
    body, coriolis = rigid_body(vehicle.mass, vehicle.r_G, inertia_of(vehicle))
    added = added_mass(coef)
    kept = [0, 1, 5] if planar else list(range(6))
    total = (body + added)[np.ix_(kept, kept)]
    plain_abs = vehicle.plain_abs or planar

    def rate(state, fins, n, extra=0.0):
        phi, theta, psi = state[3:6]
        nu = state[6:]
        R = rotation(phi, theta, psi)
        flow = R.T @ np.asarray(current)
        water = nu - np.concatenate([flow, np.zeros(3)])
        flow_rate = np.concatenate([R.T @ np.asarray(met) - np.cross(nu[3:], flow), np.zeros(3)])
        force = hull_forces(coef, water, fins, plain_abs) - coriolis(nu) + added @ flow_rate + extra
        force[0] += propulsion_force(
            vehicle.propulsion.model, vehicle.propulsion.values, vehicle.rho, vehicle.L, water[0], n
        )
        if vehicle.crossflow:
            force += strip_drag(vehicle, water)
        if not planar:
            force += restoring(vehicle, phi, theta)
            values = vehicle.propulsion.values
            if "Q_ref" in values:  # reaction of the propeller
                force[3] += values["Q_ref"] * n * abs(n) / values["rpm_ref"] ** 2
            if "Kq0" in values:
                rps, D = n / 60.0, values["D"]
                J = max(0.0, water[0] * (1.0 - values["w"]) / (rps * D))
                K_Q = values["Kq0"] * (1.0 - (J / values["Kq_a"]) ** values["Kq_b"])
                force[3] -= vehicle.rho * rps * abs(rps) * D**5 * K_Q
        out = np.zeros(12)
        out[:3] = R @ nu[:3]
        p, q, r = nu[3:]
        out[3] = p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi))
        out[4] = q * np.cos(phi) - r * np.sin(phi)
        out[5] = (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta)
        out[[6 + k for k in kept]] = np.linalg.solve(total, force[kept])
        return out

    return rate
