"""Fit a problem with the weight its readings deserve: output error, noise of its residuals, output error
again.

Takes a `FitProblem`. Gives the fit and its `CoefficientPosterior`. White residuals leave the fit as it is.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import CoefficientPosterior, coefficient_posterior
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.search import FitOptions, fit

# Rounds of noise and fit, and change of the logarithm of the weight that counts as none.
ROUNDS, SAME_WEIGHT = 3, 0.1


def weighted_fit(
    problem: FitProblem,
    options: FitOptions,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = True,
    watch: Callable[[int, float, float], None] | None = None,
    parts: NoiseParts | None = None,
) -> tuple[FitProblem, Fit, CoefficientPosterior | None]:
    """Fit whose readings count for what their residuals say they are worth.

    Parameters
    ----------
    folder : as in `fit`; a further round writes into its sub-folder weighted_<round>
    parts : noise to assume, None for what the data ask for

    Returns
    -------
    problem with the noise of the residuals, fit, posterior (None where the vehicle diverges at the estimate).
    The fit has the posterior's standard deviations; its cost and weights are those of full weight.
    """
    first = fit(problem, options, folder, resume, watch)
    problem = problem.with_sigma(first.sigma)
    result, posterior = first, _posterior(problem, first.z, parts, options.seed)
    weight = 1.0
    for number in range(1, ROUNDS + 1):
        if posterior is None or not first.converged:
            break
        if abs(np.log(posterior.parts.weight / weight)) < SAME_WEIGHT:
            break
        weight = posterior.parts.weight
        started = replace(
            weighed(problem, weight),
            params=problem.params.started_at(result.z[: result.n_params]),
        )
        below = None if folder is None else Path(folder) / f"weighted_{number}"
        again = fit(started, replace(options, profile=False, starts=1), below, resume, watch)
        if not again.converged:
            break
        found = _posterior(problem, again.z, parts, options.seed)
        if found is None:
            break
        result, posterior = again, found
    return problem, _told(problem, first, result, posterior, folder), posterior


def weighed(problem: FitProblem, weight: float) -> FitProblem:
    """The problem with the likelihood of its readings to a power: white noise larger by its root."""
    return replace(problem, runs=tuple(replace(r, sigma=r.sigma / np.sqrt(weight)) for r in problem.runs))


def _posterior(
    problem: FitProblem, z: np.ndarray, parts: NoiseParts | None, seed: int
) -> CoefficientPosterior | None:
    try:
        return coefficient_posterior(problem, z, parts, seed)
    except ModelError:
        return None


def _told(
    problem: FitProblem,
    first: Fit,
    result: Fit,
    posterior: CoefficientPosterior | None,
    folder: str | os.PathLike[str] | None,
) -> Fit:
    """The fit of the last round in the words and weights of the first."""
    if posterior is None:
        return first
    k = first.n_params
    sd, covariance = np.array(result.sd), np.array(result.covariance)
    sd[:k], covariance[:k, :k] = posterior.sd, posterior.covariance
    covariance[:k, k:] = covariance[k:, :k] = 0.0
    message = first.message
    if result is not first:
        message = (
            f"{result.message}; the readings count for {100 * posterior.parts.weight:.2g} % of white ones"
        )
    told = replace(
        result,
        start=first.start,
        sd=sd,
        covariance=covariance,
        cost_start=first.cost_start,
        cost=problem.cost(result.z),
        sigma=first.sigma,
        channel_rms=problem.channel_rms(result.z),
        message=message,
        digest=first.digest,
        costs=first.costs,
        steps=first.steps,
        seconds=first.seconds + (result.seconds if result is not first else 0.0),
        uncertainty=posterior.record(),
    )
    if folder is not None:
        told.save(Path(folder) / "fit.json")
    return told
