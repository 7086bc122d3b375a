"""A logged run as a filter-error fit reads it, with a first guess of its path from the readings alone.

Takes a `Model` and a `trials.Run`. Gives `RunData`. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import savgol_filter

from bayesid.equations.model import Model
from bayesid.estimation.run_data import Array, RunData
from bayesid.simulation import TimePlan, plan_trial_run, with_own_states

ANGLES = frozenset({"psi", "phi", "theta"})
# Error of the first guess of velocities over U, of turning rates over U/L.
FIRST_SLOPE_ERROR = 0.07
# A straight run: rms of a fin over its limit, swing of the heading [rad], bend of the course [rad per L],
# least duration [L/U], that of the longest correlation time of a disturbance
# (`noise_identification.LONGEST_TAU`).
STRAIGHT_FIN_RMS, STRAIGHT_HEADING_SWING, STRAIGHT_COURSE_BEND, STRAIGHT_LENGTHS = 0.1, 0.26, 0.01, 6.0
# Swing of revolutions over the largest of a shaft; what turns at most where the file states no limit [rad].
STRAIGHT_RPM_SWING, LARGEST_ANGLE = 0.02, 0.6
NAMES = {"delta_r": "rudder", "delta_s": "stern plane", "delta_b": "bow plane"}
# Start of a run, in L/U, whose median speed is the prior mean of an unmeasured first speed.
FIRST_SPEED_LENGTHS = 5.0
# How much longer steps are than those of whole runs: maps of single sample intervals gather no error. Twice
# as long moved the evidence of eight fits by at most 1.6 nats and no parameter by more than 0.07 of its
# standard deviation, against steps an eighth as long.
LONGER_STEPS = 2.0


def filter_error_run(
    model: Model, run: Any, noise: Mapping[str, float], channels: Sequence[str], longer: float = 1.0
) -> RunData:
    """Log of a trial run.

    Parameters
    ----------
    run : trials.Run
    noise : channel -> white sensor sigma [SI]
    channels : names to use, a subset of the kernel's channels
    longer : how much longer steps are than the usual ones, where runs are not simulated from end to end
    """
    plan = plan_trial_run(model, run, longer=longer)
    names = [c for c in channels if c in run.data]
    data = np.column_stack([run.data[c] for c in names])
    s = model.scales
    wide = {
        **dict.fromkeys(("x", "y", "z"), 0.5 * s["L"] + 10.0 * max(noise.get(n, 0.0) for n in ("x", "y"))),
        **dict.fromkeys(("phi", "theta", "psi"), 0.3),
        **dict.fromkeys(("u", "v", "w"), 0.3 * s["U"]),
        **dict.fromkeys(("p", "q", "r"), 0.5 * s["U"] / s["L"]),
        **model.own_state_sd,
    }
    states = model.kernel.full.states
    path = _first_path(model, run, noise)
    first = path[0].copy()
    # Velocities nobody measured: slopes of positions at the end of a record are no prior, and v is small.
    if "u" not in names:
        lead = plan.t - plan.t[0] <= FIRST_SPEED_LENGTHS * s["L"] / s["U"]
        first[states.index("u")] = np.median(path[lead, states.index("u")])
    for name, sd in (("v", 0.2), ("w", 0.1)):
        if name not in names and name in states:
            first[states.index(name)], wide[name] = 0.0, sd * s["U"]
    first = with_own_states(model, first[None, : len(model.states)])[0]
    return RunData(
        run.name,
        plan,
        tuple(names),
        data,
        np.array([noise[c] for c in names]),
        first,
        states,
        # states of effects that were taken out move nothing, and are as good as known
        np.array([wide.get(n, 0.1 * s["U"]) for n in states]),
        run.manoeuvre,
        run.role,
        path,
        not _bent(model, plan, _heading(model, plan, path, names)),
    )


def _first_path(model: Model, run: Any, noise: Mapping[str, float]) -> Array:
    """States from smoothed readings and their slopes; zero where nothing tells.

    The window of a channel is half L/U, or as long as its noise needs for slopes good to `FIRST_SLOPE_ERROR`.
    """
    t, s = run.t, model.scales
    spacing = float(np.median(np.diff(t)))
    grid = np.arange(t[0], t[-1] + 0.5 * spacing, spacing)
    most = max(2, (grid.size - 1) // 4)
    rate = dict.fromkeys(("x", "y", "z"), FIRST_SLOPE_ERROR * s["U"]) | dict.fromkeys(
        ("phi", "theta", "psi"), FIRST_SLOPE_ERROR * s["U"] / s["L"]
    )
    value: dict[str, Array] = {}
    slope: dict[str, Array] = {}
    for name in set(run.data) & set(model.states):
        y = run.data[name]
        good = np.isfinite(y)
        if good.sum() < 5:
            continue
        half = round(0.5 * s["L"] / s["U"] / spacing)
        if name in rate:
            # deviation of the middle slope of n readings: sigma sqrt(12 / n^3) / spacing
            noisy = noise.get(name, 0.0) * np.sqrt(12.0) / (rate[name] * spacing)
            half = max(half, round(0.5 * noisy ** (2.0 / 3.0)))
        half = int(np.clip(half, 2, most))
        even = median_filter(np.interp(grid, t[good], y[good]), 5, mode="nearest")
        if grid.size > 2 * half + 1:
            value[name] = np.interp(t, grid, savgol_filter(even, 2 * half + 1, 2))
            slope[name] = np.interp(t, grid, savgol_filter(even, 2 * half + 1, 2, deriv=1, delta=spacing))
        else:
            value[name], slope[name] = (
                np.interp(t, grid, even),
                np.interp(t, grid, np.gradient(even, spacing)),
            )
    psi = value.get("psi", np.zeros(t.size))
    if "x" in slope and "y" in slope:
        # Slopes at the ends of a record are poor; a vehicle drifts and overtakes its own speed only so far.
        ahead = slope["x"] * np.cos(psi) + slope["y"] * np.sin(psi)
        aside = slope["y"] * np.cos(psi) - slope["x"] * np.sin(psi)
        value.setdefault("u", np.clip(ahead, -s["U"], 2.5 * s["U"]))
        value.setdefault("v", np.clip(aside, -0.4 * s["U"], 0.4 * s["U"]))
    for angle, turn in (("psi", "r"), ("theta", "q"), ("phi", "p")):
        if angle in slope:
            value.setdefault(turn, slope[angle])
    value.setdefault("u", np.full(t.size, s["U"]))
    bare = np.column_stack([value.get(n, np.zeros(t.size)) for n in model.states])
    return with_own_states(model, bare)


def _heading(model: Model, plan: TimePlan, path: Array, names: Sequence[str]) -> Array | None:
    """Heading along the first path; the course over two lengths of travel where none is logged; else None."""
    at = model.kernel.full.states.index
    if "psi" in names:
        return path[:, at("psi")]
    if not {"x", "y"} <= set(names):
        return None
    t, ahead = plan.t, 2.0 * model.scales["L"] / model.scales["U"]
    late = np.minimum(np.searchsorted(t, t + ahead), t.size - 1)
    early = np.arange(t.size)
    kept = late > early
    gone = [(path[late, at(c)] - path[early, at(c)])[kept] for c in ("y", "x")]
    course = np.unwrap(np.arctan2(*gone))
    return np.interp(t, t[kept], course)


def why_not_straight(model: Model, log: RunData) -> str:
    """Why a run is no straight one, as a clause; empty where it is."""
    return _bent(model, log.plan, _heading(model, log.plan, log.path, list(log.channels)))


def _bent(model: Model, plan: TimePlan, heading: Array | None) -> str:
    """Why a run is none in which nothing was ordered and the vehicle keeps a course, empty where it is one:
    there what moves it sideways is the environment.

    Revolutions are held; every fin, and every thruster that turns, moves little about its mean, as one does
    that answers; the heading stays within 15 degrees, if need be of a course so slowly bent that the vehicle
    does not feel it. Held fins alone do not make a run straight: a remus100 whose rudder stands 1 degree off
    turns half as fast as it ever can, and then the cause moves it. The run lasts as long as the slowest
    disturbance, which in less time is a constant without a level.
    """
    a = model.kernel.actuators
    time = model.scales["L"] / model.scales["U"]
    shafts = [k for k, name in enumerate(a) if name not in model.kernel.spec.servos]
    rpm, usual = np.abs(plan.command[:, shafts]).max(axis=0), abs(model.vehicle.rpm_ref or 0.0)
    # what stands still reads noise, small beside the revolutions of a usual shaft
    held = np.where(rpm > STRAIGHT_RPM_SWING * max(usual, rpm.max()), rpm, max(usual, rpm.max()))
    swing = np.ptp(plan.command[:, shafts], axis=0) / np.maximum(held, 1.0)
    k = int(np.argmax(swing))
    if swing[k] > STRAIGHT_RPM_SWING:
        name = a[shafts[k]]
        return f"its revolutions {'' if name == 'n' else f'{name} '}change"
    if plan.t[-1] - plan.t[0] < STRAIGHT_LENGTHS * time:
        return f"it is shorter than {STRAIGHT_LENGTHS:g} lengths"
    for name in (n for n in a if n in model.kernel.spec.servos):
        if np.std(plan.command[:, a.index(name)]) >= STRAIGHT_FIN_RMS * min(model.limit(name), LARGEST_ANGLE):
            return f"its {NAMES.get(name, name)} moves"
    if heading is None:
        return "its heading is not known"
    if np.ptp(heading) < STRAIGHT_HEADING_SWING:
        return ""
    bend, begin = np.polyfit(plan.t, heading, 1)
    kept = (
        abs(bend) * time < STRAIGHT_COURSE_BEND
        and np.ptp(heading - begin - bend * plan.t) < STRAIGHT_HEADING_SWING
    )
    return "" if kept else "it keeps no course within 15 degrees"
