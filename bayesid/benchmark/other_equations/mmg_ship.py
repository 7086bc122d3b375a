"""A ship by the MMG standard method: hull polynomial, propeller, rudder behind it. Three degrees of freedom.

Yasukawa and Yoshimura (2015), Introduction of MMG standard method for ship maneuvering predictions, J Mar Sci
Technol 20:37-52; numbers of KVLCC2, the 7 m model (their table 3 and section 4).
Takes: state, rudder angle (positive turns to PORT; the paper has the other sign), shaft speed [1/s], causes.
Does not: step in time.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

NUMBERS = {
    "rho": 1000.0, "L": 7.0, "B": 1.27, "d": 0.46, "volume": 3.27, "x_G": 0.25, "D_P": 0.216, "H_R": 0.345,
    "A_R": 0.0539, "k_zz": 0.25, "m_x": 0.022, "m_y": 0.223, "J_z": 0.011, "t_P": 0.220, "w_P0": 0.40,
    "x_P": -0.690, "C_1": 2.0, "C_2plus": 1.6, "C_2minus": 1.1, "t_R": 0.387, "a_H": 0.312, "x_H": -0.464,
    "x_R": -0.500, "gamma_minus": 0.395, "gamma_plus": 0.640, "l_R": -0.710, "epsilon": 1.09, "kappa": 0.50,
    "f_alpha": 2.747, "k_0": 0.2931, "k_1": -0.2753, "k_2": -0.1385, "R_0": 0.022, "X_vv": -0.040,
    "X_vr": 0.002, "X_rr": 0.011, "X_vvvv": 0.771, "Y_v": -0.315, "Y_r": 0.083, "Y_vvv": -1.607,
    "Y_vvr": 0.379, "Y_vrr": -0.391, "Y_rrr": 0.008, "N_v": -0.137, "N_r": -0.049, "N_vvv": -0.030,
    "N_vvr": -0.294, "N_vrr": 0.055, "N_rrr": -0.013,
    # exposed areas over L^2 and coefficients of a laden tanker (assumed: KVLCC2 above its waterline)
    "air_front": 0.0113, "air_side": 0.0318, "air_X": 0.7, "air_Y": 0.9, "air_N": 0.1,
}  # fmt: skip
AIR = 1.2  # kg/m^3
FROUDE_ACROSS = 1e-6  # speeds below are no speed: angles of the flow are not defined


def ship_numbers(length: float = 7.0, **changed: float) -> np.void:
    """KVLCC2 scaled to a length by Froude's law, as a record for `rates`."""
    values = dict(NUMBERS)
    scale = length / values["L"]
    for name, power in (("L", 1), ("B", 1), ("d", 1), ("x_G", 1), ("D_P", 1), ("H_R", 1), ("A_R", 2),
                        ("volume", 3)):  # fmt: skip
        values[name] *= scale**power
    values |= changed
    out = np.zeros(1, np.dtype([(name, "f8") for name in values]))[0]
    for name, value in values.items():
        out[name] = value
    return out


def mirrored_ship(numbers: np.void) -> np.void:
    """The ship with port and starboard exchanged: wake and flow straightening differ by side."""
    out = numbers.copy()
    for a, b in (("C_2plus", "C_2minus"), ("gamma_plus", "gamma_minus")):
        out[a], out[b] = numbers[b], numbers[a]
    return out


def self_propulsion_rps(numbers: np.void, speed: float) -> float:
    """Shaft speed [1/s] at which thrust balances resistance on a straight course: a quadratic, solved."""
    b = numbers
    drag = 0.5 * b["rho"] * b["L"] * b["d"] * speed**2 * b["R_0"]
    flow = speed * (1.0 - b["w_P0"])
    # (1 - t) rho D^2 (k_0 n^2 D^2 + k_1 V n D + k_2 V^2) = R
    a2, a1 = b["k_0"] * b["D_P"] ** 2, b["k_1"] * flow * b["D_P"]
    a0 = b["k_2"] * flow**2 - drag / ((1.0 - b["t_P"]) * b["rho"] * b["D_P"] ** 2)
    return float((-a1 + math.sqrt(a1 * a1 - 4.0 * a2 * a0)) / (2.0 * a2))


@njit(cache=True)
def ship_rates(t, x, delta, rps, sea, b, g, out):
    """Time derivative of x y z phi theta psi u v w p q r (through the water; the ship uses six) into `out`.

    Parameters
    ----------
    sea : (3,) force X, Y [N] and moment N [N m]
    b, g : numbers of the ship, causes
    """
    psi, u, v, r = x[5], x[6], x[7], x[11]
    U = math.sqrt(u * u + v * v) + FROUDE_ACROSS
    vd, rd = v / U, r * b.L / U
    area = 0.5 * b.rho * b.L * b.d * U * U
    bottom = 1.0 + g.bottom * 0.5 * (1.0 + math.sin((x[0] * g.bottom_n + x[1] * g.bottom_e) * g.bottom_k))
    v2, r2 = vd * vd, rd * rd
    X = -b.R_0 * (1.0 + g.fouling) + b.X_vv * v2 + b.X_vr * vd * rd + b.X_rr * r2 + b.X_vvvv * v2 * v2
    Y = (
        b.Y_v * vd
        + b.Y_r * rd
        + b.Y_vvv * v2 * vd
        + b.Y_vvr * v2 * rd
        + b.Y_vrr * vd * r2
        + b.Y_rrr * r2 * rd
    )
    N = (
        b.N_v * vd
        + b.N_r * rd
        + b.N_vvv * v2 * vd
        + b.N_vvr * v2 * rd
        + b.N_vrr * vd * r2
        + b.N_rrr * r2 * rd
    )
    X, Y, N = area * X * bottom, area * Y * bottom, area * b.L * N * bottom
    # propeller: wake by the drift at the stern, its change on either side
    beta = math.atan2(-v, u)
    beta_P = beta - b.x_P * rd
    C_2 = b.C_2plus if beta_P > 0.0 else b.C_2minus
    wake = (1.0 - b.w_P0) * (1.0 + (1.0 - math.exp(-b.C_1 * abs(beta_P))) * (C_2 - 1.0))
    ahead = u * wake
    speed = max(rps, 1e-3)
    J = ahead / (speed * b.D_P)
    K_T = (b.k_0 + b.k_1 * J + b.k_2 * J * J) * (1.0 - g.thrust_loss)
    T = b.rho * speed * speed * b.D_P**4 * K_T
    X += (1.0 - b.t_P) * T
    side = g.side_force * (1.0 - b.t_P) * T  # of the thrust the hull feels, as simulators state it
    Y += side
    N += side * b.x_R * b.L
    # rudder: race of the propeller over a part of its height, flow straightened by hull and propeller
    loading = max(1.0 + 8.0 * K_T / (math.pi * J * J), 0.0) if abs(J) > 1e-6 else 1.0
    eta = b.D_P / b.H_R
    race = 1.0 + b.kappa * (math.sqrt(loading) - 1.0)
    u_R = b.epsilon * ahead * math.sqrt(eta * race * race + 1.0 - eta)
    beta_R = beta - b.l_R * rd
    v_R = U * (b.gamma_plus if beta_R > 0.0 else b.gamma_minus) * beta_R
    starboard = -delta
    alpha = starboard - math.atan2(v_R, u_R)
    F_N = 0.5 * b.rho * b.A_R * (u_R * u_R + v_R * v_R) * b.f_alpha * math.sin(alpha)
    X -= (1.0 - b.t_R) * F_N * math.sin(starboard)
    Y -= (1.0 + b.a_H) * F_N * math.cos(starboard)
    N -= (b.x_R + b.a_H * b.x_H) * b.L * F_N * math.cos(starboard)
    c, s = math.cos(psi), math.sin(psi)
    if g.wind_n != 0.0 or g.wind_e != 0.0:
        for north, east, sign in ((g.wind_n, g.wind_e, 1.0), (0.0, 0.0, -1.0)):  # less that of still air
            a = north * c + east * s - u - g.current_n * c - g.current_e * s
            w = east * c - north * s - v - g.current_e * c + g.current_n * s
            q = sign * 0.5 * AIR * math.sqrt(a * a + w * w) * b.L * b.L
            X += q * b.air_front * b.air_X * a
            Y += q * b.air_side * b.air_Y * w
            N += q * b.air_side * b.L * b.air_N * a * w * 2.0 / (math.sqrt(a * a + w * w) + 1e-9) * -1.0
    swell = g.swell * math.sin(g.swell_w * t + g.swell_p)
    X += sea[0] + swell * (g.swell_n * c + g.swell_e * s)
    Y += sea[1] + swell * (g.swell_e * c - g.swell_n * s)
    N += sea[2]
    m = b.rho * b.volume
    half = 0.5 * b.rho * b.L**2 * b.d
    m_x, m_y, x_G = half * b.m_x, half * b.m_y, b.x_G
    I = m * (b.k_zz * b.L) ** 2 + x_G * x_G * m + half * b.L**2 * b.J_z
    X += (m + m_y) * v * r + x_G * m * r * r
    Y -= (m + m_x) * u * r
    N -= x_G * m * u * r
    det = (m + m_y) * I - (x_G * m) ** 2
    out[:] = 0.0
    out[0] = u * c - v * s + g.current_n
    out[1] = u * s + v * c + g.current_e
    out[5] = r
    out[6] = X / (m + m_x)
    out[7] = (Y * I - N * x_G * m) / det
    out[11] = (N * (m + m_y) - Y * x_G * m) / det
