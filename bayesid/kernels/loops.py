"""Time loops around the generated equations: scalar run, sensitivities, step transitions, adjoint.

Takes sizes and a prefix, gives source text that is printed into every kernel module (numba caches per module,
and the loops must see their own module's equations). RK4 with inputs held over each step throughout.
"""

from __future__ import annotations

import re

from bayesid.kernels.context import FUSED, PLAIN

_TEMPLATE = '''
@PLAIN
def @_inverses(pars, out):
    """Inverse mass matrix, flat, of every parameter vector."""
    for b in range(pars.shape[0]):
        out[b, :] = np.linalg.inv(@_mass(pars[b])).ravel()


@FUSED
def @_simulate(par, minv, x0, times, steps, act, exo, record, out):
    """States at the recorded steps, one parameter vector."""
    x = x0.copy()
    xs = np.empty(NX)
    k = np.empty(NX)
    acc = np.empty(NX)
    sample = 0
    while sample < record.size and record[sample] == 0:
        out[sample, :] = x
        sample += 1
    for s in range(steps.size):
        h = steps[s]
        @_rhs(x, act[s], exo[s], times[s], par, minv, k)
        for i in range(NX):
            acc[i] = k[i]
            xs[i] = x[i] + 0.5 * h * k[i]
        @_rhs(xs, act[s], exo[s], times[s] + 0.5 * h, par, minv, k)
        for i in range(NX):
            acc[i] += 2.0 * k[i]
            xs[i] = x[i] + 0.5 * h * k[i]
        @_rhs(xs, act[s], exo[s], times[s] + 0.5 * h, par, minv, k)
        for i in range(NX):
            acc[i] += 2.0 * k[i]
            xs[i] = x[i] + h * k[i]
        @_rhs(xs, act[s], exo[s], times[s] + h, par, minv, k)
        for i in range(NX):
            x[i] += h / 6.0 * (acc[i] + k[i])
        while sample < record.size and record[sample] == s + 1:
            out[sample, :] = x
            sample += 1


@PLAIN
def @_slopes(x, act, exo, t, par, minv, n, rows, entries, columns, dact, act_columns, input_columns,
             k, jac, dpar, dinp, b):
    """One linearisation with the forcing b (NX x n) of the wanted columns.

    `columns[e]` is the output column of sparse parameter entry e (-1: not wanted); `act_columns` maps
    actuator-slope columns, `input_columns` raw inputs (actuators, then exogenous) to output columns.
    """
    @_linearise(x, act, exo, t, par, minv, k, jac, dpar, dinp)
    b[:] = 0.0
    for e in range(columns.size):
        c = columns[e]
        if c >= 0:
            row = entries[e, 0]
            if row < NV:
                for i in range(NV):
                    b[rows[i] * n + c] += minv[i * NV + row] * dpar[e]
            else:
                b[rows[row] * n + c] += dpar[e]
    for a in range(act_columns.size):
        c = act_columns[a]
        if c >= 0:
            for row in range(rows.size):
                total = 0.0
                for j in range(NA):
                    total += dinp[row, j] * dact[j, a]
                if total != 0.0:
                    if row < NV:
                        for i in range(NV):
                            b[rows[i] * n + c] += minv[i * NV + row] * total
                    else:
                        b[rows[row] * n + c] += total
    for j in range(input_columns.size):
        c = input_columns[j]
        if c >= 0:
            for row in range(rows.size):
                slope = dinp[row, j]
                if slope != 0.0:
                    if row < NV:
                        for i in range(NV):
                            b[rows[i] * n + c] += minv[i * NV + row] * slope
                    else:
                        b[rows[row] * n + c] += slope


@FUSED
def @_advance(x, act, exo, t, h, par, minv, n, rows, entries, columns, dact, act_columns, input_columns,
              s, xs, ss, k, jac, dpar, dinp, b, ks, acc, sacc):
    """One RK4 step of the state and of n sensitivity columns (flat, NX x n)."""
    for stage in range(4):
        if stage == 0:
            xs[:] = x
            ss[:] = s
        shift = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
        @_slopes(xs, act, exo, t + shift, par, minv, n, rows, entries, columns, dact, act_columns,
                 input_columns, k, jac, dpar, dinp, b)
        @_propagate(jac, ss, b, ks, n)
        weight = 2.0 if (stage == 1 or stage == 2) else 1.0
        if stage == 0:
            acc[:] = k
            for i in range(NX * n):
                sacc[i] = ks[i]
        else:
            for i in range(NX):
                acc[i] += weight * k[i]
            for i in range(NX * n):
                sacc[i] += weight * ks[i]
        if stage < 3:
            move = h if stage == 2 else 0.5 * h
            for i in range(NX):
                xs[i] = x[i] + move * k[i]
            for i in range(NX * n):
                ss[i] = s[i] + move * ks[i]
    for i in range(NX):
        x[i] += h / 6.0 * acc[i]
    for i in range(NX * n):
        s[i] += h / 6.0 * sacc[i]


@PLAIN
def @_variational(par, minv, x0, s0, times, steps, act, dact, exo, record, rows, entries, columns,
                  act_columns, input_columns, out, sens, rate, srate):
    """States and sensitivities at the recorded steps; if not empty `rate`, `srate` get their rates."""
    n = s0.shape[1]
    x = x0.copy()
    s = s0.copy().reshape(NX * n)
    xs = np.empty(NX)
    k = np.empty(NX)
    acc = np.empty(NX)
    jac = np.zeros((NX, NX))
    dpar = np.empty(columns.size)
    dinp = np.zeros((rows.size, NA + NE))
    ss = np.empty(NX * n)
    b = np.empty(NX * n)
    ks = np.empty(NX * n)
    sacc = np.empty(NX * n)
    want_rate = rate.size > 0
    sample = 0
    for q in range(steps.size + 1):
        while sample < record.size and record[sample] == q:
            out[sample, :] = x
            sens[sample] = s.reshape(NX, n)
            if want_rate:
                j = min(q, steps.size - 1)
                t = times[j] + (steps[j] if q > j else 0.0)
                @_slopes(x, act[j], exo[j], t, par, minv, n, rows, entries, columns, dact[j], act_columns,
                         input_columns, k, jac, dpar, dinp, b)
                @_propagate(jac, s, b, ks, n)
                rate[sample, :] = k
                srate[sample] = ks.reshape(NX, n)
            sample += 1
        if q < steps.size:
            @_advance(x, act[q], exo[q], times[q], steps[q], par, minv, n, rows, entries, columns, dact[q],
                      act_columns, input_columns, s, xs, ss, k, jac, dpar, dinp, b, ks, acc, sacc)


@PLAIN
def @_transition(par, minv, path, times, steps, act, dact, exo, record, rows, entries, columns, act_columns,
                 input_columns, n, ends, maps):
    """Each sample interval run from path[i]: where it ends, and d end / d [state, wanted columns]."""
    m = NX + n
    x = np.empty(NX)
    s = np.empty(NX * m)
    xs = np.empty(NX)
    k = np.empty(NX)
    acc = np.empty(NX)
    jac = np.zeros((NX, NX))
    dpar = np.empty(columns.size)
    dinp = np.zeros((rows.size, NA + NE))
    ss = np.empty(NX * m)
    b = np.empty(NX * m)
    ks = np.empty(NX * m)
    sacc = np.empty(NX * m)
    for i in range(record.size - 1):
        x[:] = path[i]
        s[:] = 0.0
        for j in range(NX):
            s[j * m + j] = 1.0
        for q in range(record[i], record[i + 1]):
            @_advance(x, act[q], exo[q], times[q], steps[q], par, minv, m, rows, entries, columns, dact[q],
                      act_columns, input_columns, s, xs, ss, k, jac, dpar, dinp, b, ks, acc, sacc)
        ends[i, :] = x
        maps[i] = s.reshape(NX, m)


@FUSED
def @_adjoint(par, minv, x0, times, steps, act, exo, record, cot, gx0, gpar, gact):
    """Discrete adjoint of `@_simulate`: cotangents of recorded states to start, parameters and actuators."""
    n_steps = steps.size
    path = np.empty((n_steps + 1, NX))
    whole = np.arange(n_steps + 1)
    @_simulate(par, minv, x0, times, steps, act, exo, whole, path)
    lam = np.zeros(NX)
    xs = np.empty((4, NX))
    k = np.empty(NX)
    g1 = np.zeros(NX)
    ga = np.zeros(NA)
    lk = np.empty(NX)
    back = np.empty(NX)
    sample = record.size - 1
    for q in range(n_steps, -1, -1):
        while sample >= 0 and record[sample] == q:
            for i in range(NX):
                lam[i] += cot[sample, i]
            sample -= 1
        if q == 0:
            break
        j = q - 1
        h = steps[j]
        t = times[j]
        xs[0, :] = path[j]
        @_rhs(xs[0], act[j], exo[j], t, par, minv, k)
        for i in range(NX):
            xs[1, i] = path[j, i] + 0.5 * h * k[i]
        @_rhs(xs[1], act[j], exo[j], t + 0.5 * h, par, minv, k)
        for i in range(NX):
            xs[2, i] = path[j, i] + 0.5 * h * k[i]
        @_rhs(xs[2], act[j], exo[j], t + 0.5 * h, par, minv, k)
        for i in range(NX):
            xs[3, i] = path[j, i] + h * k[i]
        for i in range(NX):
            back[i] = lam[i]
            g1[i] = 0.0
        for stage in range(3, -1, -1):
            weight = h / 3.0 if (stage == 1 or stage == 2) else h / 6.0
            move = h if stage == 2 else 0.5 * h
            for i in range(NX):
                lk[i] = weight * lam[i]
                if stage < 3:
                    lk[i] += move * g1[i]
            for i in range(NX):
                g1[i] = 0.0
            ga[:] = 0.0
            shift = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            @_vjp(xs[stage], act[j], exo[j], t + shift, par, minv, lk, g1, gpar, ga)
            for i in range(NX):
                back[i] += g1[i]
            for i in range(NA):
                gact[j, i] += ga[i]
        lam[:] = back
    gx0[:] = lam
'''


def loop_source(prefix: str, nx: int, nv: int, na: int, ne: int) -> str:
    """Loops of one set of functions, sizes written in as numbers."""
    text = _TEMPLATE.replace("@PLAIN", PLAIN).replace("@FUSED", FUSED).replace("@_", f"{prefix}_")
    for name, value in (("NX", nx), ("NV", nv), ("NA", na), ("NE", ne)):
        text = re.sub(rf"\b{name}\b", str(value), text)
    return text
