"""The estimate that weighs every score by its own covariance: when it is taken, where it is, how sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.composite import Composite, RunScore
from bayesid.estimation.likelihood.model_form import SIZES
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import (
    LEFT_OUT_P,
    better,
    composite_of,
    scores_and_noise,
    with_weight,
)
from bayesid.estimation.likelihood.residual_noise import MOST_ORDER, residual_noise
from bayesid.estimation.likelihood.score_step import efficient_estimate, with_settled_starts
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.output_error import FitOptions, FitProblem, fit
from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, remembering, setting

STATED = FitOptions(profile=False)


def coloured_runs(rng, prior_sd=1.0, count=6, k=4):
    """Composite of linear runs whose scores are loud in some directions only, and the truth."""
    truth = prior_sd * rng.standard_normal(k)
    noise_scale = np.geomspace(1.0, 30.0, k)
    runs = []
    for i in range(count):
        x = rng.standard_normal((40, k))
        h = x.T @ x
        runs.append(
            RunScore(
                f"r{i}",
                h,
                h * np.outer(noise_scale, noise_scale),
                h @ truth + noise_scale * (x.T @ rng.standard_normal(40)),
            )
        )
    return Composite(tuple(runs), np.eye(k) / prior_sd**2, np.zeros(k), np.full(k, prior_sd)), truth


def test_scores_weighed_by_their_covariance_err_least_and_hold_what_they_say():
    error = {}
    for name in ("efficient", "power"):
        z, squares = [], []
        for seed in range(400):
            composite, truth = coloured_runs(np.random.default_rng([1, seed]))
            parts = NoiseParts(1, weight=0.05, efficient=name == "efficient")
            law = composite.law(parts)
            z.append((law.mean - truth) / np.sqrt(np.diag(law.covariance)))
            squares.append((law.mean - truth) ** 2)
            if parts.efficient:
                assert law.covariance == pytest.approx(composite.prior_kept(parts), rel=1e-6)
        assert np.mean(np.abs(z) < 1.645) == pytest.approx(0.9, abs=0.03)  # both: 1600 intervals
        error[name] = np.mean(squares)
    assert error["efficient"] < 0.7 * error["power"]


def test_a_power_is_taken_only_where_left_out_runs_speak_for_it():
    taken = {}
    for off in (1.0, 30.0):  # truth over the prior's sd: a prior that is right, one that is too narrow
        chosen = []
        for seed in range(60):
            composite, _ = coloured_runs(np.random.default_rng([2, seed]), prior_sd=off)
            narrow = replace(composite, prior_precision=np.eye(4), spread=np.ones(4))
            chosen.append(with_weight(narrow, NoiseParts(1)).efficient)
        taken[off] = 1.0 - np.mean(chosen)
    assert taken[1.0] <= 0.1  # LEFT_OUT_P
    assert taken[30.0] >= 0.6  # control: four directions, six runs, and 30 times what the prior allows


def test_white_noise_has_its_one_answer():
    composite, _ = coloured_runs(np.random.default_rng(3))
    parts = with_weight(composite.as_white(), NoiseParts())
    assert parts.white and not parts.efficient and parts.weight == 1.0


def test_costs_that_chance_makes_smaller_are_not_better():
    rng = np.random.default_rng(4)
    said = [better(rng.standard_normal(4), rng.standard_normal(4)) for _ in range(2000)]
    assert np.mean(said) == pytest.approx(LEFT_OUT_P, abs=0.03)
    assert better(np.zeros(4), np.array([3.0, 4.0, 5.0, 4.0]))


@pytest.fixture(scope="module")
def rough():
    """A campaign of two runs in a rough sea, its truth and its setting."""
    s = setting((10.0, 20.0))
    rng = np.random.default_rng(5)
    truth = drawn_truth(s, rng)
    return s, truth, campaign(s, Condition(force=3e-5), truth, rng)


def test_a_fit_in_a_rough_sea_stands_where_its_scores_balance_the_prior(rough):
    s, _, trial = rough
    problem, found, posterior = weighted_fit(problem_of(s, trial), STATED)
    k = found.n_params
    assert posterior.parts.efficient and "covariance of its score" in found.message
    np.testing.assert_allclose(found.z[:k], np.clip(posterior.mean, posterior.low, posterior.high))
    assert (np.abs(posterior.mean - posterior.estimate) < 0.1 * posterior.sd).all()
    assert (posterior.sd <= posterior.prior_sd * (1 + 1e-9)).all()
    # its initial states suit it: those of one more step are the same
    again = with_settled_starts(problem, found.z)
    spread = np.concatenate([run.initial_sd for run in problem.runs])
    assert (np.abs(again[k:] - found.z[k:]) < 1e-3 * spread).all()


def test_steps_from_an_estimate_lower_the_sum_of_weighed_scores(rough):
    s, _, trial = rough
    problem = problem_of(s, trial)
    z = fit(problem, STATED).z
    scores, noise = scores_and_noise(problem, z)
    parts = NoiseParts(noise.order, efficient=True)
    found = efficient_estimate(problem, z, noise, parts)
    assert found is not None
    before, after = (composite_of(problem, at, some).law(parts).mean for at, some in ((z, scores), found))
    sd = np.sqrt(np.diag(composite_of(problem, *found).law(parts).covariance))
    assert np.abs(before / sd).max() > 0.3  # white noise's estimate is another one
    assert np.abs(after / sd).max() < 0.1


def test_a_vehicle_that_diverges_on_the_way_keeps_its_estimate(rough, monkeypatch):
    s, _, trial = rough
    problem = problem_of(s, trial)
    _, noise = scores_and_noise(problem, problem.start)
    start = problem.start
    block = FitProblem.run_blocks

    def only_there(self, z):
        if not np.array_equal(z, start):
            raise ModelError("diverges")
        return block(self, z)

    monkeypatch.setattr(FitProblem, "run_blocks", only_there)
    assert efficient_estimate(problem, start, noise, NoiseParts(noise.order, efficient=True)) is None


def test_the_order_of_slow_errors_under_white_noise_is_not_cut_short():
    rng = np.random.default_rng(6)
    slow = [(0.7 * remembering(rng, 800, 25.0) + rng.standard_normal(800))[:, None] for _ in range(4)]
    seen = [np.ones((800, 1), dtype=bool)] * 4
    noise = residual_noise(slow, seen, MOST_ORDER)
    assert noise.order >= 3
    # variance of a mean over 200 samples, of which an autoregression of order 1 shows a part
    long = noise.covariance(200)[:, 0, 0]
    mean = (long[0] + 2 * ((1 - np.arange(1, 200) / 200) * long[1:]).sum()) / 200
    first = residual_noise(slow, seen, 1).covariance(200)[:, 0, 0]
    short = (first[0] + 2 * ((1 - np.arange(1, 200) / 200) * first[1:]).sum()) / 200
    true = np.exp(-np.arange(200) / 25.0) * 0.49
    true[0] += 1.0
    wanted = (true[0] + 2 * ((1 - np.arange(1, 200) / 200) * true[1:]).sum()) / 200
    assert abs(np.log(mean / wanted)) < abs(np.log(short / wanted))


def test_white_residuals_have_no_memory():
    rng = np.random.default_rng(7)
    orders = [
        residual_noise([rng.standard_normal((400, 3))], [np.ones((400, 3), dtype=bool)]).order
        for _ in range(60)
    ]
    assert np.mean(np.array(orders) > 0) < 0.05


def test_sizes_of_a_form_are_close_enough_to_be_averaged():
    assert max(np.diff(np.log(SIZES))) < np.log(2.1)
