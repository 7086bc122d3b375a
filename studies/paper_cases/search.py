"""The section on the search: time and work of its parts, each by itself, and its iterations.

Takes the plain records of `simulated_recovery` with their traces. Does not search.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report.writer import Block, Figure, Section, Table, Text
from studies.paper_cases import figures
from studies.paper_cases.monitor import hessian_seconds, per_iteration, time_shares
from studies.paper_cases.stated import PAPER
from studies.paper_cases.targets import Records, values


def search_section(records: Records, titles: Mapping[str, str]) -> Section:
    watched = {n: runs for n, runs in records.items() if all("trace" in r for r in runs)}
    if "1" not in watched:
        words = (
            "The kept seeds hold no iterations: delete the folder `seeds` beside this report and run again."
        )
        return Section("The search, its parts apart", [Text(words)])
    hessian = {k: hessian_seconds(k) for k in {len(runs[0]["names"]) for runs in watched.values()}}
    times: list[list[Any]] = []
    work: list[list[Any]] = []
    for name, runs in records.items():
        label = f"{name[0]}: {titles[name]}" if name[0] in "123" else titles.get(name, name)
        reasons = ", ".join(f"{k} {v}" for k, v in sorted(Counter(r["status"] for r in runs).items()))
        seconds = float(np.median(values(runs, "seconds")))
        counts = [int(np.median(values(runs, key))) for key in ("n_cost", "n_gradient", "rounds")]
        if name in watched:
            shares = time_shares(runs, hessian[len(runs[0]["names"])])
            found = per_iteration(runs)
            times.append([label, seconds, *shares.values()])
            cells: list[Any] = [f"{found[k]:.2g}" if k != "iterations" else int(found[k]) for k in found]
        else:  # the fits in six degrees of freedom keep totals only
            line, slope = (
                100 * float(np.median(values(runs, "shares", k))) for k in ("line_search", "gradient")
            )
            times.append([label, seconds, line, None, slope, *[None] * (len(shares) - 3)])
            cells = [int(np.median(values(runs, "iterations"))), *[None] * (len(found) - 1)]
        work.append([label, *counts, *cells, reasons])
    text = (
        "The parts of the search that an SQP monitor lists, each by itself. Costs: simulations the line "
        "search "
        "asks for. Line search: its own arithmetic with the merit function. Gradient: adjoint. Bounds: "
        "evaluating "
        "the constraints. Scipy's SLSQP updates the Hessian and solves the quadratic sub-problem in one "
        "compiled "
        "call; the same update in numpy "
        f"({1e6 * min(hessian.values()):.0f} to {1e6 * max(hessian.values()):.0f} µs each) bounds the "
        f"Hessian's "
        "part from above, and what remains of the call bounds the sub-problem from below. Medians over "
        "seeds; two "
        "seeds ran at a time. The restarts' sensitivity runs lie outside the iterations. The "
        "6-DOF fits keep totals only, restarts included."
    )
    columns = ["case", "time per seed [s]", *(f"{k} [%]" for k in shares)]
    blocks: list[Block] = [Text(text), Table(columns, times, digits=2)]
    caption = (
        "What the iterations did. V is evaluated `costs` times; a whole step is the one the sub-problem "
        "proposes; "
        "bounds overrun: before clipping, relative to the coefficient."
    )
    columns = ["case", "costs", "gradients", "restarts", *found, "stopped (seeds)"]
    blocks.append(Table(columns, work, caption))
    traces = {f"Case {n}": watched[n][0]["trace"] for n in PAPER if n in watched}
    caption = (
        f"Iteration by iteration, seed {watched['1'][0]['seed']}: V, the decrease a whole step promises "
        "(directional derivative), the step length taken, the largest derivative of V by a relative change "
        "of one "
        "coefficient, and the coefficients on a bound. Dotted: change between samples every half second and "
        "all "
        "samples; V is then a sum over other samples."
    )
    blocks.append(Figure("search", figures.search(traces), caption))
    return Section("The search, its parts apart", blocks)
