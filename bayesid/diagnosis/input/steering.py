"""What steers a vehicle, all of it as one rudder, and the sign of its angles in a log.

Takes a model and runs. Gives columns, a run with a rudder, the mistake of angles that all count the other
way, and whether the runs show that they do not. Does not: ask actuators of which one alone is reversed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.model.actuators import Pusher
from bayesid.model.vehicles.orders import NEAR_CENTRE, missing_actuators, named_rudders, side_of, spread
from bayesid.trials import Run
from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import SOME_RUNS
from bayesid.trials.mistakes.signs import sign_evidence
from bayesid.trials.mistakes.table import COMMON, Mistake
from bayesid.words import and_list

RUDDER = ("delta_r",)
TURNING = ("azimuth_", "nozzle_")  # columns of the angle of a thrust
WORDS = {"delta": "rudder", "azimuth": "azimuth", "nozzle": "nozzle"}


def steering(model: Model) -> tuple[str, ...]:
    """What turns a vehicle: its rudder, or where it has none the named ones that push sideways, or where it
    has none of these either the angles of thrusts off the centre."""
    if "delta_r" not in missing_actuators(model.vehicle):
        return RUDDER
    fins = tuple(f"delta_{name}" for name in named_rudders(model.vehicle))
    return fins or tuple(_thrusts(model)) or RUDDER


def steers_by_thrust(columns: Sequence[str]) -> bool:
    """Whether columns of `steering` are angles of thrusts."""
    return any(name.startswith(TURNING) for name in columns)


def with_rudder(model: Model, run: Run, columns: Sequence[str]) -> Run:
    """The run with what steers it as one rudder, positive to port: the mean of named ones, each as it turns
    the vehicle; one near the centre, which hardly turns it, is left out."""
    run = replace(run, commands=spread(model.vehicle, run.commands, run.measured_inputs))
    side = {f"delta_{fin.name}": side_of(fin, model.scales["L"]) for fin in model.vehicle.fins}
    thrusts = _thrusts(model)
    orders = []
    for name in columns:
        angle = run.input(name)
        if angle is None:
            continue
        if name in thrusts:
            turning, pusher = thrusts[name]
            revolutions = run.input(pusher.signal)
            ahead = 1.0 if revolutions is None else np.sign(revolutions)
            orders.append(turning * ahead * np.sin(angle))
        elif side.get(name):
            orders.append(side[name] * angle)
    if not orders:
        return run
    return replace(run, commands={**run.commands, "delta_r_cmd": np.mean(orders, axis=0)})


def sign_of_steering(columns: Sequence[str]) -> Mistake:
    """All angles that steer a vehicle, named ones, with the opposite sign."""
    many = len(columns) > 1
    kinds = dict.fromkeys(WORDS[name.partition("_")[0]] for name in columns)
    stated = "`at`" if steers_by_thrust(columns) else "`direction`"
    return Mistake(
        f"sign of {', '.join(columns)}",
        f"{' and '.join(f'{kind}s' if many else kind for kind in kinds)} {_names(columns)} "
        f"{'have' if many else 'has'} the opposite sign, or {stated} in the vehicle file has",
        Correction(scale={name: -1.0 for one in columns for name in (one, f"{one}_cmd")}),
        COMMON,
    )


def steering_shown(model: Model, runs: Sequence[Run]) -> str:
    """In words that the turns after named rudders or thrusts tell the sign of their angles, and that it is
    right; empty where they do not, or where a rudder `delta_r` tells it by the channels alone."""
    columns = steering(model)
    if columns == RUDDER:
        return ""
    told = [sign_evidence(with_rudder(model, run, columns), ("rudder",)) for run in runs]
    lead = sum(one.get("rudder", 0.0) - one.get("rudder against", 0.0) for one in told)
    kinds = dict.fromkeys(WORDS[name.partition("_")[0]] for name in columns)
    return f"sign of the {' and '.join(kinds)} angles of {_names(columns)}" if lead > SOME_RUNS else ""


def _names(columns: Sequence[str]) -> str:
    return and_list([name.partition("_")[2] for name in columns])


def _thrusts(model: Model) -> dict[str, tuple[float, Pusher]]:
    """Column of the angle of each thrust off the centre -> 1 where a positive one turns the vehicle to port
    as it pushes ahead, -1 to starboard; and whose it is."""
    out = {}
    for pusher in model.vehicle.thrusters:
        angles = [name for name in pusher.signals if name.startswith(TURNING)]
        arm = pusher.at[0] * pusher.direction[0] + pusher.at[1] * pusher.direction[1]
        if angles and abs(arm) > NEAR_CENTRE * model.vehicle.L:
            out[angles[0]] = -math.copysign(1.0, arm), pusher
    return out
