"""The estimate of a filter, for runs on which a random force acts: filter error in place of output error.

Takes a `FitProblem` and its runs as logged. Gives a `FilterEstimate`, or None. Does not choose between the
two: `weighted_fit` does.

A gust moves the vehicle, and open loop the vehicle stays moved: residuals of output error remember it, and a
search at the full weight of the readings takes it for coefficients. A filter has a random force in the
equations of motion and follows the readings, so that its innovations are white where force and equations are
right (Ljung 1999, 16.6; Jategaonkar 2015, 5; the size of the force by maximum likelihood). Where they are
not white - noise of sensors that remembers, equations that lack a force, real ships - it has no claim: on two
tankers it predicted held-out runs worse than output error, and its innovations remember there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_identification import LONGEST_TAU, noise_beside
from bayesid.estimation.filter_error.noise_model import NoiseModel, whitened
from bayesid.estimation.likelihood.composite import RunScore, run_scores
from bayesid.estimation.likelihood.mixed_rates import MixedRateNoise, mixed_rate_noise
from bayesid.estimation.likelihood.posterior import CoefficientPosterior, groups, posterior_of_scores
from bayesid.estimation.likelihood.run_information import RunInformation
from bayesid.estimation.likelihood.smoothed_start import (
    DISTURBANCE,
    USUAL_LEVEL,
    along_readings,
    first_states,
    small_disturbance,
)
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.parameters import GaussianPrior, known_together
from bayesid.trials import Run

Array = np.ndarray
# Measurements of the force, and gain in log density from which another one is worth while [nats].
ROUNDS, WORTH = 4, 1.0
# Prior sd over the size of a parameter that has none: wide, so that it only keeps the steps in bounds.
UNSTATED_SD = 3.0
# Mean square of a channel's innovations over their variance, within which the two agree.
CONSISTENT = (0.6, 1.7)
# Share of the longest memory of a disturbance from which it is none: a current passes for a force that lasts.
AS_LONG = 0.95
# Correlation of innovations at any lag up to which they count as white: of many readings less is told.
NEARLY_WHITE = 0.1


@dataclass(frozen=True, eq=False)
class FilterEstimate:
    """Coefficients of largest posterior density beside a random force.

    Attributes
    ----------
    values : (k,) parameters [SI]
    starts : per run its first state, as smoothed
    scores : per run, at the values, initial state and force integrated out
    order : of what is left of memory in the innovations
    noise : of force and sensors
    passes : of the last fit
    """

    values: Array
    starts: tuple[Array, ...]
    scores: tuple[RunScore, ...]
    order: int
    noise: NoiseModel
    passes: int

    def unknowns(self) -> Array:
        """(n,) parameters and first states, as in the problem."""
        return np.concatenate([self.values, *self.starts])

    def posterior(self, problem: FitProblem, z: Array, seed: int = 0) -> CoefficientPosterior:
        """Posterior of the coefficients, widened until halves of the runs agree.

        Parameters
        ----------
        z : (n,) unknowns of the problem
        """
        return posterior_of_scores(problem, z, self.scores, self.order, None, seed)


def filter_estimate(
    problem: FitProblem, runs: Sequence[Run], tick: Callable[[], None] = lambda: None
) -> FilterEstimate | None:
    """The estimate, where it arrives and its innovations are white and as large as they should be.

    Parameters
    ----------
    problem : with the noise of its sensors
    runs : those of the problem, as logged
    tick : called before every fit
    """
    model, params = problem.model, problem.params
    if any(p.role == "tied" for p in params) or not params.names:
        return None
    known = np.isfinite(params.prior_sd)
    sd = np.where(known, params.prior_sd, UNSTATED_SD * params.vector("scale"))
    low, high = params.vector("low"), params.vector("high")
    where, together = model.positions(params.names), known_together(params)
    free = GaussianPrior(params.names, where, params.start, sd, low, high, together)
    (logs, points), noise = along_readings(problem, runs), small_disturbance(model)
    level = USUAL_LEVEL
    try:
        for number in range(ROUNDS + 1):
            tick()
            made = fit(model, logs, free, noise, points, level)
            if number == ROUNDS:
                break
            noise, gain = noise_beside(made, noise)
            if number and gain < WORTH:
                break
            points, level = list(made.points), DISTURBANCE
        longest = LONGEST_TAU * model.scales["L"] / model.scales["U"]
        if not made.converged or made.noise_model.force_tau > AS_LONG * longest:
            return None
        infos = [
            _information(problem, made, path, run.name)
            for path, run in zip(made.paths, problem.runs, strict=True)
        ]
    except (ModelError, np.linalg.LinAlgError):
        return None
    left = _memory_left(infos)
    if left is None:
        return None
    scores = run_scores(infos, left, groups([i.name for i in infos]))
    starts = tuple(first_states(problem, made.points))
    return FilterEstimate(
        np.array(made.values), starts, scores, left.order, made.noise_model, made.iterations
    )


def _information(problem: FitProblem, made: FilterErrorFit, path: Linearisation, name: str) -> RunInformation:
    """Innovations of one run and their slopes by the parameters per scale."""
    scale = problem.scale[: made.values.size]
    step = made.values - path.point.par[made.free.where]
    white = whitened(made.model, path, step, scale, made.noise_model)
    valid = np.asarray(path.log.valid, dtype=bool)
    resid = np.where(valid, white.resid.reshape(valid.shape), 0.0)
    columns = np.where(valid[:, :, None], white.columns.reshape(*valid.shape, -1), 0.0)
    score = columns.reshape(-1, scale.size).T @ resid.ravel()
    return RunInformation(name, resid, valid, columns, np.zeros((0, scale.size)), score)


def _memory_left(infos: Sequence[RunInformation]) -> MixedRateNoise | None:
    """Noise of the innovations where they are white, or nearly, and of the size they should be; else None."""
    resids, valid = [i.resid for i in infos], [i.valid for i in infos]
    count = sum(v.sum(axis=0) for v in valid)
    square = sum((r**2).sum(axis=0) for r in resids)
    read = count > 0
    size = square[read] / count[read]
    if not (np.isfinite(size).all() and CONSISTENT[0] < size.min() and size.max() < CONSISTENT[1]):
        return None
    noise = mixed_rate_noise(resids, valid)
    for group in noise.groups:
        rows = [group.rows(v) for v in valid]
        series = [r[at][:, group.channels] for r, at in zip(resids, rows, strict=True)]
        seen = [v[at][:, group.channels] for v, at in zip(valid, rows, strict=True)]
        own = square[list(group.channels)] / np.maximum(count[list(group.channels)], 1)
        for lag in range(1, group.noise.order + 1):
            product = np.sum([(r[lag:] * r[:-lag]).sum(axis=0) for r in series], axis=0)
            pairs = np.sum([(v[lag:] & v[:-lag]).sum(axis=0) for v in seen], axis=0)
            if np.any(np.abs(product) > NEARLY_WHITE * own * pairs):
                return None
    return noise
