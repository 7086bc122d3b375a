"""Whether readings are too far apart to see a rudder move.

Takes the runs of a diagnosis. Gives a sentence, or None. Drops nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.run_data import RunData

LEAST_MOVE = 0.02  # rad: smaller steps of the command say nothing about the time a rudder takes
AT_ONCE = 0.1  # L/U: a rudder that is there sooner is there at once, for the hull


def too_coarse(model: Model, logs: Sequence[RunData]) -> str | None:
    """That lag, delay, play and rate of the rudder rest on few readings, with both times; None where not.

    A rudder takes the median step of its command over its rate; readings are their median distance apart. Of
    one that the vehicle file lets move at once nothing is said.
    """
    rate = model.vehicle.rates.get("delta_r", np.inf)
    moves, apart = [], []
    for log in logs:
        if "delta_r" not in model.kernel.actuators:
            continue
        order = log.plan.levels[:, model.kernel.actuators.index("delta_r")]
        steps = np.abs(np.diff(order))
        moves += list(steps[steps > LEAST_MOVE] / rate)
        apart += list(np.diff(log.plan.t[log.valid.any(axis=1)]))
    if not moves or not apart:
        return None
    move, interval = float(np.median(moves)), float(np.median(apart))
    if move < AT_ONCE * model.scales["L"] / model.scales["U"] or interval <= move:
        return None
    return (
        f"readings are {interval:.3g} s apart and the rudder takes {move:.2g} s to where it is ordered: lag, "
        "dead time, play and rate limit show in the answer of the hull only, and not one from the other"
    )
