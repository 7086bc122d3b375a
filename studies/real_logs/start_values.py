"""Which table rows stand for a published MMG parameter set? Prints [propulsion] and [coef] of a vehicle file.

Takes: the data folder (`--data`) with `kvlcc2_hsva/mmg_reference` and `esso_osaka/mmg_reference`.
Gives: rows fitted to the MMG hull and rudder forces over the range of motion of the free-running trials. The
numbers are starting values with wide priors; nothing is fitted to a trial here.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from bayesid.model.terms import term

SAMPLES = 4000
SHIP_ROWS = {
    "X": ("X_vv", "X_vr", "X_rr", "X_vvvv", "X_drdr"),
    "Y": ("Y_v", "Y_r", "Y_vvv", "Y_vvr", "Y_vrr", "Y_rrr", "Y_dr", "Y_dr,eta"),
    "N": ("N_v", "N_r", "N_vvv", "N_vvr", "N_vrr", "N_rrr", "N_dr", "N_dr,eta"),
}


@dataclass(frozen=True)
class Ship:
    """MMG parameters, SI or in MMG primes (forces 1/2 rho L d U^2, moments 1/2 rho L^2 d U^2)."""

    rho: float
    L: float
    d: float
    D: float
    A_R: float
    f_alpha: float
    eta: float  # propeller diameter over rudder height
    hull: dict[str, float]
    kt: tuple[float, float, float]
    w: float
    t: float
    t_R: float
    a_H: float
    x_H: float
    gamma: tuple[float, float]  # inflow angle to the rudder negative, positive
    l_R: float
    epsilon: float
    kappa: float
    added: tuple[float, float, float]  # m_x, m_y, J_z
    resistance: float
    U_ref: float
    speeds: tuple[float, float]  # surge speed over the speed of straight running
    rpm: tuple[float, float]


def thrust_rows(ship: Ship) -> dict[str, float]:
    """(1 - t) rho n^2 D^4 (k0 + k1 J + k2 J^2) with J = u (1 - w) / (n D), n in rpm: exact."""
    k0, k1, k2 = ship.kt
    base = (1 - ship.t) * ship.rho * ship.D**2
    return {
        "X_prop_n|n|": base * ship.D**2 * k0 / 3600,
        "X_prop_un": base * ship.D * k1 * (1 - ship.w) / 60,
        "X_prop_u|u|": base * k2 * (1 - ship.w) ** 2,
    }


def straight_speed(ship: Ship, rpm: float) -> float:
    """Speed at which thrust and resistance balance, m/s."""
    rows = thrust_rows(ship)
    drag = rows["X_prop_u|u|"] - 0.5 * ship.rho * ship.L * ship.d * ship.resistance

    def surplus(u: float) -> float:
        return rows["X_prop_n|n|"] * rpm**2 + rows["X_prop_un"] * u * rpm + drag * u * u

    return float(brentq(surplus, 1e-3, 10.0))


def wrench(ship: Ship, u, v, r, delta, rpm):
    """Hull (without resistance) and rudder force, (n, 3) in N, N, N m about midship; delta > 0 to starboard.

    Yasukawa and Yoshimura (2015); hulls with cross-flow drag after Yoshimura, Nakao and Ishibashi (2009)."""
    h, L, d = ship.hull, ship.L, ship.d
    U = np.hypot(u, v)
    vp, rp = v / U, r * L / U
    force = 0.5 * ship.rho * L * d * U**2
    if "Y_vvv" in h:
        X = h["X_vv"] * vp**2 + h["X_vr"] * vp * rp + h["X_rr"] * rp**2 + h["X_vvvv"] * vp**4
        Y, N = (
            sum(h[f"{axis}_{name}"] * vp ** name.count("v") * rp ** name.count("r") for name in _POLYNOMIAL)
            for axis in "YN"
        )
    else:
        x = np.linspace(-0.5, 0.5, 101)[:, None]
        over_y, over_n = vp + h["C_rY"] * rp * x, vp + h["C_rN"] * rp * x
        Y = h["Y_v"] * vp + h["Y_r"] * rp - h["C_D"] * np.trapezoid(np.abs(over_y) * over_y, x, axis=0)
        N = h["N_v"] * vp + h["N_r"] * rp - h["C_D"] * np.trapezoid(np.abs(over_n) * over_n * x, x, axis=0)
        X = h["X_vr"] * vp * rp
    J = u * (1 - ship.w) * 60 / (rpm * ship.D)
    K_T = ship.kt[0] + ship.kt[1] * J + ship.kt[2] * J**2
    race = 1 + ship.kappa * (np.sqrt(1 + 8 * K_T / (math.pi * J**2)) - 1)
    u_R = ship.epsilon * u * (1 - ship.w) * np.sqrt(ship.eta * race**2 + 1 - ship.eta)
    beta_R = -v / U - ship.l_R * rp
    v_R = U * np.where(beta_R < 0, *ship.gamma) * beta_R
    F_N = 0.5 * ship.rho * ship.A_R * ship.f_alpha * (u_R**2 + v_R**2) * np.sin(delta - np.arctan2(v_R, u_R))
    X_R = -(1 - ship.t_R) * F_N * np.sin(delta)
    Y_R = -(1 + ship.a_H) * F_N * np.cos(delta)
    N_R = -(-0.5 + ship.a_H * ship.x_H) * L * F_N * np.cos(delta)
    return np.column_stack((force * X + X_R, force * Y + Y_R, force * L * N + N_R))


_POLYNOMIAL = ("v", "r", "vvv", "vvr", "vrr", "rrr")


def rows_of(ship: Ship) -> tuple[dict[str, float], dict[str, float]]:
    """Prime coefficients (port-positive rudder) and the share of each axis' variance they explain."""
    rng = np.random.default_rng(2015)
    rpm = rng.uniform(*ship.rpm, SAMPLES)
    straight = np.array([straight_speed(ship, value) for value in rpm])
    u = straight * rng.uniform(*ship.speeds, SAMPLES)
    r = rng.uniform(-0.9, 0.9, SAMPLES) * u / ship.L
    v = -0.4 * r * ship.L + 0.15 * u * rng.standard_normal(SAMPLES)
    delta = np.radians(rng.uniform(-35, 35, SAMPLES))  # port-positive
    tau = wrench(ship, u, v, r, -delta, rpm)
    known = {"u": u, "v": v, "r": r, "delta_r": delta, "eta1": straight / np.hypot(u, v) - 1}
    prime, explained = {}, {}
    for k, axis in enumerate("XYN"):
        names = SHIP_ROWS[axis]
        columns = np.column_stack(
            [np.prod([known[f.symbol] for f in term(n).factors], axis=0) for n in names]
        )
        values = np.linalg.lstsq(columns, tau[:, k], rcond=None)[0]
        explained[axis] = 1 - np.var(tau[:, k] - columns @ values) / np.var(tau[:, k])
        for name, value in zip(names, values, strict=True):
            row = term(name)
            scale = 0.5 * ship.rho * ship.L**row.length_power * ship.U_ref ** (2 - row.velocity_power)
            prime[name] = float(value / scale)
    slender = ship.d / ship.L
    m_x, m_y, J_z = (value * slender for value in ship.added)
    prime |= {"X_udot": -m_x, "Y_vdot": -m_y, "N_rdot": -J_z, "X_u|u|": -ship.resistance * slender}
    prime["X_vr"] += m_y  # MMG keeps the added-mass Coriolis parts on the left
    prime["Y_r"] -= m_x
    return prime, explained


def kvlcc2(folder: Path) -> Ship:
    tree = json.loads((folder / "mmg_reference" / "kvlcc2_l7_mmg.json").read_text())
    b, hull = tree["basic"], tree["hull"]
    with open(folder / "open_water_characteristics.csv", newline="") as file:
        table = np.array([[float(row["J"]), float(row["Kt"])] for row in csv.DictReader(file)])
    k2, k1, k0 = np.polyfit(table[:, 0], table[:, 1], 2)
    # wake and resistance from the measured thrust of the approach: 41.0 N at 613.8 rpm and 1.178 m/s
    rho, L, d, D, n, u, thrust = 1000.0, 7.0, 0.455, 0.204, 613.8 / 60, 1.178, 41.0
    J = brentq(lambda J: k0 + k1 * J + k2 * J * J - thrust / (rho * n**2 * D**4), 0.0, 0.9)
    resistance = (1 - b["t_P"]) * thrust / (0.5 * rho * L * d * u**2)
    gamma = (b["gamma_R_minus"], b["gamma_R_plus"])
    return Ship(
        rho, L, d, D, b["A_R_m2"], b["f_alpha"], b["D_p_m"] / b["H_R_m"], hull, (k0, k1, k2),
        1 - J * n * D / u, b["t_P"], b["t_R"], b["a_H"], b["x_H_dash"], gamma,
        b["l_R_dash"], b["epsilon"], b["kappa"], (b["m_x_dash"], b["m_y_dash"], b["J_z_dash"]), resistance,
        U_ref=1.0, speeds=(0.6, 1.0), rpm=(613.7, 613.9),
    )  # fmt: skip


def esso_osaka(folder: Path) -> Ship:
    with open(folder / "mmg_reference" / "MMG_params.csv", newline="") as file:
        p = {row["parameter"]: float(row["params_init"]) for row in csv.DictReader(file)}
    with open(folder / "mmg_reference" / "principal_particulars.csv", newline="") as file:
        s = {row["parameter"]: float(row["value"]) for row in csv.DictReader(file)}
    hull = {"X_vr": p["xvr_nd"], "Y_v": p["yv_nd"], "Y_r": p["yr_nd"], "N_v": p["nv_nd"],
            "N_r": p["nr_nd"], "C_D": p["coeff_drag_sway"], "C_rY": p["cry_cross_flow"],
            "C_rN": p["crn_cross_flow"]}  # fmt: skip
    aspect, area = s["lambda_rudder"], s["area_rudder"]
    J_z = p["IzzJzz_nd"] - s["mass_nd"] * (0.25**2 + s["x_lcg"] ** 2)  # assumed: k_zz = 0.25 L
    return Ship(
        s["rho_fresh"], s["lpp"], s["draft"], s["dia_prop"], area, 6.13 * aspect / (aspect + 2.25),
        s["dia_prop"] / math.sqrt(aspect * area), hull, (p["kt_coeff0"], p["kt_coeff1"], p["kt_coeff2"]),
        p["w_prop_zero"], p["t_prop"], p["t_rudder"], p["ah_rudder"], p["xh_rudder_nd"],
        (p["gammaN_rudder"], p["gammaP_rudder"]), p["lr_rudder_nd"], p["epsilon_rudder"], p["kx_rudder"],
        (p["massx_nd"], p["massy_nd"], J_z), -p["xuu_nd"], U_ref=0.3, speeds=(0.4, 1.0), rpm=(480.0, 1000.0),
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with kvlcc2_hsva and esso_osaka")
    data = parser.parse_args().data
    for name, read in (("kvlcc2_hsva", kvlcc2), ("esso_osaka", esso_osaka)):
        ship = read(data / name)
        prime, explained = rows_of(ship)
        rpm = float(np.mean(ship.rpm))
        print(f"# {name}: {straight_speed(ship, rpm):.4f} m/s at {rpm:.1f} rpm;", end=" ")
        print("explained " + ", ".join(f"{axis} {share:.4f}" for axis, share in explained.items()))
        print('[propulsion]\nmodel = "quadratic"')
        for key, value in thrust_rows(ship).items():
            print(f'"{key}" = {value:.5g}')
        print("[coef]")
        for key in sorted(prime, key=lambda name: ("XYN".index(name[0]), "dot" not in name)):
            quoted = key if key.replace("_", "").isalnum() else f'"{key}"'
            print(f"{quoted} = {prime[key]:.5g}")


if __name__ == "__main__":
    main()
