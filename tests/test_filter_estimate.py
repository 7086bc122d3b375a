"""The filter's estimate of a fit: taken where a random force acts, refused where something else errs."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from bayesid.estimation.filter_error.noise_model import force_unit
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood import weighted_fit as weighted_fit_module
from bayesid.estimation.likelihood.filter_estimate import FilterEstimate, filter_estimate
from bayesid.estimation.likelihood.filter_estimate import _memory_left as memory_left
from bayesid.estimation.likelihood.filtered_fit import fit_by_filter
from bayesid.estimation.likelihood.left_out_runs import predicts_worse
from bayesid.estimation.likelihood.posterior import composite_of
from bayesid.estimation.likelihood.run_information import RunInformation
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.output_error.search import fit
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.params import JointPrior, ParameterSet, Prior
from studies.coverage import campaigns
from studies.coverage.campaigns import (
    FORCE_MEMORY,
    Condition,
    campaign,
    drawn_truth,
    fitted,
    problem_of,
    setting,
)

STATED = FitOptions(profile=False)
SEA = 1e-4  # of 1/2 rho L^2 U^2


def small():
    """Ten coefficients of sway, yaw and surge, the others as they are."""
    s = setting()
    names = ("X_u|u|", "Y_v", "Y_r", "Y_dr", "N_v", "N_r", "N_dr", "X_vr", "Y_v|v|", "N_r|r|")
    return replace(s, params=ParameterSet(tuple(p for p in s.params.entries if p.name in names)))


@lru_cache
def case(force=SEA, memory=0.0, seed=3):
    """Setting, truth, campaign in a sea or with noise that remembers so many samples, its problem."""
    s, rng = small(), np.random.default_rng([41, seed])
    truth = drawn_truth(s, rng)
    trial = campaign(s, Condition(force=force, memory=memory), truth, rng)
    return s, truth, trial, problem_of(s, trial)


@lru_cache
def estimate(force=SEA, memory=0.0, seed=3):
    _, _, trial, problem = case(force, memory, seed)
    return filter_estimate(problem, trial.identify)


def test_force_and_coefficients_of_a_sea_are_found():
    s, truth, _, problem = case()
    found = estimate()
    size = np.array(found.noise.force) / force_unit(s.model)
    assert size == pytest.approx(SEA, rel=0.4)
    assert found.noise.force_tau == pytest.approx(FORCE_MEMORY * s.time, rel=0.4)
    posterior = found.posterior(problem, found.unknowns())
    z = (posterior.mean - truth) / posterior.sd
    assert np.sqrt(np.mean(z**2)) < 1.6 and np.median(posterior.sd / posterior.prior_sd) < 0.8


@pytest.mark.thorough
def test_its_scores_balance_the_prior_where_it_ended():
    _, _, _, problem = case()
    found = estimate()
    composite = composite_of(problem, found.unknowns(), found.scores)
    score = composite.prior_score + sum(run.score for run in found.scores)
    information = composite.prior_precision + sum(run.information for run in found.scores)
    step = np.linalg.solve(information, score)
    assert np.abs(step / np.sqrt(np.diag(np.linalg.inv(information)))).max() < 0.05
    alone = [np.linalg.norm(run.score) for run in found.scores]
    assert np.linalg.norm(sum(run.score for run in found.scores)) < 0.3 * sum(
        alone
    )  # no run is at rest alone


@pytest.mark.thorough
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_noise_of_sensors_that_is_misstated_is_refused(factor):
    """Innovations are then not of the size they should be."""
    _, _, trial, problem = case()
    wrong = problem.with_sigma({c: factor * s for c, s in trial.noise.items()})
    assert filter_estimate(wrong, trial.identify) is None


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_sensors_that_remembers_is_refused(seed):
    assert estimate(0.0, 10.0, seed) is None


@pytest.mark.thorough
def test_a_force_that_lasts_as_long_as_a_run_is_no_sea(monkeypatch):
    """Innovations beside it are white, too: a cause is missing."""
    monkeypatch.setattr(campaigns, "FORCE_MEMORY", 100.0)
    s, rng = small(), np.random.default_rng(5)
    trial = campaign(s, Condition(force=SEA), drawn_truth(s, rng), rng)
    assert filter_estimate(problem_of(s, trial), trial.identify) is None


def sparse(memory, seed=2):
    """Innovations white in one channel; in another, read at every tenth sample, with so much memory."""
    rng, n = np.random.default_rng(seed), 6000
    resid, valid = rng.standard_normal((n, 2)), np.ones((n, 2), dtype=bool)
    valid[:, 1] = np.arange(n) % 10 == 0
    read = np.flatnonzero(valid[:, 1])
    for before, at in zip(read[:-1], read[1:], strict=True):
        resid[at, 1] = memory * resid[before, 1] + np.sqrt(1.0 - memory**2) * resid[at, 1]
    resid[~valid] = 0.0
    return [RunInformation("a", resid, valid, np.zeros((n, 2, 1)), np.zeros((0, 1)), np.zeros(1))]


@pytest.mark.parametrize(("memory", "white"), [(0.0, True), (0.5, False), (0.9, False)])
def test_memory_of_a_channel_that_is_read_seldom_is_seen(memory, white):
    assert (memory_left(sparse(memory)) is not None) is white


@pytest.mark.thorough
def test_an_upper_bound_holds():
    s, _, trial, problem = case()
    i = [p.name for p in s.params].index("N_dr")
    sd = estimate().posterior(problem, estimate().unknowns()).sd[i]
    most = estimate().values[i] - 0.5 * sd
    entries = tuple(
        replace(p, start=min(p.start, most), high=most) if p.name == "N_dr" else p for p in s.params
    )
    found = filter_estimate(problem.with_params(ParameterSet(entries)), trial.identify)
    assert found.values[i] == pytest.approx(most)


@pytest.mark.thorough
def test_a_prior_that_moves_the_estimate_further_than_a_line_holds_is_left_to_output_error():
    """The filter's prior lies about the start, not about a centre elsewhere."""
    s, _, _, problem = case()
    first, found = fit(problem, STATED), estimate()
    assert fit_by_filter(problem, first, found, STATED) is not None
    sd = found.posterior(problem, found.unknowns()).sd
    entries = tuple(
        replace(p, prior=Prior("normal", v + 20.0 * d, d))
        for p, v, d in zip(s.params, found.values, sd, strict=True)
    )
    assert fit_by_filter(problem.with_params(ParameterSet(entries)), first, found, STATED) is None


@pytest.mark.thorough
def test_what_an_earlier_campaign_told_of_coefficients_together_counts_in_the_filter():
    """The filter took a joint prior for its marginals, and ended elsewhere."""
    s, truth, _, problem = case()
    first, earlier = fit(problem, STATED), estimate()
    _, told = fit_by_filter(problem, first, earlier, STATED)
    sd = np.sqrt(np.diag(told.covariance))
    assert (
        np.linalg.eigvalsh(told.covariance / np.outer(sd, sd)).min() < 0.1
    )  # some are known as combinations
    entries = tuple(replace(p, start=float(v), prior=None) for p, v in zip(s.params, told.mean, strict=True))
    known = ParameterSet(entries, JointPrior(s.params.names, told.mean.copy(), told.covariance))
    later = campaign(s, Condition(force=SEA), truth, np.random.default_rng([41, 77]))
    problem = problem_of(replace(s, params=known), later)
    found = filter_estimate(problem, later.identify)
    composite = composite_of(problem, found.unknowns(), found.scores)
    score = composite.prior_score + sum(run.score for run in found.scores)
    covariance = np.linalg.inv(composite.prior_precision + sum(run.information for run in found.scores))
    assert np.abs(covariance @ score / np.sqrt(np.diag(covariance))).max() < 0.05


@pytest.mark.thorough
def test_scores_that_count_for_less_carry_less_information(monkeypatch):
    _, _, _, problem = case()
    first, found = fit(problem, STATED), estimate()
    result, plain = fit_by_filter(problem, first, found, STATED)
    assert plain.estimate == pytest.approx(result.z[: result.n_params])  # where the fit ends
    loud = replace(found.posterior(problem, found.unknowns()), parts=NoiseParts(excess=4.0, efficient=True))
    monkeypatch.setattr(FilterEstimate, "posterior", lambda *args: loud)
    _, told = fit_by_filter(problem, first, found, STATED)
    assert told.parts.share == pytest.approx(plain.parts.share / 4.0 * plain.parts.excess, rel=0.05)


@pytest.mark.thorough
def test_weights_from_the_residuals_are_not_those_of_a_filter():
    """`--estimate-noise` asks for output error weighed by its own residuals."""
    s, _, trial, _ = case()
    found = fit_trial(trial, s.model.vehicle, params=s.params, options=FitOptions(profile=True), threads=1)
    assert found.posterior.parts.disturbance == 0.0
    assert fit_trial(trial, s.model.vehicle, params=s.params, threads=1).posterior.parts.disturbance > 0.0


@pytest.mark.thorough
def test_a_tied_parameter_is_left_to_output_error():
    s, _, trial, problem = case()
    entries = list(s.params.entries)
    tied = replace(entries[1], role="tied", tie=(entries[0].name, 1.0, 0.0), prior=None)
    assert filter_estimate(problem.with_params(ParameterSet((entries[0], tied))), trial.identify) is None


@pytest.mark.thorough
def test_a_fit_in_a_sea_is_the_filters_and_says_so():
    s, truth, trial, _ = case()
    _, found, posterior = fitted(s, trial, STATED)
    assert found.converged and "filter" in found.message
    assert posterior.parts.disturbance == pytest.approx(estimate().noise.force_tau)
    assert "a random force that lasts" in posterior.parts.describe() and not posterior.parts.white
    assert 0.0 < posterior.parts.share < 0.5  # of what white noise would tell
    assert found.uncertainty["filter"]["force"] == pytest.approx(estimate().noise.force)
    assert found.sd[: truth.size] == pytest.approx(posterior.sd)
    assert np.all(posterior.white_sd < posterior.sd)


@pytest.mark.thorough
def test_readings_that_nothing_moves_are_fitted_as_before():
    """White noise: the filter is not asked."""
    _, _, _, problem = case(0.0)
    asked = []
    _, plain, _ = weighted_fit(problem, STATED)
    _, found, posterior = weighted_fit(problem, STATED, filtered=lambda even, tick: asked.append(1))
    assert not asked and np.array_equal(found.z, plain.z) and posterior.parts.white


@pytest.mark.thorough
def test_where_the_filter_is_refused_the_fit_is_as_without_it():
    s, _, trial, problem = case(0.0, 10.0, 0)
    _, plain, _ = weighted_fit(problem, STATED)
    _, found, posterior = fitted(s, trial, STATED)
    assert np.array_equal(found.z, plain.z) and posterior.parts.disturbance == 0.0


@pytest.mark.slow
def test_intervals_in_a_sea_hold_the_truth_and_are_narrower_than_those_of_output_error():
    z, ratio = [], []
    for seed in range(16):
        s, truth, trial, problem = case(3e-4, 0.0, seed)
        _, _, posterior = fitted(s, trial, STATED)
        assert posterior.parts.disturbance > 0.0
        _, _, other = weighted_fit(problem, STATED)
        z.append((posterior.mean - truth) / posterior.sd)
        ratio.append(posterior.sd / other.sd)
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.2
    assert np.median(ratio) < 0.95


def test_left_out_runs_tell_which_of_two_estimates_predicts_worse():
    same = np.array([3.0, 40.0, 500.0, 6000.0])
    assert not predicts_worse(same, same)
    assert predicts_worse(1.5 * same, same) and not predicts_worse(same, 1.5 * same)
    chance = same * np.array([2.0, 0.6, 1.5, 0.7])
    assert not predicts_worse(chance, same)
    assert predicts_worse(np.array([np.inf, 50.0, 600.0, 7000.0]), same)
    assert not predicts_worse(np.full(4, np.inf), np.full(4, np.inf))
    assert predicts_worse(1.01 * same[:2], same[:2]) and not predicts_worse(0.99 * same[:2], same[:2])


@pytest.mark.thorough
def test_a_single_run_is_left_to_output_error():
    """Nothing tells there whether runs to come are predicted."""
    s, _, trial, _ = case()
    one = replace(trial, runs=trial.runs[:1])
    _, found, posterior = fitted(s, one, STATED)
    assert posterior.parts.disturbance == 0.0 and "filter" not in found.message


@pytest.mark.thorough
def test_a_filter_whose_left_out_runs_are_predicted_worse_is_not_taken(monkeypatch):
    s, _, trial, problem = case()
    monkeypatch.setattr(weighted_fit_module, "predicts_worse", lambda one, other: True)
    _, found, posterior = fitted(s, trial, STATED)
    _, plain, _ = weighted_fit(problem, STATED)
    assert posterior.parts.disturbance == 0.0 and np.array_equal(found.z, plain.z)
