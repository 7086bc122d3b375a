"""Zig-zag and spiral: how far a vehicle swings past the order, and whether small rudder angles obey.

Takes: arrays t, psi and rudder (or pitch and stern planes) of one run, simulated or logged. Results do not
depend on the side or sign convention; a quantity the run does not allow is NaN with a reason.
Does not: check that the run was a good zig-zag; the executes are those of the rudder.

Definitions: IMO Resolution MSC.137(76), sections 2.2.4 and 3.2; ITTC Recommended Procedure 7.5-04-02-01.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bayesid.measures.tools import Order, Series, channel, checked, crossing, orders, peak, value

DEG = math.pi / 180


@dataclass(frozen=True)
class Zigzag:
    """Zig-zag measures; angles [rad], times [s].

    `overshoots[k]` is how far the heading went on after execute k+2, `overshoot_times` how long. `switch` is
    the change of heading at the second execute, `initial_turning_time` the time and
    `initial_turning_distance` the way along the track from the first execute to it. `reach` is the time from
    the first execute until the heading is back at the base course, `period` the time from the second to the
    fourth execute. A run that starts with the rudder over counts its first sample as the first execute.
    In the vertical plane `first_side` "port" stands for bow down first.
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
    unsettled: tuple[float, ...]
    reasons: Mapping[str, str] = field(default_factory=dict)


def zigzag(
    t: np.ndarray,
    psi: np.ndarray,
    rudder: np.ndarray,
    x: np.ndarray | None = None,
    y: np.ndarray | None = None,
    orders_t: np.ndarray | None = None,
) -> Zigzag:
    """Measures of a zig-zag, horizontal (heading and rudder) or vertical (pitch and stern planes).

    Parameters
    ----------
    t, psi, rudder : (n,) array    time [s], heading [rad], ordered (preferred) or measured rudder [rad]
    x, y : (n,) array or None      position [m], for the distance to the second execute only
    orders_t : (n,) array or None  since when the order of a sample is given [s], where that is known

    Returns
    -------
    Zigzag    with as many overshoots as the run holds; fewer than two executes give NaN and reasons
    """
    t, data = checked("zig-zag", t, psi=psi, rudder=rudder, x=x, y=y)
    c = channel(t if orders_t is None else orders_t, data["rudder"])
    heading = channel(t, data["psi"], angle=True)
    found, end = _executes(c)
    if not found or heading.t.size < 5:
        return _no_zigzag("no rudder order found" if not found else "too few headings")
    executes = [order.t for order in found]
    if len(executes) < 2:
        return _no_zigzag("only one rudder order found; two needed", executes)
    early = heading.between(-math.inf, executes[0])
    base = float(np.interp(executes[0], heading.t, heading.y))
    if heading.sigma > 1e-6 and early.t.size >= 5:
        base = float(np.median(early.y[-max(5, early.t.size // 2) :]))
    reasons: dict[str, str] = {}
    angles = [
        value(heading, b, 0.15 * (b - a), 0.05) - base for a, b in zip(executes, executes[1:], strict=False)
    ]
    # the second leg shows the side best: a run that starts with the rudder over may start off its base course
    sign = math.copysign(1.0, angles[0] - angles[1] if len(angles) > 1 else angles[0])
    overshoots, lags = [], []
    for k, angle in enumerate(angles, 1):
        side = sign if k % 2 else -sign
        window = heading.between(executes[k], executes[k + 1] if k + 1 < len(executes) else end)
        swing = Series(window.t, side * (window.y - base), heading.sigma)
        when, top = peak(swing, 0.2 * (executes[k] - executes[k - 1]), 0.05)
        if math.isnan(top - angle):
            reasons["overshoots"] = f"no peak of the heading after execute {k + 1} (run too short, or a gap)"
            break
        overshoots.append(top - side * angle)
        lags.append(when - executes[k])
    started_over = found[0].before == found[0].after
    switch, turning_time = abs(angles[0]), executes[1] - executes[0]
    distance = _distance(t, data, executes[0], executes[1])
    if started_over:
        switch = turning_time = distance = math.nan
        why = "the run starts with the rudder over"
        reasons |= dict.fromkeys(("switch", "initial_turning_time", "initial_turning_distance"), why)
    elif math.isnan(distance):
        reasons["initial_turning_distance"] = "no track between the first two executes"
    later = heading.between(executes[1] + (lags[0] if lags else 0.0), math.inf)
    reach = crossing(Series(later.t, -sign * (later.y - base), heading.sigma), 0.0, 2 * DEG) - executes[0]
    if started_over:
        reach = math.nan
    if math.isnan(reach):
        reasons["reach"] = "the heading does not come back to the base course of an approach"
    if math.isnan(switch):
        reasons.setdefault("switch", "a gap in the heading at the second execute")
    period = executes[3] - executes[1] if len(executes) >= 4 else math.nan
    if len(executes) < 4:
        reasons["period"] = f"{len(executes)} executes; four needed"
    first_side = "starboard" if sign > 0 else "port"
    rudder_step = abs(found[0].after) if started_over else abs(found[0].after - found[0].before)
    return Zigzag(
        first_side,
        rudder_step,
        switch,
        tuple(executes),
        tuple(overshoots),
        tuple(lags),
        turning_time,
        distance,
        reach,
        period,
        reasons,
    )


def _executes(c: Series) -> tuple[list[Order], float]:
    """Rudder orders of the longest stretch that alternates between the two sides, and when its last leg ends.

    Steering before the zig-zag is passed over. The first sample is an order if the rudder is over by then;
    such an order has before == after.
    """
    if c.t.size < 2:
        return [], math.inf
    high, low = float(np.quantile(c.y, 0.98)), float(np.quantile(c.y, 0.02))
    largest, middle = 0.5 * (high - low), 0.5 * (high + low)
    found = orders(c, max(0.5 * largest, 6 * c.sigma, 0.2 * DEG))
    if found and abs(found[0].before - middle) > 0.6 * largest:
        found.insert(0, Order(float(c.t[0]), found[0].before, found[0].before))
    best: list[Order] = []
    stretch: list[Order] = []
    for order in found:
        over = abs(order.after - middle) > 0.6 * largest
        if not (over and stretch and (order.after - middle) * (stretch[-1].after - middle) < 0):
            stretch = []
        if over:
            stretch = [*stretch, order]
        if len(stretch) > len(best):
            best = stretch
    best = best or found[:1]
    return best, next((order.t for order in found if best and order.t > best[-1].t), math.inf)


def _no_zigzag(why: str, executes: Sequence[float] = ()) -> Zigzag:
    names = ("rudder", "switch", "initial_turning_time", "initial_turning_distance", "reach", "period")
    return Zigzag(
        first_side="",
        executes=tuple(executes),
        overshoots=(),
        overshoot_times=(),
        reasons=dict.fromkeys((*names, "first_side", "overshoots"), why),
        **dict.fromkeys(names, math.nan),
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
    held, moving = [], []
    for begin, end, level in zip(edges, edges[1:], levels, strict=False):
        if end - begin < shortest * (1 - 1e-6):
            continue
        part = heading.between(begin + settle * (end - begin), end)
        if part.t.size >= 3:
            rate, bend = np.polyfit(part.t - part.t.mean(), part.y, 2)[1::-1]
            held.append((level, float(rate)))
            moving.append((level, abs(2.0 * bend) * float(part.t[-1] - part.t[0])))
    if len(held) < 5:
        why = f"{len(held)} rudder angles held for {shortest:g} s or longer; at least five needed"
        return Spiral(
            (), (), math.nan, math.nan, (), (), dict.fromkeys(("loop_width", "loop_height", "differ"), why)
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
    unsettled = tuple(sorted({level for level, change in moving if change > tolerance * scale}))
    return Spiral(down, up, width, height, differ, unsettled, reasons)


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
