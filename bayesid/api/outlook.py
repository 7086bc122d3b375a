"""What a diagnosis is about to read, how long it may take, and what it will be judged by; before it begins.

Takes a trial and its vehicle. Gives an `Outlook`. Does not: check the log, or diagnose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.api.inputs import TrialLike, VehicleLike, model_of, trial_of
from bayesid.diagnosis.input import MOST_SAMPLES, as_read
from bayesid.progress import time_words
from bayesid.trials import Run
from bayesid.trials.condensing import speed_known
from bayesid.words import and_list, counted, digits

# Seconds of one core per reading, least and most of four diagnoses with --quick of AUVs and a submarine in
# the plane (3100 to 7800 readings: 38 to 79 s), and what else they need; without --quick it is up to half as
# long again; spatial ones take so many times a planar one (an AUV, 3086 readings in seven runs: 203 s on one
# core, 141 s on two).
PER_READING, BESIDE, WHOLE, SPATIAL = (0.005, 0.015), 10.0, 1.5, 5.0
PLENTY = 10.0  # readings per length travelled


@dataclass(frozen=True)
class Outlook:
    """What a diagnosis is about to do.

    Attributes
    ----------
    readings : of the runs to identify, as logged
    spacing : usual time between them [s]
    per_length : of them while the vehicle travels its length; None where its usual speed is not known
    used, used_spacing : readings that are left, and the time between them [s]
    seconds : least and most time it usually takes on an idle machine [s]
    held_out : names of the runs it is judged by, with their manoeuvres
    """

    readings: int
    spacing: float
    per_length: float | None
    used: int
    used_spacing: float
    seconds: tuple[float, float]
    held_out: tuple[tuple[str, str], ...]

    @property
    def coarser(self) -> float | None:
        """Time between readings [s] by which single ones would do; None where all are read, or none spare."""
        if self.per_length is None or self.used <= MOST_SAMPLES or self.used < self.readings:
            return None
        step = self.spacing * self.per_length / PLENTY
        return float(f"{step:.2g}") if step >= 1.5 * self.spacing else None

    def sentences(self) -> tuple[str, ...]:
        """In words: the rate and what is made of it, the time, the runs held out."""
        rate = f"The runs to identify hold {self.readings} readings, {self.spacing:.3g} s apart"
        if self.per_length is not None:
            rate += f": {digits(self.per_length, 2)} per length travelled, of which {PLENTY:.0f} are plenty"
        rate += "."
        if self.used < self.readings:
            rate += (
                f" They are averaged to {self.used}, {self.used_spacing:.3g} s apart, as far as the motion "
                "loses nothing by it."
            )
        low, high = (time_words(s) for s in self.seconds)
        time = f"The diagnosis takes about {low} to {high} on an idle machine; other work makes it longer."
        if not self.held_out:
            return rate, time, "No run is held out, so nothing it finds is judged by a prediction."
        names = and_list(f"{name} ({kind})" if kind else name for name, kind in self.held_out)
        number = "is" if len(self.held_out) == 1 else "are"
        held = counted(len(self.held_out), "run")
        return rate, time, f"{names} {number} held out: {held} read only to judge what the others tell."


def outlook(trial: TrialLike, vehicle: VehicleLike | None = None, *, quick: bool = False) -> Outlook:
    """What `bayesid.diagnose` of the same trial is about to do.

    Parameters
    ----------
    trial, vehicle : as in `bayesid.diagnose`
    quick : without next manoeuvres and draws

    Raises
    ------
    TrialError, VehicleError, ModelError
        what cannot be read
    """
    logged = trial_of(trial)
    model = model_of(logged, vehicle)
    used = as_read(logged, model).identify
    speed, spacing = speed_known(model.vehicle), _spacing(logged.identify)
    count = sum(run.n_samples for run in used)
    factor = (1.0 if quick else WHOLE) * (SPATIAL if model.dof == 6 else 1.0)
    low, high = (factor * (BESIDE + each * count) for each in PER_READING)
    return Outlook(
        sum(run.n_samples for run in logged.identify), spacing,
        None if speed is None or not spacing > 0 else model.vehicle.L / speed / spacing,
        count, _spacing(used), (low, high), tuple((run.name, run.manoeuvre) for run in logged.holdout),
    )  # fmt: skip


def _spacing(runs: tuple[Run, ...]) -> float:
    steps = [np.diff(run.t) for run in runs if run.n_samples > 1]
    return float(np.median(np.concatenate(steps))) if steps else 0.0
