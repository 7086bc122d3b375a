"""Whether a trial holds enough to say anything: readings, sampling, inputs that move, a vehicle that moves.

Takes a trial, and a model where there is one. Gives sentences; empty where there is enough.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.model.channels import ACTUATORS
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import has_propeller, spread
from bayesid.simulation import shaft_speed_words
from bayesid.trials import Run, Trial
from bayesid.trials.trial import Floats

FEWEST = 8  # readings of a run, fewer than its first state and a response have unknowns
COARSE = math.radians(90.0)  # heading from reading to reading: the turn between them is not told
STILL = 0.02  # speed over the vehicle's usual one, or m/s where none is known
STEADY_COURSE, STEADY_SPEED = math.radians(20.0), 0.2  # rad, and of the speed
LEAST_FIN = math.radians(0.05)


def not_enough(trial: Trial, model: Model | None = None) -> tuple[str, ...]:
    """Why nothing can be told from the runs a fit may read, one sentence each."""
    runs = trial.identify
    if not runs:
        return ()
    out = []
    short = [run for run in runs if _readings(run) < FEWEST]
    if len(short) == len(runs):
        most = max(_readings(run) for run in runs)
        out.append(f"no run has more than {most} readings; at least {FEWEST} are needed to tell a response")
        return tuple(out)
    coarse = [(run, step) for run in runs if (step := _turn_between(run)) > COARSE]
    if len(coarse) == len(runs):
        worst = math.degrees(max(step for _, step in coarse))
        out.append(
            f"the heading moves by {worst:.0f} degrees and more in one of ten steps; log it more often, the "
            "turn between two readings is not told"
        )
    speed = model.scales["U"] if model is not None else 1.0
    if all(_fastest(run) < STILL * speed for run in runs):
        out.append("the vehicle is at rest in every run; forces of the water show in motion only")
    if all(_steady(run) for run in runs):
        out.append(
            "every run is straight and steady with no input that moves: what rudder, planes and propeller do "
            "cannot be seen; run a zig-zag or a turning circle"
        )
    return tuple(out)


def unmoved_inputs(trial: Trial, vehicle: Vehicle) -> tuple[str, ...]:
    """One sentence per input the vehicle's forces depend on that no run has, or that is the same in all.

    Fins count whose rows are in the file, the propeller where it gives thrust, and all named actuators.
    """
    out = []
    runs = [replace(r, commands=spread(vehicle, r.commands, r.measured_inputs)) for r in trial.runs]
    for name in inputs_of(vehicle):
        there = [run for run in runs if run.input(name) is not None]
        if not there:
            taken = "and in no run; it is taken as 0" if name != "n" else f"and {shaft_speed_words(vehicle)}"
            out.append(f"{name} is an input of {vehicle.name} {taken}")
        elif not any(_moves(run, name) for run in there) and not _differs(there, name):
            out.append(f"{name} never moves in any run: what it does cannot be told")
    return tuple(out)


def inputs_of(vehicle: Vehicle) -> list[str]:
    """What the forces of a vehicle depend on: fins with rows, the propeller, all named actuators."""
    fins = {"delta_r": "dr", "delta_s": "ds", "delta_b": "db"}
    turning = [fin for fin, short in fins.items() if any(short in n.partition("_")[2] for n in vehicle.coef)]
    planar = [f for f in turning if f == "delta_r" or not vehicle.planar_only]
    return [
        *planar,
        *(["n"] if has_propeller(vehicle) else []),
        *(signal for a in vehicle.actuators for signal in a.signals),
    ]


def still_inputs(trial: Trial) -> tuple[str, ...]:
    """Inputs that are logged and never move in any run a fit may read."""
    names = [
        n for n in ("delta_r", "delta_s", "delta_b") if any(r.input(n) is not None for r in trial.identify)
    ]
    return tuple(n for n in names if not any(_moves(run, n) for run in trial.identify))


def _readings(run: Run) -> int:
    return max((int(np.isfinite(v).sum()) for v in run.data.values()), default=0)


def _turn_between(run: Run) -> float:
    """Turn from reading to reading that one in ten exceeds [rad]."""
    psi = run.data.get("psi")
    if psi is None:
        return 0.0
    good = psi[np.isfinite(psi)]
    return float(np.percentile(np.abs(np.diff(good)), 90)) if good.size > 2 else 0.0


def _fastest(run: Run) -> float:
    """Speed [m/s] that a tenth of the readings exceed; of the track where none is logged."""
    for name in ("u", "u_water"):
        if name in run.data and np.isfinite(run.data[name]).any():
            return float(np.nanpercentile(np.abs(run.data[name]), 90))
    if {"x", "y"} <= set(run.data):
        x, y = run.data["x"], run.data["y"]
        good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))[:: max(1, run.n_samples // 20)]
        if good.size > 1:
            speed = np.hypot(np.diff(x[good]), np.diff(y[good])) / np.diff(run.t[good])
            return float(np.percentile(speed, 90))
    return math.inf


def _steady(run: Run) -> bool:
    """Nothing ordered, course and speed kept."""
    if any(_moves(run, name) for name in ACTUATORS):
        return False
    for name, least in (("psi", STEADY_COURSE), ("theta", STEADY_COURSE)):
        if name in run.data and float(np.nanmax(run.data[name]) - np.nanmin(run.data[name])) > least:
            return False
    u = run.data.get("u", run.data.get("u_water"))
    if u is None:
        return "psi" in run.data
    middle = float(np.nanmedian(np.abs(u)))
    spread = float(np.nanpercentile(u, 95) - np.nanpercentile(u, 5))
    return spread < STEADY_SPEED * max(middle, 1e-9)


def _moves(run: Run, name: str) -> bool:
    values = run.input(name)
    return values is not None and _changes(values, name)


def _differs(runs: Sequence[Run], name: str) -> bool:
    """Whether runs are steered with an input at another value each."""
    every = [values for run in runs if (values := run.input(name)) is not None]
    return bool(every) and _changes(np.concatenate(every), name)


def _changes(values: Floats, name: str) -> bool:
    least = LEAST_FIN if name.startswith("delta") else 0.01 * max(float(np.max(np.abs(values))), 1e-9)
    return float(np.ptp(values)) > least
