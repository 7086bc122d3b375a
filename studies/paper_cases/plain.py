"""One plain call of scipy's SLSQP with forward differences: the kind of search the paper may have run.

Takes a case, a seed and the target. Gives a plain record. The study's own fits do not use it: it shows what
an early stop does to the coefficients, the paper's program and tolerances being unstated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize

from bayesid.equations.model import Model
from bayesid.estimation.output_error.simulated_recovery import (
    RecoveryCase,
    Target,
    draw,
    position_error,
    problem_of,
)

WIDTH = 0.1  # unit of the search: a tenth of the start value; the cost is in units of its start
ITERATIONS, TOLERANCE = 2000, 1e-13
BOUND = 1e-3  # of the distance between the bounds


def plain_search(model: Model, case: RecoveryCase, target: Target, seed: int) -> dict[str, Any]:
    """One search from the same start, within the same bounds, as `run_case` of this seed."""
    params, base = draw(model, case, seed)
    problem = problem_of(model, params, base, [target])
    truth = model.nominal[model.positions(case.unknown)]
    start, low, high = problem.start, problem.low, problem.high
    unit = WIDTH * np.abs(start)
    first = 2 * problem.cost(start)

    def point(s: np.ndarray) -> np.ndarray:
        return np.clip(start + s * unit, low, high)

    found = minimize(
        lambda s: min(2 * problem.cost(point(s)) / first, 1e12),
        np.zeros(start.size),
        method="SLSQP",
        bounds=list(zip((low - start) / unit, (high - start) / unit, strict=True)),
        options={"maxiter": ITERATIONS, "ftol": TOLERANCE},
    )
    z = point(found.x)
    near = np.minimum(z - low, high - z) <= BOUND * (high - low)
    return {
        "case": case.name, "seed": seed, "names": case.unknown, "V_start": first,
        "V_end": 2 * problem.cost(z), "ratio": z / truth,
        "at_bound": [n for n, b in zip(case.unknown, near, strict=True) if b],
        "max_position_error": position_error(model, problem.split(z)[0], target),
        "iterations": int(found.nit), "n_cost": int(found.nfev), "message": str(found.message),
    }  # fmt: skip
