"""Printed by bayesid.equations.generate from the term table and the effects: do not edit."""

import math

import numpy as np
from numba import njit

EQUATIONS = "d75129a2296e8561"
LANES = 16
PARAMETERS = (
    'm', 'Izz', 'x_G', 'y_G', 'L', 'rho', 'height', 'rpm_ref', 'U_ref', 'point_x', 'point_y', 'W', 'B',
    'x_B', 'y_B', 'inverse_rate_r', 'servo_lag_r', 'limit_r', 'X_uu', 'Y_vdot', 'N_dr', 'push.F',
)
ACTUATORS = (
    'delta_r', 'n',
)
EXOGENOUS = (
    'wind_north', 'wind_east', 'flow_north', 'flow_east', 'force_X', 'force_Y', 'force_N',
)
VELOCITIES = (
    'u', 'v', 'r',
)
CHANNELS = (
    'x', 'y', 'psi', 'u', 'v', 'r', 'u_water', 'v_water',
)
EFFECTS = (
    'push',
)

FULL_STATES = (
    'x', 'y', 'psi', 'u', 'v', 'r',
)


@njit(cache=True, nogil=True, error_model='numpy')
def full_masses(pars, out):
    """Mass matrices, added mass included, of every parameter vector; `out` comes with zeros."""
    for b in range(pars.shape[0]):
        t151 = pars[b, 0] * pars[b, 2]
        t173 = -(pars[b, 0] * pars[b, 3])
        out[b, 0, 0] = pars[b, 0]
        out[b, 0, 2] = t173
        out[b, 1, 1] = pars[b, 0] - pars[b, 19]
        out[b, 1, 2] = t151
        out[b, 2, 0] = t173
        out[b, 2, 1] = t151
        out[b, 2, 2] = pars[b, 1]


@njit(cache=True, nogil=True, error_model='numpy')
def full_start(x, exo, t, par, slope_x, slope_par):
    """Fill the effects' own states of x with their initial values, and the slopes of those."""
    return 6


@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def full_simulate(par, minv, x0, times, steps, act, exo, record, out, trace):
    """States at the recorded steps.

    `trace` (steps, 4, states + velocities), if not empty, gets state, acceleration of every stage.
    """
    b0 = x0[0]
    b1 = x0[1]
    b2 = x0[2]
    b3 = x0[3]
    b4 = x0[4]
    b5 = x0[5]
    keep = trace.size > 0
    sample = 0
    for s in range(steps.size + 1):
        while sample < record.size and record[sample] == s:
            out[sample, 0] = b0
            out[sample, 1] = b1
            out[sample, 2] = b2
            out[sample, 3] = b3
            out[sample, 4] = b4
            out[sample, 5] = b5
            sample += 1
        if s == steps.size:
            break
        h = steps[s]
        m0 = act[s, 0]
        m1 = act[s, 1]
        d0 = act[s, 2]
        d1 = act[s, 3]
        e0 = exo[s, 0]
        e1 = exo[s, 1]
        e2 = exo[s, 2]
        e3 = exo[s, 3]
        e4 = exo[s, 4]
        e5 = exo[s, 5]
        e6 = exo[s, 6]
        z0 = b0
        z1 = b1
        z2 = b2
        z3 = b3
        z4 = b4
        z5 = b5
        q0 = 0.0
        q1 = 0.0
        q2 = 0.0
        q3 = 0.0
        q4 = 0.0
        q5 = 0.0
        for stage in range(4):
            weight = 2.0 if (stage == 1 or stage == 2) else 1.0
            half = h if stage == 2 else 0.5 * h
            t = times[s] + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))
            part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)
            u0 = m0 + part * d0
            u1 = m1 + part * d1
            t43 = math.cos(z2)
            t45 = math.sin(z2)
            t47 = (e2 * t43) + (e3 * t45)
            t56 = z3 - t47
            t61 = t56 * t56
            t66 = z4 * z5
            t68 = z5 * z5
            t82 = z3 * z5
            f0 = e4 + ((par[18] * t61) - (par[0] * ((-t66) - (par[2] * t68))))
            f1 = e5 + (par[21] + ((par[19] * (z5 * t47)) - (par[0] * (t82 - (par[3] * t68)))))
            f2 = e6 + ((par[20] * (u0 * t61)) - (par[0] * ((par[2] * t82) + (par[3] * t66))))
            k0 = (z3 * t43) - (z4 * t45)
            k1 = (z3 * t45) + (z4 * t43)
            k2 = z5
            a0 = minv[0] * f0 + minv[1] * f1 + minv[2] * f2
            a1 = minv[3] * f0 + minv[4] * f1 + minv[5] * f2
            a2 = minv[6] * f0 + minv[7] * f1 + minv[8] * f2
            if keep:
                trace[s, stage, 0] = z0
                trace[s, stage, 1] = z1
                trace[s, stage, 2] = z2
                trace[s, stage, 3] = z3
                trace[s, stage, 4] = z4
                trace[s, stage, 5] = z5
                trace[s, stage, 6] = a0
                trace[s, stage, 7] = a1
                trace[s, stage, 8] = a2
            q0 += weight * k0
            q1 += weight * k1
            q2 += weight * k2
            q3 += weight * a0
            q4 += weight * a1
            q5 += weight * a2
            z0 = b0 + half * k0
            z1 = b1 + half * k1
            z2 = b2 + half * k2
            z3 = b3 + half * a0
            z4 = b4 + half * a1
            z5 = b5 + half * a2
        b0 += h / 6.0 * q0
        b1 += h / 6.0 * q1
        b2 += h / 6.0 * q2
        b3 += h / 6.0 * q3
        b4 += h / 6.0 * q4
        b5 += h / 6.0 * q5


@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def full_lanes(par, minv, x0, times, steps, act, exo, record, out, trace):
    """RK4 over 16 vectors at once; every array is flat with 16 values per entry.

    `trace`, if not empty, gets state and acceleration of every stage.
    """
    work = np.zeros(896)
    for i in range(352):
        work[544 + i] = par[i]
    for i in range(144):
        work[400 + i] = minv[i]
    for i in range(96):
        work[0 + i] = x0[i]
    for i in range(96):
        work[96 + i] = x0[i]
    store = trace.size > 0
    sample = 0
    for s in range(steps.size + 1):
        while sample < record.size and record[sample] == s:
            for i in range(96):
                out[sample * 96 + i] = work[0 + i]
            sample += 1
        if s == steps.size:
            break
        h = steps[s]
        sixth = h / 6.0
        e0 = exo[s, 0]
        e1 = exo[s, 1]
        e2 = exo[s, 2]
        e3 = exo[s, 3]
        e4 = exo[s, 4]
        e5 = exo[s, 5]
        e6 = exo[s, 6]
        for i in range(64):
            work[336 + i] = act[s * 64 + i]
        for stage in range(4):
            weight = 2.0 if (stage == 1 or stage == 2) else 1.0
            half = h if stage == 2 else 0.5 * h
            t = times[s] + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))
            part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)
            last = stage == 3
            keep = 0.0 if last else 1.0
            to = (s * 4 + stage) * 144
            if store:
                for i in range(96):
                    trace[to + i] = work[96 + i]
            for l in range(16):
                t26_k = math.floor(work[128 + l] * 0.6366197723675814 + 0.5)
                t26_y = ((work[128 + l] - t26_k * 1.57079625129699707031) - t26_k * 7.54978941586159635335e-08) - t26_k * 5.39030285815811905290e-15
                t26_z = t26_y * t26_y
                t26_ps = t26_y + t26_y * t26_z * ((((((1.5896230157654656e-10) * t26_z + -2.5050747762857807e-08) * t26_z + 2.7557313621385722e-06) * t26_z + -0.0001984126982958954) * t26_z + 0.008333333333322118) * t26_z + -0.1666666666666663)
                t26_pc = 1.0 - 0.5 * t26_z + t26_z * t26_z * ((((((-1.1358536521387682e-11) * t26_z + 2.087570084197473e-09) * t26_z + -2.755731417929674e-07) * t26_z + 2.4801587288851704e-05) * t26_z + -0.0013888888888873056) * t26_z + 0.041666666666666595)
                t26_h = t26_k - 2.0 * math.floor(0.5 * t26_k)
                t26_q = t26_k - 4.0 * math.floor(0.25 * t26_k)
                t26_s0 = t26_pc if t26_h > 0.5 else t26_ps
                t26_c0 = t26_ps if t26_h > 0.5 else t26_pc
                t26_sin = -t26_s0 if t26_q > 1.5 else t26_s0
                t26_cos = -t26_c0 if (t26_q > 0.5 and t26_q < 2.5) else t26_c0
                t47 = (e2 * t26_cos) + (e3 * t26_sin)
                t56 = work[144 + l] - t47
                t61 = t56 * t56
                t66 = work[160 + l] * work[176 + l]
                t68 = work[176 + l] * work[176 + l]
                t82 = work[144 + l] * work[176 + l]
                t136 = work[880 + l] + ((work[848 + l] * (work[176 + l] * t47)) - (work[544 + l] * (t82 - (work[592 + l] * t68))))
                t143 = (work[864 + l] * ((work[336 + l] + part * work[368 + l]) * t61)) - (work[544 + l] * ((work[576 + l] * t82) + (work[592 + l] * t66)))
                f0 = e4 + ((work[832 + l] * t61) - (work[544 + l] * ((-t66) - (work[576 + l] * t68))))
                f1 = e5 + t136
                f2 = e6 + t143
                k0 = (work[144 + l] * t26_cos) - (work[160 + l] * t26_sin)
                k1 = (work[144 + l] * t26_sin) + (work[160 + l] * t26_cos)
                k2 = work[176 + l]
                a0 = work[400 + l] * f0 + work[416 + l] * f1 + work[432 + l] * f2
                a1 = work[448 + l] * f0 + work[464 + l] * f1 + work[480 + l] * f2
                a2 = work[496 + l] * f0 + work[512 + l] * f1 + work[528 + l] * f2
                work[288 + l] = a0
                work[304 + l] = a1
                work[320 + l] = a2
                q0 = work[192 + l] + weight * k0
                work[192 + l] = q0 * keep
                w0 = work[0 + l] + (q0 * sixth if last else half * k0)
                work[96 + l] = w0
                q1 = work[208 + l] + weight * k1
                work[208 + l] = q1 * keep
                w1 = work[16 + l] + (q1 * sixth if last else half * k1)
                work[112 + l] = w1
                q2 = work[224 + l] + weight * k2
                work[224 + l] = q2 * keep
                w2 = work[32 + l] + (q2 * sixth if last else half * k2)
                work[128 + l] = w2
                q3 = work[240 + l] + weight * a0
                work[240 + l] = q3 * keep
                w3 = work[48 + l] + (q3 * sixth if last else half * a0)
                work[144 + l] = w3
                q4 = work[256 + l] + weight * a1
                work[256 + l] = q4 * keep
                w4 = work[64 + l] + (q4 * sixth if last else half * a1)
                work[160 + l] = w4
                q5 = work[272 + l] + weight * a2
                work[272 + l] = q5 * keep
                w5 = work[80 + l] + (q5 * sixth if last else half * a2)
                work[176 + l] = w5
            if store:
                for i in range(48):
                    trace[to + 96 + i] = work[288 + i]
        for i in range(96):
            work[0 + i] = work[96 + i]


FULL_ENTRIES = np.array([(0, 0), (0, 2), (0, 3), (0, 18), (1, 0), (1, 2), (1, 3), (1, 19), (1, 21), (2, 0), (2, 1), (2, 2), (2, 3), (2, 20)], dtype=np.int64).reshape(-1, 2)


@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def full_variational(par, minv, x0, s0, times, steps, act, dact, exo, record, entries,
        columns, act_columns, input_columns, path, out, sens, rate, srate):
    """States and sensitivities at the recorded steps; `rate`, `srate`, if there, get their rates.

    `columns[e]` is the output column of sparse parameter entry e (-1: not wanted); `act_columns`
    maps actuator slopes, `input_columns` raw inputs (actuators, then exogenous) to output columns.
    `path` (records, states), if not empty: after every record the run starts again there, from s0.
    """
    n = s0.shape[1]
    blocks = (n + 15) // 16
    work = np.zeros(blocks * 336)
    slot = np.full(6, -1, dtype=np.int64)
    slot[0] = 18
    slot[1] = 19
    slot[2] = 20
    source = np.empty(columns.size, dtype=np.int64)
    target = np.empty(columns.size, dtype=np.int64)
    wanted = 0
    for e in range(columns.size):
        c = columns[e]
        if c >= 0:
            source[wanted] = e
            target[wanted] = (c // 16 * 21 + slot[entries[e, 0]]) * 16 + c % 16
            wanted += 1
    want_inputs = False
    for a in range(act_columns.size):
        want_inputs = want_inputs or act_columns[a] >= 0
    for a in range(input_columns.size):
        want_inputs = want_inputs or input_columns[a] >= 0
    want_rate = rate.size > 0
    restart = path.size > 0
    dpar = np.empty(columns.size)
    dinp = np.zeros((6, 9))
    b0 = x0[0]
    b1 = x0[1]
    b2 = x0[2]
    b3 = x0[3]
    b4 = x0[4]
    b5 = x0[5]
    for i in range(6):
        for c in range(n):
            work[(c // 16 * 21 + 0 + i) * 16 + c % 16] = s0[i, c]
    last = steps.size - 1
    sample = 0
    for q in range(steps.size + 1):
        first = sample
        while sample < record.size and record[sample] == q:
            out[sample, 0] = b0
            out[sample, 1] = b1
            out[sample, 2] = b2
            out[sample, 3] = b3
            out[sample, 4] = b4
            out[sample, 5] = b5
            for i in range(6):
                for c in range(n):
                    sens[sample, i, c] = work[(c // 16 * 21 + 0 + i) * 16 + c % 16]
            sample += 1
        if restart and sample > first:
            b0 = path[sample - 1, 0]
            b1 = path[sample - 1, 1]
            b2 = path[sample - 1, 2]
            b3 = path[sample - 1, 3]
            b4 = path[sample - 1, 4]
            b5 = path[sample - 1, 5]
            for i in range(6):
                for c in range(n):
                    work[(c // 16 * 21 + 0 + i) * 16 + c % 16] = s0[i, c]
        if q > last and not (want_rate and sample > first):
            break
        s = min(q, last)
        h = steps[s]
        m0 = act[s, 0]
        m1 = act[s, 1]
        d0 = act[s, 2]
        d1 = act[s, 3]
        e0 = exo[s, 0]
        e1 = exo[s, 1]
        e2 = exo[s, 2]
        e3 = exo[s, 3]
        e4 = exo[s, 4]
        e5 = exo[s, 5]
        e6 = exo[s, 6]
        begin = times[s] + (h if q > last else 0.0)
        z0 = b0
        z1 = b1
        z2 = b2
        z3 = b3
        z4 = b4
        z5 = b5
        q0 = 0.0
        q1 = 0.0
        q2 = 0.0
        q3 = 0.0
        q4 = 0.0
        q5 = 0.0
        for o in range(blocks):
            base = o * 336
            for l in range(96):
                work[base + 96 + l] = work[base + l]
                work[base + 192 + l] = 0.0
        for stage in range(1 if q > last else 4):
            weight = 2.0 if (stage == 1 or stage == 2) else 1.0
            half = h if stage == 2 else 0.5 * h
            t = begin + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))
            part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)
            part += 1.0 if q > last else 0.0
            u0 = m0 + part * d0
            u1 = m1 + part * d1
            t43 = math.cos(z2)
            t45 = math.sin(z2)
            t47 = (e2 * t43) + (e3 * t45)
            t56 = z3 - t47
            t61 = t56 * t56
            t66 = z4 * z5
            t68 = z5 * z5
            t82 = z3 * z5
            f0 = e4 + ((par[18] * t61) - (par[0] * ((-t66) - (par[2] * t68))))
            f1 = e5 + (par[21] + ((par[19] * (z5 * t47)) - (par[0] * (t82 - (par[3] * t68)))))
            f2 = e6 + ((par[20] * (u0 * t61)) - (par[0] * ((par[2] * t82) + (par[3] * t66))))
            k0 = (z3 * t43) - (z4 * t45)
            k1 = (z3 * t45) + (z4 * t43)
            k2 = z5
            a0 = minv[0] * f0 + minv[1] * f1 + minv[2] * f2
            a1 = minv[3] * f0 + minv[4] * f1 + minv[5] * f2
            a2 = minv[6] * f0 + minv[7] * f1 + minv[8] * f2
            v149 = par[0] * par[3]
            v151 = par[0] * par[2]
            v152 = z5 * v151
            v154 = par[0] * z5
            v157 = par[18] * t56
            v158 = v157 + v157
            v180 = z5 * v149
            v186 = par[19] * z5
            v209 = t56 * (par[20] * u0)
            v210 = v209 + v209
            d0_2 = (t45 * (e2 * v158)) - (t43 * (e3 * v158))
            d0_3 = v158
            d0_4 = v154
            d0_5 = (v152 + v152) + (par[0] * z4)
            d1_2 = (t43 * (e3 * v186)) - (t45 * (e2 * v186))
            d1_3 = -v154
            d1_5 = (v180 + (v180 - (par[0] * z3))) + (par[19] * t47)
            d2_2 = (t45 * (e2 * v210)) - (t43 * (e3 * v210))
            d2_3 = v210 - v152
            d2_4 = -v180
            d2_5 = (-(z3 * v151)) - (z4 * v149)
            d3_2 = (-(z4 * t43)) - (z3 * t45)
            d3_3 = t43
            d3_4 = -t45
            d4_2 = (z3 * t43) - (z4 * t45)
            d4_3 = t45
            d4_4 = t43
            d5_5 = 1.0
            if wanted:
                p67 = a0 - t66
                p83 = a1 + t82
                p148 = par[0] * a2
                p150 = par[0] * t68
                dpar[0] = (par[3] * a2) - (p67 - (par[2] * t68))
                dpar[1] = p150
                dpar[2] = p148
                dpar[3] = t61
                dpar[4] = -((p83 - (par[3] * t68)) + (par[2] * a2))
                dpar[5] = -p148
                dpar[6] = p150
                dpar[7] = a1 + (z5 * t47)
                dpar[8] = 1.0
                dpar[9] = (par[3] * p67) - (par[2] * p83)
                dpar[10] = -a2
                dpar[11] = -(par[0] * p83)
                dpar[12] = par[0] * p67
                dpar[13] = u0 * t61
                pass
            for o in range(blocks):
                base = o * 336 + 288
                for l in range(48):
                    work[base + l] = 0.0
            for w in range(wanted):
                work[target[w]] += dpar[source[w]]
            if want_inputs:
                dinp[0, 4] = -(t43 * v158)
                dinp[0, 5] = -(t45 * v158)
                dinp[0, 6] = 1.0
                dinp[1, 4] = t43 * v186
                dinp[1, 5] = t45 * v186
                dinp[1, 7] = 1.0
                dinp[2, 0] = par[20] * t61
                dinp[2, 4] = -(t43 * v210)
                dinp[2, 5] = -(t45 * v210)
                dinp[2, 8] = 1.0
                for row in range(6):
                    if slot[row] < 0:
                        continue
                    for a in range(act_columns.size):
                        c = act_columns[a]
                        if c >= 0:
                            spot = (c // 16 * 21 + slot[row]) * 16 + c % 16
                            for j in range(2):
                                along = dact[s, j, a] + part * dact[s, 2 + j, a]
                                work[spot] += dinp[row, j] * along
                    for j in range(9):
                        c = input_columns[j]
                        if c >= 0:
                            spot = (c // 16 * 21 + slot[row]) * 16 + c % 16
                            work[spot] += dinp[row, j]
            for o in range(blocks):
                base = o * 336
                for l in range(16):
                    c0 = work[base + 96 + l]
                    c1 = work[base + 112 + l]
                    c2 = work[base + 128 + l]
                    c3 = work[base + 144 + l]
                    c4 = work[base + 160 + l]
                    c5 = work[base + 176 + l]
                    g0 = work[base + 288 + l] + d0_2 * c2 + d0_3 * c3 + d0_4 * c4 + d0_5 * c5
                    g1 = work[base + 304 + l] + d1_2 * c2 + d1_3 * c3 + d1_5 * c5
                    g2 = work[base + 320 + l] + d2_2 * c2 + d2_3 * c3 + d2_4 * c4 + d2_5 * c5
                    g3 = d3_2 * c2 + d3_3 * c3 + d3_4 * c4
                    g4 = d4_2 * c2 + d4_3 * c3 + d4_4 * c4
                    g5 = d5_5 * c5
                    r0 = g3
                    work[base + 192 + l] += weight * r0
                    work[base + 96 + l] = work[base + 0 + l] + half * r0
                    r1 = g4
                    work[base + 208 + l] += weight * r1
                    work[base + 112 + l] = work[base + 16 + l] + half * r1
                    r2 = g5
                    work[base + 224 + l] += weight * r2
                    work[base + 128 + l] = work[base + 32 + l] + half * r2
                    r3 = minv[0] * g0 + minv[1] * g1 + minv[2] * g2
                    work[base + 240 + l] += weight * r3
                    work[base + 144 + l] = work[base + 48 + l] + half * r3
                    r4 = minv[3] * g0 + minv[4] * g1 + minv[5] * g2
                    work[base + 256 + l] += weight * r4
                    work[base + 160 + l] = work[base + 64 + l] + half * r4
                    r5 = minv[6] * g0 + minv[7] * g1 + minv[8] * g2
                    work[base + 272 + l] += weight * r5
                    work[base + 176 + l] = work[base + 80 + l] + half * r5
            q0 += weight * k0
            q1 += weight * k1
            q2 += weight * k2
            q3 += weight * a0
            q4 += weight * a1
            q5 += weight * a2
            z0 = b0 + half * k0
            z1 = b1 + half * k1
            z2 = b2 + half * k2
            z3 = b3 + half * a0
            z4 = b4 + half * a1
            z5 = b5 + half * a2
            if want_rate and stage == 0:
                for j in range(first, sample):
                    rate[j, 0] = q0
                    rate[j, 1] = q1
                    rate[j, 2] = q2
                    rate[j, 3] = q3
                    rate[j, 4] = q4
                    rate[j, 5] = q5
                    for i in range(6):
                        for c in range(n):
                            srate[j, i, c] = work[(c // 16 * 21 + 12 + i) * 16 + c % 16]
        if q <= last:
            b0 += h / 6.0 * q0
            b1 += h / 6.0 * q1
            b2 += h / 6.0 * q2
            b3 += h / 6.0 * q3
            b4 += h / 6.0 * q4
            b5 += h / 6.0 * q5
            for o in range(blocks):
                base = o * 336
                for l in range(96):
                    work[base + l] += h / 6.0 * work[base + 192 + l]


@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def full_adjoint(par, minv, times, steps, act, exo, record, trace, cot, gx0, gpar, gact):
    """Discrete adjoint of the run that filled `trace`; gx0 and gact are set, gpar is added to."""
    lam0 = 0.0
    lam1 = 0.0
    lam2 = 0.0
    lam3 = 0.0
    lam4 = 0.0
    lam5 = 0.0
    sample = record.size - 1
    for q in range(steps.size, -1, -1):
        while sample >= 0 and record[sample] == q:
            lam0 += cot[sample, 0]
            lam1 += cot[sample, 1]
            lam2 += cot[sample, 2]
            lam3 += cot[sample, 3]
            lam4 += cot[sample, 4]
            lam5 += cot[sample, 5]
            sample -= 1
        if q == 0:
            break
        s = q - 1
        h = steps[s]
        m0 = act[s, 0]
        m1 = act[s, 1]
        d0 = act[s, 2]
        d1 = act[s, 3]
        e0 = exo[s, 0]
        e1 = exo[s, 1]
        e2 = exo[s, 2]
        e3 = exo[s, 3]
        e4 = exo[s, 4]
        e5 = exo[s, 5]
        e6 = exo[s, 6]
        y0 = 0.0
        y1 = 0.0
        y2 = 0.0
        y3 = 0.0
        y4 = 0.0
        y5 = 0.0
        back0 = lam0
        back1 = lam1
        back2 = lam2
        back3 = lam3
        back4 = lam4
        back5 = lam5
        ga0 = 0.0
        ga1 = 0.0
        ga2 = 0.0
        ga3 = 0.0
        for stage in range(3, -1, -1):
            weight = h / 3.0 if (stage == 1 or stage == 2) else h / 6.0
            move = 0.0 if stage == 3 else (h if stage == 2 else 0.5 * h)
            t = times[s] + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))
            part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)
            u0 = m0 + part * d0
            u1 = m1 + part * d1
            c0 = weight * lam0 + move * y0
            c1 = weight * lam1 + move * y1
            c2 = weight * lam2 + move * y2
            c3 = weight * lam3 + move * y3
            c4 = weight * lam4 + move * y4
            c5 = weight * lam5 + move * y5
            z0 = trace[s, stage, 0]
            z1 = trace[s, stage, 1]
            z2 = trace[s, stage, 2]
            z3 = trace[s, stage, 3]
            z4 = trace[s, stage, 4]
            z5 = trace[s, stage, 5]
            a0 = trace[s, stage, 6]
            a1 = trace[s, stage, 7]
            a2 = trace[s, stage, 8]
            g0 = minv[0] * c3 + minv[3] * c4 + minv[6] * c5
            g1 = minv[1] * c3 + minv[4] * c4 + minv[7] * c5
            g2 = minv[2] * c3 + minv[5] * c4 + minv[8] * c5
            g3 = c0
            g4 = c1
            g5 = c2
            v43 = math.cos(z2)
            v45 = math.sin(z2)
            v47 = (e2 * v43) + (e3 * v45)
            v56 = z3 - v47
            v61 = v56 * v56
            v67 = a0 - (z4 * z5)
            v68 = z5 * z5
            v83 = a1 + (z3 * z5)
            v266 = par[0] * g2
            v281 = (-(((par[2] * v83) - (par[3] * v67)) * g2)) - (((v83 - (par[3] * v68)) + (par[2] * a2)) * g1)
            v282 = par[0] * g1
            v290 = (-(par[2] * v266)) - v282
            v302 = par[0] * g0
            v313 = z5 * ((par[3] * v282) + (par[2] * v302))
            v316 = v302 - (par[3] * v266)
            v322 = par[20] * g2
            v326 = par[19] * g1
            v330 = v56 * ((u0 * v322) + (par[18] * g0))
            v331 = v330 + v330
            v338 = (z5 * v326) - v331
            v348 = (v43 * (((z3 * g4) - (z4 * g3)) + (e3 * v338))) - (v45 * (((z4 * g4) + (z3 * g3)) + (e2 * v338)))
            y0 = 0.0
            y1 = 0.0
            y2 = v348
            y3 = (((v45 * g4) + (v43 * g3)) + (z5 * v290)) + v331
            y4 = ((v43 * g4) - (v45 * g3)) + (z5 * v316)
            y5 = ((v313 + ((g5 + (z3 * v290)) + v313)) + (z4 * v316)) + (v47 * v326)
            gpar[0] += v281 - (((v67 - (par[2] * v68)) - (par[3] * a2)) * g0)
            gpar[1] += -(a2 * g2)
            gpar[2] += ((-(v83 * v266)) - (a2 * v282)) + (v68 * v302)
            gpar[3] += ((v67 * v266) + (v68 * v282)) + (a2 * v302)
            gpar[18] += v61 * g0
            gpar[19] += (a1 + (z5 * v47)) * g1
            gpar[20] += (u0 * v61) * g2
            gpar[21] += g1
            by0 = v61 * v322
            ga0 += by0
            ga2 += part * by0
            back0 += y0
            back1 += y1
            back2 += y2
            back3 += y3
            back4 += y4
            back5 += y5
        lam0 = back0
        lam1 = back1
        lam2 = back2
        lam3 = back3
        lam4 = back4
        lam5 = back5
        gact[s, 0] = ga0
        gact[s, 1] = ga1
        gact[s, 2] = ga2
        gact[s, 3] = ga3
    gx0[0] = lam0
    gx0[1] = lam1
    gx0[2] = lam2
    gx0[3] = lam3
    gx0[4] = lam4
    gx0[5] = lam5


FULL_ADJOINT_PARAMETERS = np.array([0, 1, 2, 3, 18, 19, 20, 21], dtype=np.int64)


@njit(cache=True, nogil=True, error_model='numpy', fastmath={'contract'})
def full_adjoint_lanes(par, minv, times, steps, act, exo, record, trace, cot, gx0, gpar, gact):
    """Discrete adjoint over 16 vectors; arrays are flat with 16 values per entry."""
    work = np.zeros(1184)
    for i in range(352):
        work[704 + i] = par[i]
    for i in range(144):
        work[560 + i] = minv[i]
    sample = record.size - 1
    for q in range(steps.size, -1, -1):
        while sample >= 0 and record[sample] == q:
            for i in range(96):
                work[0 + i] += cot[sample * 96 + i]
            sample -= 1
        if q == 0:
            break
        s = q - 1
        h = steps[s]
        e0 = exo[s, 0]
        e1 = exo[s, 1]
        e2 = exo[s, 2]
        e3 = exo[s, 3]
        e4 = exo[s, 4]
        e5 = exo[s, 5]
        e6 = exo[s, 6]
        for i in range(96):
            work[96 + i] = work[0 + i]
        for i in range(96):
            work[192 + i] = 0.0
        for i in range(64):
            work[496 + i] = 0.0
        for i in range(64):
            work[432 + i] = act[s * 64 + i]
        for stage in range(3, -1, -1):
            weight = h / 3.0 if (stage == 1 or stage == 2) else h / 6.0
            move = 0.0 if stage == 3 else (h if stage == 2 else 0.5 * h)
            t = times[s] + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))
            part = -0.5 if stage == 0 else (0.5 if stage == 3 else 0.0)
            of = (s * 4 + stage) * 144
            for i in range(96):
                work[288 + i] = trace[of + i]
            for i in range(48):
                work[384 + i] = trace[of + 96 + i]
            for l in range(16):
                c0 = weight * work[0 + l] + move * work[192 + l]
                c1 = weight * work[16 + l] + move * work[208 + l]
                c2 = weight * work[32 + l] + move * work[224 + l]
                c3 = weight * work[48 + l] + move * work[240 + l]
                c4 = weight * work[64 + l] + move * work[256 + l]
                c5 = weight * work[80 + l] + move * work[272 + l]
                g0 = work[560 + l] * c3 + work[608 + l] * c4 + work[656 + l] * c5
                g1 = work[576 + l] * c3 + work[624 + l] * c4 + work[672 + l] * c5
                g2 = work[592 + l] * c3 + work[640 + l] * c4 + work[688 + l] * c5
                g3 = c0
                g4 = c1
                g5 = c2
                v26_k = math.floor(work[320 + l] * 0.6366197723675814 + 0.5)
                v26_y = ((work[320 + l] - v26_k * 1.57079625129699707031) - v26_k * 7.54978941586159635335e-08) - v26_k * 5.39030285815811905290e-15
                v26_z = v26_y * v26_y
                v26_ps = v26_y + v26_y * v26_z * ((((((1.5896230157654656e-10) * v26_z + -2.5050747762857807e-08) * v26_z + 2.7557313621385722e-06) * v26_z + -0.0001984126982958954) * v26_z + 0.008333333333322118) * v26_z + -0.1666666666666663)
                v26_pc = 1.0 - 0.5 * v26_z + v26_z * v26_z * ((((((-1.1358536521387682e-11) * v26_z + 2.087570084197473e-09) * v26_z + -2.755731417929674e-07) * v26_z + 2.4801587288851704e-05) * v26_z + -0.0013888888888873056) * v26_z + 0.041666666666666595)
                v26_h = v26_k - 2.0 * math.floor(0.5 * v26_k)
                v26_q = v26_k - 4.0 * math.floor(0.25 * v26_k)
                v26_s0 = v26_pc if v26_h > 0.5 else v26_ps
                v26_c0 = v26_ps if v26_h > 0.5 else v26_pc
                v26_sin = -v26_s0 if v26_q > 1.5 else v26_s0
                v26_cos = -v26_c0 if (v26_q > 0.5 and v26_q < 2.5) else v26_c0
                v47 = (e2 * v26_cos) + (e3 * v26_sin)
                v56 = work[336 + l] - v47
                v61 = v56 * v56
                v67 = work[384 + l] - (work[352 + l] * work[368 + l])
                v68 = work[368 + l] * work[368 + l]
                v83 = work[400 + l] + (work[336 + l] * work[368 + l])
                v266 = work[704 + l] * g2
                v281 = (-(((work[736 + l] * v83) - (work[752 + l] * v67)) * g2)) - (((v83 - (work[752 + l] * v68)) + (work[736 + l] * work[416 + l])) * g1)
                v282 = work[704 + l] * g1
                v290 = (-(work[736 + l] * v266)) - v282
                v302 = work[704 + l] * g0
                v313 = work[368 + l] * ((work[752 + l] * v282) + (work[736 + l] * v302))
                v316 = v302 - (work[752 + l] * v266)
                v322 = work[1024 + l] * g2
                v326 = work[1008 + l] * g1
                v330 = v56 * (((work[432 + l] + part * work[464 + l]) * v322) + (work[992 + l] * g0))
                v331 = v330 + v330
                v338 = (work[368 + l] * v326) - v331
                v348 = (v26_cos * (((work[336 + l] * g4) - (work[352 + l] * g3)) + (e3 * v338))) - (v26_sin * (((work[352 + l] * g4) + (work[336 + l] * g3)) + (e2 * v338)))
                y0 = 0.0
                y1 = 0.0
                y2 = v348
                y3 = (((v26_sin * g4) + (v26_cos * g3)) + (work[368 + l] * v290)) + v331
                y4 = ((v26_cos * g4) - (v26_sin * g3)) + (work[368 + l] * v316)
                y5 = ((v313 + ((g5 + (work[336 + l] * v290)) + v313)) + (work[352 + l] * v316)) + (v47 * v326)
                work[1056 + l] += v281 - (((v67 - (work[736 + l] * v68)) - (work[752 + l] * work[416 + l])) * g0)
                work[1072 + l] += -(work[416 + l] * g2)
                work[1088 + l] += ((-(v83 * v266)) - (work[416 + l] * v282)) + (v68 * v302)
                work[1104 + l] += ((v67 * v266) + (v68 * v282)) + (work[416 + l] * v302)
                work[1120 + l] += v61 * g0
                work[1136 + l] += (work[400 + l] + (work[368 + l] * v47)) * g1
                work[1152 + l] += ((work[432 + l] + part * work[464 + l]) * v61) * g2
                work[1168 + l] += g1
                by0 = v61 * v322
                work[496 + l] += by0
                work[528 + l] += part * by0
                work[192 + l] = y0
                work[208 + l] = y1
                work[224 + l] = y2
                work[240 + l] = y3
                work[256 + l] = y4
                work[272 + l] = y5
                work[96 + l] += y0
                work[112 + l] += y1
                work[128 + l] += y2
                work[144 + l] += y3
                work[160 + l] += y4
                work[176 + l] += y5
        for i in range(96):
            work[0 + i] = work[96 + i]
        for i in range(64):
            gact[s * 64 + i] = work[496 + i]
    for i in range(96):
        gx0[i] = work[0 + i]
    for i in range(128):
        gpar[i] = work[1056 + i]


FULL_SENSOR_ENTRIES = np.array([(0, 9), (0, 10), (1, 9), (1, 10)], dtype=np.int64).reshape(-1, 2)
FULL_DELAYS = {}


@njit(cache=True, nogil=True, error_model='numpy')
def full_sense(xs, exo, times, par, slopes, obs, dx, dpar):
    """Readings of every channel at every sample, with slopes by state and parameter if asked."""
    for i in range(times.size):
        t = times[i]
        t43 = math.cos(xs[i, 2])
        t45 = math.sin(xs[i, 2])
        obs[i, 0] = (xs[i, 0] + (par[9] * t43)) - (par[10] * t45)
        obs[i, 1] = (xs[i, 1] + (par[9] * t45)) + (par[10] * t43)
        obs[i, 2] = xs[i, 2]
        obs[i, 3] = xs[i, 3]
        obs[i, 4] = xs[i, 4]
        obs[i, 5] = xs[i, 5]
        obs[i, 6] = xs[i, 3] - ((exo[i, 2] * t43) + (exo[i, 3] * t45))
        obs[i, 7] = xs[i, 4] - ((exo[i, 3] * t43) - (exo[i, 2] * t45))
        if slopes:
            v43 = math.cos(xs[i, 2])
            v45 = math.sin(xs[i, 2])
            dx[i, 0, 0] = 1.0
            dx[i, 0, 2] = (-(par[10] * v43)) - (par[9] * v45)
            dpar[i, 0] = v43
            dpar[i, 1] = -v45
            dx[i, 1, 1] = 1.0
            dx[i, 1, 2] = (par[9] * v43) - (par[10] * v45)
            dpar[i, 2] = v45
            dpar[i, 3] = v43
            dx[i, 2, 2] = 1.0
            dx[i, 3, 3] = 1.0
            dx[i, 4, 4] = 1.0
            dx[i, 5, 5] = 1.0
            dx[i, 6, 2] = (exo[i, 2] * v45) - (exo[i, 3] * v43)
            dx[i, 6, 3] = 1.0
            dx[i, 7, 2] = (exo[i, 2] * v43) + (exo[i, 3] * v45)
            dx[i, 7, 4] = 1.0


FULL_ACT_COLUMNS = (15, 16, 17)
FULL_ACT_DELAYS = {0: [], 1: []}
FULL_ACT_MEMORY = 2


@njit(cache=True, nogil=True, error_model='numpy')
def full_actuate(command, delay_slope, stretch, lengths, owner, weight, tilt, weight_slope, tilt_slope,
        par, slopes, restart, memory, carried, act, dact):
    """Add means and changes of the positions over the steps, from commands held over pieces."""
    tangent, ahead = np.zeros(3), np.zeros(3)
    if restart:
        value = command[0, 0]
        for c in range(3):
            tangent[c] = 0.0
        u8 = value - value
        u9 = (1.0 if u8 > 0.0 else 0.0) - (1.0 if u8 < 0.0 else 0.0)
        u12 = abs(u8)
        u13 = par[15] * u12
        u15 = ((u13 - par[16]) if (u13 - par[16]) > 0.0 else 0.0)
        u26 = (par[16] if par[16] > 1e-12 else 1e-12)
        u62 = (u15 if u15 < 1000000000.0 else 1000000000.0)
        u64 = (u62 - 1000000000.0) / u26
        u65 = math.exp(u64)
        u66 = u62 / par[15]
        u68 = u9 * (u12 - u66)
        u72 = 1.0 / u26
        u77 = 1.0 - (1.0 if (u15 - 1000000000.0) > 0.0 else 0.0)
        u79 = 1.0 if (par[16] - u13) > 0.0 else 0.0
        u80 = 1.0 - u79
        u83 = u77 * (u80 * (par[15] * u9))
        u86 = u68 * (u65 * (u72 * u83))
        u87 = 1.0 / par[15]
        u90 = u83 * u87
        u112 = u77 * (u12 * u80)
        u124 = u77 * (u79 - 1.0)
        u133 = u68 * (u65 * ((u72 * u124) - ((u64 / u26) * (1.0 - (1.0 if (1e-12 - par[16]) > 0.0 else 0.0)))))
        end = value - (u65 * u68)
        ex = (1.0 - (u86 + (u65 * (u9 * (u9 - u90))))) + (u86 - (u65 * (u9 * (u90 - u9))))
        ep0 = -((u68 * (u65 * (u72 * u112))) + (u65 * (u9 * ((u66 / par[15]) - (u87 * u112)))))
        ep1 = (u65 * (u9 * (u87 * u124))) - u133
        memory[0] = end
        for c in range(3):
            tangent[c] = ex * tangent[c]
        tangent[0] += ep0
        tangent[1] += ep1
        for c in range(3):
            carried[0, c] = tangent[c]
        value = end
        u39 = -par[17]
        u40 = (value if value > u39 else u39)
        u143 = 1.0 if (u40 - par[17]) > 0.0 else 0.0
        u144 = 1.0 - u143
        u146 = 1.0 if (u39 - value) > 0.0 else 0.0
        end = (u40 if u40 < par[17] else par[17])
        ex = u144 * (1.0 - u146)
        ep2 = u143 - (u144 * u146)
        memory[1] = end
        for c in range(3):
            tangent[c] = ex * tangent[c]
        tangent[2] += ep2
        for c in range(3):
            carried[1, c] = tangent[c]
        value = end
    for s in range(lengths.size):
        h = lengths[s]
        o = owner[s]
        value = command[s, 0]
        rest = 0.0
        if slopes:
            for c in range(3):
                tangent[c] = ahead[c] = 0.0
        t8 = value - memory[0]
        t9 = (1.0 if t8 > 0.0 else 0.0) - (1.0 if t8 < 0.0 else 0.0)
        t10 = t9 / h
        t12 = abs(t8)
        t13 = par[15] * t12
        t15 = ((t13 - par[16]) if (t13 - par[16]) > 0.0 else 0.0)
        t16 = (t15 if t15 < h else h)
        t18 = t12 - (t16 / par[15])
        t20 = 0.5 * (t12 + t18)
        t22 = par[16] * t18
        t26 = (par[16] if par[16] > 1e-12 else 1e-12)
        t28 = math.exp(((t16 - h) / t26))
        t29 = 1.0 - t28
        t32 = t10 * ((t16 * t20) + (t22 * t29))
        t36 = value - (t28 * (t9 * t18))
        t159 = ((1.0 - (1.0 if (par[16] - t13) > 0.0 else 0.0)) * (par[15] * t9)) * (1.0 - (1.0 if (t15 - h) > 0.0 else 0.0))
        t165 = t9 - ((1.0 / par[15]) * t159)
        t180 = ((t20 * t159) + (t16 * (0.5 * (t9 + t165)))) + ((t29 * (par[16] * t165)) - (t22 * (t28 * ((1.0 / t26) * t159))))
        mean = value - t32
        end = t36
        left = ((1.0 - (t10 * t180)) * rest) + (t36 + (t32 - value))
        if slopes:
            v8 = value - memory[0]
            v9 = (1.0 if v8 > 0.0 else 0.0) - (1.0 if v8 < 0.0 else 0.0)
            v10 = v9 / h
            v12 = abs(v8)
            v13 = par[15] * v12
            v15 = ((v13 - par[16]) if (v13 - par[16]) > 0.0 else 0.0)
            v16 = (v15 if v15 < h else h)
            v17 = v16 / par[15]
            v18 = v12 - v17
            v20 = 0.5 * (v12 + v18)
            v22 = par[16] * v18
            v26 = (par[16] if par[16] > 1e-12 else 1e-12)
            v27 = (v16 - h) / v26
            v28 = math.exp(v27)
            v29 = 1.0 - v28
            v34 = v9 * v18
            v72 = 1.0 / v26
            v79 = 1.0 if (par[16] - v13) > 0.0 else 0.0
            v80 = 1.0 - v79
            v87 = 1.0 / par[15]
            v128 = 1.0 - (1.0 if (1e-12 - par[16]) > 0.0 else 0.0)
            v158 = 1.0 - (1.0 if (v15 - h) > 0.0 else 0.0)
            v159 = (v80 * (par[15] * v9)) * v158
            v160 = v20 * v159
            v163 = v87 * v159
            v165 = v9 - v163
            v167 = 0.5 * (v9 + v165)
            v170 = par[16] * v165
            v174 = v72 * v159
            v175 = v28 * v174
            v177 = v22 * v175
            v181 = v10 * ((v160 + (v16 * v167)) + ((v29 * v170) - v177))
            v183 = 1.0 - v181
            v191 = v163 - v9
            v193 = 0.5 * (v191 - v9)
            v196 = par[16] * v191
            v201 = v10 * (((v16 * v193) - v160) + (v177 + (v29 * v196)))
            v228 = (v12 * v80) * v158
            v232 = (v17 / par[15]) - (v87 * v228)
            v233 = 0.5 * v232
            v236 = par[16] * v232
            v239 = v28 * (v72 * v228)
            v245 = v10 * (((v20 * v228) + (v16 * v233)) + ((v29 * v236) - (v22 * v239)))
            v247 = (v79 - 1.0) * v158
            v249 = v87 * v247
            v251 = 0.5 * v249
            v258 = v18 - (par[16] * v249)
            v264 = v28 * ((v72 * v247) - (v128 * (v27 / v26)))
            v270 = v10 * (((v20 * v247) - (v16 * v251)) + ((v29 * v258) - (v22 * v264)))
            v272 = v34 * v175
            v277 = 1.0 - (v272 + (v28 * (v9 * v165)))
            v282 = v272 - (v28 * (v9 * v191))
            v293 = (v34 * v239) + (v28 * (v9 * v232))
            v301 = (v28 * (v9 * v249)) - (v34 * v264)
            v302 = v159 * v167
            v304 = v170 * v175
            v307 = v22 * (v174 * v175)
            v334 = (v201 + v282) - (rest * (v10 * (((v159 * v193) - v302) + (v304 + (v307 - (v175 * v196))))))
            v359 = v158 * (v9 * v80)
            v369 = (v159 * (v87 / par[15])) - (v87 * v359)
            v387 = ((v29 * (par[16] * v369)) - (v170 * v239)) - ((v175 * v236) + (v22 * ((v174 * v239) + (v28 * (v72 * v359)))))
            v391 = rest * (v10 * ((((v159 * v233) + (v20 * v359)) + ((v167 * v228) + (v16 * (0.5 * v369)))) + v387))
            v417 = ((v29 * v165) - (v170 * v264)) - ((v175 * v258) + (v22 * ((v174 * v264) - (v28 * (v159 * (v128 * (v72 / v26)))))))
            mx = v183
            my = -v201
            mp0 = -v245
            mp1 = -v270
            ex = v277
            ey = v282
            ep0 = -v293
            ep1 = v301
            rx = (v277 + ((-1.0) + v181)) - (rest * (v10 * ((v302 + v302) + ((-v304) - (v304 + v307)))))
            ry = v334
            rr = v183
            rp0 = (v245 - v293) - v391
            rp1 = (v270 + v301) - (rest * (v10 * (((v167 * v247) - (v159 * v251)) + v417)))
            for c in range(3):
                old, kept = tangent[c], carried[0, c]
                ahead[c] = rx * old + ry * kept + rr * ahead[c]
                tangent[c] = mx * old + my * kept
                carried[0, c] = ex * old + ey * kept
            tangent[0] += mp0
            tangent[1] += mp1
            carried[0, 0] += ep0
            carried[0, 1] += ep1
            ahead[0] += rp0
            ahead[1] += rp1
        memory[0] = end
        value = mean
        rest = left
        t39 = -par[17]
        t40 = (value if value > t39 else t39)
        t41 = (t40 if t40 < par[17] else par[17])
        t148 = (1.0 - (1.0 if (t40 - par[17]) > 0.0 else 0.0)) * (1.0 - (1.0 if (t39 - value) > 0.0 else 0.0))
        mean = t41
        end = t41
        left = t148 * rest
        if slopes:
            v39 = -par[17]
            v143 = 1.0 if (((value if value > v39 else v39)) - par[17]) > 0.0 else 0.0
            v144 = 1.0 - v143
            v146 = 1.0 if (v39 - value) > 0.0 else 0.0
            v148 = v144 * (1.0 - v146)
            v152 = v143 - (v144 * v146)
            mx = v148
            my = 0.0
            mp2 = v152
            ex = v148
            ey = 0.0
            ep2 = v152
            rx = 0.0
            ry = 0.0
            rr = v148
            for c in range(3):
                old, kept = tangent[c], carried[1, c]
                ahead[c] = rx * old + ry * kept + rr * ahead[c]
                tangent[c] = mx * old + my * kept
                carried[1, c] = ex * old + ey * kept
            tangent[2] += mp2
            carried[1, 2] += ep2
        memory[1] = end
        value = mean
        rest = left
        act[o, 0] += value * weight[s]
        act[o, 2] += value * tilt[s]
        if slopes:
            for c in range(3):
                dact[o, 0, c] += tangent[c] * weight[s]
                dact[o, 2, c] += tangent[c] * tilt[s]
        act[o, 2] += 2.0 * weight[s] * weight[s] * rest
        if slopes:
            for c in range(3):
                dact[o, 2, c] += 2.0 * weight[s] * weight[s] * ahead[c]
        value = command[s, 1]
        rest = 0.0
        if slopes:
            for c in range(3):
                tangent[c] = ahead[c] = 0.0
        act[o, 1] += value * weight[s]
        act[o, 3] += value * tilt[s]
        if slopes:
            for c in range(3):
                dact[o, 1, c] += tangent[c] * weight[s]
                dact[o, 3, c] += tangent[c] * tilt[s]

