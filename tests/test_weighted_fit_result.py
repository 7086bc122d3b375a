"""What a fit with weighted readings leaves behind when it is stopped, and says when a part of it fails."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import lru_cache

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood import weighted_fit as module
from bayesid.estimation.likelihood.held_coefficients import HeldCheck
from bayesid.estimation.likelihood.model_form import Asked
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.output_error.fit_result import load_fit
from bayesid.model.params import ParameterSet
from bayesid.model.vehicles import load_vehicle
from bayesid.report.fit import form_words
from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, setting
from studies.posterior.problem import VEHICLE, manoeuvres, posed, prior_of

SIX = ("Y_r", "Y_dr", "N_r", "N_v", "N_dr", "X_u|u|")
STATED = FitOptions(profile=False)


@lru_cache
def problem():
    """Six coefficients that differ from run to run, noise with memory."""
    s = setting()
    s = replace(s, params=ParameterSet(tuple(p for p in s.params.entries if p.name in SIX)))
    rng = np.random.default_rng([31, 4])
    return problem_of(s, campaign(s, Condition(run_spread=0.3, memory=10.0), drawn_truth(s, rng), rng))


def spiral_case():
    """A truth drawn from the prior, its spiral, and the prior."""
    model = build_model(load_vehicle(VEHICLE), 3)
    params = prior_of(model, model.coefficients, 0.5)
    spiral = {"spiral": manoeuvres(dt=2.0)["spiral"]}
    return posed(model, spiral, params, np.random.default_rng(12))


@lru_cache
def unstopped():
    """A fit that nothing stops."""
    return weighted_fit(problem(), STATED)[1]


@pytest.mark.thorough
@pytest.mark.parametrize("at", [0, 1])
def test_a_fit_stopped_before_its_weights_are_final_leaves_no_result(tmp_path, monkeypatch, at):
    plain = weighted_fit(problem(), STATED, tmp_path, parts=NoiseParts())[1]
    assert load_fit(tmp_path / "fit.json").converged  # of an earlier, finished fit
    calls, real = [], module._posterior

    def stopped(*args):
        calls.append(1)
        if len(calls) > at:
            raise KeyboardInterrupt
        return real(*args)

    monkeypatch.setattr(module, "_posterior", stopped)
    with pytest.raises(KeyboardInterrupt):
        weighted_fit(problem(), STATED, tmp_path)
    assert (tmp_path / "iterates.jsonl").is_file() and not list(tmp_path.rglob("fit.json"))
    monkeypatch.setattr(module, "_posterior", real)
    _, found, posterior = weighted_fit(problem(), STATED, tmp_path)
    assert posterior.parts.weight < 0.9
    stored = load_fit(tmp_path / "fit.json")
    assert np.array_equal(stored.z, found.z) and not np.array_equal(stored.sd, plain.sd)
    assert np.array_equal(found.z, unstopped().z)


@pytest.mark.thorough
@pytest.mark.parametrize("weighed_stops_too", [False, True])
def test_a_search_that_stops_short_under_white_noise_goes_on_with_what_its_readings_weigh(
    monkeypatch, weighed_stops_too
):
    real, calls, whole = module.fit, [], unstopped()

    def short(posed, *args, **named):
        found = real(posed, *args, **named)
        calls.append(found)
        if len(calls) == 1:
            way = np.where(np.arange(found.z.size) < found.n_params, 0.5, 1.0)
            return replace(found, status="stalled", z=found.start + way * (found.z - found.start))
        return replace(found, status="budget") if weighed_stops_too else found

    monkeypatch.setattr(module, "fit", short)
    _, found, posterior = weighted_fit(problem(), STATED)
    k = found.n_params
    off = np.abs(found.z[:k] - whole.z[:k]) / whole.sd[:k]
    if weighed_stops_too:
        assert not found.converged and not posterior.parts.efficient and off.max() > 1.0
    else:
        assert found.converged and off.max() < 0.2
        assert found.sd[:k] == pytest.approx(whole.sd[:k], rel=0.1)


@pytest.mark.thorough
@pytest.mark.parametrize("how", ["raises", "does not converge", "diverges"])
def test_a_model_form_that_cannot_be_fitted_is_said(monkeypatch, how):
    real = module._without_form

    def failing(asked, *args):
        if len(asked.params.names) == len(SIX):
            return real(asked, *args)
        if how == "raises":
            raise FitError("it diverges from the start")
        noisy, found, posterior = real(problem(), *args)
        if how == "diverges":
            return noisy, found, None
        return noisy, replace(found, status="budget", message="not converged in 3 rounds"), posterior

    held = HeldCheck(30.0, {"N_r": (1.0, 0.1)})
    monkeypatch.setattr(module, "asked_beyond", lambda *args: Asked(1e-4, held))
    monkeypatch.setattr(module, "_without_form", failing)
    _, found, posterior = weighted_fit(problem(), STATED)
    assert found.n_params == len(posterior.names) == len(SIX) and found.converged
    assert "model form of 1e-04, the fit with it failed" in found.message
    reason = {"raises": "diverges from the start", "does not converge": "3 rounds", "diverges": "diverges"}[
        how
    ]
    assert reason in found.message.split("failed")[1]
    (said,) = form_words(found)
    assert "may stand in for it" in said
    assert found.uncertainty["held"] == asdict(held)


def test_a_fit_whose_runs_ask_for_no_form_says_nothing_of_one():
    found = unstopped()
    assert "form" not in found.message and not form_words(found)


def test_a_fit_counts_that_the_ridges_of_a_spiral_bend(tmp_path):
    """22 coefficients known to 50 % from one spiral: combinations fixed at the estimate are less sure."""
    case = spiral_case()
    _, found, posterior = weighted_fit(case.problem, STATED, tmp_path, parts=NoiseParts())
    k = found.n_params
    linear, told = posterior.covariance, found.covariance[:k, :k]
    unit = np.outer(case.known.sd, case.known.sd)
    narrow, wide = (np.sqrt(np.linalg.eigvalsh(c / unit)[0]) for c in (linear, told))
    assert found.converged
    assert wide > 1.3 * narrow
    assert np.sqrt(np.diag(told)) == pytest.approx(found.sd[:k])
    assert found.uncertainty["nonlinear"]["widest_over_linear"] >= wide / narrow
    assert load_fit(tmp_path / "fit.json").covariance[:k, :k] == pytest.approx(told)
