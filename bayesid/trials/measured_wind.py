"""The wind a trial measured, and the vehicle it blows on.

Takes a trial and a vehicle. Gives the vehicle on which that wind acts, and a sentence on it. Does not
simulate.
"""

from __future__ import annotations

from dataclasses import replace

from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.check import AREA_SHARE
from bayesid.trials.trial import Trial
from bayesid.words import counted

OF_WIND, GAIN = "wind.", "wind.gain"


def in_measured_wind(vehicle: Vehicle, trial: Trial) -> Vehicle:
    """The vehicle with the measured wind acting on it as measured, where nothing else is stated of wind.

    It acts on a ship by MMG, and on any other vehicle at the surface whose file states the areas the air
    pushes on (`air_front`, `air_side`); `[effects.wind]` with a `gain` of 0 keeps the wind away.
    """
    if not _measured(trial) or not _catches_wind(vehicle) or _stated(vehicle):
        return vehicle
    return replace(vehicle, effects={**vehicle.effects, GAIN: 1.0})


def apart_from_measured_wind(vehicle: Vehicle) -> Vehicle:
    """The vehicle without what `in_measured_wind` adds: runs in wind and in calm air are of one vehicle."""
    if {n for n in vehicle.effects if n.startswith(OF_WIND)} != {GAIN} or vehicle.effects[GAIN] != 1.0:
        return vehicle
    return replace(vehicle, effects={n: v for n, v in vehicle.effects.items() if n != GAIN})


def wind_words(vehicle: Vehicle, trial: Trial) -> str | None:
    """Whether the wind that some runs measured acts on a vehicle as simulated; None without such runs."""
    if not (runs := _measured(trial)):
        return None
    where = f"the wind of {counted(len(runs), 'run')} is measured"
    if not _catches_wind(vehicle):
        return f"{where} and {_on_assumed_areas(vehicle)}"
    gain = vehicle.effects.get(GAIN, 0.0)
    if gain == 0.0:
        return f"{where} and not simulated: [effects.wind] of {vehicle.name} has no gain"
    strong = "as measured" if gain == 1.0 else f"{gain:g} times as fast as measured"
    return (
        f"{where} and acts on the vehicle, {strong} (`gain` of [effects.wind] in a vehicle file changes that)"
    )


def _on_assumed_areas(vehicle: Vehicle) -> str:
    """What a measured wind does to a vehicle whose areas are not stated, or that may be below the surface."""
    if share := vehicle.effects.get(AREA_SHARE, 0.0):
        return f"acts on {share:g} times the areas assumed of a low deck ({AREA_SHARE} of [effects])"
    if vehicle.areas_stated:
        why = f"{vehicle.name} may be below the surface"
        return f"not simulated: {why}; `gain = 1` in [effects.wind] lets it act"
    why = f"{vehicle.name} states no areas the air pushes on (air_front and air_side in [vehicle])"
    mend = "; `area_coefficients = 1` in [effects.wind] lets it act on areas assumed"
    return f"not simulated: {why}{mend * vehicle.planar_only}"  # one that dives is seldom in the wind


def _measured(trial: Trial) -> list[str]:
    return [run.name for run in trial.runs if {"wind_speed", "wind_from"} <= set(run.exogenous)]


def _stated(vehicle: Vehicle) -> bool:
    return any(name.startswith(OF_WIND) for name in vehicle.effects)


def _catches_wind(vehicle: Vehicle) -> bool:
    return vehicle.propulsion.model == "mmg" or (
        vehicle.areas_stated and (vehicle.planar_only or vehicle.effects.get(GAIN, 0.0) != 0.0)
    )
