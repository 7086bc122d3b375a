"""Bundles for whoever is to find out, answers for whoever is to judge; never in the same folder.

Takes: a campaign. Writes trial.toml, vehicle.toml and one CSV per run; returns the truth as plain values.
Does not: commit or score.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.plant.body import cruising_speed
from bayesid.benchmark.plant.campaign import Campaign
from bayesid.benchmark.plant.draw import draw_campaign
from bayesid.benchmark.plant.execute_campaign import ExecutedRun, execute_campaign
from bayesid.errors import TrialError
from bayesid.model.vehicles import CoefficientPrior, write_vehicle

DECIMALS = {"t": 2, "x": 3, "y": 3, "z": 3, "psi": 4, "phi": 4, "theta": 4, "r": 5, "p": 5, "q": 5,
            "u": 5, "v": 5, "w": 5, "delta_r_cmd": 3, "delta_s_cmd": 3, "n_cmd": 1}  # fmt: skip
UNITS = {"t": "s", "x": "m", "y": "m", "z": "m", "u": "m/s", "v": "m/s", "w": "m/s", "n_cmd": "rpm",
         "r": "deg/s", "p": "deg/s", "q": "deg/s"}  # fmt: skip


def write_bundle(campaign: Campaign, folder: str | Path, name: str | None = None) -> dict[str, Any]:
    """Write the bundle into a new folder.

    Returns
    -------
    dict                       the truth, ready for JSON; it is nowhere in the folder

    Raises
    ------
    TrialError                 the folder holds a trial already
    """
    folder = Path(folder)
    name = name or folder.name
    if (folder / "trial.toml").exists():
        raise TrialError(f"{folder}: holds a trial already; choose another folder")
    execution = execute_campaign(campaign)
    folder.mkdir(parents=True, exist_ok=True)
    c = campaign
    prior = CoefficientPrior(dict.fromkeys(c.vehicle.coef, c.prior_sd))
    nominal = replace(c.vehicle, prior=prior, validation={}, confidence={}, sources={})
    write_vehicle(nominal, folder / "vehicle.toml", schema=False)
    for run in execution.runs:
        (folder / f"{run.plan.name}.csv").write_text(run_csv(run), encoding="utf-8", newline="\n")
    (folder / "trial.toml").write_text(_trial_toml(c, name), encoding="utf-8", newline="\n")
    return truth(campaign, name)


def run_csv(run: ExecutedRun) -> str:
    """The log as CSV text: degrees for angles, heading between 0 and 360, missing samples empty."""
    order = ["x", "y", "psi", "r", "u", "v", "delta_r_cmd", "n_cmd", "z", "phi", "theta", "p", "q", "w"]
    series = {"t": run.t} | run.data | run.commands
    names = ["t", *(n for n in order if n in series)] + (["delta_s_cmd"] if "delta_s_cmd" in series else [])
    columns = []
    for name in names:
        values = series[name]
        if UNITS.get(name, "deg").startswith("deg"):
            values = np.degrees(values)
        if name == "psi":
            values = np.mod(values, 360.0)
        text = [f"{value:.{DECIMALS[name]}f}" for value in values]
        columns.append(["" if word == "nan" else word for word in text])
    header = ",".join(f"{name}[{UNITS.get(name, 'deg')}]" for name in names)
    return "\n".join([header, *(",".join(row) for row in zip(*columns, strict=True))]) + "\n"


def _trial_toml(c: Campaign, name: str) -> str:
    lines = ["format = 1", f"name = {json.dumps(name)}", 'vehicle = "vehicle.toml"', f"dof = {c.dof}"]
    lines += ["", "[noise]", *(f"{channel} = {sd!r}" for channel, sd in c.sigma.items())]
    if c.disturbance.sea == "still":
        lines += ["", "[environment]", "force_rms = 0.0", "nav_drift = 0.0"]
    for run in c.runs:
        lines += ["", "[[runs]]", f'file = "{run.name}.csv"', f"manoeuvre = {json.dumps(run.manoeuvre)}"]
        lines.append(f'role = "{run.role}"')
    return "\n".join(lines) + "\n"


def truth(campaign: Campaign, name: str) -> dict[str, Any]:
    """Everything that is true of a campaign, as plain values."""
    c, execution = campaign, execute_campaign(campaign)
    scale = _force_scale(c)
    return {
        "format": 1,
        "name": name,
        "seed": c.seed,
        "attempt": c.attempt,
        "kind": c.kind,
        "label": c.label,
        "vehicle": c.vehicle_name,
        "dof": c.dof,
        "sensors": c.sensors,
        "campaign": "rich" if c.rich else "zig-zags",
        "prior_relative_sd": c.prior_sd,
        "effects": [asdict(planted) for planted in c.planted],
        "coefficient_error": c.coefficient_error,
        "coefficient_draw_relative": {
            key: (c.coef[key] - value) / value if value else 0.0 for key, value in c.vehicle.coef.items()
        },
        "environment": asdict(c.disturbance)
        | {"force_rms": [float(v) for v in np.array(c.disturbance.amplitude) * execution.typical / scale]},
        "noise": c.sigma,
        "runs": [
            {"file": f"{run.name}.csv", "manoeuvre": run.manoeuvre, "role": run.role,
             "seconds": run.duration, "start": [float(v) for v in executed.start[:12]]}
            for run, executed in zip(c.runs, execution.runs, strict=True)
        ],
    }  # fmt: skip


def _force_scale(c: Campaign) -> np.ndarray:
    """1/2 rho L^2 U^2 for X Y Z, times L for N M: the scale of `force_rms` in trial.toml."""
    v = c.vehicle
    force = 0.5 * v.rho * v.L**2 * cruising_speed(v, float(v.rpm_ref or math.nan)) ** 2
    return force * np.array([1.0, 1.0, v.L, 1.0, v.L])


def write_pack(
    count: int, seed: int, out: str | Path, answers: str | Path, prefix: str = "p", **factors: Any
) -> list[dict[str, Any]]:
    """Write `count` bundles into `out` and one JSON answer each into `answers`; campaign k has seed + k.

    Raises
    ------
    TrialError                 one folder lies within the other, or a bundle exists already
    """
    packs, committed = Path(out).resolve(), Path(answers).resolve()
    if packs == committed or packs in committed.parents or committed in packs.parents:
        raise TrialError("answers must be in a folder of their own, not within the bundles or around them")
    committed.mkdir(parents=True, exist_ok=True)
    made = []
    for k in range(count):
        name = f"{prefix}{seed + k:04d}"
        answer = write_bundle(draw_campaign(seed + k, **factors), packs / name)
        (committed / f"{name}.json").write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")
        made.append(answer)
    return made
