"""What do a Jacobian and a gradient cost, in runs of the scalar kernel without derivatives?

Prints Markdown rows. The adjoint includes the forward run that leaves its stages.
"""

from __future__ import annotations

import numpy as np
from bench_simulation import scalar_run
from setting import LANES, Setting, machine, paired, row, setting

COLUMNS = 31


def jacobian_run(s: Setting, count: int):
    """Sensitivities of every state to `count` coefficients that the kernel carries."""
    p, fun = s.plan, s.fun
    names = list(s.model.coefficients) + list(s.model.candidate_rows)
    chosen = s.model.positions(names[:count])
    column = {int(k): c for c, k in enumerate(chosen)}
    columns = np.array([column.get(int(k), -1) for k in fun.entries[:, 1]], dtype=np.int64)
    none = np.full(s.act.shape[1] + p.exogenous.shape[1], -1, dtype=np.int64)
    chain = np.full(len(fun.act_columns), -1, dtype=np.int64)
    nx, n, x = len(fun.states), len(column), s.begin()
    out, sens = np.empty((p.t.size, nx)), np.empty((p.t.size, nx, n))
    no_rate, no_slopes = np.empty((0, nx)), np.empty((0, nx, n))
    minv, s0 = s.minv()[0], np.zeros((nx, n))
    return lambda: fun.variational(
        s.par, minv, x, s0, p.times, p.steps, s.act, s.dact, p.exogenous, p.record, fun.entries, columns,
        chain, none, no_rate, out, sens, no_rate, no_slopes,
    )  # fmt: skip


def gradient_run(s: Setting):
    p, fun = s.plan, s.fun
    nx, x, minv = len(fun.states), s.begin(), s.minv()[0]
    trace, out = np.empty((p.steps.size, 4, fun.traced)), np.empty((p.t.size, nx))
    cotangent = np.random.default_rng(1).standard_normal(out.shape)
    results = np.zeros(nx), np.zeros(s.par.size), np.zeros_like(s.act)

    def run() -> None:
        fun.simulate(s.par, minv, x, p.times, p.steps, s.act, p.exogenous, p.record, out, trace)
        fun.adjoint(s.par, minv, p.times, p.steps, s.act, p.exogenous, p.record, trace, cotangent, *results)

    return run


def gradient_lanes_run(s: Setting):
    p, fun = s.plan, s.fun
    pars = s.vectors(LANES)
    nx = len(fun.states)
    par, minv = (np.ascontiguousarray(a.T).ravel() for a in (pars, s.minv(pars)))
    x, act = np.repeat(s.begin(), LANES), np.repeat(s.act.ravel(), LANES)
    out, trace = np.empty(p.t.size * nx * LANES), np.empty(p.steps.size * 4 * fun.traced * LANES)
    cotangent = np.random.default_rng(1).standard_normal(out.size)
    results = np.zeros(nx * LANES), np.zeros(fun.adjoint_parameters.size * LANES), np.zeros(act.size)

    def run() -> None:
        fun.lanes(par, minv, x, p.times, p.steps, act, p.exogenous, p.record, out, trace)
        fun.adjoint_lanes(par, minv, p.times, p.steps, act, p.exogenous, p.record, trace, cotangent, *results)

    return run


if __name__ == "__main__":
    print(machine())
    row("model", "question", "scalar runs", "target", "times")
    row("---", "---", "---", "---", "---")
    for dof in (3, 6):
        for full in (False, True):
            s = setting(dof, full)
            words, scalar = f"{dof}-DOF {'all effects' if full else 'bare'}", scalar_run(s)
            for question, run, target, vectors in (
                (f"Jacobian, {COLUMNS} columns", jacobian_run(s, COLUMNS), "<= 6", 1),
                ("gradient by the adjoint", gradient_run(s), "<= 4", 1),
                ("gradient, 16 lanes, per vector", gradient_lanes_run(s), "<= 1.3", LANES),
            ):
                _, seconds, ratio = paired(scalar, run, repeats=9)
                times = f"{seconds / vectors * 1e3:.3f} ms"
                row(words, question, f"{ratio / vectors:.2f}", target if dof == 3 else f"({target})", times)
