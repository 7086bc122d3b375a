"""One sample interval of the plant: servo solved exactly, motion by fourth-order Runge-Kutta between kinks.

Takes: state, servo memory, orders held between their changes, process forces on a grid.
Does not: know manoeuvres or sensors.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from bayesid.benchmark.plant.motion import N_STATES, WORK, rates
from bayesid.benchmark.plant.servo import kink_after, second_order, servo_at

SERVO = 5  # rudder angle, its rate, play output, stern angle, order last followed
TINY = 1e-9  # s


@njit(cache=True)
def _force_at(t, sea, spacing, out):
    """Process forces at t, linear between grid points; the last one holds."""
    last = sea.shape[0] - 1
    at = min(max(t / spacing, 0.0), float(last))
    k = min(int(at), last - 1) if last > 0 else 0
    w = at - k
    for i in range(5):
        out[i] = sea[k, i] if last == 0 else (1.0 - w) * sea[k, i] + w * sea[k + 1, i]


@njit(cache=True)
def follow(servo, order, g, first):
    """A new order reaches the gear: dead band and play."""
    if first or abs(order - servo[4]) > g.band:
        servo[4] = order
    wanted = servo[4]
    servo[2] = wanted if first else min(max(servo[2], wanted - g.play), wanted + g.play)


@njit(cache=True)
def _angle(servo, span, now, tau, rate, stop, g, stuck):
    """Rudder `span` seconds after the state in `servo`: the gear at its stops, and off its zero."""
    if stuck:
        angle = servo[0]
    elif g.servo_w > 0.0:
        angle, _ = second_order(servo[0], servo[1], servo[2], g.servo_w, g.servo_z, rate, span)
    else:
        angle = servo_at(servo[0], servo[2], tau, rate, span)
    return min(max(angle + g.hunt * math.sin(g.hunt_w * (now + span)), -stop), stop) + g.offset


@njit(cache=True)
def interval(x, servo, t0, t1, parts, changes, orders, plane, n, body, g, sea, spacing, track):
    """Carry state and servo from t0 to t1 in `parts` recorded pieces.

    Parameters
    ----------
    changes, orders : (k,) times [s] in [t0, t1) at which the gear receives a rudder order, and the orders
    plane, n : stern-plane order [rad] and shaft speed [rpm] of this interval
    track : (parts, N_STATES + 2) states and true fin angles at the end of each piece, written
    """
    b = body[0]
    k1, k2, k3, k4 = np.zeros(N_STATES), np.zeros(N_STATES), np.zeros(N_STATES), np.zeros(N_STATES)
    y, work, force = np.zeros(N_STATES), np.zeros(WORK), np.zeros(5)
    rate = b.dr_rate if g.slow == 0.0 else 1.0 / (1.0 / b.dr_rate + g.slow)
    wanted_plane = plane
    t, given = t0, 0
    for part in range(parts):
        end = t0 + (t1 - t0) * (part + 1) / parts
        while t < end - TINY:
            while given < changes.size and changes[given] <= t + TINY:
                follow(servo, orders[given], g, False)
                given += 1
            stuck = g.stuck_from <= t + TINY < g.stuck_to
            h = end - t
            if given < changes.size:
                h = min(h, changes[given] - t)
            if g.servo_w == 0.0 and not stuck:
                h = min(h, max(kink_after(servo[0], servo[2], g.tau, rate, b.dr_max), TINY))
            h = min(h, max(kink_after(servo[3], wanted_plane, 0.0, b.ds_rate, b.ds_max), TINY))
            r0 = _angle(servo, 0.0, t, g.tau, rate, b.dr_max, g, stuck)
            r1 = _angle(servo, 0.5 * h, t, g.tau, rate, b.dr_max, g, stuck)
            r2 = _angle(servo, h, t, g.tau, rate, b.dr_max, g, stuck)
            p0 = min(max(servo[3], -b.ds_max), b.ds_max) + g.s_offset
            p1 = servo_at(servo[3], wanted_plane, 0.0, b.ds_rate, 0.5 * h)
            p2 = servo_at(servo[3], wanted_plane, 0.0, b.ds_rate, h)
            servo[3] = p2
            p1 = min(max(p1, -b.ds_max), b.ds_max) + g.s_offset
            p2 = min(max(p2, -b.ds_max), b.ds_max) + g.s_offset
            _force_at(t, sea, spacing, force)
            rates(t, x, r0, p0, n, body, g, force, k1, work)
            y[:] = x + 0.5 * h * k1
            _force_at(t + 0.5 * h, sea, spacing, force)
            rates(t + 0.5 * h, y, r1, p1, n, body, g, force, k2, work)
            y[:] = x + 0.5 * h * k2
            rates(t + 0.5 * h, y, r1, p1, n, body, g, force, k3, work)
            y[:] = x + h * k3
            _force_at(t + h, sea, spacing, force)
            rates(t + h, y, r2, p2, n, body, g, force, k4, work)
            x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            if not stuck:
                if g.servo_w > 0.0:
                    servo[0], servo[1] = second_order(
                        servo[0], servo[1], servo[2], g.servo_w, g.servo_z, rate, h
                    )
                else:
                    servo[0] = servo_at(servo[0], servo[2], g.tau, rate, h)
            t += h
        track[part, :N_STATES] = x
        track[part, N_STATES] = _angle(servo, 0.0, t, g.tau, rate, b.dr_max, g, False)
        track[part, N_STATES + 1] = min(max(servo[3], -b.ds_max), b.ds_max) + g.s_offset


@njit(cache=True)
def forces_along(t, states, angles, n, body, g):
    """(k, 6) fluid forces (rows, propulsion, what was added) on a recorded track, without disturbance."""
    out = np.zeros((t.size, 6))
    work, scratch, calm = np.zeros(WORK), np.zeros(N_STATES), np.zeros(5)
    for k in range(t.size):
        rates(t[k], states[k], angles[k, 0], angles[k, 1], n[k], body, g, calm, scratch, work)
        out[k] = work[20:26]
    return out
