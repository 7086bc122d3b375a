"""Draws that end at bounds: against scipy's truncated normal, and in the model a fit predicts with."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

from bayesid.diagnosis.diagnosed_file import (
    read_diagnosed,
    remove_fitted,
    write_diagnosed,
    write_why_not,
)
from bayesid.errors import ModelError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.trial_fit import fit_trial
from bayesid.estimation.truncated_normal import about_each, within_bounds
from bayesid.model.params import ParameterSet
from bayesid.prediction.fitted_model import with_disturbance
from studies.coverage.campaigns import Condition, campaign, drawn_truth, setting


def gaussian(mean, covariance, count, rng):
    return rng.multivariate_normal(mean, covariance, size=count)


@pytest.mark.parametrize("mean", [-6.0, -1.0, 0.2, 4.0])
def test_draws_of_one_parameter_follow_the_truncated_normal(mean):
    rng = np.random.default_rng(1)
    mean, covariance = np.array([2.0 * mean]), np.array([[4.0]])
    low, high = np.array([-1.0]), np.array([3.0])
    found = within_bounds(gaussian(mean, covariance, 4000, rng), mean, covariance, low, high, rng)
    exact = truncnorm((low - mean)[0] / 2, (high - mean)[0] / 2, mean[0], 2.0)
    assert kstest(found[:, 0], exact.cdf).pvalue > 1e-3


def test_a_bound_on_one_parameter_moves_those_that_go_with_it():
    rng = np.random.default_rng(2)
    mean, covariance = np.zeros(2), np.array([[1.0, 0.8], [0.8, 1.0]])
    low, high = np.array([0.5, -np.inf]), np.full(2, np.inf)
    found = within_bounds(gaussian(mean, covariance, 6000, rng), mean, covariance, low, high, rng)
    kept = gaussian(mean, covariance, 200_000, rng)
    kept = kept[kept[:, 0] > 0.5]  # by rejection
    assert found[:, 0].min() >= 0.5
    assert found.mean(axis=0) == pytest.approx(kept.mean(axis=0), abs=0.04)
    assert np.cov(found.T) == pytest.approx(np.cov(kept.T), abs=0.05)


def test_draws_inside_are_left_as_they_are():
    rng = np.random.default_rng(3)
    drawn = gaussian(np.zeros(2), np.eye(2), 50, rng)
    free = np.full(2, np.inf)
    assert within_bounds(drawn, np.zeros(2), np.eye(2), -free, free, rng) is drawn


def test_draws_about_a_point_follow_the_truncated_normal_there():
    rng = np.random.default_rng(4)
    centres = np.repeat([[-1.0, 0.5, 2.0], [0.0, 0.5, 2.0]], 4000, axis=0)
    low, high = np.array([-1.0, -np.inf, 0.0]), np.array([np.inf, np.inf, 5.0])
    found = about_each(centres, np.array([2.0, 3.0, 0.0]), low, high, rng)
    assert np.array_equal(found[:, 2], centres[:, 2])  # no deviation
    assert kstest(found[:4000, 0], truncnorm(0.0, np.inf, -1.0, 2.0).cdf).pvalue > 1e-3
    assert kstest(found[4000:, 0], truncnorm(-0.5, np.inf, 0.0, 2.0).cdf).pvalue > 1e-3
    assert kstest(found[:, 1], norm(0.5, 3.0).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(found[:4000, :2].T)[0, 1]) < 0.06


@pytest.fixture(scope="module")
def at_bound():
    """A fit whose N_dr ends on its upper, N_r on its lower bound."""
    s, rng = setting(), np.random.default_rng(7)
    truth = drawn_truth(s, rng)
    trial = campaign(s, Condition(), truth, rng)
    par = dict(zip(s.params.names, truth, strict=True))
    few = ParameterSet(tuple(p for p in s.params.entries if p.name in ("N_dr", "N_r", "Y_v")))
    for name, side, sign in (("N_dr", "high", -1.0), ("N_r", "low", 1.0)):
        edge = par[name] + sign * 0.02 * abs(par[name])
        begin = edge + sign * 0.02 * abs(par[name])
        few = few.changed([name], prior=None, start=begin, **{side: edge})
    return fit_trial(
        trial, s.model.vehicle, params=few, threads=1, parts=NoiseParts(), options=FitOptions(profile=False)
    )


def test_draws_of_a_fit_on_its_bounds_stay_within_them_in_memory_and_from_the_file(at_bound, tmp_path):
    assert set(at_bound.fit.at_bound) == {"N_dr", "N_r"}
    posterior = at_bound.posterior
    drawn = posterior.draws(400, np.random.default_rng(0))
    assert np.all((drawn >= posterior.low) & (drawn <= posterior.high))
    posterior = replace(posterior, run_sd=0.5 * posterior.sd)  # single runs stay within them as well
    model = with_disturbance(at_bound, posterior, np.full(3, 1e-5), 2.0)
    assert np.array_equal(model.hypotheses[0].covariance, posterior.covariance)
    write_diagnosed(model, tmp_path)
    where = model.model.positions(posterior.names)
    h, free = model.hypotheses[0], np.full(len(posterior.names), np.inf)
    unbounded = replace(model, hypotheses=(replace(h, low=-free, high=free),))
    beyond = unbounded.draw(np.random.default_rng(0), 400)[0][1][:, where]
    assert np.mean(np.any((beyond < posterior.low) | (beyond > posterior.high), axis=1)) > 0.3
    for one in (model, read_diagnosed(tmp_path)):
        pars = one.draw(np.random.default_rng(0), 400)[0][1][:, where]
        assert np.all((pars >= posterior.low) & (pars <= posterior.high))
        assert np.all(pars.std(axis=0) > 0)


@pytest.mark.parametrize("bounds", [[-1e30] * 3, [1e30], "none", [[1.0], 2.0, 3.0]])
def test_bounds_that_are_none_are_refused(at_bound, tmp_path, bounds):
    path = write_diagnosed(with_disturbance(at_bound, at_bound.posterior, np.full(3, 1e-5), 2.0), tmp_path)
    record = json.loads(path.read_text())
    record["hypotheses"][0]["high"] = bounds
    path.write_text(json.dumps(record))
    with pytest.raises(ModelError, match=r"model\.json"):
        read_diagnosed(tmp_path)


@pytest.mark.parametrize(
    ("beside", "told"),
    [
        ("fit.json", "without --quick"),
        ("diagnosis.json", "could not make one"),
        (None, "bayesid diagnose BUNDLE"),
    ],
)
def test_a_folder_without_a_model_says_why_and_what_writes_one(tmp_path, beside, told):
    if beside:
        (tmp_path / beside).write_text("{}")
    with pytest.raises(ModelError, match="cannot be read") as found:
        read_diagnosed(tmp_path)
    assert told in str(found.value)


def test_why_a_fit_left_no_model_is_said_where_one_is_asked_for_until_there_is_one(tmp_path):
    (tmp_path / "fit.json").write_text("{}")
    write_why_not(tmp_path, "every draw diverges")
    with pytest.raises(ModelError, match="the fit in this folder wrote none: every draw diverges"):
        read_diagnosed(tmp_path)
    remove_fitted(tmp_path)
    with pytest.raises(ModelError, match="without --quick"):
        read_diagnosed(tmp_path)
