"""A sampled likelihood whose curvature is adjusted: against the interval of the fit and against the prior."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from bayesid.api.sample import sample as sample_trial
from bayesid.errors import SampleError
from bayesid.estimation.likelihood import NoiseParts, coefficient_posterior
from bayesid.estimation.likelihood.weighted_fit import weighed, weighted_fit
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.sampling import SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.likelihood_adjustment import likelihood_adjustment
from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts
from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity
from bayesid.model.params import ParameterSet
from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, setting

SIX = ("Y_r", "Y_dr", "N_r", "N_v", "N_dr", "X_u|u|")
FIXED = SamplingSettings(noise="fixed", memory="ignore")
MEMORY, SPREAD, WIDE = "memory", "run-to-run spread", "large spread"
CONDITIONS = {
    MEMORY: Condition(memory=10.0),
    SPREAD: Condition(run_spread=0.3, memory=10.0),
    WIDE: Condition(run_spread=0.5),
}


@lru_cache
def fitted(condition, names=SIX):
    """Problem, fit and posterior of one campaign in which these coefficients, None for all, are unknown."""
    s = setting()
    if names is not None:
        s = replace(s, params=ParameterSet(tuple(p for p in s.params.entries if p.name in names)))
    rng = np.random.default_rng([31, 4])
    trial = campaign(s, CONDITIONS[condition], drawn_truth(s, rng), rng)
    return s, trial, *weighted_fit(problem_of(s, trial), FitOptions(profile=False))


def adjusted(condition, names=SIX, settings=FIXED):
    _, _, problem, found, posterior = fitted(condition, names)
    problem = weighed(problem, posterior.parts.weight)
    return trial_density(problem, found.z, settings, {}, (posterior.mean, posterior.covariance)), posterior


@pytest.mark.thorough
@pytest.mark.parametrize("condition", [MEMORY, SPREAD])
@pytest.mark.parametrize("initial", ["marginal", "sampled", "fixed"])
def test_the_adjusted_density_has_the_interval_of_the_fit(condition, initial):
    density, posterior = adjusted(condition, settings=replace(FIXED, initial=initial))
    assert not posterior.parts.white and (posterior.parts.run_spread > 0) == (condition == SPREAD)
    sd = np.sqrt(np.diag(density.laplace.covariance))[: posterior.sd.size]
    assert sd == pytest.approx(posterior.sd, rel=0.01)


@pytest.mark.thorough
def test_a_power_of_the_likelihood_alone_has_another_interval():
    _, _, problem, found, posterior = fitted(SPREAD)
    power = trial_density(weighed(problem, posterior.parts.share), found.z, FIXED, {})
    ratio = np.sqrt(np.diag(power.laplace.covariance)) / posterior.sd
    assert np.abs(np.log(ratio)).max() > 0.2


@pytest.mark.slow  # the density drawn from has this interval: held above, without draws
@pytest.mark.parametrize("condition", [MEMORY, SPREAD])
def test_bayesid_sample_gives_the_interval_of_the_fit_it_starts_from(condition, tmp_path):
    s, trial, *_ = fitted(condition)
    found = sample_trial(trial, tmp_path, s.model.vehicle, free=SIX, ensembles=2, max_steps=1000, seed=1)
    drawn, fit = found.posterior, found.found.posterior
    assert drawn.converged and drawn.names == fit.names  # no noise among the unknowns
    ess = drawn.convergence.ess_bulk
    # 0.05, 0.1: what the bend of the equations over the interval adds, in sd
    assert np.all(np.abs(drawn.sd / fit.sd - 1) < 4.5 / np.sqrt(ess) + 0.05)
    assert np.all(np.abs(drawn.mean - fit.mean) < fit.sd * (4.5 / np.sqrt(ess) + 0.1))


@pytest.mark.slow  # its density and its gradient are held to the same interval below and above, without draws
def test_nuts_draws_the_interval_of_the_fit_too():
    pytest.importorskip("nutpie")
    density, fit = adjusted(SPREAD)
    target = GradientTrialDensity(density)
    drawn = sample_nuts(target, density.laplace, NutsOptions(chains=2, tune=150, draws=250), threads=1)
    ess = drawn.convergence.ess_bulk
    assert np.all(np.abs(drawn.sd / fit.sd - 1) < 4.5 / np.sqrt(ess) + 0.05)
    assert np.all(np.abs(drawn.mean - fit.mean) < fit.sd * (4.5 / np.sqrt(ess) + 0.1))


@pytest.mark.parametrize("initial", ["marginal", "sampled"])
def test_the_gradient_of_an_adjusted_density_is_its_difference_quotient(initial):
    density, _ = adjusted(SPREAD, settings=replace(FIXED, initial=initial))
    sd = np.sqrt(np.diag(density.laplace.covariance))
    q = density.laplace.mode + 0.5 * sd * np.random.default_rng(2).standard_normal(sd.size)
    value, slope = GradientTrialDensity(density).log_prob_slope(q)
    assert value == pytest.approx(density.log_prob(q[None])[0], rel=1e-10)
    steps = 1e-4 * np.diag(sd)
    found = (density.log_prob(q + steps) - density.log_prob(q - steps)) / (2e-4)
    assert slope * sd == pytest.approx(found, abs=1e-3 * np.abs(found).max())


@pytest.mark.thorough
def test_where_the_fit_is_less_sure_than_the_prior_the_prior_stands():
    density, posterior = adjusted(WIDE, None)
    assert (posterior.sd > 1.5 * posterior.prior_sd).any()
    prior = np.diag(1.0 / posterior.prior_sd**2)
    scale = posterior.prior_sd
    unit = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(np.linalg.inv(posterior.covariance / unit) - np.eye(scale.size))
    assert (values < -0.1).any() and (values > 1.0).any()
    found = np.linalg.inv(density.laplace.covariance / unit)
    # no combination is surer than fit and prior allow, or less sure than the prior
    assert np.linalg.eigvalsh(found - prior * unit).min() > -1e-2
    assert np.linalg.eigvalsh(np.linalg.inv(posterior.covariance / unit) - found).max() < 0.05
    # along a combination of which the readings know nothing, the density is that of the prior
    worst = scale * vectors[:, 0]
    q = density.laplace.mode
    steps = q + np.array([-0.5, 0.0, 0.5])[:, None] * worst
    logs, priors = density.log_prob(steps), density.log_prior(density.natural(steps))
    bend = (logs - priors) @ [1, -2, 1] / abs(priors @ [1, -2, 1])
    assert abs(bend) < 0.3


@pytest.mark.thorough
@pytest.mark.parametrize("condition", [MEMORY, SPREAD, WIDE])
def test_the_estimate_of_the_fit_is_the_mode_also_where_readings_know_nothing(condition):
    """Slope of the density along its axes, per sd; it was 0.27 where runs differ much."""
    density, _ = adjusted(condition)
    steps = 0.05 * density.laplace.root.T
    up, down = (density.log_prob(density.laplace.mode + sign * steps) for sign in (1, -1))
    assert np.abs((up - down) / 0.1).max() < 0.03


@pytest.mark.thorough
def test_white_noise_at_full_weight_needs_no_adjustment():
    _, _, problem, found, _ = fitted(MEMORY)
    white = coefficient_posterior(problem, found.z, NoiseParts())
    k = white.sd.size
    none = likelihood_adjustment(problem, found.z, white.mean, white.covariance)
    unit = none.matrix / np.outer(white.sd, 1 / white.sd)
    assert np.abs(unit - np.eye(k)).max() < 1e-4
    assert np.abs(none.tilt * white.sd).max() < 1e-3


def test_an_adjusted_likelihood_takes_fixed_noise_and_tells_its_density_apart():
    _, _, problem, found, posterior = fitted(MEMORY)
    honest = posterior.mean, posterior.covariance
    with pytest.raises(SampleError, match="fixed"):
        trial_density(problem, found.z, SamplingSettings(), {}, honest)
    one = trial_density(problem, found.z, FIXED, {}, honest)
    other = trial_density(problem, found.z, FIXED, {}, (posterior.mean, 1.1 * posterior.covariance))
    assert len({one.digest, other.digest, trial_density(problem, found.z, FIXED, {}).digest}) == 3


@pytest.mark.slow
def test_all_seventeen_coefficients_have_the_interval_of_the_fit():
    density, fit = adjusted(MEMORY, None)
    drawn = sample(density, density.laplace, SamplerOptions(ensembles=2, max_steps=3000, seed=1))
    ess = drawn.convergence.ess_bulk
    assert np.all(np.abs(drawn.sd / fit.sd - 1) < 4.5 / np.sqrt(ess) + 0.05)
    assert np.all(np.abs(drawn.mean - fit.mean) < fit.sd * (4.5 / np.sqrt(ess) + 0.15))
