"""Turning circle: how soon and how tightly a vehicle turns, and what it costs in speed.

Takes: arrays t, x, y, psi and the rudder of one run, simulated or logged (noise, NaN, uneven sampling);
velocities where there are any. Results are positive for either side. A quantity the run does not allow is
NaN with a reason.
Does not: average runs or judge a vehicle.

Definitions: IMO Resolution MSC.137(76), section 2.2; ITTC Recommended Procedure 7.5-04-02-01 (free running
tests).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.measures.tools import Order, Series, between, channel, checked, crossing, orders, slope, value

STEADY_TOLERANCE = 0.05  # relative change of the yaw rate from one circle to the next, or over a quarter turn
HALVES_TOLERANCE = 0.10  # the same between the halves of the only circle, which wind and waves make uneven
# Between fixes up to 45 degrees of turn apart, in windows of eight: a cubic then errs by 1 % of the radius.
SELDOM = 45.0 / 8.0
DEG = math.pi / 180


@dataclass(frozen=True)
class TurningCircle:
    """Turning circle measures; lengths [m], angles [rad], rates [rad/s], times [s] from the rudder order.

    `advance` along and `transfer` across the approach course at 90 deg change of heading, `tactical_diameter`
    across it at 180 deg; the steady values come from the last full circle (the last quarter if there is
    none). `drift_angle` is positive with the bow inside the circle. `speed_ratio` is steady over approach
    speed, `drift_velocity` the set found from the circles (north, east) [m/s], NaN without a full circle.
    """

    side: str
    rudder: float
    execute: float
    approach_speed: float
    advance: float
    transfer: float
    tactical_diameter: float
    t90: float
    t180: float
    steady_diameter: float
    steady_yaw_rate: float
    drift_angle: float
    steady_speed: float
    speed_ratio: float
    drift_velocity: tuple[float, float]
    reasons: Mapping[str, str] = field(default_factory=dict)

    @property
    def speed_loss(self) -> float:
        """Share of the approach speed lost in the steady turn."""
        return 1.0 - self.speed_ratio


def turning_circle(
    t: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    psi: np.ndarray,
    rudder: np.ndarray,
    u: np.ndarray | None = None,
    v: np.ndarray | None = None,
    current: tuple[float, float] = (0.0, 0.0),
) -> TurningCircle:
    """Measures of a turning circle.

    Parameters
    ----------
    t : (n,) array                time [s], increasing
    x, y : (n,) array             position north, east [m]
    psi : (n,) array              heading [rad], wrapped or not
    rudder : (n,) array           ordered (preferred) or measured deflection [rad], either sign convention
    u, v : (n,) array or None     body velocity over ground [m/s]; without it the track is fitted
    current : (2,) pair           known set, north and east [m/s], taken off the track and, through the
    heading,
                                  off u and v; pass zero for velocities through the water

    Returns
    -------
    TurningCircle    NaN with an entry in `reasons` where the run is too short, not steady or has a gap
    """
    t, data = checked("turning circle", t, x=x, y=y, psi=psi, rudder=rudder, u=u, v=v)
    reasons: dict[str, str] = {}
    order, end = _turn_order(t, data["rudder"], channel(t, data["psi"], angle=True))
    if order is None:
        return _no_turn("no rudder order found: the rudder never leaves its first value")
    heading = channel(t, data["psi"], angle=True).between(-math.inf, end)
    before = heading.y[heading.t <= order.t]
    if before.size == 0:
        return _no_turn("no heading before the rudder order, so no approach course")
    psi0 = _mean_direction(heading, order.t)
    late = heading.between(order.t, end)
    total = late.y[-1] - psi0 if late.t.size else 0.0
    sign = 1.0 if total >= 0 else -1.0
    turned = Series(late.t, sign * (late.y - psi0), heading.sigma)
    elapsed = t - order.t
    px = channel(t, data["x"] - current[0] * elapsed).between(-math.inf, end)
    py = channel(t, data["y"] - current[1] * elapsed).between(-math.inf, end)

    times, along, across = {}, {}, {}
    start = _start(px, order.t), _start(py, order.t)
    for deg in (90, 180):
        at = crossing(turned, deg * DEG, 5 * DEG)
        times[deg] = at - order.t
        if math.isnan(at):
            seen = np.max(turned.y, initial=0.0) / DEG
            why = "a gap in the heading" if seen >= deg else f"heading changed by {seen:.0f} deg only"
            reasons[f"t{deg}"] = f"{why}; {deg} deg needed"
        window = 8 * DEG / max(_rate(turned, at), 1e-9) if not math.isnan(at) else 0.0
        place = _position(px, py, at, window)
        north, east = place[0] - start[0], place[1] - start[1]
        along[deg] = north * math.cos(psi0) + east * math.sin(psi0)
        across[deg] = sign * (-north * math.sin(psi0) + east * math.cos(psi0))
    for name, number, deg in (
        ("advance", along[90], 90),
        ("transfer", across[90], 90),
        ("tactical_diameter", across[180], 180),
    ):
        if math.isnan(number):
            reasons[name] = reasons.get(f"t{deg}", "no position there (gap or NaN)")

    speeds = _speeds(t, data, current, heading)
    approach = _approach_speed(speeds, px, py, order.t)
    steady = _steady(turned, px, py, speeds, psi0, end, sign, reasons)
    if math.isnan(approach):
        reasons["approach_speed"] = "no speed or track before the rudder order"
    ratio = steady["steady_speed"] / approach if approach > 0 else math.nan
    if math.isnan(ratio):
        reasons["speed_ratio"] = (
            reasons.get("steady_speed") or reasons.get("approach_speed") or "no approach speed"
        )
    return TurningCircle(
        side="starboard" if sign > 0 else "port",
        rudder=abs(order.after - order.before),
        execute=order.t,
        approach_speed=approach,
        advance=along[90],
        transfer=across[90],
        tactical_diameter=across[180],
        t90=times[90],
        t180=times[180],
        speed_ratio=ratio,
        reasons=reasons,
        **steady,
    )


def _turn_order(t: np.ndarray, rudder: np.ndarray, heading: Series) -> tuple[Order | None, float]:
    """The order that turned the vehicle furthest, and when that turn ends; earlier steering is left out."""
    c = channel(t, rudder)
    if c.t.size < 2 or heading.t.size < 2:
        return None, math.nan
    largest = float(np.quantile(np.abs(c.y - np.median(c.y[:3])), 0.98))
    found = orders(c, max(0.5 * largest, 6 * c.sigma, 0.2 * DEG))
    if not found:
        return None, math.nan
    edges = [*(o.t for o in found), float(t[-1])]
    turned = np.abs(np.diff(np.interp(edges, heading.t, heading.y)))
    k = int(np.argmax(turned))
    return found[k], edges[k + 1]


def _mean_direction(heading: Series, until: float) -> float:
    """Heading of the approach: its value at the order, averaged over the steady time before when noisy."""
    early = heading.between(-math.inf, until)
    if heading.sigma < 1e-6 or early.t.size < 5:
        return float(np.interp(until, heading.t, heading.y))
    return float(np.median(early.y[-max(5, early.t.size // 2) :]))


def _rate(turned: Series, at: float) -> float:
    """Mean rate over the 20 deg around a time [rad/s]."""
    level = float(np.interp(at, turned.t, turned.y))
    a, b = (np.interp(level + d, np.maximum.accumulate(turned.y), turned.t) for d in (-10 * DEG, 10 * DEG))
    return 20 * DEG / max(float(b - a), 1e-9)


def _position(px: Series, py: Series, at: float, window: float) -> tuple[float, float]:
    if math.isnan(at):
        return math.nan, math.nan
    span = float(np.ptp(px.y) + np.ptp(py.y)) if px.t.size and py.t.size else 0.0
    read = value(px, at, window, 0.01 * span), value(py, at, window, 0.01 * span)
    if not any(map(math.isnan, read)):
        return read
    return between(px, at, SELDOM * window), between(py, at, SELDOM * window)


def _start(c: Series, at: float) -> float:
    """Coordinate at the order: of the straight line through the last two readings before it, with noise
    through the second half of the approach. What comes after the order is in the turn already."""
    early = c.between(-math.inf, at)
    if early.t.size < 2:
        return value(c, at, math.inf, math.inf)
    exact = c.sigma < 1e-4 * float(np.ptp(c.y))
    late = slice(-2 if exact else -max(5, early.t.size // 2), None)
    return float(np.polyval(np.polyfit(early.t[late] - at, early.y[late], 1), 0.0))


def _speeds(
    t: np.ndarray, data: dict[str, np.ndarray], current: tuple[float, float], heading: Series
) -> tuple[Series, Series] | None:
    """u and v through the water, if logged."""
    if "u" not in data or "v" not in data or heading.t.size == 0:
        return None
    psi = np.interp(t, heading.t, heading.y)
    u = data["u"] - current[0] * np.cos(psi) - current[1] * np.sin(psi)
    v = data["v"] + current[0] * np.sin(psi) - current[1] * np.cos(psi)
    return channel(t, u), channel(t, v)


def _approach_speed(speeds: tuple[Series, Series] | None, px: Series, py: Series, until: float) -> float:
    if speeds is not None:
        u, v = (c.between(-math.inf, until) for c in speeds)
        if u.t.size and v.t.size:
            last = max(1, u.t.size // 2)
            return math.hypot(float(np.median(u.y[-last:])), float(np.median(v.y[-last:])))
    a, b = px.between(-math.inf, until), py.between(-math.inf, until)
    if min(a.t.size, b.t.size) < 3:
        return math.nan
    return math.hypot(np.polyfit(a.t - until, a.y, 1)[0], np.polyfit(b.t - until, b.y, 1)[0])


def _steady(
    turned: Series,
    px: Series,
    py: Series,
    speeds: tuple[Series, Series] | None,
    psi0: float,
    end: float,
    sign: float,
    reasons: dict[str, str],
) -> dict:
    names = ("steady_diameter", "steady_yaw_rate", "drift_angle", "steady_speed")
    out: dict = {**dict.fromkeys(names, math.nan), "drift_velocity": (math.nan, math.nan)}

    def give_up(why: str) -> dict:
        reasons.update(dict.fromkeys((*names, "drift_velocity"), why))
        return out

    if turned.t.size < 10:
        return give_up("too few headings in the turn")
    total = float(turned.y[-1])
    circle = total >= 540 * DEG
    if total < 270 * DEG:
        return give_up(f"heading changed by {total / DEG:.0f} deg only; 270 deg needed for a steady turn")
    begin = float(np.interp(total - (360 if circle else 90) * DEG, np.maximum.accumulate(turned.y), turned.t))
    last = turned.between(begin, end)
    if last.t.size < 10:
        return give_up("too few samples in the last part of the turn")
    middle = 0.5 * (last.t[0] + last.t[-1])
    rate, earlier, later = slope(last), slope(last.between(begin, middle)), slope(last.between(middle, end))
    tolerance = HALVES_TOLERANCE if circle else STEADY_TOLERANCE
    if total >= 900 * DEG:
        before = float(np.interp(total - 720 * DEG, np.maximum.accumulate(turned.y), turned.t))
        earlier, later, tolerance = slope(turned.between(before, begin)), rate, STEADY_TOLERANCE
    change = abs(later - earlier) / rate if rate > 0 else math.nan
    if math.isnan(change):
        return give_up("a gap in the last part of the turn")
    if change > tolerance:
        return give_up(f"the yaw rate still changes by {100 * change:.0f} % towards the end; turn for longer")
    out["steady_yaw_rate"] = rate
    headings = Series(last.t, psi0 + sign * last.y, last.sigma)
    fit = _circle(
        px.between(last.t[0], last.t[-1]), py.between(last.t[0], last.t[-1]), headings, sign, with_set=circle
    )
    if fit is None:
        reasons.update(
            dict.fromkeys(
                ("steady_diameter", "drift_angle", "steady_speed", "drift_velocity"),
                "too few positions in the last part of the turn",
            )
        )
        return out
    radius, drift, set_velocity = fit
    out |= {"steady_diameter": 2 * radius, "drift_angle": drift, "steady_speed": radius * rate}
    if circle:
        out["drift_velocity"] = set_velocity
    else:
        reasons["drift_velocity"] = "needs a full circle after the first half turn"
    if speeds is not None:
        u, v = (c.between(begin, end) for c in speeds)
        if min(u.t.size, v.t.size) >= 3:
            mean_u, mean_v = float(np.mean(u.y)), float(np.mean(v.y))
            out["steady_speed"] = math.hypot(mean_u, mean_v)
            out["drift_angle"] = -sign * math.atan2(mean_v, mean_u)
            out["steady_diameter"] = 2 * out["steady_speed"] / rate
    return out


def _circle(
    px: Series, py: Series, heading: Series, sign: float, with_set: bool
) -> tuple[float, float, tuple[float, float]] | None:
    """Radius, drift angle and set from x = a + b t + C cos + S sin(psi), y = c + d t + C sin - S cos(psi).

    The exact track of a steady turn in a uniform current, linear in its six unknowns: R = hypot(C, S), and
    the phase between course and heading is the drift angle.
    """
    if min(px.t.size, py.t.size) < 5:
        return None
    middle = 0.5 * (heading.t[0] + heading.t[-1])
    rows, right = [], []
    for c, north in ((px, True), (py, False)):
        angle = np.interp(c.t, heading.t, heading.y)
        one, zero, tau = np.ones(c.t.size), np.zeros(c.t.size), c.t - middle
        cos, sin = np.cos(angle), np.sin(angle)
        terms = [one, zero, cos, sin] if north else [zero, one, sin, -cos]
        if with_set:
            terms += [tau, zero] if north else [zero, tau]
        rows.append(np.column_stack(terms))
        right.append(c.y)
    solution = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
    drift = -sign * math.atan2(sign * solution[2], sign * solution[3])
    set_velocity = (float(solution[4]), float(solution[5])) if with_set else (math.nan, math.nan)
    return math.hypot(solution[2], solution[3]), drift, set_velocity


def _no_turn(why: str) -> TurningCircle:
    names = (
        "execute",
        "approach_speed",
        "advance",
        "transfer",
        "tactical_diameter",
        "t90",
        "t180",
        "steady_diameter",
        "steady_yaw_rate",
        "drift_angle",
        "steady_speed",
        "speed_ratio",
        "rudder",
    )
    nothing = dict.fromkeys(names, math.nan)
    return TurningCircle(
        side="",
        drift_velocity=(math.nan, math.nan),
        reasons=dict.fromkeys((*names, "side", "drift_velocity"), why),
        **nothing,
    )
