"""The steering gear as one element: towards the order at 1/tau of the error, no faster than its rate.

Takes: angles [rad], times [s]. Gives exact angles while the order is constant.
Does not: clip; the stops act on what leaves the servo.
"""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True)
def servo_at(start: float, order: float, tau: float, rate: float, span: float) -> float:
    """Angle after `span` [s] of delta' = clip((order - delta)/tau, -rate, rate) from `start`."""
    error = order - start
    size = abs(error)
    sign = 1.0 if error >= 0.0 else -1.0
    ramp = max(size - rate * tau, 0.0)  # angle covered at full rate
    if span * rate < ramp or tau <= 0.0:
        return start + sign * min(rate * span, size)
    left = span - ramp / rate
    return order - sign * (size - ramp) * math.exp(-left / tau)


@njit(cache=True)
def kink_after(start: float, order: float, tau: float, rate: float, stop: float) -> float:
    """Time [s] until the motion changes its law: end of the ramp, a stop reached or left; else inf."""
    error = order - start
    size = abs(error)
    found = math.inf
    ramp = size - rate * tau
    if ramp > 0.0:
        found = ramp / rate
        for edge in (-stop, stop):
            way = (edge - start) * (1.0 if error >= 0.0 else -1.0)
            if 0.0 < way < ramp:
                found = min(found, way / rate)
    return found


@njit(cache=True)
def second_order(
    angle: float, speed: float, order: float, w: float, z: float, rate: float, span: float
) -> tuple[float, float]:
    """Angle and rate after `span` of a second-order servo, frequency w [rad/s], damping z, rate limited."""
    count = max(4, math.ceil(span * w / 0.02))
    h = span / count
    for _ in range(count):
        half = min(max(speed + 0.5 * h * (w * w * (order - angle) - 2.0 * z * w * speed), -rate), rate)
        middle = angle + 0.5 * h * speed
        speed = min(max(speed + h * (w * w * (order - middle) - 2.0 * z * w * half), -rate), rate)
        angle += h * half
    return angle, speed
