"""How far is the lane kernel from hand-written C, and what do effects that are off, lanes and threads cost?

Prints Markdown rows. Usage: python benchmarks/bench_simulation.py. Needs gcc with AVX2.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from setting import LANES, Setting, machine, paired, row, setting
from simd import Reference

from bayesid.simulation import simulate_batch
from bayesid.simulation.prepare import NO_LANE_TRACE, NO_TRACE

VECTORS = 16
MANY = 128


def scalar_run(s: Setting, par: np.ndarray | None = None):
    par = s.par if par is None else par
    x, minv, out = s.begin(), s.minv(par[None])[0], np.empty((s.plan.t.size, len(s.fun.states)))
    p = s.plan
    return lambda: s.fun.simulate(par, minv, x, p.times, p.steps, s.act, p.exogenous, p.record, out, NO_TRACE)


def lanes_run(s: Setting, pars: np.ndarray):
    """One call of the lane kernel and its (samples, states, lanes) output."""
    flat = np.empty(s.plan.t.size * len(s.fun.states) * LANES)
    arguments = (
        np.ascontiguousarray(pars.T).ravel(),
        np.ascontiguousarray(s.minv(pars).T).ravel(),
        np.repeat(s.begin(), LANES),
        *(s.plan.times, s.plan.steps, np.repeat(s.act.ravel(), LANES), s.plan.exogenous, s.plan.record),
    )
    return lambda: s.fun.lanes(*arguments, flat, NO_LANE_TRACE), flat.reshape(s.plan.t.size, -1, LANES)


def against_c(dof: int) -> None:
    s = setting(dof)
    pars = s.vectors(VECTORS)
    ours, states = lanes_run(s, pars)
    scalar = scalar_run(s)
    us, them, ratio = paired(scalar, ours)
    row(f"{dof}-DOF", "lane kernel / scalar kernel, per vector", f"{ratio / LANES:.2f}", "< 0.4 (guard)",
        f"{us * 1e3:.3f} and {them / LANES * 1e3:.3f} ms")  # fmt: skip
    variants = [("every row", w, False) for w in (4, 8)] + ([("non-zero rows", 4, True)] if dof == 3 else [])
    for words, width, hand in variants:
        c = Reference(s, pars, width, hand)
        seconds, _, ratio = paired(c.run, ours)
        apart = np.abs(c.states() - states.transpose(2, 0, 1)).max() / np.abs(states).max()
        target = {3: "<= 1.3", 6: "<= 1.5"}[dof] if not hand else "shown"
        row(f"{dof}-DOF", f"lane kernel / C, {words}, {width} wide", f"{ratio:.2f}", target,
            f"C {seconds / VECTORS * 1e3:.3f} ms; tracks agree to {apart:.0e}")  # fmt: skip


def off_cost(dof: int) -> None:
    bare, full = setting(dof), setting(dof, full=True)
    pars = bare.vectors(VECTORS)
    for words, a, b in (
        ("scalar", scalar_run(bare), scalar_run(full)),
        ("lanes", lanes_run(bare, pars)[0], lanes_run(full, pars)[0]),
    ):
        _, _, ratio = paired(a, b)
        row(f"{dof}-DOF", f"all effects compiled in but off / bare, {words}", f"{ratio:.2f}", "<= 1.2", "")


def threads() -> None:
    """Wall time; the other core must be free for this to mean anything."""
    s = setting(3)
    pars = s.vectors(MANY)
    groups = [lanes_run(s, pars[i : i + LANES])[0] for i in range(0, MANY, LANES)]
    pool = ThreadPoolExecutor(2)

    def one() -> None:
        for g in groups:
            g()

    def two() -> None:
        list(pool.map(lambda half: [g() for g in half], (groups[::2], groups[1::2])))

    _, _, ratio = paired(one, two, repeats=21, clock=time.perf_counter)
    row("3-DOF", f"kernels, 2 threads, {MANY} vectors: speed-up", f"{1 / ratio:.2f}", ">= 1.5", "wall")
    c = Reference(s, pars, 4)
    _, _, ratio = paired(lambda: c.run(1), lambda: c.run(2), repeats=21, clock=time.perf_counter)
    row("3-DOF", "C with OpenMP, 2 threads: speed-up", f"{1 / ratio:.2f}", "", "wall, every row")

    def batch(count: int) -> None:
        simulate_batch(s.model, pars, s.plan, s.x0, threads=count)

    _, _, ratio = paired(lambda: batch(1), lambda: batch(2), repeats=21, clock=time.perf_counter)
    row(
        "3-DOF",
        f"`simulate_batch`, 2 threads, {MANY} vectors: speed-up",
        f"{1 / ratio:.2f}",
        ">= 1.5",
        "wall",
    )
    _, _, ratio = paired(one, lambda: batch(1))
    row("3-DOF", "`simulate_batch` / its kernels, 1 thread", f"{ratio:.2f}", "", "")
    pool.shutdown()


if __name__ == "__main__":
    print(machine())
    row("model", "question", "ratio", "target", "times")
    row("---", "---", "---", "---", "---")
    for dof in (3, 6):
        against_c(dof)
        off_cost(dof)
    threads()
