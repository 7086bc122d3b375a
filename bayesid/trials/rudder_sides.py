"""Runs in which positive rudder turns the vehicle to the other side than in all others.

Takes runs of a trial. Gives names. Does not mend or ask.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.trials.consistency import check_rudder
from bayesid.trials.trial import Run

# t values of a first-order turn, of one run and of all others pooled, from which a side is plain. Of 1241
# runs of real and simulated trials none that moves the rudder as far as others passes the first so.
PLAIN, PLAIN_TOGETHER = 5.0, 6.0
MOST = 10.0  # t value beyond which one run counts no more
# A helmsman who answers the waves moves the rudder against the turn (t values of 6 to 10 on courses held,
# with a tenth of the rudder of other runs): least rudder, over the median.
LEAST_RUDDER = 0.5


def other_side(runs: Sequence[Run]) -> tuple[str, ...]:
    """Names of the runs whose rudder plainly turns the vehicle to the other side than that of all others."""
    asked = [run for run in runs if _goes_ahead(run) and not _contradicts_itself(run)]
    found = [(run, check) for run in asked if (check := check_rudder(run)) is not None]
    told = [(run.name, c.t_value, _largest(run)) for run, c in found if math.isfinite(c.t_value)]
    usual = float(np.median([rudder for _, _, rudder in told])) if told else 0.0
    sides = {
        name: float(np.clip(t, -MOST, MOST)) for name, t, rudder in told if rudder >= LEAST_RUDDER * usual
    }
    if len(sides) < 3:
        return ()
    together = sum(sides.values())
    side, rest = math.copysign(1.0, together), math.sqrt(len(sides) - 1)
    return tuple(
        name
        for name, t in sides.items()
        if side * t <= -PLAIN and side * (together - t) / rest >= PLAIN_TOGETHER
    )


def _goes_ahead(run: Run) -> bool:
    """Astern a rudder turns the vehicle to the other side."""
    for name in ("u", "u_water"):
        speed = run.data.get(name)
        if speed is not None and np.isfinite(speed).any():
            return float(np.nanmedian(speed)) > 0.0
    if not {"x", "y", "psi"} <= set(run.data):
        return True
    x, y, psi = (run.data[name] for name in ("x", "y", "psi"))
    read = np.isfinite(x) & np.isfinite(y) & np.isfinite(psi)
    along = np.diff(x[read]) * np.cos(psi[read][1:]) + np.diff(y[read]) * np.sin(psi[read][1:])
    return float(along.sum()) >= 0.0


def _contradicts_itself(run: Run) -> bool:
    """Whether the rudder as measured is the mirror image of its order: one of the two is wrong, not both."""
    read, order = run.measured_inputs.get("delta_r"), run.commands.get("delta_r_cmd")
    if read is None or order is None:
        return False
    both = np.isfinite(read) & np.isfinite(order)
    if not both.any():
        return False
    apart = (values[both] - values[both].mean() for values in (read, order))
    return float(np.prod(list(apart), axis=0).sum()) < 0.0


def _largest(run: Run) -> float:
    """Largest departure of the rudder from where it mostly is [rad]."""
    rudder = run.input("delta_r")
    if rudder is None or not np.isfinite(rudder).any():
        return 0.0
    return float(np.nanmax(np.abs(rudder - np.nanmedian(rudder))))
