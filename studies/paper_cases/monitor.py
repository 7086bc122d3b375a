"""What the SQP search reports, its parts apart: costs, line search, gradient, bounds, Hessian, sub-problem.

Takes the traces of finished records (one `fit.slsqp.Iterate` per iteration). Does not search.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Runs = Sequence[Mapping[str, Any]]
KINDS = ("cost_s", "search_s", "gradient_s", "bounds_s", "subproblem_s")


def hessian_seconds(size: int, count: int = 400) -> float:
    """Time of one damped BFGS update (Powell 1978) of `size` unknowns, in numpy: median of `count` [s].

    scipy's SLSQP updates the Hessian and solves the sub-problem in one compiled call. This update of a full
    matrix, interpreted, takes longer than its compiled one of the factors: it bounds the share from above.
    """
    rng = np.random.default_rng(0)
    steps = rng.normal(size=(count, size))
    slopes = steps + 0.1 * rng.normal(size=(count, size))
    hessian, spent = np.eye(size), []
    for s, y in zip(steps, slopes, strict=True):
        begin = time.perf_counter()
        hessian = bfgs_update(hessian, s, y)
        spent.append(time.perf_counter() - begin)
    return float(np.median(spent))


def bfgs_update(hessian: np.ndarray, s: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Hessian after a step `s` that changed the slope by `y`; damped so that it stays positive definite."""
    bs = hessian @ s
    sbs, sy = float(s @ bs), float(s @ y)
    if sy < 0.2 * sbs:
        share = 0.8 * sbs / (sbs - sy)
        y = share * y + (1.0 - share) * bs
        sy = float(s @ y)
    return np.asarray(hessian - np.outer(bs, bs) / sbs + np.outer(y, y) / sy)


def time_shares(runs: Runs, hessian: float) -> dict[str, float]:
    """Share of the time of the SQP iterations [%] per kind of work, median over seeds.

    `hessian` [s] per update is taken out of the call that holds it, never more than is there.
    """
    rows = []
    for run in runs:
        trace = run["trace"]
        total = {k: float(np.sum(trace[k])) for k in KINDS}
        update = float(np.sum(np.minimum(hessian, trace["subproblem_s"])))
        rows.append(
            [total["cost_s"], total["search_s"], total["gradient_s"], total["bounds_s"], update,
             total["subproblem_s"] - update]
        )  # fmt: skip
    parts = np.array(rows)
    share = np.median(100 * parts / parts.sum(axis=1, keepdims=True), axis=0)
    names = (
        "costs",
        "line search",
        "gradient",
        "bounds",
        "Hessian update (at most)",
        "sub-problem (at least)",
    )
    return dict(zip(names, share.tolist(), strict=True))


def per_iteration(runs: Runs) -> dict[str, float]:
    """What the iterations did, medians over seeds; V is twice the cost."""
    found: dict[str, list[float]] = {}

    def add(key: str, value: float) -> None:
        found.setdefault(key, []).append(float(value))

    for run in runs:
        trace = {k: np.array(run["trace"][k], dtype=float) for k in run["trace"] if k != "samples"}
        whole = np.abs(trace["length"] - 1) < 1e-6
        add("iterations", len(whole))
        add("costs per iteration", float(trace["trials"].mean()))
        add("whole steps [%]", 100 * float(whole.mean()))
        add("shortest step", trace["length"].min())
        add("uphill proposals [%]", 100 * float(np.mean(trace["slope"] >= 0)))
        add("bounds overrun, largest", trace["violation"].max())
        add("on a bound, most", trace["active"].max())
        add("on a bound, last", trace["active"][-1])
    return {k: float(np.median(v)) for k, v in found.items()}


def compact(run: Mapping[str, Any], keep: bool) -> dict[str, Any]:
    """The record for `results.json`: the trace to four digits if kept, without the times, else left out."""
    out = {k: v for k, v in run.items() if k != "trace"}
    if keep and "trace" in run:
        out["trace"] = {
            k: v if k == "samples" else [float(f"{x:.4g}") for x in v]
            for k, v in run["trace"].items()
            if not k.endswith("_s")
        }
    return out
