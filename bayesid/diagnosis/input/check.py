"""A trial checked for mistakes of the log, by kinematics and by its vehicle.

Takes a trial and a model. Gives an `InputCheck`, and the trial with its mends applied in memory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesid.diagnosis.input.measured_wind import WindCheck, check_wind
from bayesid.diagnosis.input.simulator_instead import (
    behaviour_of,
    mistakes_that_clear,
    open_to_the_simulator,
    weighed_against_simulator,
)
from bayesid.diagnosis.input.single_fins import shown, single_fins
from bayesid.diagnosis.input.steering import steering, steering_shown
from bayesid.diagnosis.input.wrong_vehicle import wrong_vehicle
from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.trials import Run, Trial
from bayesid.trials.correction import WIND, Correction, apply
from bayesid.trials.handedness import handedness
from bayesid.trials.mistakes import InputCheck, check_input
from bayesid.trials.noise_stated import seen_noise, stated_wrongly

WIND_WORDS = "the direction of the measured wind against the motion"


def check_trial(trial: Trial, model: Model | None = None) -> InputCheck:
    """Mistakes in the runs a fit may read; held-out runs are not looked at.

    Parameters
    ----------
    model : with it the behaviour of the vehicle counts too
    """
    if not trial.identify:
        return InputCheck()
    found, size, wind = _by_channels(trial, model), None, WindCheck()
    if model is not None:
        size = model.scales["L"], model.scales["U"]
        if any(f.by_vehicle for f in found.findings) and (first := _wind_instead(trial, found, model)):
            found, wind = first
    right = mended(trial, found)
    if model is not None:
        rest = tuple(f for f in found.findings if not open_to_the_simulator(f))
        bare = mended(trial, replace(found, findings=rest))
        found = replace(found, findings=weighed_against_simulator(found.findings, bare, right, model))
        right = mended(trial, found.of_log)
        if (other := wrong_vehicle(model, right.identify)) is not None:
            # what the vehicle alone tells of a log is not told where it is not the one of the log
            if len(rest) < len(found.findings) and wrong_vehicle(model, bare.identify) is not None:
                found, right = replace(found, findings=rest), bare
            other = replace(other, instead=mistakes_that_clear(right.identify, model))
            found = replace(found, findings=(*found.findings, other))
        elif wind.finding is None:
            wind = check_wind(right, model)
            found = _with_wind(found, wind)
        found = _with_fins(_with_steering(found, right, model), right, model)
    wrong = stated_wrongly(seen_noise(right.identify, right.noise, size))
    return replace(found, remarks=() if wrong is None else (wrong,))


def _by_channels(trial: Trial, model: Model | None) -> InputCheck:
    """What the channels say of one another, and where there is a model its behaviour."""
    runs, known = trial.identify, handedness(trial.folder)
    if model is None:
        return check_input(runs, known=known)
    travel = model.scales["L"] / model.scales["U"]
    return check_input(runs, travel, behaviour_of(model, runs), model.vehicle.rates, known)


def _wind_instead(trial: Trial, found: InputCheck, model: Model) -> tuple[InputCheck, WindCheck] | None:
    """A mistake of the measured wind in place of all that only the vehicle tells; None where it is none.

    In a wind that blows the wrong way a ship turns otherwise than its log: that looks like a wrong rudder.
    """
    alone = replace(found, findings=tuple(f for f in found.findings if not f.by_vehicle))
    wind = check_wind(mended(trial, alone), model)
    if wind.finding is None:
        return None
    again = _by_channels(mended(trial, InputCheck((wind.finding,))), model)
    if any(f.by_vehicle for f in again.findings):
        return None
    return _with_wind(again, wind), wind


def _with_wind(found: InputCheck, wind: WindCheck) -> InputCheck:
    if wind.untested:
        found = replace(found, unseen=(*found.unseen, f"{wind.untested} against the motion"))
    if wind.finding is not None:
        return replace(found, findings=(*found.findings, wind.finding))
    if wind.remark is not None:
        found = replace(found, left_open=(*found.left_open, wind.remark))
    if not wind.asked:
        return found
    if wind.in_order:
        return replace(found, in_order=(*found.in_order, WIND_WORDS))
    return found if wind.untested else replace(found, unseen=(*found.unseen, WIND_WORDS))


def _with_steering(found: InputCheck, right: Trial, model: Model) -> InputCheck:
    """With the sign of named angles that steer, where the turns tell that it is right."""
    columns = {name for one in steering(model) for name in (one, f"{one}_cmd")}
    if any(f.correction is None or columns & set(f.channels) for f in found.findings):
        return found
    with np.errstate(all="ignore"):
        told = steering_shown(model, right.identify)
    return replace(found, in_order=(*found.in_order, told)) if told else found


def _with_fins(found: InputCheck, right: Trial, model: Model) -> InputCheck:
    """With what was asked of the named fins; nothing is said of fins beside a mistake of one of them."""
    fins = {name for fin in single_fins(model) for name in (fin, f"{fin}_cmd")}
    if any(f.correction is None or fins & set(f.channels) for f in found.findings):
        return found
    told, untold = shown(model, right.identify)
    return replace(found, in_order=(*found.in_order, *told), unseen=(*found.unseen, *untold))


def _mended_run(run: Run, correction: Correction) -> Run:
    """The run with one mend; a held-out one that lacks what a wind is mended by is left without its wind."""
    try:
        return apply(correction, run)
    except TrialError as error:
        if run.role == "identify":
            raise
        kept = {name: values for name, values in run.exogenous.items() if name not in WIND}
        return replace(run, exogenous=kept, warnings=(*run.warnings, f"its wind is left out: {error}"))


def mended(trial: Trial, check: InputCheck) -> Trial:
    """The trial with every mend applied; held-out runs too where all runs have the mistake."""
    runs = []
    for run in trial.runs:
        for finding in check.findings:
            if finding.correction is not None:
                run = _mended_run(run, finding.correction)
        runs.append(run)
    noise = dict(trial.noise)
    for finding in check.findings:
        # noise is stated once for all runs
        if finding.correction is not None and not finding.correction.runs:
            noise = {k: v * abs(finding.correction.scale.get(k, 1.0)) for k, v in noise.items()}
            noise = {finding.correction.rename.get(k, k): v for k, v in noise.items()}
    return replace(trial, runs=tuple(runs), noise=noise)
