"""A logged run as an output-error fit reads it: noise and initial state from the record where none is stated.

Takes a `trials.Run`. Gives `RunData`. Does not simulate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.estimation.run_data import Array, RunData
from bayesid.model.vehicles import self_propulsion_speed
from bayesid.simulation import plan_trial_run
from bayesid.trials.noise import rough_noise

# A run's start is read from this many samples at most; enough to average noise, too short for the vehicle to
# turn.
START_SAMPLES = 9


def output_error_run(
    model: Model,
    run: Any,
    sigma: Mapping[str, float] | None = None,
    channels: Sequence[str] | None = None,
    initial: bool = True,
    measured_point: tuple[float, float, float] = (0.0, 0.0, 0.0),
    max_step: float | None = None,
) -> RunData:
    """A logged run (`trials.Run`) ready for a fit.

    Parameters
    ----------
    sigma : channel -> noise [SI]; a channel left out gets the noise its own series shows
    channels : readings to compare; by default all the model can simulate
    initial : treat the initial state as unknown

    Raises
    ------
    FitError
        no channel in common with the model, or one that is constant and has no stated noise
    """
    known = [c for c in model.kernel.channels if c in run.data]
    wanted = [c for c in (channels or known) if c in known]
    if not wanted:
        raise FitError(
            f"run {run.name!r}: none of {', '.join(channels or run.data)} can be compared with a "
            f"{model.dof}-DOF model; it gives {', '.join(model.kernel.channels)}"
        )
    noise = []
    for c in wanted:
        value = (sigma or {}).get(c) or rough_noise(run.t, run.data[c])
        if not (value and math.isfinite(value)):
            spread = float(np.nanstd(run.data[c]))
            value = 1e-3 * spread
        if not value > 0:
            raise FitError(f"run {run.name!r}: channel {c} is constant and has no stated noise; leave it out")
        noise.append(value)
    if not any(np.isfinite(run.data[c]).any() for c in wanted):
        raise FitError(f"run {run.name!r}: no finite reading in {', '.join(wanted)}")
    x0 = initial_state(model, run, measured_point)
    free = model.states if initial else ()
    return RunData(
        run.name,
        plan_trial_run(model, run, max_step),
        tuple(wanted),
        np.stack([run.data[c] for c in wanted], axis=1),
        np.array(noise),
        x0,
        free,
        initial_spread(model, x0, free),
        run.manoeuvre,
        run.role,
    )


def initial_spread(model: Model, x0: Array, states: Sequence[str]) -> Array:
    """Weak prior sd of initial states: a length, half a turn per length, half the speed; wide, never
    infinite.
    """
    length, speed = model.vehicle.L, max(abs(float(x0[model.states.index("u")])), 0.1 * model.scales["U"])
    wide = {"x": length, "y": length, "z": length, "phi": 0.3, "theta": 0.3, "psi": 0.5}
    return np.array([wide.get(s, 0.3 * speed if s in "uvw" else 0.3 * speed / length) for s in states])


def initial_state(model: Model, run: Any, measured_point: tuple[float, float, float] = (0, 0, 0)) -> Array:
    """State at the first sample, from a straight line through the first readings of every channel.

    What was not logged: rates from the slope of the angles, speed from the slope of the position or, failing
    that, the self-propulsion speed of the first shaft speed; anything else 0.
    """
    found: dict[str, float] = {}
    slope: dict[str, float] = {}
    for name, values in run.data.items():
        good = np.flatnonzero(np.isfinite(values))[:START_SAMPLES]
        if good.size >= 3:
            slope[name], found[name] = np.polyfit(run.t[good] - run.t[0], values[good], 1)
        elif good.size:
            found[name] = float(values[good[0]])
    for name in ("u", "v", "w"):
        if name not in found and f"{name}_water" in found:
            found[name] = found[f"{name}_water"]
    psi = found.get("psi", math.atan2(slope.get("y", 0.0), slope.get("x", 1.0)))
    if "u" not in found:
        if "x" in slope and "y" in slope:
            found["u"] = math.hypot(slope["x"], slope["y"])
        else:
            rpm = run.input("n")
            first = float(rpm[0]) if rpm is not None else (model.vehicle.rpm_ref or 0.0)
            found["u"] = self_propulsion_speed(model.vehicle, first)
    for rate, angle in (("r", "psi"), ("q", "theta"), ("p", "phi")):
        if rate not in found and angle in slope:
            found[rate] = slope[angle]
    px, py, pz = measured_point
    found["psi"] = psi
    found["x"] = found.get("x", 0.0) - (px * math.cos(psi) - py * math.sin(psi))
    found["y"] = found.get("y", 0.0) - (px * math.sin(psi) + py * math.cos(psi))
    found["z"] = found.get("z", 0.0) - pz
    return np.array([found.get(name, 0.0) for name in model.states])
