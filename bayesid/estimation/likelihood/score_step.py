"""From an estimate to the one that weighs the score of every run by its own covariance: steps of scoring.

Takes a `FitProblem`, an estimate, the noise of its residuals and the parts they ask for. Gives the unknowns,
or None where the steps do not arrive. Does not choose the parts.

The estimate has the smallest sum over runs of g_r' C_r^-1 g_r beside the prior (generalised method of
moments; Hansen 1982). Each step is linear in the scores, C_r is that where it begins, and it is halved until
the sum falls. A vehicle whose readings are far from linear in the parameters does not come that way: it keeps
the estimate it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.composite import Composite, RunScore, root
from bayesid.estimation.likelihood.mixed_rates import MixedRateNoise
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import composite_of, scores_under
from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
# Steps, halvings of one, and step in standard deviations that counts as none.
STEPS, HALVINGS, SETTLED = 6, 4, 0.02
# Steps of the initial states for new parameters.
START_STEPS = 3


class Scored(NamedTuple):
    """Unknowns and the scores of all runs there."""

    z: Array
    scores: tuple[RunScore, ...]


def efficient_estimate(
    problem: FitProblem,
    z: Array,
    noise: MixedRateNoise,
    parts: NoiseParts,
    scores: tuple[RunScore, ...] | None = None,
) -> Scored | None:
    """Unknowns whose scores, weighed by their own covariance, balance the prior; None if no step is of use.

    Parameters
    ----------
    z : unknowns of the problem at the estimate to begin from
    noise : of the residuals there
    scores : of the runs there under that noise, where they are known
    """
    here = Scored(z, scores_under(problem, z, noise) if scores is None else scores)
    for number in range(STEPS):
        composite = composite_of(problem, here.z, here.scores)
        law = composite.law(parts)
        if float(np.max(np.abs(law.mean) / np.sqrt(np.diag(law.covariance)))) < SETTLED:
            break
        weights = _weights(composite, parts)
        found = _fallen(problem, here, law.mean, noise, weights, _missed(composite, weights))
        if found is None:
            return None if number == 0 else here
        here = found
    return here


def _fallen(
    problem: FitProblem,
    here: Scored,
    step: Array,
    noise: MixedRateNoise,
    weights: Sequence[Array],
    value: float,
) -> Scored | None:
    """Where a part of the step leads with which the sum falls below a value; None where no part does."""
    k = step.size
    low, high = problem.params.vector("low"), problem.params.vector("high")
    for halved in range(HALVINGS + 1):
        z = here.z.copy()
        z[:k] = np.clip(z[:k] + 0.5**halved * problem.scale[:k] * step, low, high)
        try:
            z = with_settled_starts(problem, z)
            there = Scored(z, scores_under(problem, z, noise))
        except ModelError:
            continue
        if _missed(composite_of(problem, z, there.scores), weights) < value:
            return there
    return None


def with_settled_starts(problem: FitProblem, z: Array) -> Array:
    """The unknowns with the initial states that suit their parameters, by Gauss-Newton.

    Raises
    ------
    ModelError
        if the simulated vehicle diverges on the way
    """
    k = len(problem.params.names)
    z = np.array(z)
    for _ in range(START_STEPS):
        block, at = problem.run_blocks(z), k
        moved = np.array(z)
        for i, run in enumerate(problem.runs):
            own = slice(at, at + len(run.initial))
            at = own.stop
            if own.stop == own.start:
                continue
            resid, jac = block(i)
            rows = np.vstack([jac[:, k:] * run.initial_sd, np.eye(len(run.initial))])
            miss = np.concatenate([resid, (z[own] - problem.start[own]) / run.initial_sd])
            moved[own] = z[own] - run.initial_sd * np.linalg.lstsq(rows, miss, rcond=None)[0]
        if not np.isfinite(moved).all():
            raise ModelError("no initial state suits these parameters")
        z = moved
    return z


def _weights(composite: Composite, parts: NoiseParts) -> list[Array]:
    """(m, k) per run: what turns its score into errors of unit variance."""
    out = []
    for run in composite.runs:
        seen = run.seen
        covariance = seen.T @ composite.score_covariance(run, parts) @ seen
        out.append(np.linalg.solve(np.linalg.cholesky(covariance), seen.T) if seen.size else seen.T)
    return out


def _missed(composite: Composite, weights: Sequence[Array]) -> float:
    """Half the sum of squares of all scores and of the prior."""
    scores = sum(float(np.sum((w @ run.score) ** 2)) for w, run in zip(weights, composite.runs, strict=True))
    held = root(composite.prior_precision)
    prior = np.linalg.lstsq(held, composite.prior_score, rcond=None)[0]
    return 0.5 * (scores + float(prior @ prior))
