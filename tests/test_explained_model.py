"""Coefficients of an explanation stay as stated unless re-tuning predicts runs left out better."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.diagnosed_model import diagnosed_model_of
from bayesid.diagnosis.evidence import explained_model as module
from bayesid.diagnosis.evidence.explained_model import as_stated, explained_model
from bayesid.diagnosis.evidence.replay import misses
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.run import diagnose
from bayesid.estimation.filter_error.fit import fit

LAG = "actuator_lag"


@lru_cache
def refitted(seed, other):
    """Problem of a vehicle with a lagging rudder, its coefficients as stated or others, and its refit."""
    model = model_of()
    values = {f"{LAG}.tau": 0.5 * model.scales["L"] / model.scales["U"]}
    values |= other_vehicle(model, seed) if other else {}
    problem = build_problem(model, planted_trial(model, values, seed))
    return problem, weighted_hypothesis(problem, (LAG,), fit_with(problem, (model.effects[LAG],)))


@pytest.mark.thorough
def test_coefficients_that_are_wrong_are_re_tuned():
    """Three vehicles: one alone has three runs, over which the gain scatters by half of itself."""
    gains, errors = [], []
    for seed in (0, 1, 2):
        problem, refit = refitted(seed, True)
        found = explained_model(problem, refit)
        assert found.retuned == (found.gain > found.error)
        assert not found.retuned or found.fit is refit.fit
        gains.append(found.gain)
        errors.append(found.error)
    assert np.mean(gains) > 2.0 * np.linalg.norm(errors) / len(errors) > 0.0
    assert np.sum(np.greater(gains, errors)) >= 2


def test_coefficients_that_re_tuning_makes_worse_stay_as_stated():
    """Re-tuned to the runs of another vehicle: they fit those, not these."""
    problem, _ = refitted(0, False)
    _, strange = refitted(1, True)
    found = explained_model(problem, strange)
    assert not found.retuned and found.gain < 0.0
    assert found.fit.free.names == (f"{LAG}.tau",)
    where = problem.coefficients.where
    assert np.array_equal(found.fit.par[where], problem.model.nominal[where])


def of_the_day(signs):
    """Problem of true coefficients in a current that is another in every pair of runs, and the refit of one
    current for all."""
    model = model_of()
    runs = ()
    for i, sign in enumerate(signs):
        trial = planted_trial(model, {"ocean_current.V_north": 0.15 * sign * model.scales["U"]}, i)
        runs += tuple(replace(run, name=f"{run.name} {i}") for run in trial.runs)
    problem = build_problem(model, replace(trial, runs=runs))
    current = fit_with(problem, (model.effects["ocean_current"],))
    return problem, weighted_hypothesis(problem, ("ocean_current",), current)


@pytest.mark.thorough
def test_what_one_day_does_is_not_in_the_model_that_predicts_other_days():
    """One current for all runs goes with what the others had; the simulator as given goes with none. The
    control: the same in all runs."""
    problem, refit = of_the_day((1, -1, -1, 1))
    explained = explained_model(problem, refit)
    assert explained.effects == ("ocean_current",) and explained.given_gain < 0.0 < explained.given_error
    for named in (True, False):
        found = explained.predicting(named)
        assert found.as_given and found.effects == () and found.refused is explained.fit
        assert np.array_equal(found.fit.par, problem.model.nominal)
    steady, refit = of_the_day((1, 1))
    kept = explained_model(steady, refit)
    assert kept.given_gain > kept.given_error and not kept.predicting(False).as_given


def test_what_is_not_named_must_predict_better_by_a_standard_error_and_a_name_no_worse():
    problem, refit = refitted(0, False)
    explained = replace(explained_model(problem, refit), given_error=0.2)
    for gain, named, as_given in (
        (0.1, True, False), (0.1, False, True), (0.3, False, False), (-0.1, True, True),
        (np.nan, False, False),
    ):  # fmt: skip
        assert replace(explained, given_gain=gain).predicting(named).as_given is as_given


def test_re_tuned_coefficients_alone_predict_where_runs_left_out_ask_for_them():
    problem, refit = refitted(0, False)
    shown = replace(explained_model(problem, refit), retuned=False, left=[np.full(3, 2.0), np.full(3, 3.0)])
    better = [np.full(3, 1.0), np.full(3, 1.2)]
    coefficients = replace(shown, effects=(), fit=replace(refit.fit), retuned=True, left=better)
    alone = shown.or_retuned(coefficients)
    assert alone.coefficients_alone and not alone.as_given and alone.effects == ()
    assert alone.fit is coefficients.fit and alone.refused is shown.fit
    assert alone.alone_gain == pytest.approx(0.5 * (np.log(2.0) + np.log(2.5)))
    # controls: no better by a standard error, not re-tuned themselves, or an explanation that is re-tuned
    unsure = shown.or_retuned(replace(coefficients, left=[np.full(3, 1.0), np.full(3, 4.0)]))
    assert unsure.effects == shown.effects and not unsure.coefficients_alone
    assert shown.or_retuned(replace(coefficients, retuned=False)) is shown
    own = replace(shown, retuned=True)
    assert own.or_retuned(coefficients) is own
    assert shown.or_retuned(replace(coefficients, left=())) is shown  # their runs left out could not be told


def test_a_run_that_the_others_lose_along_the_path_of_all_is_left_out_of_a_fit_of_its_own(monkeypatch):
    problem, refit = refitted(0, False)
    usual = module._misses_without_each(problem, refit.fit)
    lost = problem.model.nominal.copy()
    lost[problem.model.index["N_v"]] *= -1e4
    monkeypatch.setattr(module, "_without", lambda fitted, run: lost)
    assert np.isinf(module._misses(problem, problem.logs[0], lost)).any()
    again = module._misses_without_each(problem, refit.fit)
    for fitted, linear in zip(again, usual, strict=True):
        assert np.isfinite(fitted).all() and np.abs(np.log(fitted / linear)).max() < 0.5
    # the control: where the others cannot be fitted either, nothing is told of the run
    monkeypatch.setattr(module, "fit", lambda *a, **k: (_ for _ in ()).throw(module.ModelError("no path")))
    assert module._misses_without_each(problem, refit.fit) == [None] * len(problem.logs)


def test_without_an_effect_the_model_as_stated_is_the_one_as_given_and_is_fitted_once(monkeypatch):
    problem, _ = refitted(0, True)
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    fits = []
    monkeypatch.setattr(module, "fit", lambda *a, **k: fits.append(a) or fit(*a, **k))
    found = explained_model(problem, none)
    assert len(fits) == 1 and found.retuned
    assert (found.given_gain, found.given_error) == (found.gain, found.error)
    assert np.array_equal(found.given.par, problem.model.nominal)
    _, lag = refitted(0, True)  # the control: with an effect these are two models
    other = explained_model(problem, lag)
    assert len(fits) == 3 and other.given_gain != other.gain


def test_the_size_with_coefficients_as_stated_is_that_of_the_truth_where_they_are_true():
    problem, refit = refitted(0, False)
    fitted = as_stated(problem, refit)
    truth = 0.5 * problem.model.scales["L"] / problem.model.scales["U"]
    assert abs(fitted.values[0] - truth) < 4.0 * fitted.sd[0]
    assert fitted.sd[0] < refit.fit.sd[-1]


def test_a_replay_misses_by_the_noise_with_the_truth_and_by_more_without():
    problem, refit = refitted(0, False)
    log = problem.logs[0]
    right, wrong = misses(problem, log, refit.fit.par), misses(problem, log, problem.model.nominal)
    assert right["psi"] < 3.0 * log.sigma[log.channels.index("psi")]
    assert wrong["psi"] > 2.0 * right["psi"]


@pytest.mark.thorough
def test_what_predicts_has_the_coefficients_of_the_explanation():
    model = model_of()
    trial = planted_trial(model, {f"{LAG}.tau": 0.5 * model.scales["L"] / model.scales["U"]}, 4)
    found = diagnose(trial, model, plan_next=False)
    first = diagnosed_model_of(found).hypotheses[0]
    at = [first.names.index(n) for n in found.problem.stated.names]
    same = np.allclose(first.mean[at], found.problem.stated.mean, rtol=1e-12)
    assert same is not found.result.retuning.kept
    moved = max(abs(m.explained - m.given) / m.prior_sd for m in found.result.moved.values())
    assert (moved < 1e-9) is not found.result.retuning.kept
