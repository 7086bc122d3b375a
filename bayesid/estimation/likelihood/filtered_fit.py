"""The fit that a filter's estimate makes of a search: estimate, intervals, what the runs leave open.

Takes a `FitProblem`, the fit its search ended with and a `FilterEstimate`. Gives the fit and its posterior.
Does not search.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.composite import inverse, root
from bayesid.estimation.likelihood.filter_estimate import FilterEstimate
from bayesid.estimation.likelihood.posterior import (
    CoefficientPosterior,
    composite_of,
    information_ratio,
)
from bayesid.estimation.likelihood.run_information import run_information
from bayesid.estimation.likelihood.score_step import with_settled_starts
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.flat_directions import flat_directions, singular_values
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.search import FitOptions

# Share of its width from which a parameter counts as on its bound.
AT_BOUND = 1e-6
# Deviations from the end of the filter to the mean of the posterior up to which the line between is trusted.
MOST_STEP = 1.0


def fit_by_filter(
    problem: FitProblem, first: Fit, found: FilterEstimate, options: FitOptions
) -> tuple[Fit, CoefficientPosterior] | None:
    """The fit at a filter's estimate; None where the vehicle diverges there in the runs' own time, or where
    the prior - one whose centre is not the start, as the filter's is - moves it further than a line holds.

    Parameters
    ----------
    problem : with the noise of its sensors
    first : how the search of output error ended; history, seed and digest stay its own

    Returns
    -------
    The fit; its cost and residuals are those of a simulation without the force. The posterior, whose share is
    the information of all readings over what they had if nothing but their sensors erred.
    """
    k = first.n_params
    posterior = found.posterior(problem, found.unknowns(), options.seed)
    z = found.unknowns()
    z[:k] = np.clip(posterior.mean, posterior.low, posterior.high)
    if np.any(np.abs(z[:k] - found.values) > MOST_STEP * posterior.sd):
        return None
    try:
        z = with_settled_starts(problem, z)
        cost, channel_rms = problem.cost(z), problem.channel_rms(z)
        white = np.sum([info.information for info in run_information(problem, z)], axis=0)
    except ModelError:
        return None
    composite = composite_of(problem, z, found.scores)
    told, prior = composite.data(posterior.parts)[0], composite.prior_precision
    share = float(np.clip(information_ratio(told, white, prior), 0.0, 1.0))
    parts = replace(posterior.parts, weight=share, share=share, disturbance=found.noise.force_tau)
    scale, half = problem.scale[:k], 0.5 * (first.high - first.low)[:k]
    seen = root(told).T
    near = np.minimum(z - first.low, first.high - z)[:k] <= AT_BOUND * 2.0 * half
    sigma = {c: float(s) for run in problem.runs for c, s in zip(run.channels, run.sigma, strict=True)}
    white_sd = scale * np.sqrt(np.diag(inverse(white + prior)))
    posterior = replace(posterior, parts=parts, white_sd=white_sd, estimate=z[:k].copy())
    result = replace(
        first,
        z=z,
        sd=np.concatenate([posterior.sd, first.sd[k:]]),
        covariance=posterior.covariance,
        cost_start=_cost(problem, problem.start, first.cost_start),
        cost=cost,
        at_bound=tuple(n for n, on in zip(first.names[:k], near & np.isfinite(half), strict=True) if on),
        status="converged",
        message=(
            f"converged in {found.passes} passes of a filter, with a random force on the vehicle and slow "
            "errors of positions"
        ),
        predicted_gain=0.0,
        flat=flat_directions(
            first.names[:k], seen, options.flat_level, problem.params.prior_sd / scale, half / scale
        ),
        singular_values=singular_values(seen)[0],
        sigma=sigma,
        channel_rms=channel_rms,
        uncertainty={**first.uncertainty, **posterior.record(), "filter": asdict(found.noise)},
    )
    return result, posterior


def _cost(problem: FitProblem, z: np.ndarray, otherwise: float) -> float:
    try:
        return problem.cost(z)
    except ModelError:
        return otherwise
