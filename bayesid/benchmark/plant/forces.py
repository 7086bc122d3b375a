"""Forces of the plant: coefficient rows, propulsion, restoring, and everything its vehicle file leaves out.

Takes: scratch s whose first six numbers are the velocity through the water, fin angles, settings. Adds to F,
the wrench X Y Z K M N [N, N m].
Does not: solve for accelerations (`motion`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from bayesid.benchmark.plant.body import DRAG, LIFT_R, LIFT_V, PLANE, RUDDER

AIR = 1.2  # kg/m^3


@njit(cache=True)
def flow_at(t, x, g, out):
    """Water velocity north, east, down into out[0:3]; its slope along x + y out[3:5], its rate out[5:7]."""
    tide = math.sin(g.tide_w * t + g.tide_p)
    swing = g.tide_w * math.cos(g.tide_w * t + g.tide_p)
    share, slope = 1.0, 0.0
    if g.eddy_len > 0.0:
        along = (x[0] + x[1]) / g.eddy_len
        share = 1.0 + g.eddy * math.tanh(along)
        slope = g.eddy * (1.0 - math.tanh(along) ** 2) / g.eddy_len
    out[0] = g.vn * share + g.an * t + g.tide_n * tide
    out[1] = g.ve * share + g.ae * t + g.tide_e * tide
    out[2] = g.vd
    out[3] = g.vn * slope
    out[4] = g.ve * slope
    out[5] = g.an + g.tide_n * swing
    out[6] = g.ae + g.tide_e * swing


@njit(cache=True)
def thrust_of(u, n, b):
    """Part of the propulsion that the shaft makes [N]."""
    if b.D > 0.0:
        rps = n / 60.0
        if rps == 0.0:
            return 0.0
        advance = max(0.0, u * (1.0 - b.wake) / (rps * b.D))
        full = (1.0 - b.deduction) * b.rho * rps * abs(rps) * b.D**4 * b.kt
        return full * (1.0 - (advance / b.kt_a) ** b.kt_b)
    return b.un * u * n + b.nn * n * abs(n) + b.n1 * n


@njit(cache=True)
def moment_of(u, n, b):
    """Heeling moment of a propeller with an open-water curve [N m]: a right-handed one lists to port."""
    if b.D <= 0.0 or n == 0.0:
        return 0.0
    rps = n / 60.0
    advance = max(0.0, u * (1.0 - b.wake) / (rps * b.D))
    full = b.rho * rps * abs(rps) * b.D**5 * b.kq
    return -full * (1.0 - (advance / b.kq_a) ** b.kq_b)


@njit(cache=True)
def _rudder_angle(delta, u, v, r, b, g):
    """Angle that counts for the lift: soft or hard stall."""
    if g.stall > 0.0:
        delta = math.tanh(delta * g.stall) / g.stall
    if g.hard_stall > 0.0:
        # lift breaks down beyond an inflow angle: the stern that swings outward in a turn takes some away
        inflow = delta - math.atan2(v - 0.5 * b.L * r, max(u, 1e-3))
        over = abs(inflow) - 1.0 / g.hard_stall
        if over > 0.0:
            delta *= max(0.3, 1.0 - 3.0 * over * g.hard_stall)
    return delta


@njit(cache=True)
def rows(x, delta_r, delta_s, b, axis, kind, factors, value, g, s, F):
    """Sum of the coefficient rows into F; s[0:6] is the velocity through the water."""
    u, v, w, r = s[0], s[1], s[2], s[5]
    cross = math.sqrt(v * v + w * w)
    s[6] = abs(v) if b.plain_abs > 0.0 else cross
    s[7] = abs(w) if b.plain_abs > 0.0 else cross
    s[8], s[9] = float(np.sign(v)), float(np.sign(w))
    for i in range(6):
        s[10 + i] = abs(s[i])
    s[17], s[18], s[19] = delta_s, 0.0, 1.0
    lift = _rudder_angle(delta_r, u, v, r, b, g)
    share = (1.0 - g.loss * (1.0 - g.loss_speed * (u / b.U0 - 1.0))) * (1.0 + g.asym * np.sign(delta_r))
    for k in range(value.size):
        kd = kind[k]
        s[16] = lift if kd == RUDDER else delta_r
        product = s[factors[k, 0]] * s[factors[k, 1]] * s[factors[k, 2]] * s[factors[k, 3]] * value[k]
        if kd == RUDDER:
            product *= share
        elif kd == PLANE:
            product *= 1.0 - g.s_loss
        elif kd == LIFT_V:
            product += g.mem * value[k] * u * (x[12] - v)
        elif kd == LIFT_R:
            product += g.mem_r * value[k] * u * (x[13] - r)
        elif kd == DRAG:
            product *= 1.0 + g.foul
        F[axis[k]] += product
    return lift * share


@njit(cache=True)
def shaft(t, n, lift, b, g, s, F):
    """Propulsion, its losses, and what the race does to hull and rudder."""
    u = s[0]
    n *= 1.0 + g.revs_swing * math.sin(g.revs_swing_w * t)
    push = thrust_of(u, n, b)
    drag = b.uu * u * abs(u)
    late = max(t - g.late_from, 0.0)
    F[0] += push * (1.0 - g.t_loss - g.t_decay * t - g.t_late * late)
    F[0] += drag * (1.0 + g.foul)
    if g.foul_linear != 0.0:
        F[0] -= g.foul_linear * thrust_of(b.U0, b.n_ref, b) * u / b.U0
    if g.step_d != 0.0 and t >= g.step_t:
        grown = min((t - g.step_t) / g.step_ramp, 1.0) if g.step_ramp > 0.0 else 1.0
        F[0] -= g.step_d * grown * u * abs(u)
    F[1] += g.side * push
    F[5] -= 0.5 * b.L * g.side * push
    F[3] += (b.q_ref + g.torque) * n * abs(n) / b.n_ref**2 + moment_of(u, n, b)
    race = b.U0**2 * n * abs(n) / b.n_ref**2
    extra = g.slip * (race - u * abs(u)) + g.jet * race
    F[1] += extra * b.Y_dr * lift
    F[5] += extra * b.N_dr * lift


@njit(cache=True)
def hull(t, x, b, g, s, F):
    """Cross-flow, cubic, one-sided and line forces."""
    u, v, r = s[0], s[1], s[5]
    half = 0.5 * b.rho
    if g.cd != 0.0:
        count = 40  # midpoints; fine enough that the kink at v + x r = 0 does not show
        for k in range(count):
            xi = (k + 0.5) / count - 0.5
            a = v + xi * b.L * r
            shape = 1.0 + 2.0 * g.tilt * xi + g.bow * (1.0 - 4.0 * xi * xi - 2.0 / 3.0)
            f = -half * g.cd * b.height * (b.L / count) * shape * a * abs(a)
            F[1] += f
            F[5] += f * xi * b.L
    F[1] += g.vvv * v**3 + g.v5 * v**5
    F[5] += g.rrr * r**3 + g.r5 * r**5
    F[5] += g.bent * u * abs(v)
    if t >= g.twist_t:
        F[1] += g.twist_y * u * u
        F[5] += g.twist_n * u * u
    stern = v - 0.5 * b.L * r
    pull = g.tether * math.sqrt(u * u + stern * stern) + g.tether_linear
    F[0] -= pull * u
    F[1] -= pull * stern
    F[5] += 0.5 * b.L * pull * stern


@njit(cache=True)
def strips(b, s, F):
    """Cross-flow drag of the vehicle file: trapezoid over its stations (Healey and Lienard 1993)."""
    n = int(b.stations)
    if n < 2:
        return
    h = b.L / (n - 1)
    for k in range(n):
        arm = -0.5 * b.L + k * h
        a, c = s[1] + arm * s[5], s[2] - arm * s[4]
        speed = math.sqrt(a * a + c * c)
        if speed == 0.0:
            continue
        d = 0.5 * b.rho * (b.strip_y * a * a + b.strip_z * c * c) / speed * h
        if k == 0 or k == n - 1:
            d *= 0.5
        F[1] -= d * a
        F[5] -= d * a * arm
        F[2] -= d * c
        F[4] += d * c * arm


@njit(cache=True)
def surroundings(t, x, b, g, s, cps, sps, F):
    """Earth-fixed force, air, wall, eddies shed by the hull."""
    swing = 1.0 + g.gust * math.sin(g.gust_w * t)
    fn, fe = g.fn * swing, g.fe * swing
    ahead, across = fn * cps + fe * sps, fe * cps - fn * sps  # in level axes; heel and trim turn them
    sph, cph, sth, cth = math.sin(x[3]), math.cos(x[3]), math.sin(x[4]), math.cos(x[4])
    F[0] += cth * ahead
    F[1] += sph * sth * ahead + cph * across
    F[2] += cph * sth * ahead - sph * across
    if g.air_x != 0.0 or g.air_y != 0.0:
        a = g.air_n * cps + g.air_e * sps - x[6]
        c = g.air_e * cps - g.air_n * sps - x[7]
        # the drag of still air is in the coefficients already
        pressure, calm = math.sqrt(a * a + c * c), math.sqrt(x[6] * x[6] + x[7] * x[7])
        side = 0.5 * AIR * b.L**2 * g.air_y * (pressure * c + calm * x[7])
        F[0] += 0.5 * AIR * b.L**2 * g.air_x * (pressure * a + calm * x[6])
        F[1] += side
        F[5] += side * g.air_arm * b.L
    u = s[0]
    if g.wall != 0.0:
        # suction towards a wall through (n, e) along a direction; bow pushed away
        away = -(x[0] - g.wall_n) * math.sin(g.wall_dir) + (x[1] - g.wall_e) * math.cos(g.wall_dir)
        near = math.exp(-abs(away) / g.wall_len) * (1.0 if away > 0.0 else -1.0)
        across = math.cos(x[5] - g.wall_dir)
        force = -0.5 * b.rho * b.L**2 * u * u * g.wall * near * across
        F[1] += force
        F[5] -= 0.3 * b.L * force
    if g.vortex != 0.0:
        force = 0.5 * b.rho * b.L**2 * u * u * g.vortex * math.sin(g.vortex_w * t)
        F[1] += force
        F[5] -= 0.35 * b.L * force


@njit(cache=True)
def vertical(x, b, g, s, F):
    """Weight, buoyancy, trim and the suction of the surface; 6-DOF only."""
    sph, cph, sth, cth = math.sin(x[3]), math.cos(x[3]), math.sin(x[4]), math.cos(x[4])
    W, B = b.W, b.B
    F[0] -= (W - B + g.heavy) * sth
    F[1] += (W - B + g.heavy) * cth * sph
    F[2] += (W - B + g.heavy) * cth * cph
    mx = b.xG * W - b.xB * B + g.heavy_x * g.heavy
    my, mz = b.yG * W - b.yB * B, b.zG * W - b.zB * B
    F[3] += my * cth * cph - mz * cth * sph
    F[4] += -mx * cth * cph - mz * sth
    F[5] += mx * cth * sph + my * sth
    if g.suck_d > 0.0:
        near = 0.5 * b.rho * b.L**2 * s[0] ** 2 * math.exp(-x[2] / (g.suck_d * b.L))
        F[2] -= g.suck_z * near
        F[4] += g.suck_m * b.L * near
