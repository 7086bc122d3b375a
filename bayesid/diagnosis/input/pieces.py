"""What a log reads at the ends of a piece of a run, and the state a simulation of that piece begins at.

Takes a run and a model. Gives numbers; None where the run does not say. Does not: simulate.
"""

from __future__ import annotations

import numpy as np

from bayesid.equations.model import Model
from bayesid.trials import Run

Array = np.ndarray

# angle -> its rate, the slide that goes with it, and that slide over rate and length as a turn begins: a hull
# slides outwards
SLIDE = {"psi": ("r", "v", -0.3), "theta": ("q", "w", 0.3)}


def change_between(t: Array, values: Array, first: float, last: float, around: float) -> float | None:
    """Change of a reading between two times, each by a line through its neighbours."""
    a, b = line_at(t, values, first, around), line_at(t, values, last, around)
    return None if a is None or b is None else b[0] - a[0]


def line_at(t: Array, values: Array, at: float, around: float) -> tuple[float, float] | None:
    """Value and slope at a time."""
    good = np.isfinite(values)
    near = good & (np.abs(t - at) <= 0.5 * around)
    if near.sum() < 3:  # sampled too coarsely for a line: the reading itself, and its neighbours' slope
        if good.sum() < 3:
            return None
        knots, read = t[good], values[good]
        k = int(np.clip(np.searchsorted(knots, at), 1, knots.size - 2))
        return float(np.interp(at, knots, read)), float(
            (read[k + 1] - read[k - 1]) / (knots[k + 1] - knots[k - 1])
        )
    since, read = t[near] - at, values[near]
    middle, mean = float(since.mean()), float(read.mean())
    spread = since - middle
    slope = float(spread @ read) / float(spread @ spread)
    return mean - slope * middle, slope


def start_of(model: Model, run: Run, speed: Array, angle: str, t0: float, travel: float) -> Array | None:
    """State at a time, as read; what is not read is zero, but the sway (heave) that goes with a turn."""
    out = np.zeros(len(model.states))
    place = {name: k for k, name in enumerate(model.states)}

    def put(name: str, value: tuple[float, float] | None, which: int = 0) -> None:
        if value is not None and name in place:
            out[place[name]] = value[which]

    # sway, and heave in a pitching turn, are left to the simulator, which then tells their sign
    for name in ("psi", "phi", "theta", "r", "q", "p", "w", "z"):
        if name in run.data and name != SLIDE[angle][1]:
            put(name, line_at(run.t, run.data[name], t0, travel))
    for turned, (rate, _, _) in SLIDE.items():
        if rate not in run.data and turned in run.data:
            put(rate, line_at(run.t, run.data[turned], t0, travel), 1)
    along = line_at(run.t, speed, t0, travel)
    if along is None or not np.isfinite(out).all():
        return None
    out[place["u"]] = along[0]
    for rate, slide, share in {SLIDE["psi"], SLIDE[angle]}:
        out[place[slide]] = share * model.scales["L"] * out[place[rate]]
    return out


def speed_of(run: Run) -> Array | None:
    """Speed ahead [m/s]: as logged, else of the track."""
    for name in ("u", "u_water"):
        if name in run.data:
            return run.data[name]
    if not {"x", "y"} <= set(run.data):
        return None
    x, y = run.data["x"], run.data["y"]
    good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    good = good[:: max(1, good.size // 60)]
    if good.size < 4:
        return None
    middle = 0.5 * (run.t[good][1:] + run.t[good][:-1])
    return np.interp(run.t, middle, np.hypot(np.diff(x[good]), np.diff(y[good])) / np.diff(run.t[good]))
