"""One round of SLSQP in coordinates where the problem looks round.

Takes a `FitProblem` and a point. Gives the point it ends at, the path and where the time went.
Does not restart, judge convergence or store anything.

SLSQP starts every run with the identity as its Hessian. In the coordinates used here the Gauss-Newton Hessian
at the start, plus a damping that shrinks with the cost, is the identity: the first step is a Gauss-Newton
step. The bounds, a box in the coefficients, become linear constraints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import minimize

from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
# Scaled cost of a diverged run: finite, so that the line search backs off.
DIVERGED = 1e12
# Damping over the excess (the cost that can still go), in relative changes: a direction it outweighs would
# change the cost by less than 1e-3 of the excess if all coefficients moved by a tenth. In units of the whole
# cost, noise included, it froze weakly seen directions of measured data.
DAMPING = 0.2


class Enough(Exception):
    """Raised by a watcher to end a round at the iterate it was shown."""


@dataclass
class Clock:
    """Seconds per kind of work, and counts."""

    line_search: float = 0.0
    gradient: float = 0.0
    subproblem: float = 0.0
    other: float = 0.0
    n_cost: int = 0
    n_gradient: int = 0

    def add(self, more: Clock) -> None:
        for name, value in vars(more).items():
            setattr(self, name, getattr(self, name) + value)


@dataclass(frozen=True)
class Iterate:
    """One SQP iteration, its parts apart.

    Attributes
    ----------
    cost : at the accepted point (half of V for the paper's objective)
    slope : directional derivative of the cost along the step the sub-problem proposed, for the whole step
    length : share of that step the line search took; 1 is all of it
    step : rms relative change of the unknowns
    violation : largest overrun of a bound before clipping, relative to the scale of the unknown
    active : unknowns on a bound
    gradient : largest derivative of the cost by a relative change of one unknown, after the step
    trials : costs evaluated by the line search
    cost_s, gradient_s, bounds_s, subproblem_s, search_s : seconds in costs, gradient, evaluation of the
        bounds, Hessian update with quadratic sub-problem (one compiled call of scipy's), and the line
        search's own arithmetic
    """

    cost: float
    slope: float
    length: float
    step: float
    violation: float
    active: int
    gradient: float
    trials: int
    cost_s: float
    gradient_s: float
    bounds_s: float
    subproblem_s: float
    search_s: float


_TIMES = ("cost_s", "gradient_s", "bounds_s", "subproblem_s", "search_s")


class _Monitor:
    """Splits the time of a round: what scipy does between two calls of ours follows from what was asked last.

    After a gradient it updates the Hessian and solves the quadratic sub-problem, after a cost it works on the
    line search.
    """

    def __init__(self, note: Callable[[Iterate], None] | None) -> None:
        self.note = note
        self.begin(np.zeros(0), np.zeros(0))

    def begin(self, s: Array, by_s: Array) -> None:
        """The next iteration starts at `s` with this slope."""
        self.last, self.by_s = s.copy(), by_s
        self.trial: Array | None = None
        self.trials = 0
        self.between = "subproblem_s"
        self.seconds: dict[str, Any] = dict.fromkeys(_TIMES, 0.0)
        self.since = time.perf_counter()

    @contextmanager
    def inside(self, kind: str) -> Iterator[None]:
        """Time a call of ours."""
        now = time.perf_counter()
        self.seconds[self.between] += now - self.since
        yield
        self.since = time.perf_counter()
        self.seconds[kind] += self.since - now
        if kind != "bounds_s":
            self.between = "subproblem_s" if kind == "gradient_s" else "search_s"

    def tried(self, s: Array) -> None:
        """A cost the line search asks for; the first is that of the whole step."""
        if self.trial is None and s.any():
            self.trial = s.copy()
        self.trials += 1

    def end(self, s: Array, by_s: Array, excess: float, found: dict[str, Any]) -> None:
        """Note the iteration that ended at `s`."""
        assert self.note is not None
        whole = (s if self.trial is None else self.trial) - self.last
        size = float(np.linalg.norm(whole))
        length = float(np.linalg.norm(s - self.last)) / size if size > 0 else 0.0
        slope = excess * float(self.by_s @ whole)
        self.note(Iterate(slope=slope, length=length, trials=self.trials - 1, **found, **self.seconds))
        self.begin(s, by_s)


@dataclass
class Round:
    """What one round did; `costs` and `steps` per iteration (step: rms relative change of the unknowns)."""

    z: Array
    cost: float
    costs: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    clock: Clock = field(default_factory=Clock)
    message: str = ""


def whitening(jac: Array, scale: Array, excess: float, damping: float = DAMPING) -> Array:
    """(k, k) map from round coordinates to unknowns; the damped Gauss-Newton Hessian of cost/excess is 1."""
    scaled = jac * scale
    hessian = scaled.T @ scaled
    values, vectors = np.linalg.eigh(hessian)
    floor = max(damping * excess, 1e-16 * max(values[-1], 1e-300))
    width = np.sqrt(excess / (np.maximum(values, 0.0) + floor))
    return scale[:, None] * vectors * width


def run_round(
    problem: FitProblem,
    z0: Array,
    iterations: int,
    tolerance: float,
    excess: float | None = None,
    damping: float = DAMPING,
    watch: Callable[[Array, float, float], None] | None = None,
    note: Callable[[Iterate], None] | None = None,
) -> Round:
    """Run SLSQP from `z0` for at most `iterations` steps.

    Parameters
    ----------
    tolerance : stop when an iteration gains less than this share of the excess
    excess : how far the cost may still fall, the unit of the round; by default all of it
    damping : of the Gauss-Newton Hessian, over the excess, in relative changes
    watch : called after every iteration with (z, cost, step); may raise `Enough`
    note : called with every `Iterate`, for studies of the search itself
    """
    clock = Clock()
    begin = time.perf_counter()
    resid, jac = problem.compressed(z0)
    cost0 = 0.5 * float(resid @ resid)
    slope0 = jac.T @ resid
    clock.gradient += time.perf_counter() - begin
    clock.n_gradient += 1
    out = Round(z0.copy(), cost0, clock=clock)
    if cost0 == 0.0:
        out.message = "the cost is zero"
        return out
    excess = cost0 if excess is None else max(excess, 1e-13 * cost0)
    transform = whitening(jac, problem.scale, excess, damping)
    low, high, scale = problem.low, problem.high, problem.scale
    below, above = np.isfinite(low), np.isfinite(high)
    rows = np.vstack([transform[below] / scale[below, None], -transform[above] / scale[above, None]])
    slack = np.concatenate(
        [(z0[below] - low[below]) / scale[below], (high[above] - z0[above]) / scale[above]]
    )
    gap = np.where(below & above, (high - low) / scale, 1.0)
    near = 1e-6 * np.concatenate([gap[below], gap[above]])
    known: dict[bytes, float] = {}

    def point(s: Array) -> Array:
        return np.clip(z0 + transform @ s, low, high)

    monitor = _Monitor(note)

    def fun(s: Array) -> float:
        with monitor.inside("cost_s"):
            start = time.perf_counter()
            monitor.tried(s)
            key = s.tobytes()
            if key not in known:
                if len(known) > 64:
                    known.clear()
                z = point(s)
                known[key] = problem.cost(z) if s.any() else cost0
                clock.n_cost += 1
                if known[key] < out.cost:
                    out.z, out.cost = z, known[key]
            clock.line_search += time.perf_counter() - start
        return min((known[key] - cost0) / excess, DIVERGED)

    last = z0.copy()

    def slope(s: Array) -> Array:
        # asked for once per iteration, where the line search ended; scipy's callback sees the next full step
        # instead
        if not s.any():
            monitor.begin(s, transform.T @ slope0 / excess)
            return transform.T @ slope0 / excess
        step = accepted(s)
        with monitor.inside("gradient_s"):
            start = time.perf_counter()
            by_z = problem.cost_gradient(point(s))[1]
            clock.n_gradient += 1
            clock.gradient += time.perf_counter() - start
        by_s = transform.T @ by_z / excess
        if note is not None:
            room = rows @ s + slack
            found = {
                "cost": known[s.tobytes()], "step": step, "gradient": float(np.abs(by_z * scale).max()),
                "violation": float(max(0.0, -room.min(initial=0.0))),
                "active": int(np.sum(room <= near)),
            }  # fmt: skip
            monitor.end(s, by_s, excess, found)
        return by_s

    def accepted(s: Array) -> float:
        nonlocal last
        fun(s)
        value = known[s.tobytes()]
        start = time.perf_counter()
        z = point(s)
        step = float(np.sqrt(np.mean(((z - last) / scale) ** 2)))
        last = z
        out.costs.append(value)
        out.steps.append(step)
        if watch is not None:
            watch(z, value, step)
        clock.other += time.perf_counter() - start
        return step

    def bounds(s: Array) -> Array:
        with monitor.inside("bounds_s"):
            return rows @ s + slack

    def bounds_slope(s: Array) -> Array:
        with monitor.inside("bounds_s"):
            return rows

    constraints = {"type": "ineq", "fun": bounds, "jac": bounds_slope} if slack.size else ()
    try:
        result = minimize(
            fun,
            np.zeros(z0.size),
            jac=slope,
            method="SLSQP",
            constraints=constraints,
            options={"maxiter": iterations, "ftol": tolerance},
        )
        out.message = str(result.message)
    except Enough as reason:
        out.message = str(reason)
    total = time.perf_counter() - begin
    clock.subproblem = max(total - clock.line_search - clock.gradient - clock.other, 0.0)
    return out
