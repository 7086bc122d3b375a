"""Bundles of campaigns of other vehicles: trial.toml, one CSV per run, the file of a nominal simulator.

Takes: a campaign, its executed runs, the text of a vehicle file. Writes a folder without a word of causes.
Does not: make labels.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bayesid.benchmark.other_equations.campaign import Campaign, Executed
from bayesid.benchmark.other_equations.simulate import CHANNELS
from bayesid.errors import TrialError
from bayesid.files import write_atomic

COLUMNS = {
    "t": "t[s]",
    "x": "x[m]",
    "y": "y[m]",
    "psi": "psi[deg]",
    "r": "r[deg/s]",
    "u": "u[m/s]",
    "v": "v[m/s]",
}
DECIMALS = {"x": 4, "y": 4, "psi": 4, "r": 5, "u": 5, "v": 5}


def write_bundle(campaign: Campaign, runs: Sequence[Executed], vehicle: str, folder: Path) -> None:
    """Write a campaign into a new folder.

    Parameters
    ----------
    vehicle : text of vehicle.toml

    Raises
    ------
    TrialError                 the folder holds a trial already
    """
    if (folder / "trial.toml").exists():
        raise TrialError(f"{folder}: holds a trial already; choose another folder")
    write_atomic(folder / "vehicle.toml", vehicle)
    for run in runs:
        write_atomic(folder / f"{run.plan.name}.csv", run_csv(run))
    write_atomic(folder / "trial.toml", _trial_toml(campaign, folder.name))


def run_csv(run: Executed) -> str:
    """A log as CSV text: degrees for angles, heading from 0 to 360; channels not logged are left out."""
    given = [name for k, name in enumerate(CHANNELS) if np.isfinite(run.logged[:, k]).all()]
    columns = [[f"{t:.3f}" for t in run.record.t]]
    for name in given:
        values = run.logged[:, CHANNELS.index(name)]
        if name in ("psi", "r"):
            values = np.degrees(values)
        if name == "psi":
            values = np.mod(values, 360.0)
        columns.append([f"{value:.{DECIMALS[name]}f}" for value in values])
    columns.append([f"{value:.3f}" for value in np.degrees(run.record.orders[:, 0])])
    columns.append([f"{value:.1f}" for value in run.record.orders[:, 1]])
    header = ",".join([COLUMNS["t"], *(COLUMNS[n] for n in given), "delta_r_cmd[deg]", "n_cmd[rpm]"])
    return "\n".join([header, *(",".join(row) for row in zip(*columns, strict=True))]) + "\n"


def _trial_toml(c: Campaign, name: str) -> str:
    lines = ["format = 1", f"name = {json.dumps(name)}", 'vehicle = "vehicle.toml"', "dof = 3", "", "[noise]"]
    lines += [f"{channel} = {sd!r}" for channel, sd in c.sigma.items()]
    for run in c.runs:
        lines += ["", "[[runs]]", f'file = "{run.name}.csv"', f"manoeuvre = {json.dumps(run.manoeuvre)}"]
        lines.append(f'role = "{run.role}"')
    return "\n".join(lines) + "\n"
