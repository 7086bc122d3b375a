"""What a replayed run gets wrong in a manoeuvre: heading, position, overshoots, diameter, drift.

Takes readings and simulations at the same times. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.estimation.trial_fit import RunOutcome
from bayesid.trials import Run

Array = np.ndarray
LEAST = np.radians(2.0)  # of rudder; smaller orders are no reversal
# Speed left in the slowest twentieth of a turn over its mean, below which wind stops the ship in its circle:
# 0.2 in one run, 0.6 to 0.9 in the others.
STANDS, SLOWEST = 0.4, 0.05


def columns(run: RunOutcome, values: Array) -> dict[str, Array]:
    return {c: values[:, j] for j, c in enumerate(run.channels)}


def filled(t: Array, values: Array) -> Array:
    """A column with its missing samples interpolated."""
    known = np.isfinite(values)
    return values if known.all() or not known.any() else np.interp(t, t[known], values[known])


def overshoots(t: Array, psi: Array, rudder: Array) -> Array:
    """Heading gained after each reversal of the rudder, towards the side the ship was turning to [rad].

    The rudder is replayed, so that simulation and log reverse at the same times.
    """
    side = np.sign(np.where(np.abs(rudder) > LEAST, rudder, 0.0))
    held = side.copy()
    for i in range(1, held.size):
        held[i] = held[i] if held[i] != 0.0 else held[i - 1]
    turns = np.flatnonzero((held[1:] != held[:-1]) & (held[:-1] != 0.0)) + 1
    out = []
    for a, b in zip(turns, [*turns[1:], t.size], strict=True):
        if b - a < 4 or b == t.size:
            continue  # the last leg may be cut
        out.append(np.max((psi[a:b] - psi[a]) * -held[a - 1]))  # rudder to port turns the heading down
    return np.array(out)


def circle(t: Array, run: Mapping[str, Array], last: Array) -> tuple[float, float]:
    """Diameter [m] and drift angle [rad] over the samples `last`."""
    rate = np.polyfit(t[last], run["psi"][last], 1)[0]
    u, v = run["u"][last], run["v"][last]
    return float(2 * np.mean(np.hypot(u, v)) / abs(rate)), float(abs(np.arctan2(-np.mean(v), np.mean(u))))


def whole_turn(psi: Array) -> Array:
    """Samples of the last whole turn of the log, over which wind and current cancel; none without one."""
    left = np.abs(psi - psi[-1])
    return np.flatnonzero(left <= 2 * np.pi) if left.max() > 2 * np.pi else np.array([], dtype=int)


def circled(run: Mapping[str, Array]) -> Array:
    """Samples of the last whole turn of the log; none where the ship comes to a stand on it."""
    last = whole_turn(run["psi"])
    speed = np.hypot(run["u"], run["v"])[last]
    return last if last.size and np.quantile(speed, SLOWEST) > STANDS * speed.mean() else last[:0]


def errors(outcome: RunOutcome, run: Run, which: str) -> dict[str, float]:
    """Errors of a simulation (`which` is "nominal" or "fitted") in degrees, metres and per cent."""
    sim = columns(outcome, getattr(outcome, which))
    log = {c: filled(outcome.t, v) for c, v in columns(outcome, outcome.readings).items()}
    deg = 180 / np.pi
    rms = {c: float(np.sqrt(np.nanmean((sim[c] - log[c]) ** 2))) for c in outcome.channels}
    found = {"psi": deg * rms["psi"], "r": deg * rms["r"], "position": float(np.hypot(rms["x"], rms["y"]))}
    if outcome.manoeuvre.startswith("zigzag"):
        rudder = np.asarray(run.measured_inputs.get("delta_r", run.commands.get("delta_r_cmd")))
        wanted = overshoots(outcome.t, log["psi"], rudder)
        got = overshoots(outcome.t, sim["psi"], rudder)
        if wanted.size:
            found["overshoot"] = deg * float(np.sqrt(np.mean((got - wanted) ** 2)))
    elif outcome.manoeuvre.startswith("turn"):
        last = circled(log)
        if last.size:
            (size, drift), (sim_size, sim_drift) = (circle(outcome.t, one, last) for one in (log, sim))
            found["diameter"] = 100 * (sim_size / size - 1)
            found["drift"] = deg * (sim_drift - drift)
    return found


def lost(run: Run) -> dict[str, float]:
    """Infinity for every measure the log of a run has, as of a fit that failed."""
    psi = filled(run.t, run.data["psi"])
    found = ["psi", "r", "position"]
    if run.manoeuvre.startswith("zigzag"):
        rudder = np.asarray(run.measured_inputs.get("delta_r", run.commands.get("delta_r_cmd")))
        found += ["overshoot"] if overshoots(run.t, psi, rudder).size else []
    elif run.manoeuvre.startswith("turn"):
        log = {c: filled(run.t, run.data[c]) for c in ("psi", "u", "v")}
        found += ["diameter", "drift"] if circled(log).size else []
    return dict.fromkeys(found, np.inf)
