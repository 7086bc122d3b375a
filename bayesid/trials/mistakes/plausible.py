"""Which channels of a run hold numbers no vehicle that steers under water or on it produces.

Takes a `Run`. Gives names of channels, one reason each. Outliers do not count: 95 % of the readings decide.
"""

from __future__ import annotations

import math
from collections.abc import Set

import numpy as np

from bayesid.trials.trial import Floats, Run

# 95 % of the size of the readings, SI
LARGEST = {
    "u": 40.0, "v": 20.0, "w": 20.0, "u_water": 40.0, "v_water": 20.0, "w_water": 20.0,
    "p": 6.0, "q": 3.0, "r": 3.0, "phi": 1.6, "theta": 1.6, "z": 12_000.0,
    "delta_r": 1.6, "delta_s": 1.6, "delta_b": 1.6, "n": 20_000.0,
}  # fmt: skip
FASTEST, SLOWEST = 40.0, 1e-4  # m/s over ground; 1e-4 is a track that does not leave the spot
TURN = 3.0  # rad/s of heading
LEAST_FIN = math.radians(0.7)  # a fin that stays within, and turns the vehicle by
TURNED = math.radians(60.0)
LONGEST, SHORTEST = 1e6, 1.0  # s, duration of a run


def implausible(run: Run, changed: Set[str] | None = None, before: Set[str] = frozenset()) -> frozenset[str]:
    """Channels whose size no vehicle reaches; "x,y" for the track, "t" for the time.

    Parameters
    ----------
    changed : channels in which the run differs from one of which `before` was found, "t" for the time; all
        by default
    """

    def of(*names: str) -> bool:
        return changed is None or not changed.isdisjoint(names)

    out = set() if changed is None else set(before)

    def say(name: str, odd: bool) -> None:
        (out.add if odd else out.discard)(name)

    odd = set()
    for logged, values in {**run.data, **run.commands, **run.measured_inputs}.items():
        name = logged.removesuffix("_cmd")
        if (limit := LARGEST.get(name)) is not None and of(*_concern(name)) and _reaches(values, limit):
            odd.add(name)
    for name in LARGEST:
        if of(*_concern(name)):
            say(name, name in odd)
    psi, rudder = run.data.get("psi"), run.input("delta_r")
    if of("t"):
        say("t", not SHORTEST <= run.duration <= LONGEST)
    if of("t", "psi"):
        say("psi", psi is not None and _rate(run.t, psi) > TURN)
    if of("t", "x", "y"):
        say("x,y", {"x", "y"} <= set(run.data) and not SLOWEST < _speed(run) < FASTEST)
    if of(*_concern("delta_r")) and rudder is not None and psi is not None and float(np.ptp(rudder)) > 0.0:
        small = float(np.abs(rudder).max()) <= LEAST_FIN
        if small and float(np.nanmax(psi) - np.nanmin(psi)) > TURNED:
            out.add("delta_r")
    return frozenset(out)


def _concern(name: str) -> tuple[str, ...]:
    """Channels on which it depends whether one is odd: a rudder is held against the turn."""
    return (name, f"{name}_cmd", "psi") if name == "delta_r" else (name, f"{name}_cmd")


def _reaches(values: Floats, limit: float) -> bool:
    """Whether one reading in twenty is larger; the percentile is asked only where the largest one is."""
    good = np.abs(values[np.isfinite(values)])
    return good.size > 0 and float(good.max()) > limit and float(np.percentile(good, 95)) > limit


def _rate(t: Floats, values: Floats) -> float:
    """Median rate over a twentieth of the readings at a time: noise does not turn a vehicle."""
    good = np.flatnonzero(np.isfinite(values))[:: max(1, int(np.isfinite(values).sum()) // 20)]
    return float(np.median(np.abs(np.diff(values[good]) / np.diff(t[good])))) if good.size > 2 else 0.0


def _speed(run: Run) -> float:
    x, y = run.data["x"], run.data["y"]
    good = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    good = good[:: max(1, good.size // 40)]
    if good.size < 3:
        return 1.0
    return float(np.median(np.hypot(np.diff(x[good]), np.diff(y[good])) / np.diff(run.t[good])))
