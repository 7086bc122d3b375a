"""The nominal simulators of the other vehicles: bayesid's form of each, tuned once on clean runs.

Usage: python -m studies.other_equations.tune [--vehicle NAME] [--out FOLDER]. Start values follow from the
plants' published numbers by linearisation; an output-error fit in pieces moves them. Writes NAME.toml.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from bayesid.benchmark.other_equations import VEHICLES, OtherVehicle, draw_campaign, executed, other_vehicle
from bayesid.benchmark.other_equations.bundles import write_bundle
from bayesid.benchmark.other_equations.evidence import piece_seconds
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces
from bayesid.model.vehicles import CoefficientPrior, Vehicle, load_vehicle, write_vehicle
from bayesid.progress import Progress
from bayesid.trials import load_trial

SEED = 71
PRIOR = 0.1  # relative sd a bundle states of every coefficient
BOUNDS = 0.9  # half width over |value| while tuning: signs stay. Added mass stays whole, as all scale with it
PIECES = 1.0  # length of a fitted piece, in pieces of ten lengths
TUNED = Path(__file__).with_name("vehicles")
GRAVITY = 9.81
DEGREES = 57.29577951308232


def start_text(v: OtherVehicle) -> str:
    """Vehicle file with start values: bayesid's rows, coefficients by linearisation of the plant."""
    ship = v.name != "strip_auv"
    mass, inertia, x_G, drive, coef = _ship(v) if ship else _auv(v)
    top, rate = DEGREES * v.rudder_max, DEGREES * v.rudder_rate
    head = {
        "nondimensional": "true", "plain_abs": "true", "planar_only": "true", "rho": v.rho, "L": v.L,
        "mass": mass, "Ixx": 0.0, "Iyy": 0.0, "Izz": inertia, "Ixy": 0.0, "Ixz": 0.0, "Iyz": 0.0,
        "r_G": f"[{x_G!r}, 0.0, 0.0]", "r_B": f"[{x_G!r}, 0.0, 0.0]",
        "W": mass * GRAVITY, "B": mass * GRAVITY, "W_equals_B": "false", "U_ref": v.U,
    }  # fmt: skip
    lines = ["[vehicle]", f'name = "{v.text}"', *(f"{k} = {x}" for k, x in head.items())]
    lines += [
        "",
        "[control]",
        f"dr_max_deg = {top:.6g}",
        *(f"{f}_rate_deg_s = {rate:.6g}" for f in ("dr", "ds", "db")),
    ]
    lines += ["", "[propulsion]", 'model = "quadratic"', *(f'"{k}" = {x!r}' for k, x in drive.items())]
    lines += [f"rpm_ref = {v.rpm!r}", "", "[coef]", *(f'"{k}" = {x!r}' for k, x in coef.items())]
    return "\n".join(lines) + "\n"


def _ship(v: OtherVehicle) -> tuple[float, float, float, dict[str, float], dict[str, float]]:
    b = {name: float(v.numbers[name]) for name in v.numbers.dtype.names or ()}
    f, mass = b["d"] / b["L"], b["rho"] * b["volume"]
    thrust = b["rho"] * (1.0 - b["t_P"])
    flow = 1.0 - b["w_P0"]
    drive = {
        "X_prop_u|u|": thrust * b["k_2"] * flow**2 * b["D_P"] ** 2,
        "X_prop_un": thrust * b["k_1"] * flow * b["D_P"] ** 3 / 60.0,
        "X_prop_n|n|": thrust * b["k_0"] * b["D_P"] ** 4 / 3600.0,
        "X_prop_n": 0.0,
    }
    fin = b["A_R"] * b["f_alpha"] / b["L"] ** 2 * 1.2 * flow**2 * b["epsilon"] ** 2 * 1.6
    Y, N = (1.0 + b["a_H"]) * fin, (b["x_R"] + b["a_H"] * b["x_H"]) * fin
    straight = 0.5
    coef = {
        "X_udot": -b["m_x"] * f, "X_u|u|": -b["R_0"] * f, "X_vv": b["X_vv"] * f, "X_rr": b["X_rr"] * f,
        "X_vr": (b["X_vr"] + b["m_y"]) * f, "X_vvvv": b["X_vvvv"] * f, "X_drdr": -0.6 * fin,
        "Y_vdot": -b["m_y"] * f, "Y_v": b["Y_v"] * f - Y * straight,
        "Y_r": (b["Y_r"] - b["m_x"]) * f + 0.7 * Y * straight, "Y_dr": Y, "Y_dr,eta": 0.5 * Y,
        "Y_vvv": b["Y_vvv"] * f, "Y_vvr": b["Y_vvr"] * f, "Y_vrr": b["Y_vrr"] * f, "Y_rrr": b["Y_rrr"] * f,
        "N_rdot": -b["J_z"] * f, "N_v": b["N_v"] * f - N * straight,
        "N_r": b["N_r"] * f + 0.7 * N * straight, "N_dr": N, "N_dr,eta": 0.5 * N, "N_vvv": b["N_vvv"] * f,
        "N_vvr": b["N_vvr"] * f, "N_vrr": b["N_vrr"] * f, "N_rrr": b["N_rrr"] * f,
    }  # fmt: skip
    return mass, mass * ((b["k_zz"] * b["L"]) ** 2 + b["x_G"] ** 2), b["x_G"], drive, coef


def _auv(v: OtherVehicle) -> tuple[float, float, float, dict[str, float], dict[str, float]]:
    b = {name: v.numbers[name] for name in v.numbers.dtype.names or ()}
    half, L = 0.5 * v.rho * v.L**2, v.L
    drive = {
        "X_prop_u|u|": 0.0,
        "X_prop_un": float(v.rho * b["D_P"] ** 3 * b["k_1"] / 60.0),
        "X_prop_n|n|": float(v.rho * b["D_P"] ** 4 * b["k_0"] / 3600.0),
        "X_prop_n": 0.0,
    }
    fin = v.rho * b["S_fin"] * b["lift_slope"]  # a pair
    body, x, Munk = 0.5 * v.rho * b["diameter"] ** 2 * b["body_lift"], b["x_fin"], b["a_y"] - b["a_x"]
    place, h = b["place"], v.L / len(b["place"])
    drag = 0.5 * v.rho * b["C_dc"] * h * b["breadth"]
    si = {
        "X_udot": (-b["a_x"], 3), "X_u|u|": (-b["drag"] - 2 * v.rho * b["S_fin"] * b["fin_drag"], 2),
        "X_vv": (0.5 * fin, 2), "X_vr": (b["a_y"] + 0.5 * fin * x, 3), "X_rr": (-b["a_yr"] * -1.0, 4),
        "X_drdr": (-0.3 * fin, 2), "Y_vdot": (-b["a_y"], 3), "Y_rdot": (-b["a_yr"], 4),
        "Y_v": (-fin - body, 2), "Y_r": (-x * fin - b["a_x"], 3), "Y_dr": (fin, 2),
        "Y_v|v|": (-float(drag.sum()), 2), "Y_r|r|": (-float((drag * place * abs(place)).sum()), 4),
        "Y_v|r|": (-float((drag * abs(place)).sum()), 3), "N_vdot": (-b["a_yr"], 4), "N_rdot": (-b["a_r"], 5),
        "N_v": (-Munk - body * b["x_cp"] - fin * x, 3), "N_r": (-x * x * fin + b["a_yr"], 4),
        "N_dr": (x * fin, 3), "N_v|v|": (-float((drag * place).sum()), 3),
        "N_r|r|": (-float((drag * abs(place) ** 3).sum()), 5), "N_|v|r": (-float((drag * place**2).sum()), 4),
    }  # fmt: skip
    coef = {name: float(value) / (half * L ** (power - 2)) for name, (value, power) in si.items()}
    return float(b["m"]), float(b["I_z"]), 0.0, drive, coef


def tuned(name: str, progress: Progress) -> Vehicle:
    """Nominal simulator of a vehicle, tuned on one clean campaign."""
    v = other_vehicle(name)
    campaign = draw_campaign(SEED, name)
    campaign = replace(campaign, runs=tuple(replace(run, role="identify") for run in campaign.runs))
    with TemporaryDirectory() as place, progress.stage(f"tune {name}") as stage:
        bundle = Path(place) / name
        write_bundle(campaign, executed(campaign), start_text(v), bundle)
        start = load_vehicle(bundle / "vehicle.toml")
        kept = [n for n in start.coef if n.endswith("dot")]
        found = fit_in_pieces(
            load_trial(bundle), PIECES * piece_seconds(v), start, fixed=kept, relative_bounds=BOUNDS,
            use_prior=False, options=FitOptions(rounds=8),
            parts=NoiseParts(), watch=lambda done, cost, step: stage.step(info=f"cost {cost:.6g}"),
        )  # fmt: skip
    print(found.fit.status, found.fit.message)
    told: Mapping[str, float] = dict.fromkeys(found.identified.coef, PRIOR)
    return replace(
        found.identified, name=v.text, source="tuned on clean runs of the plant", validation={},
        confidence={}, sources={}, prior=CoefficientPrior(dict(told)),
    )  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicle", choices=VEHICLES, help="default: all")
    parser.add_argument("--out", type=Path, default=Path("out/other_equations_vehicles"))
    asked = parser.parse_args()
    for each in (asked.vehicle,) if asked.vehicle else VEHICLES:
        print(write_vehicle(tuned(each, Progress()), asked.out / f"{each}.toml"))
