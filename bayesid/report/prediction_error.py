"""How well a vehicle predicts runs: rms errors in usual units and fit per cent, beside another vehicle.

Takes `RunOutcome` of a fit. Gives table rows and plain numbers; does not simulate.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from bayesid.estimation.trial_fit import RunOutcome
from bayesid.model.channels import channel
from bayesid.trials.noise import rough_noise

PREDICTION_COLUMNS = (
    "run",
    "role",
    "channel",
    "rms as given",
    "as found",
    "fit as given [%]",
    "as found [%]",
)


# Standard deviation of readings over that of their noise up to which a channel moves no more than its noise.
HARDLY_MOVES = 2.0**0.5
NO_FIT = (
    "No fit [%] (–) of a channel that moves no more than its noise, as a depth that is held: it would set "
    "the error against noise. Its rms error counts."
)


def hardly_moves(t: np.ndarray, readings: np.ndarray, sigma: float) -> bool:
    """Whether readings vary so little that what is left of them beside their noise is no larger than it.

    A noise that is not stated, `sigma` of a fit, is error of the model too: no more counts than fast changes
    of the readings show.
    """
    spread, seen = float(np.nanstd(readings)), rough_noise(t, readings)
    return spread == 0.0 or spread <= HARDLY_MOVES * (min(sigma, seen) if np.isfinite(seen) else sigma)


def fit_percent(rms: float, t: np.ndarray, readings: np.ndarray, sigma: float) -> float:
    """100 (1 - rms error / standard deviation of the readings): 100 is perfect, 0 as good as their mean; nan
    where the channel hardly moves, by its noise `sigma`.
    """
    if hardly_moves(t, readings, sigma):
        return float("nan")
    return 100.0 * (1.0 - rms / float(np.nanstd(readings)))


def no_fit_note(runs: Iterable[RunOutcome]) -> str:
    """What a dash in `prediction_rows` stands for; empty where there is none."""
    still = any(hardly_moves(run.t, run.readings[:, j], s) for run in runs for j, s in enumerate(run.sigma))
    return NO_FIT if still else ""


def prediction_rows(runs: Iterable[RunOutcome]) -> list[list[Any]]:
    """Rows of `PREDICTION_COLUMNS`, one per run and channel."""
    rows = []
    for run in runs:
        for j, name in enumerate(run.channels):
            factor, unit = channel(name).shown
            pair = (float(run.rms_nominal[j]), float(run.rms_fitted[j]))
            shares = [fit_percent(rms, run.t, run.readings[:, j], float(run.sigma[j])) for rms in pair]
            rows.append([run.name, run.role, f"{name} [{unit}]", *(factor * rms for rms in pair), *shares])
    return rows


def prediction_numbers(runs: Iterable[RunOutcome]) -> list[dict[str, Any]]:
    """The same as plain numbers for results.json, SI; no series."""
    found = []
    for run in runs:
        channels = {}
        for j, name in enumerate(run.channels):
            nominal, fitted = float(run.rms_nominal[j]), float(run.rms_fitted[j])
            sigma = float(run.sigma[j])
            channels[name] = {
                "rms_nominal": nominal, "rms_fitted": fitted,
                "fit_nominal_percent": fit_percent(nominal, run.t, run.readings[:, j], sigma),
                "fit_percent": fit_percent(fitted, run.t, run.readings[:, j], sigma),
            }  # fmt: skip
        found.append({"run": run.name, "manoeuvre": run.manoeuvre, "role": run.role, "channels": channels})
    return found
