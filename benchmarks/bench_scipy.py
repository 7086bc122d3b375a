"""How much faster is a run than the same equations in scipy's `solve_ivp`?

scipy is given every advantage a careful user would take: only the rows that are not zero, plain scalar
arithmetic (numba-compiled or Python), and a restart wherever an input switches, so that no step is lost on a
jump. The relative tolerance is 1e-6. The tracks are compared. Prints Markdown rows.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from bench_simulation import lanes_run, scalar_run
from numba import njit
from scipy.integrate import solve_ivp
from setting import LANES, Setting, machine, row, setting
from simd import HAND

REPEATS = 3


def right_side(t, x, dr, n, P, M):
    """Surge, sway and yaw of the generic submarine, non-zero rows (order of `simd.HAND`)."""
    psi, u, v, r = x[2], x[3], x[4], x[5]
    s, c = math.sin(psi), math.cos(psi)
    av, ar = abs(v), abs(r)
    uu, uv, ur, vr, vav, uar = u * u, u * v, u * r, v * r, v * av, u * ar
    f0 = (
        P[1] * r * r
        + P[2] * vr
        + P[3] * v * v
        + P[4] * dr * dr * uu
        + P[5] * u * abs(u)
        + P[6] * u * n
        + P[7] * n * n
        + P[0] * vr
    )
    f1 = P[8] * ur + P[9] * uar * dr + P[10] * v * ar + P[11] * uv + P[12] * vav + P[13] * uu * dr - P[0] * ur
    f2 = (
        P[14] * r * ar
        + P[15] * ur
        + P[16] * uar * dr
        + P[17] * av * r
        + P[18] * uv
        + P[19] * vav
        + P[20] * uu * dr
    )
    return (
        u * c - v * s,
        u * s + v * c,
        r,
        M[0] * f0 + M[1] * f1 + M[2] * f2,
        M[3] * f0 + M[4] * f1 + M[5] * f2,
        M[6] * f0 + M[7] * f1 + M[8] * f2,
    )


@njit(cache=True, error_model="numpy")
def _compiled(t, x, dr, n, P, M):
    return np.array(_jitted(t, x, dr, n, P, M))


_jitted = njit(error_model="numpy")(right_side)


def integrate(s: Setting, rate: Callable, method: str) -> np.ndarray:
    """States at every sample, restarted where an input switches."""
    t, x = s.plan.t - s.plan.t[0], s.begin()
    P, M = s.par[s.model.positions(HAND)], s.minv()[0]
    if rate is right_side:
        P, M = P.tolist(), M.tolist()
    switches = np.flatnonzero(np.any(np.diff(s.act, axis=0) != 0.0, axis=1)) + 1
    edges = [0, *switches.tolist(), s.plan.steps.size]
    out = np.empty((t.size, x.size))
    out[0] = x
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        dr, n = s.act[a].tolist()
        solution = solve_ivp(
            rate, (t[a], t[b]), x, method, t_eval=t[a + 1 : b + 1], rtol=1e-6, atol=1e-8, args=(dr, n, P, M)
        )
        out[a + 1 : b + 1] = solution.y.T
        x = solution.y[:, -1]
    return out


def main() -> None:
    print(machine())
    row("solver", "ms per run", "one run, scalar kernel, is faster by", "one of 16 lanes", "track apart [m]")
    row("---", "---", "---", "---", "---")
    s = setting(3)
    scalar, (lanes, states) = scalar_run(s), lanes_run(s, np.repeat(s.par[None], LANES, axis=0))
    lanes()

    def clock(run: Callable[[], object], calls: int) -> float:
        begin = time.process_time()
        for _ in range(calls):
            run()
        return (time.process_time() - begin) / calls

    for words, rate in (("Python", right_side), ("numba", _compiled)):
        for method in ("RK45", "DOP853", "LSODA"):
            track = integrate(s, rate, method)
            apart = np.hypot(*(track[:, :2] - states[:, :2, 0]).T).max()
            seconds = np.empty((REPEATS, 3))
            for times in seconds:
                times[0] = clock(partial(integrate, s, rate, method), 1)
                times[1:] = clock(scalar, 100), clock(lanes, 20) / LANES
            ratios = np.median(seconds[:, :1] / seconds[:, 1:], axis=0)
            target = " (>= 500, >= 1000)" if (words, method) == ("Python", "RK45") else ""
            row(f"{method}, {words} right side{target}", f"{np.median(seconds[:, 0]) * 1e3:.0f}",
                f"{ratios[0]:.0f}", f"{ratios[1]:.0f}", f"{apart:.1e}")  # fmt: skip


if __name__ == "__main__":
    main()
