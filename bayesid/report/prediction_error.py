"""How well a vehicle predicts runs: rms errors in usual units and fit per cent, beside another vehicle.

Takes `RunOutcome` of a fit. Gives table rows and plain numbers; does not simulate.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from bayesid.estimation.trial_fit import RunOutcome
from bayesid.model.channels import channel

PREDICTION_COLUMNS = (
    "run",
    "role",
    "channel",
    "rms as given",
    "as found",
    "fit as given [%]",
    "as found [%]",
)


def fit_percent(rms: float, readings: np.ndarray) -> float:
    """100 (1 - rms error / standard deviation of the readings): 100 is perfect, 0 as good as their mean."""
    spread = float(np.nanstd(readings))
    return 100.0 * (1.0 - rms / spread) if spread > 0 else float("nan")


def prediction_rows(runs: Iterable[RunOutcome]) -> list[list[Any]]:
    """Rows of `PREDICTION_COLUMNS`, one per run and channel."""
    rows = []
    for run in runs:
        for j, name in enumerate(run.channels):
            factor, unit = channel(name).shown
            pair = (float(run.rms_nominal[j]), float(run.rms_fitted[j]))
            shares = [fit_percent(rms, run.readings[:, j]) for rms in pair]
            rows.append([run.name, run.role, f"{name} [{unit}]", *(factor * rms for rms in pair), *shares])
    return rows


def prediction_numbers(runs: Iterable[RunOutcome]) -> list[dict[str, Any]]:
    """The same as plain numbers for results.json, SI; no series."""
    found = []
    for run in runs:
        channels = {}
        for j, name in enumerate(run.channels):
            nominal, fitted = float(run.rms_nominal[j]), float(run.rms_fitted[j])
            channels[name] = {
                "rms_nominal": nominal, "rms_fitted": fitted,
                "fit_nominal_percent": fit_percent(nominal, run.readings[:, j]),
                "fit_percent": fit_percent(fitted, run.readings[:, j]),
            }  # fmt: skip
        found.append({"run": run.name, "manoeuvre": run.manoeuvre, "role": run.role, "channels": channels})
    return found
