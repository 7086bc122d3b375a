"""Zig-zag and spiral: how far a vehicle swings past the order, and whether small rudder angles obey.

Takes: arrays t, psi and rudder (or pitch and stern planes) of one run, simulated or logged. Results do not
depend on the side or sign convention; a quantity the run does not allow is NaN with a reason.
Does not: check that the run was a good zig-zag; the executes are those of the rudder.

Definitions: IMO Resolution MSC.137(76), sections 2.2.4 and 3.2; ITTC Recommended Procedure 7.5-04-02-01.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.measures.tools import Channel, channel, checked, crossing, orders, peak, value

DEG = math.pi / 180


@dataclass(frozen=True)
class Zigzag:
    """Zig-zag measures; angles [rad], times [s].

    `overshoots[k]` is how far the heading went on after execute k+2, `overshoot_times` how long. `switch` is
    the change of heading at the second execute, `initial_turning_time` the time and
    `initial_turning_distance` the way along the track from the first execute to it. `reach` is the time from
    the first execute until the heading is back at the base course, `period` the mean time between executes
    to the same side from the second on.
    """

    first_side: str
    rudder: float
    switch: float
    executes: tuple[float, ...]
    overshoots: tuple[float, ...]
    overshoot_times: tuple[float, ...]
    initial_turning_time: float
    initial_turning_distance: float
    reach: float
    period: float
    reasons: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Spiral:
    """Steady yaw rate against rudder, rudder going down and up again; [rad], [rad/s].

    `going_down`, `going_up` are tuples of (rudder, yaw rate). `loop_height` is the difference of the yaw
    rates at the neutral rudder, `loop_width` the rudder interval between the sign changes of the two
    branches: both zero for a vehicle that is straight-line stable. `differ` lists the rudder angles where
    the branches disagree.
    """

    going_down: tuple[tuple[float, float], ...]
    going_up: tuple[tuple[float, float], ...]
    loop_width: float
    loop_height: float
    differ: tuple[float, ...]
    reasons: Mapping[str, str] = field(default_factory=dict)


def zigzag(
    t: np.ndarray,
    psi: np.ndarray,
    rudder: np.ndarray,
    x: np.ndarray | None = None,
    y: np.ndarray | None = None,
) -> Zigzag:
    """Measures of a zig-zag, horizontal (heading and rudder) or vertical (pitch and stern planes).

    Parameters
    ----------
    t, psi, rudder : (n,) array    time [s], heading [rad], ordered (preferred) or measured rudder [rad]
    x, y : (n,) array or None      position [m], for the distance to the second execute only

    Returns
    -------
    Zigzag    with as many overshoots as the run holds; fewer than two executes give NaN and reasons
    """
    t, data = checked("zig-zag", t, psi=psi, rudder=rudder, x=x, y=y)
    c = channel(t, data["rudder"])
    heading = channel(t, data["psi"], angle=True)
    largest = float(np.quantile(np.abs(c.y - np.median(c.y[:3])), 0.9)) if c.t.size else 0.0
    found = orders(c, max(0.5 * largest, 6 * c.sigma, 0.2 * DEG)) if c.t.size > 1 else []
    names = ["rudder", "switch", "initial_turning_time", "initial_turning_distance", "reach", "period"]
    if not found or heading.t.size < 5:
        why = "no rudder order found" if not found else "too few headings"
        return Zigzag(
            "",
            math.nan,
            math.nan,
            (),
            (),
            (),
            math.nan,
            math.nan,
            math.nan,
            math.nan,
            dict.fromkeys([*names, "first_side", "overshoots"], why),
        )
    # rudder amidships after the last reversal ends the zig-zag; it is an execute, not a new leg
    executes = [o.t for o in found]
    early = heading.between(-math.inf, executes[0])
    noisy = heading.sigma > 1e-6 and early.t.size >= 5
    base = (
        float(np.median(early.y[-max(5, early.t.size // 2) :]))
        if noisy
        else float(np.interp(executes[0], heading.t, heading.y))
    )
    reasons: dict[str, str] = {}
    overshoots, lags = [], []
    sign = 0.0
    for k, at in enumerate(executes[1:], 1):
        window = heading.between(at, executes[k + 1] if k + 1 < len(executes) else math.inf)
        leg = at - executes[k - 1]
        angle = value(heading, at, 0.15 * leg, 0.05) - base
        if k == 1:
            sign, switch = math.copysign(1.0, angle), abs(angle)
        side = sign if k % 2 else -sign
        when, top = peak(Channel(window.t, side * (window.y - base), heading.sigma), 0.2 * leg, 0.05)
        if math.isnan(top):
            reasons["overshoots"] = f"the run ends before the heading turns back after execute {k + 1}"
            break
        overshoots.append(top - side * angle)
        lags.append(when - at)
    if len(executes) < 2:
        reasons |= dict.fromkeys(names[1:] + ["overshoots"], "only one rudder order found; two needed")
        return Zigzag(
            "",
            abs(found[0].after - found[0].before),
            math.nan,
            tuple(executes),
            (),
            (),
            math.nan,
            math.nan,
            math.nan,
            math.nan,
            reasons | {"first_side": "only one rudder order"},
        )
    later = heading.between(executes[1] + (lags[0] if lags else 0.0), math.inf)
    reach = crossing(Channel(later.t, -sign * (later.y - base), heading.sigma), 0.0, 2 * DEG) - executes[0]
    if math.isnan(reach):
        reasons["reach"] = "the heading does not come back to the base course"
    period = math.nan
    if len(executes) >= 4:
        period = float(np.mean([b - a for a, b in zip(executes[1:], executes[3:], strict=False)]))
    else:
        reasons["period"] = f"{len(executes)} executes; four needed"
    distance = _distance(t, data, executes[0], executes[1])
    if math.isnan(distance):
        reasons["initial_turning_distance"] = "no track between the first two executes"
    return Zigzag(
        "starboard" if sign > 0 else "port",
        abs(found[0].after - found[0].before),
        switch,
        tuple(executes),
        tuple(overshoots),
        tuple(lags),
        executes[1] - executes[0],
        distance,
        reach,
        period,
        reasons,
    )


def _distance(t: np.ndarray, data: dict[str, np.ndarray], start: float, end: float) -> float:
    """Way along the track, from a cubic through noisy positions so that noise does not lengthen it."""
    if "x" not in data or "y" not in data:
        return math.nan
    legs = []
    steps = np.linspace(start, end, 201)
    for name in ("x", "y"):
        c = channel(t, data[name])
        inside = c.between(start, end)
        if inside.t.size < 6 or c.t[0] > start or c.t[-1] < end:
            return math.nan
        if c.sigma > 1e-5 * np.ptp(inside.y):
            fit = np.polyfit(inside.t - start, inside.y, 3)
            legs.append(np.diff(np.polyval(fit, steps - start)))
        else:
            legs.append(np.diff(np.interp(steps, c.t, c.y)))
    return float(np.hypot(*legs).sum())


def spiral(
    t: np.ndarray,
    psi: np.ndarray,
    rudder: np.ndarray,
    shortest: float,
    settle: float = 0.6,
    neutral: float = 0.0,
    tolerance: float = 0.02,
) -> Spiral:
    """Yaw rate against rudder of a Dieudonne spiral (rudder in held steps, one way and back).

    Parameters
    ----------
    t, psi, rudder : (n,) array    time [s], heading [rad], rudder [rad]; positive rudder to port or starboard
    shortest : float               shorter holds [s] are left out
    settle : share of each hold left for the yaw rate to settle
    neutral : rudder that keeps straight [rad]
    tolerance : disagreement of the branches that counts, relative to the largest yaw rate

    Returns
    -------
    Spiral    NaN with reasons when a branch does not pass the neutral rudder
    """
    t, data = checked("spiral", t, psi=psi, rudder=rudder)
    c = channel(t, data["rudder"])
    heading = channel(t, data["psi"], angle=True)
    found = orders(c, max(0.4 * DEG, 6 * c.sigma)) if c.t.size > 1 else []
    edges = [float(t[0]), *(o.t for o in found), float(t[-1])] if found else []
    levels = [found[0].before, *(o.after for o in found)] if found else []
    held = []
    for begin, end, level in zip(edges, edges[1:], levels, strict=False):
        if end - begin < shortest * (1 - 1e-6):
            continue
        part = heading.between(begin + settle * (end - begin), end)
        if part.t.size >= 3:
            held.append((level, float(np.polyfit(part.t - begin, part.y, 1)[0])))
    if len(held) < 5:
        why = f"{len(held)} rudder angles held for {shortest:g} s or longer; at least five needed"
        return Spiral(
            (), (), math.nan, math.nan, (), dict.fromkeys(("loop_width", "loop_height", "differ"), why)
        )
    # the approach is no part of a branch: the branches run between the two extreme angles
    angles = np.array([level for level, _ in held])
    high, low = int(np.argmax(angles)), int(np.argmin(angles))
    down_first = high < low
    top, turning = (high, low) if down_first else (low, high)
    first, second = held[top : turning + 1], held[turning:]
    falling, rising = (first, second) if down_first else (second, first)
    down, up = tuple(sorted(falling, reverse=True)), tuple(sorted(rising))
    reasons: dict[str, str] = {}
    scale = max(abs(rate) for _, rate in held)
    differ = tuple(
        a
        for a, rate in up
        for b, other in down
        if abs(a - b) < 0.2 * DEG and abs(rate - other) > tolerance * scale
    )
    at = [_at_neutral(branch, neutral) for branch in (down, up)]
    zero = [_sign_change(branch) for branch in (down, up)]
    height, width = abs(at[0] - at[1]), abs(zero[0] - zero[1])
    if math.isnan(height):
        reasons["loop_height"] = "a branch does not pass the neutral rudder"
    if math.isnan(width):
        reasons["loop_width"] = "a branch does not change the sense of the turn"
    return Spiral(down, up, width, height, differ, reasons)


def _at_neutral(branch: tuple[tuple[float, float], ...], neutral: float) -> float:
    rudder, rate = (np.array(c) for c in zip(*sorted(branch), strict=True))
    if not rudder[0] <= neutral <= rudder[-1]:
        return math.nan
    return float(np.interp(neutral, rudder, rate))


def _sign_change(branch: tuple[tuple[float, float], ...]) -> float:
    points = sorted(branch)
    for (a, left), (b, right) in zip(points, points[1:], strict=False):
        if left == 0.0:
            return a
        if left * right < 0:
            return a - left * (b - a) / (right - left)
    return points[-1][0] if points[-1][1] == 0.0 else math.nan
