"""Logs that hold more readings than an answer needs: thinned as asked for, or averaged.

Takes a trial and its vehicle. Gives the trial that an estimation reads.
"""

from __future__ import annotations

from dataclasses import replace

from bayesid.errors import VehicleError
from bayesid.model.vehicles import Vehicle, usual_speed
from bayesid.trials.averaging import averaged
from bayesid.trials.kinematics.derived_velocity import velocity_from_track
from bayesid.trials.noise_stated import with_noise_of_readings, with_seen_noise
from bayesid.trials.trial import Trial
from bayesid.trials.window import thin


def thinned(trial: Trial, step: float) -> Trial:
    """The trial with single readings every `step` [s]; commands keep their own times."""
    # thinned readings have lost the fast changes that tell
    derived = velocity_from_track(trial.identify)
    return replace(trial, runs=tuple(thin(run, step) for run in trial.runs), velocity_from_track=derived)


def condensed(
    trial: Trial, vehicle: Vehicle, most: int, trust_noise: bool = False, as_seen: bool = False
) -> Trial:
    """The trial with dense readings averaged where its runs to identify hold more than `most` samples.

    Noise is compared with fast changes of the readings as logged, unless it is to be trusted. A vehicle
    without a usual speed keeps its readings.

    Parameters
    ----------
    as_seen : a noise that is not stated is taken from fast changes of the readings as logged, with a warning;
        else a trial without any stated noise keeps its readings
    """
    speed = speed_known(vehicle)
    if speed is None or sum(run.n_samples for run in trial.identify) <= most:
        return trial
    believed = trial if trust_noise else with_seen_noise(trial, (vehicle.L, speed))
    known = with_noise_of_readings(believed, (vehicle.L, speed)) if as_seen else believed
    done = averaged(known, vehicle.L / speed, most)
    return believed if done is known else done


def speed_known(vehicle: Vehicle) -> float | None:
    """Usual speed [m/s]; None where the file names none that the vehicle reaches."""
    try:
        speed = usual_speed(vehicle)
    except VehicleError:
        return None
    return speed if speed > 0 else None
