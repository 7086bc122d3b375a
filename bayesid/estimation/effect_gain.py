"""Whether an effect freed in a fit is there: what the runs lose where it is as the vehicle states it.

Takes a `FitProblem` at its estimate. Gives nats per effect, all else fitted again. Standard deviations cannot
tell: the trace of a lag inside a rate limit goes with its square near zero, so that one sd at the estimate
says nothing of zero.
"""

from __future__ import annotations

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.output_error.problem import FitProblem

STEPS, SAME = 6, 1e-3  # Gauss-Newton steps, and change of cost that counts as none


def effect_gains(problem: FitProblem, z: np.ndarray, weight: float = 1.0) -> dict[str, float]:
    """Effect -> gain [nats] of the best fit near the estimate z over that in which the effect is as stated.

    As stated is off where the vehicle states nothing. Both are fits of the readings: the estimate itself may
    have left the least cost to balance scores of runs, and would then lose to either.

    Parameters
    ----------
    weight : of the readings, as their residuals ask for
    """
    off = problem.model.effect_off
    freed = [n for n in problem.params.names if problem.model.index[n] in off]
    out: dict[str, float] = {}
    best = descended(problem, z)[1] if freed else 0.0
    for effect in dict.fromkeys(n.partition(".")[0] for n in freed):
        names = [n for n in freed if n.partition(".")[0] == effect]
        params = problem.params
        for name in names:
            stated = float(problem.base[problem.model.index[name]])
            params = params.changed([name], role="fixed", start=stated, prior=None)
        kept = [i for i, n in enumerate(problem.names) if n not in names]
        out[effect] = weight * max(descended(problem.with_params(params), z[kept])[1] - best, 0.0)
    return out


def descended(problem: FitProblem, z: np.ndarray) -> tuple[np.ndarray, float]:
    """Unknowns and cost after a few Gauss-Newton steps inside the bounds, never more than at z."""
    cost = problem.cost(z)
    for _ in range(STEPS):
        try:
            resid, jac = problem.compressed(z)
        except ModelError:
            break
        step = np.linalg.lstsq(jac * problem.scale, resid, rcond=None)[0] * problem.scale
        shares = (np.clip(z - share * step, problem.low, problem.high) for share in (1.0, 0.3, 0.1))
        tried = next(((new, c) for new in shares if (c := problem.cost(new)) < cost), None)
        if tried is None:
            break
        gained, (z, cost) = cost - tried[1], tried
        if gained < SAME:
            break
    return z, cost
