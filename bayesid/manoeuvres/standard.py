"""Manoeuvres by name: turns, zig-zags, spirals, speed changes and depth changes, in SI and radians.

Takes: deflections [rad] (positive rudder turns to port), rpm, times and steps [s].
Does not: choose sizes for a vehicle (see `library`) or excite all terms at once (see `excite`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres.core import ClosedLoop, OpenLoop, grid
from bayesid.manoeuvres.laws import DepthLaw, ZigzagLaw


def _after(t: np.ndarray, when: float) -> np.ndarray:
    """True from `when` on; a row a rounding error early counts."""
    return t >= when - 1e-9 * max(1.0, abs(when))


def spiral(
    rpm: float = 90.0,
    start: float = 10.0,
    end: float = 600.0,
    first: float = math.radians(-5.0),
    last: float = math.radians(-30.0),
    dt: float = 0.1,
) -> OpenLoop:
    """One-sided spiral: rudder `first` at `start`, then linear in time to `last` at `end` [rad, s].

    The defaults stand in for the ten-minute "spiral type" input of Furlong et al. (2003), whose rudder
    history was not printed; 6001 rows, the last being the end of the run.
    """
    t = grid(end, dt)
    ramp = first + (last - first) * np.clip((t - start) / (end - start), 0.0, 1.0)
    return OpenLoop(
        "spiral",
        t,
        {"delta_r_cmd": np.where(_after(t, start), ramp, 0.0), "n_cmd": np.full(t.size, rpm)},
        {"rpm": rpm, "start": start, "end": end, "first": first, "last": last},
    )


DIEUDONNE_DEG = (15.0, 10.0, 5.0, 3.0, 2.0, 1.0, 0.0, -1.0, -2.0, -3.0, -5.0, -10.0, -15.0)


DIEUDONNE = tuple(math.radians(d) for d in DIEUDONNE_DEG)


def dieudonne(
    rpm: float, hold: float, approach: float, dt: float, levels: Sequence[float] = DIEUDONNE
) -> OpenLoop:
    """Spiral of Dieudonne (1953): rudder in steps from one side to the other and back, each held.

    `levels` [rad] run one way; the way back repeats them in reverse without the turning point.
    """
    if not hold > 0:
        raise ManoeuvreError(f"spiral: each rudder angle is held for {hold:g} s; give a positive hold")
    there = list(levels)
    steps = there + there[-2::-1]
    t = grid(approach + hold * len(steps), dt)
    slot = np.floor((t - approach) / hold + 1e-9).astype(int)
    rudder = np.where(slot < 0, 0.0, np.asarray(steps)[np.clip(slot, 0, len(steps) - 1)])
    return OpenLoop(
        "dieudonne spiral",
        t,
        {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, rpm)},
        {"rpm": rpm, "hold": hold, "approach": approach, "levels": tuple(float(x) for x in there)},
    )


def turn(rudder: float, rpm: float, approach: float, duration: float, dt: float) -> OpenLoop:
    """Turning circle: straight for `approach` [s], then the rudder held for `duration` [s]."""
    t = grid(approach + duration, dt)
    return OpenLoop(
        "turning circle",
        t,
        {"delta_r_cmd": np.where(_after(t, approach), rudder, 0.0), "n_cmd": np.full(t.size, rpm)},
        {"rudder": rudder, "rpm": rpm, "approach": approach},
    )


def pull_out(rudder: float, rpm: float, approach: float, turning: float, after: float, dt: float) -> OpenLoop:
    """Turn for `turning` [s], then rudder amidships for `after` [s]: what yaw rate remains."""
    t = grid(approach + turning + after, dt)
    over = _after(t, approach) & ~_after(t, approach + turning)
    return OpenLoop(
        "pull-out",
        t,
        {"delta_r_cmd": np.where(over, rudder, 0.0), "n_cmd": np.full(t.size, rpm)},
        {"rudder": rudder, "rpm": rpm, "approach": approach, "turning": turning},
    )


def zigzag(
    rudder: float,
    switch: float,
    rpm: float,
    approach: float,
    duration: float,
    dt: float,
    executes: int = 0,
    neutral: float = 0.0,
) -> ClosedLoop:
    """Zig-zag (Kempf): rudder reversed whenever the heading has left its start by `switch` [rad].

    A positive `rudder` goes to port first. A switch angle other than the deflection is the modified zig-zag.
    `executes` orders are given (0: until the end of the run), `neutral` [rad] is the rudder that keeps
    straight.
    """
    if not (np.isfinite(switch) and switch > 0 and np.isfinite(rudder) and rudder != 0):
        raise ManoeuvreError(
            f"zig-zag {math.degrees(rudder):g}/{math.degrees(switch):g} deg: the rudder must not "
            "be zero and the switch angle must be positive"
        )
    law = ZigzagLaw(rudder, switch, approach, "delta_r_cmd", executes, neutral, (("n_cmd", rpm),))
    name = f"zig-zag {abs(math.degrees(rudder)):g}/{math.degrees(switch):g}"
    return ClosedLoop(
        name,
        approach + duration,
        dt,
        {"delta_r_cmd": neutral, "n_cmd": rpm},
        law,
        {"rpm": rpm, "first side": "port" if rudder > 0 else "starboard"},
    )


def vertical_zigzag(
    plane: float, switch: float, rpm: float, approach: float, duration: float, dt: float, executes: int = 0
) -> ClosedLoop:
    """Overshoot manoeuvre in the vertical plane: stern planes reversed at a pitch of `switch` [rad]; 6-DOF.

    A positive `plane` puts the bow down first.
    """
    if not (np.isfinite(switch) and switch > 0 and np.isfinite(plane) and plane != 0):
        raise ManoeuvreError(
            f"vertical zig-zag {math.degrees(plane):g}/{math.degrees(switch):g} deg: the plane must "
            "not be zero and the switch angle must be positive"
        )
    held = (("delta_r_cmd", 0.0), ("n_cmd", rpm))
    law = ZigzagLaw(plane, switch, approach, "delta_s_cmd", executes, 0.0, held)
    name = f"vertical zig-zag {abs(math.degrees(plane)):g}/{math.degrees(switch):g}"
    return ClosedLoop(
        name,
        approach + duration,
        dt,
        {"delta_s_cmd": 0.0, **dict(held)},
        law,
        {"rpm": rpm, "first side": "down" if plane > 0 else "up"},
    )


def depth_change(
    change: float,
    rpm: float,
    approach: float,
    duration: float,
    dt: float,
    lookahead: float,
    max_pitch: float,
    max_plane: float,
    k_theta: float = 1.5,
    k_q: float = 0.0,
    back_after: float | None = None,
) -> ClosedLoop:
    """Depth changed by `change` [m] (positive: deeper) at `approach` [s], back `back_after` [s] later; 6-DOF.

    See `DepthLaw` for the gains: `k_theta` [rad/rad], `k_q` [s], `lookahead` [m] (two to four lengths).
    """
    if not lookahead > 0:
        raise ManoeuvreError(f"depth change: look-ahead of {lookahead:g} m; give a few vehicle lengths")
    steps = [(approach, change)] + ([(approach + back_after, 0.0)] if back_after is not None else [])
    held = (("delta_r_cmd", 0.0), ("n_cmd", rpm))
    law = DepthLaw(tuple(steps), lookahead, max_pitch, max_plane, k_theta, k_q, held)
    return ClosedLoop(
        "depth change",
        approach + duration,
        dt,
        {"delta_s_cmd": 0.0, **dict(held)},
        law,
        {"change": change, "rpm": rpm},
    )


def straight(rpm: float, duration: float, dt: float) -> OpenLoop:
    """Constant rpm, rudder amidships."""
    t = grid(duration, dt)
    return OpenLoop(
        "straight run", t, {"delta_r_cmd": np.zeros(t.size), "n_cmd": np.full(t.size, rpm)}, {"rpm": rpm}
    )


def coast_down(rpm: float, approach: float, duration: float, dt: float) -> OpenLoop:
    """Propeller stopped at `approach` [s], rudder amidships: resistance and surge added mass."""
    t = grid(approach + duration, dt)
    return OpenLoop(
        "coast-down",
        t,
        {"delta_r_cmd": np.zeros(t.size), "n_cmd": np.where(_after(t, approach), 0.0, rpm)},
        {"rpm": rpm, "approach": approach},
    )


def speed_steps(rpms: Sequence[float], hold: float, dt: float) -> OpenLoop:
    """Rpm levels held for `hold` [s] each, rudder amidships."""
    if len(rpms) < 1:
        raise ManoeuvreError("speed steps: no rpm level given")
    t = grid(hold * len(rpms), dt)
    slot = np.clip(np.floor(t / hold + 1e-9).astype(int), 0, len(rpms) - 1)
    return OpenLoop(
        "speed steps",
        t,
        {"delta_r_cmd": np.zeros(t.size), "n_cmd": np.asarray(rpms, float)[slot]},
        {"rpms": tuple(float(n) for n in rpms), "hold": hold},
    )


def meander(
    rudder: float, period: float, rpm: float, approach: float, duration: float, dt: float
) -> OpenLoop:
    """Sinusoidal rudder of the given amplitude [rad] and period [s]; a positive one goes to port first."""
    if not period > 0:
        raise ManoeuvreError(f"meander: period of {period:g} s; it must be positive")
    t = grid(approach + duration, dt)
    wave = np.where(_after(t, approach), np.sin(2 * np.pi * (t - approach) / period), 0.0)
    return OpenLoop(
        "meander",
        t,
        {"delta_r_cmd": rudder * wave, "n_cmd": np.full(t.size, rpm)},
        {"rudder": rudder, "period": period, "rpm": rpm, "approach": approach},
    )
