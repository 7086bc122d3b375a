"""Fit a problem with the weight its readings deserve: output error, noise of its residuals, output error
again; a filter where a random force acts.

Takes a `FitProblem`. Gives the fit and its `CoefficientPosterior`. White residuals leave the fit as it is.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.errors import FitError, ModelError
from bayesid.estimation.likelihood.filter_estimate import FilterEstimate
from bayesid.estimation.likelihood.filtered_fit import fit_by_filter
from bayesid.estimation.likelihood.left_out_runs import left_out_misfits, predicts_worse
from bayesid.estimation.likelihood.model_form import asked_beyond, form_part, with_form
from bayesid.estimation.likelihood.nonlinear_covariance import nonlinear_covariance
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import (
    CoefficientPosterior,
    coefficient_posterior,
    groups,
    posterior_of_scores,
    scores_and_noise,
)
from bayesid.estimation.likelihood.predictive_check import predictive_p
from bayesid.estimation.likelihood.score_step import efficient_estimate, with_settled_starts
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.search import FitOptions, fit, minus_log_likelihood

# Gives a filter's estimate of a problem, or none; calls its second argument before every fit.
Filtered = Callable[[FitProblem, Callable[[], None]], FilterEstimate | None]
# Rounds of noise and fit, and change of the logarithm of the weight that counts as none.
ROUNDS, SAME_WEIGHT = 3, 0.1
# Rms residual of a channel over its stated noise from which the noise is no measure of its errors.
MISFIT = 1.5
# Difference of log likelihood up to which two ends lie in the same valley.
SAME_VALLEY = 0.5


def weighted_fit(
    problem: FitProblem,
    options: FitOptions,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = True,
    watch: Callable[[int, float, float], None] | None = None,
    parts: NoiseParts | None = None,
    kinds: Mapping[str, str] | None = None,
    say: Callable[[str], None] | None = None,
    smoothed: Callable[[], np.ndarray | None] = lambda: None,
    filtered: Filtered = lambda problem, tick: None,
) -> tuple[FitProblem, Fit, CoefficientPosterior | None]:
    """Fit whose readings count for what their residuals say they are worth.

    Where the residuals of a channel exceed its stated noise, the channels are weighed by their residuals from
    the start values on, the stated noise a lower limit. With the stated noise channels that a disturbance
    moves most decide most, the search ends far off, and no covariance mends that (simulated campaigns in a
    rough sea: 54 to 80 % of the 90 % intervals held the truth).

    Parameters
    ----------
    folder : as in `fit`, but fit.json is there only once all is done; further fits write their iterates into
        the sub-folders "second", "balanced", weighted_<round> and "form"
    parts : noise to assume, None for what the data ask for; white noise is taken at its stated size
    kinds : run -> kind of its motion, for posterior predictive p
    say : as in `fit`, of the first search
    options : in 6 degrees of freedom searches are finished in a trust region (`FitOptions.finish`)
    smoothed : unknowns at an estimate along the smoothed path (`smoothed_start`). In 6 degrees of freedom the
        first search begins there where the cost is lower than at the start values; in the plane a second one
        does where the first did not converge, or ended with a higher cost. The likelier end stands
    filtered : the estimate of a filter (`filter_estimate`), asked for where residuals of the first search
        remember and no parts are given. Where there is one, of two or more runs, it is the fit unless
        left-out runs are predicted worse

    Returns
    -------
    problem with the noise of the residuals, fit, posterior (None where the vehicle diverges at the estimate).
    The fit has the posterior's standard deviations; its cost and weights are those of full weight. Where the
    runs ask for a model form, its rows are among the parameters; beside a filter's estimate, whose
    innovations are white, none is asked for.
    """
    if folder is not None:  # one of an earlier fit would look like this one's
        (Path(folder) / "fit.json").unlink(missing_ok=True)
    options = replace(options, finish=problem.model.dof == 6)
    noisy, result, posterior = _without_form(
        problem, options, folder, resume, watch, parts, say, smoothed, filtered
    )
    by_filter = posterior is not None and bool(posterior.parts.disturbance)
    if by_filter:
        result = _with_held_said(noisy, result, options.seed)
    elif parts is None and posterior is not None and result.converged:
        plain = noisy, result, posterior
        noisy, result, posterior = _with_form_if_asked(problem, options, folder, resume, watch, *plain)
    if posterior is not None:
        checked = predictive_p(noisy, result.z, posterior, kinds, options.seed)
        result = replace(result, uncertainty={**result.uncertainty, "predictive_p": checked})
        if result.converged and not by_filter:
            result = _along_ridges(noisy, result, posterior, options.seed, watch)
    if folder is not None:
        result.save(Path(folder) / "fit.json")
    return noisy, result, posterior


def _with_form_if_asked(
    problem: FitProblem,
    options: FitOptions,
    folder: str | os.PathLike[str] | None,
    resume: bool,
    watch: Callable[[int, float, float], None] | None,
    plain: FitProblem,
    result: Fit,
    posterior: CoefficientPosterior,
) -> tuple[FitProblem, Fit, CoefficientPosterior]:
    """The fit again with a model form where the runs ask for one; where that fails, as it was, with why. Says
    so where they ask for coefficients that it holds."""
    asked = asked_beyond(plain, result.z, posterior.parts)
    size = asked.size
    if asked.held is not None:
        result = replace(result, uncertainty={**result.uncertainty, "held": asdict(asked.held)})
    if size == 0.0:
        return plain, result, posterior
    k = result.n_params
    wide = with_form(problem, size)
    wide = wide.with_params(wide.params.started_at([*result.z[:k], *np.zeros(len(wide.params.names) - k)]))
    below = None if folder is None else Path(folder) / "form"
    try:
        formed, again, wider = _without_form(wide, replace(options, starts=1), below, resume, watch, None)
    except (FitError, ModelError) as error:  # the vehicle may diverge anywhere on the way
        return plain, _formless(result, size, str(error)), posterior
    if wider is None or not again.converged:
        why = "the vehicle diverges at its estimate" if wider is None else again.message
        return plain, _formless(result, size, why), posterior
    rows = form_part(problem.model, again.values, problem.model.vehicle.coef)
    start = np.concatenate([result.start[:k], np.zeros(again.n_params - k), again.start[again.n_params :]])
    again = replace(
        again,
        start=start,
        cost_start=result.cost_start,
        digest=result.digest,
        seconds=result.seconds + again.seconds,
        uncertainty={
            **again.uncertainty,
            "form": {"size": size, "rows": rows},
            **{k: v for k, v in result.uncertainty.items() if k == "held"},
        },
    )
    return formed, again, wider


def _with_held_said(problem: FitProblem, result: Fit, seed: int) -> Fit:
    """A filter's fit with what its runs ask of coefficients that it holds, by residuals of output error."""
    try:
        parts = coefficient_posterior(problem, result.z, None, seed).parts
        held = asked_beyond(problem, result.z, parts).held
    except ModelError:
        return result
    if held is None:
        return result
    return replace(result, uncertainty={**result.uncertainty, "held": asdict(held)})


def _formless(result: Fit, size: float, why: str) -> Fit:
    """The fit that stands although its runs ask for a model form, which it has not."""
    told = f"the runs ask for a model form of {size:.0e}, the fit with it failed: {why}"
    return replace(
        result,
        message=f"{result.message}; {told}",
        uncertainty={**result.uncertainty, "form_failed": {"size": size, "reason": why}},
    )


def _without_form(
    problem: FitProblem,
    options: FitOptions,
    folder: str | os.PathLike[str] | None,
    resume: bool,
    watch: Callable[[int, float, float], None] | None,
    parts: NoiseParts | None,
    say: Callable[[str], None] | None = None,
    smoothed: Callable[[], np.ndarray | None] = lambda: None,
    filtered: Filtered = lambda problem, tick: None,
) -> tuple[FitProblem, Fit, CoefficientPosterior | None]:
    """`weighted_fit` for the parameters the problem has."""
    arrived = _first(problem, options, folder, resume, watch, say, smoothed)
    first = arrived.fit
    if parts is None and _remembers(problem, first):
        told = _filtered_fit(problem, first, options, watch, filtered)
        if told is not None:
            return told
    if not options.profile and not (parts is not None and parts.white) and _missed(first):
        first = _balanced(problem, options, arrived, folder, resume, watch)
    problem = problem.with_sigma(first.sigma)
    result, posterior = first, _posterior(problem, first.z, parts, options.seed)
    weight = 1.0
    for number in range(1, ROUNDS + 1):
        if posterior is None:
            break
        if abs(np.log(posterior.parts.weight / weight)) < SAME_WEIGHT:
            break
        weight = posterior.parts.weight
        started = replace(
            weighed(problem, weight),
            params=problem.params.started_at(result.z[: result.n_params]),
        )
        below = None if folder is None else Path(folder) / f"weighted_{number}"
        try:
            again = fit(started, replace(options, profile=False, starts=1), below, resume, watch, store=False)
        except (FitError, ModelError):  # it diverges; the round before stands
            break
        if not again.converged:
            break
        found = _posterior(problem, again.z, parts, options.seed)
        if found is None:
            break
        result, posterior = again, found
    if parts is None and posterior is not None and posterior.parts.efficient:
        if result.converged:
            result, posterior = _by_scores(problem, result, posterior, options.seed)
        else:  # the estimate stays where the search stopped, and so does its interval
            one_power = replace(posterior.parts, efficient=False)
            posterior = _posterior(problem, result.z, one_power, options.seed)
    return problem, _told(problem, first, result, posterior), posterior


@dataclass(frozen=True, eq=False)
class _Arrived:
    """A search, and the unknowns it began at; None for the start values."""

    fit: Fit
    begin: np.ndarray | None


def _first(
    problem: FitProblem,
    options: FitOptions,
    folder: str | os.PathLike[str] | None,
    resume: bool,
    watch: Callable[[int, float, float], None] | None,
    say: Callable[[str], None] | None,
    smoothed: Callable[[], np.ndarray | None],
) -> _Arrived:
    """Search with the stated noise; where it does not converge, or ends worse than another one begins, that
    one too, and the likelier end.

    Whole runs of a vehicle that rolls and pitches amplify errors of its coefficients: there the first search
    begins at the smoothed path, where that is nearer the readings, and the second at the start values. In the
    plane it is the other way round, so that a fit that arrives from the start values is what it was; but an
    end that misses the readings is no end where the smoothed path is nearer to them (a boat that turns on the
    spot, one thruster 15 % weak: the search from no loss stopped at a loss of 0.002 %, headings turns off).
    """

    def lower() -> np.ndarray | None:
        before = problem.cost(problem.start)
        if watch is not None:
            watch(0, before, 0.0)
        begin = smoothed()
        return begin if begin is not None and problem.cost(begin) < before else None

    led = problem.model.dof == 6
    begin = lower() if led else None
    first = fit(problem, options, folder, resume, watch, store=False, say=say, begin=begin)
    if first.converged and (led or options.profile or not _missed(first)):
        return _Arrived(first, begin)
    other = None if led else lower()
    if begin is None and other is None:
        return _Arrived(first, begin)
    if first.converged and other is not None and not problem.cost(other) < first.cost:
        return _Arrived(first, begin)
    below = None if folder is None else Path(folder) / "second"
    try:
        again = fit(problem, replace(options, starts=1), below, resume, watch, store=False, begin=other)
    except (FitError, ModelError):
        return _Arrived(first, begin)
    # costs of estimated noise are each in their own; of two ends in the same valley the one that arrived
    gain = minus_log_likelihood(problem, first) - minus_log_likelihood(problem, again)
    if gain > SAME_VALLEY or (gain > -SAME_VALLEY and again.converged):
        again = replace(again, seconds=first.seconds + again.seconds, starts=(*first.starts, *again.starts))
        return _Arrived(again, other)
    return _Arrived(replace(first, seconds=first.seconds + again.seconds), begin)


def _filtered_fit(
    problem: FitProblem,
    first: Fit,
    options: FitOptions,
    watch: Callable[[int, float, float], None] | None,
    filtered: Filtered,
) -> tuple[FitProblem, Fit, CoefficientPosterior] | None:
    """The fit by a filter, of the problem with one noise per channel; None where there is none, for a single
    run, and where left-out runs are predicted better by what the search found: a servo that is late looks
    like a random force to a filter, coefficients imitate it in runs to come (heading of a held-out run 0.9
    degrees off instead of 3.6).
    """
    if len(set(groups([run.name for run in problem.runs]))) < 2:
        return None
    began = time.perf_counter()
    even = problem.with_sigma(_common_noise(problem))
    estimate = filtered(even, (lambda: None) if watch is None else (lambda: watch(0, first.cost, 0.0)))
    told = None if estimate is None else fit_by_filter(even, first, estimate, options)
    if told is None:
        return None
    result, posterior = told
    found = _posterior(problem.with_sigma(first.sigma), first.z, None, options.seed)
    if found is not None:
        judge = even.with_sigma({c: max(s, first.channel_rms[c]) for c, s in result.sigma.items()})
        rivals = [left_out_misfits(judge, z, own) for z, own in ((result.z, posterior), (first.z, found))]
        if predicts_worse(*rivals):
            return None
    took = time.perf_counter() - began
    uncertainty = {**result.uncertainty, "filter_seconds": took}
    return even, replace(result, seconds=first.seconds + took, uncertainty=uncertainty), posterior


def _common_noise(problem: FitProblem) -> dict[str, float]:
    """Root mean square over runs of the noise of every channel: where none is stated each run has its own."""
    squares: dict[str, list[float]] = {}
    for run in problem.runs:
        for channel, sigma in zip(run.channels, run.sigma, strict=True):
            squares.setdefault(channel, []).append(float(sigma) ** 2)
    return {channel: float(np.sqrt(np.mean(values))) for channel, values in squares.items()}


def _remembers(problem: FitProblem, first: Fit) -> bool:
    """Whether residuals of a search have memory, or cannot be simulated where it ended."""
    try:
        return scores_and_noise(problem.with_sigma(first.sigma), first.z)[1].order > 0
    except ModelError:
        return True


def _by_scores(
    problem: FitProblem, result: Fit, posterior: CoefficientPosterior, seed: int
) -> tuple[Fit, CoefficientPosterior]:
    """The fit moved to where its scores, weighed by their own covariance, balance the prior.

    Where the steps do not arrive the fit stays with the power of its search, and its interval is of that.
    """
    parts = posterior.parts
    try:
        scores, noise = scores_and_noise(problem, result.z)
        moved = efficient_estimate(problem, result.z, noise, parts, scores)
        if moved is not None:
            again = posterior_of_scores(problem, moved.z, moved.scores, noise.order, parts, seed)
            k = result.n_params
            z = np.concatenate([np.clip(again.mean, again.low, again.high), moved.z[k:]])
            return replace(result, z=with_settled_starts(problem, z)), again
    except ModelError:  # it diverges there
        pass
    return result, coefficient_posterior(problem, result.z, replace(parts, efficient=False), seed)


def weighed(problem: FitProblem, weight: float) -> FitProblem:
    """The problem with the likelihood of its readings to a power: white noise larger by its root."""
    return replace(problem, runs=tuple(replace(r, sigma=r.sigma / np.sqrt(weight)) for r in problem.runs))


def _missed(found: Fit) -> bool:
    return any(rms > MISFIT * found.sigma[c] for c, rms in found.channel_rms.items())


def _balanced(
    problem: FitProblem,
    options: FitOptions,
    arrived: _Arrived,
    folder: str | os.PathLike[str] | None,
    resume: bool,
    watch: Callable[[int, float, float], None] | None,
) -> Fit:
    """Fit from where the first one began whose channels weigh as their residuals do, at most as their stated
    noise."""
    first = arrived.fit
    below = None if folder is None else Path(folder) / "balanced"
    try:
        profiled = replace(options, profile=True)
        found = fit(problem, profiled, below, resume, watch, store=False, begin=arrived.begin)
    except (FitError, ModelError):
        return first
    if not found.converged:
        return first
    sigma = {c: max(s, first.sigma[c]) for c, s in found.sigma.items()}
    if sigma != found.sigma:
        started = problem.with_params(problem.params.started_at(found.z[: found.n_params])).with_sigma(sigma)
        below = None if below is None else below / "limited"
        try:
            limited = fit(started, replace(options, starts=1), below, resume, watch, store=False)
        except (FitError, ModelError):
            return first
        found = replace(limited, start=found.start, seconds=found.seconds + limited.seconds)
    return replace(
        found,
        digest=first.digest,
        cost_start=problem.with_sigma(sigma).cost(problem.start),
        sigma=sigma,
        seconds=first.seconds + found.seconds,
        uncertainty={"noise_raised": {c: s / first.sigma[c] for c, s in sigma.items() if s > first.sigma[c]}},
    )


def _posterior(
    problem: FitProblem, z: np.ndarray, parts: NoiseParts | None, seed: int
) -> CoefficientPosterior | None:
    try:
        return coefficient_posterior(problem, z, parts, seed)
    except ModelError:
        return None


def _along_ridges(
    problem: FitProblem,
    result: Fit,
    posterior: CoefficientPosterior,
    seed: int,
    watch: Callable[[int, float, float], None] | None,
) -> Fit:
    """The fit with the errors of ridges that bend; predictions and the sampler keep the linear law."""
    k = result.n_params
    told = nonlinear_covariance(
        weighed(problem, posterior.parts.weight), result.z, posterior.covariance, seed,
        held=[i for i, n in enumerate(result.names[:k]) if n in result.at_bound],
        tick=lambda: watch(0, result.cost, 0.0) if watch else None,
    )  # fmt: skip
    if not told.pairs:
        told_so = {"nonlinear": told.record()} if told.lost else {}
        return replace(result, uncertainty={**result.uncertainty, **told_so})
    sd = np.array(result.sd)
    sd[:k] = np.sqrt(np.diag(told.covariance))
    uncertainty = {**result.uncertainty, "nonlinear": told.record()}
    return replace(result, sd=sd, covariance=told.covariance, uncertainty=uncertainty)


def _told(
    problem: FitProblem,
    first: Fit,
    result: Fit,
    posterior: CoefficientPosterior | None,
) -> Fit:
    """The fit of the last round in the words and weights of the first."""
    if posterior is None:
        return first
    k = first.n_params
    sd = np.array(result.sd)
    sd[:k] = posterior.sd
    message = first.message
    if posterior.parts.efficient:
        message = f"{result.message}; then every run weighed by the covariance of its score"
    elif result is not first:
        message = (
            f"{result.message}; the readings weigh {100 * posterior.parts.weight:.2g} % beside the prior"
        )
    return replace(
        result,
        start=first.start,
        sd=sd,
        covariance=posterior.covariance,
        cost_start=first.cost_start,
        cost=problem.cost(result.z),
        sigma=first.sigma,
        channel_rms=problem.channel_rms(result.z),
        message=message,
        digest=first.digest,
        costs=first.costs,
        steps=first.steps,
        seconds=first.seconds + (result.seconds if result is not first else 0.0),
        uncertainty={**first.uncertainty, **posterior.record()},
    )
