"""Is this another vehicle: a speed or a turn off by factors that no effect of the catalogue makes.

Takes a model and runs whose other mistakes are mended. Gives an `InputFinding` without a mend, or None.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.diagnosis.input.steering import steering, steers_by_thrust
from bayesid.diagnosis.input.vehicle_behaviour import fin_gains, speed_beside_simulation
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.mistakes import InputFinding

# Logarithms of speed over self-propulsion speed, and of turn over simulated turn. Of 40 campaigns with gaps,
# half of vehicles with other equations, the first is -0.20 to 0.11, the second, where sure, -0.5 to 0.2.
FAR_SPEED, FAR_TURN = math.log(2.0), math.log(3.3)  # either alone
BOTH_SPEED, BOTH_TURN = 0.3, math.log(2.2)
SURE_TURN = 0.25  # sd over gain
FEWEST = 2  # runs
# What is said of the probability: none of 58 campaigns was taken for another vehicle, so at most 5 % are.
SURE = 0.95
WRONG_VEHICLE = "wrong vehicle"
SHAFT = ("n", "n_cmd")


def wrong_vehicle(model: Model, runs: Sequence[Run]) -> InputFinding | None:
    """That speed and turn are another vehicle's."""
    speed, turn = _off(model, runs)
    if not _far(speed, turn):
        return None
    parts = []
    if abs(speed) > BOTH_SPEED:
        parts.append(f"is {math.exp(speed):.2g} times as fast at its revolutions")
    if abs(turn) > BOTH_TURN:
        parts.append(f"turns {math.exp(turn):.2g} times as much for its rudder")
    told = (("vehicle's speed",) if abs(speed) > BOTH_SPEED else ()) + (
        ("vehicle's turn",) if abs(turn) > BOTH_TURN else ()
    )
    asked = "is it that one"
    if speed < -BOTH_SPEED and _geared(model, runs, speed):
        asked += (
            ", or are its revolutions those of an engine ahead of a gear (`[corrections]` takes the ratio, "
            "3 to 1 as `scale = { n_cmd = 0.3333 }`, for n as well where it is logged)"
        )
    return InputFinding(
        WRONG_VEHICLE, f"the vehicle {' and '.join(parts)} as the one stated: {asked}?", (),
        tuple(run.name for run in runs), True, SURE, told, 0.0, 0.0, None,
    )  # fmt: skip


def _off(model: Model, runs: Sequence[Run]) -> tuple[float, float]:
    """Logarithms of speed and turn over the simulator's, medians of runs; 0 where too few tell."""
    with np.errstate(all="ignore"):
        speeds = [math.log(s) for run in runs if (s := speed_beside_simulation(model, run)) is not None]
        turns = [math.log(g) for run in runs if (g := _gain(model, run)) is not None]
    speed = float(np.median(speeds)) if len(speeds) >= min(FEWEST, len(runs)) and speeds else 0.0
    turn = float(np.median(turns)) if len(turns) >= FEWEST else 0.0
    return speed, turn


def _far(speed: float, turn: float) -> bool:
    alone = abs(speed) > FAR_SPEED or abs(turn) > FAR_TURN
    return alone or (abs(speed) > BOTH_SPEED and abs(turn) > BOTH_TURN)


def _geared(model: Model, runs: Sequence[Run], speed: float) -> bool:
    """Whether speed and turn are this vehicle's at fewer revolutions. Not at how many: speed tells no ratio
    from a loss of thrust."""
    fewer = Correction(scale=dict.fromkeys(SHAFT, math.exp(speed)))
    try:
        return not _far(*_off(model, [apply(fewer, run) for run in runs]))
    except BayesidError:
        return False


def _gain(model: Model, run: Run) -> float | None:
    columns = steering(model)
    if steers_by_thrust(columns):  # how far their turns usually are off is not known
        return None
    try:
        found = fin_gains(model, run, columns, "psi")[0]
    except BayesidError:
        return None
    if found is None or not found[0] > 0 or found[1] > SURE_TURN * found[0]:
        return None
    return found[0]
