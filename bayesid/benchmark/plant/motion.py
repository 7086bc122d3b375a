"""Rates of the plant: the rigid body under all forces of `forces`, in moving water.

Takes: state x y z phi theta psi u v w p q r + (lagged v, lagged r, slosh offset, slosh speed), fin angles,
rpm, the packed `Body`, the settings. Velocities are over ground. SI, radians.
Does not: step in time (`advance`) or draw anything.
"""

from __future__ import annotations

import math

from numba import njit

from bayesid.benchmark.plant.forces import flow_at, hull, rows, shaft, strips, surroundings, vertical

N_STATES = 16
WORK = 64  # scratch numbers one call needs
GRAVITY = 9.81  # m/s^2, turns the buoyancy of a vehicle file into the mass it displaces


@njit(cache=True)
def _rigid(x, b, F):
    """Velocity parts of the rigid-body equations, taken to the right-hand side."""
    u, v, w, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11]
    m, xG, yG, zG = b.m, b.xG, b.yG, b.zG
    ax, ay, az = w * q - v * r, u * r - w * p, v * p - u * q
    F[0] -= m * (ax - xG * (q * q + r * r) + yG * p * q + zG * p * r)
    F[1] -= m * (ay - yG * (r * r + p * p) + zG * q * r + xG * q * p)
    F[2] -= m * (az - zG * (p * p + q * q) + xG * r * p + yG * r * q)
    F[3] -= (b.Iz - b.Iy) * q * r - p * q * b.Ixz + (r * r - q * q) * b.Iyz + p * r * b.Ixy
    F[3] -= m * (yG * az - zG * ay)
    F[4] -= (b.Ix - b.Iz) * r * p - q * r * b.Ixy + (p * p - r * r) * b.Ixz + q * p * b.Iyz
    F[4] -= m * (zG * ax - xG * az)
    F[5] -= (b.Iy - b.Ix) * p * q - r * p * b.Iyz + (q * q - p * p) * b.Ixy + r * q * b.Ixz
    F[5] -= m * (xG * ay - yG * ax)


@njit(cache=True)
def rates(t, x, delta_r, delta_s, n, body, g, sea, out, work):
    """Time derivative of the state into `out`.

    Parameters
    ----------
    sea : (5,) process forces X Y N Z M at this instant [N, N m]
    work : (WORK,) scratch; on return work[20:26] is the sum of rows, propulsion and other fluid forces
    """
    b, axis, kind, factors, value, added, inverse = body
    s, F, flow, dflow, stream = work[:20], work[20:26], work[26:29], work[29:32], work[32:40]
    F[:] = 0.0
    sph, cph, sth, cth = math.sin(x[3]), math.cos(x[3]), math.sin(x[4]), math.cos(x[4])
    sps, cps = math.sin(x[5]), math.cos(x[5])
    u, v, w, p, q, r = x[6], x[7], x[8], x[9], x[10], x[11]
    a0, a1, a2 = cps * cth, sps * cth, -sth
    b0, b1, b2 = cps * sth * sph - sps * cph, sps * sth * sph + cps * cph, cth * sph
    c0, c1, c2 = cps * sth * cph + sps * sph, sps * sth * cph - cps * sph, cth * cph
    out[0] = a0 * u + b0 * v + c0 * w
    out[1] = a1 * u + b1 * v + c1 * w
    out[2] = a2 * u + b2 * v + c2 * w
    out[3] = p + (q * sph + r * cph) * sth / cth
    out[4] = q * cph - r * sph
    out[5] = (q * sph + r * cph) / cth
    flow_at(t, x, g, stream)
    fn, fe, fd = stream[0], stream[1], stream[2]
    # the water's own acceleration, which pushes by its pressure gradient as if the hull were water too
    hn, he = stream[5], stream[6]
    pull, where = work[46:49], work[49:52]
    pull[0], pull[1], pull[2] = a0 * hn + a1 * he, b0 * hn + b1 * he, c0 * hn + c1 * he
    where[0], where[1], where[2] = b.xB, b.yB, b.zB
    # change of the current as the vehicle meets it: in time, and by moving through an uneven one
    closing = out[0] + out[1]
    gn, ge = stream[5] + stream[3] * closing, stream[6] + stream[4] * closing
    flow[0], flow[1] = a0 * fn + a1 * fe + a2 * fd, b0 * fn + b1 * fe + b2 * fd
    flow[2] = c0 * fn + c1 * fe + c2 * fd
    dflow[0] = a0 * gn + a1 * ge - (q * flow[2] - r * flow[1])
    dflow[1] = b0 * gn + b1 * ge - (r * flow[0] - p * flow[2])
    dflow[2] = c0 * gn + c1 * ge - (p * flow[1] - q * flow[0])
    s[0], s[1], s[2], s[3], s[4], s[5] = u - flow[0], v - flow[1], w - flow[2], p, q, r
    lift = rows(x, delta_r, delta_s, b, axis, kind, factors, value, g, s, F)
    shaft(t, n, lift, b, g, s, F)
    hull(t, x, b, g, s, F)
    strips(b, s, F)
    surroundings(t, x, b, g, s, cps, sps, F)
    force = work[40:46]
    for i in range(6):
        force[i] = F[i] - added[i, 0] * dflow[0] - added[i, 1] * dflow[1] - added[i, 2] * dflow[2]
    displaced = b.B / GRAVITY
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        force[i] += displaced * pull[i]
        force[3 + i] += displaced * (where[j] * pull[k] - where[k] * pull[j])
    force[0] += sea[0]
    force[1] += sea[1]
    force[5] += sea[2]
    force[2] += sea[3]
    force[4] += sea[4]
    if b.planar == 0.0:
        vertical(x, b, g, s, force)
    out[14] = 0.0
    out[15] = 0.0
    spring = 0.0
    if b.slosh_m > 0.0:
        k = b.slosh_m * g.slosh_w**2
        spring = k * x[14] + 2.0 * g.slosh_z * b.slosh_m * g.slosh_w * x[15]
        push = spring + b.slosh_m * u * r
        force[1] += push
        force[5] += g.slosh_x * push
    _rigid(x, b, force)
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += inverse[i, j] * force[j]
        out[6 + i] = total
    if b.slosh_m > 0.0:
        out[14] = x[15]
        out[15] = -spring / b.slosh_m - (out[7] + u * r + g.slosh_x * out[11])
    out[12], out[13] = 0.0, 0.0
    if g.mem_lag > 0.0:
        out[12] = (s[1] - x[12]) * abs(s[0]) / (g.mem_lag * b.L)
        out[13] = (r - x[13]) * abs(s[0]) / (g.mem_lag * b.L)
