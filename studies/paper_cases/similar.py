"""Manoeuvres like the one that was fitted, and others: what the Case-1 estimates predict of each.

Takes a `Model` and finished records. Gives metres and degrees. Does not fit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.output_error.simulated_recovery import Target, make_target
from bayesid.manoeuvres import Manoeuvre, coast_down, pull_out, spiral, turn, zigzag
from bayesid.simulation import simulate, steady_start

DEG = math.pi / 180
LIKE, UNLIKE = "similar", "unlike"


def manoeuvres(rpm: float, dt: float) -> dict[str, tuple[str, float, Manoeuvre]]:
    """Name -> (similar or unlike, rpm of the approach, manoeuvre); none is the fitted spiral."""
    return {
        "spiral to 25 deg": (LIKE, rpm, spiral(rpm, last=-25 * DEG, dt=dt)),
        "spiral to 35 deg": (LIKE, rpm, spiral(rpm, last=-35 * DEG, dt=dt)),
        "spiral at 85 rpm": (LIKE, 85.0, spiral(85.0, dt=dt)),
        "spiral in 8 min": (LIKE, rpm, spiral(rpm, end=480.0, dt=dt)),
        "turn, 15 deg": (LIKE, rpm, turn(-15 * DEG, rpm, 10.0, 590.0, dt)),
        "spiral backwards": (LIKE, rpm, spiral(rpm, first=-30 * DEG, last=-5 * DEG, dt=dt)),
        "zig-zag 5/5": (UNLIKE, rpm, zigzag(5 * DEG, 5 * DEG, rpm, 10.0, 590.0, dt)),
        "zig-zag 20/20": (UNLIKE, rpm, zigzag(20 * DEG, 20 * DEG, rpm, 10.0, 590.0, dt)),
        "pull-out, 20 deg": (UNLIKE, rpm, pull_out(-20 * DEG, rpm, 10.0, 200.0, 390.0, dt)),
        "coast-down": (UNLIKE, rpm, coast_down(rpm, 10.0, 590.0, dt)),
    }


def prediction_table(
    model: Model, records: Sequence[Mapping[str, Any]], rpm: float, dt: float, more: Mapping[str, Target]
) -> dict[str, dict[str, Any]]:
    """Largest position [m] and heading [deg] error per manoeuvre and seed, of the start and of the estimate.

    Parameters
    ----------
    records : of Case 1, each with the stages "start" and "goal"
    more : unlike manoeuvres at hand already, by name
    """
    asked = {
        name: (kind, make_target(model, name, manoeuvre, steady_start(model, speed)))
        for name, (kind, speed, manoeuvre) in manoeuvres(rpm, dt).items()
    }
    asked |= {name: (UNLIKE, target) for name, target in more.items()}
    names = records[0]["names"]
    truth = model.nominal[model.positions(names)]
    found: dict[str, dict[str, Any]] = {}
    for name, (kind, target) in asked.items():
        row: dict[str, Any] = {"kind": kind}
        for stage in ("start", "goal"):
            sets = (np.array(r[stage]["ratio"]) * truth for r in records)
            errors = [apart(model, model.with_values(dict(zip(names, z, strict=True))), target) for z in sets]
            row[stage] = {"position": [e[0] for e in errors], "heading": [e[1] for e in errors]}
        found[name] = row
    return found


def apart(model: Model, par: np.ndarray, target: Target) -> tuple[float, float]:
    """Largest distance from the true track [m] and largest difference of heading [deg]."""
    states = simulate(model, par, target.plan, target.x0).states
    x, y, psi = (model.states.index(s) for s in ("x", "y", "psi"))
    far = np.hypot(states[:, x] - target.states[:, x], states[:, y] - target.states[:, y])
    turned = np.abs(states[:, psi] - target.states[:, psi])
    return float(far.max()), math.degrees(float(turned.max()))
