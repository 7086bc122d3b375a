"""The shaft speed where a log or a table orders none: the vehicle's usual one, held.

Takes a trial or a manoeuvre, and the vehicle. Gives it with `n_cmd`. Does not guess a speed from the track.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesid.manoeuvres import Manoeuvre, OpenLoop
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import has_propeller
from bayesid.trials import Trial

SAID = "no run logs the shaft speed"


def with_shaft_speed(trial: Trial, vehicle: Vehicle) -> Trial:
    """The trial with the vehicle's usual shaft speed in every run, and a warning, where no run has any.

    A propeller at rest would brake the vehicle, and a cause would be named for it. Trials that log n in some
    run, vehicles without a propeller and files without `rpm_ref` (a warning says so) stay as they are.
    """
    if any(run.input("n") is not None for run in trial.runs) or not has_propeller(vehicle):
        return trial
    if shaft_speed_note(trial) is not None:
        return trial
    rpm, runs = vehicle.rpm_ref, trial.runs
    if rpm is not None:
        runs = tuple(
            replace(run, commands={**run.commands, "n_cmd": np.full(run.n_samples, rpm)}) for run in runs
        )
    return replace(trial, runs=runs, warnings=(*trial.warnings, shaft_speed_words(vehicle)))


def shaft_speed_words(vehicle: Vehicle) -> str:
    """What stands in for a shaft speed that no run logs."""
    if vehicle.rpm_ref is None:
        return f"{SAID}: taken as 0, as {vehicle.name} names no rpm_ref; log n_cmd or give rpm_ref"
    return f"{SAID}: held at {vehicle.rpm_ref:g} rpm, the vehicle file's"


def shaft_speed_note(trial: Trial) -> str | None:
    """The sentence `with_shaft_speed` has put into the warnings of a trial."""
    return next((text for text in trial.warnings if text.startswith(SAID)), None)


def ordered_with_shaft_speed(manoeuvre: Manoeuvre, rpm: float) -> Manoeuvre:
    """A table may order fins only; the vehicle then keeps this shaft speed [rpm] instead of stopping."""
    if isinstance(manoeuvre, OpenLoop) and "n_cmd" not in manoeuvre.commands:
        held = np.full(manoeuvre.t.shape, rpm)
        return replace(manoeuvre, commands={**manoeuvre.commands, "n_cmd": held})
    return manoeuvre
