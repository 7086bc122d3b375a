"""A search over whole runs that begins at a filter-error estimate arrives where one from afar does not."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.errors import FitError, ModelError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood import weighted_fit as weighted_fit_module
from bayesid.estimation.likelihood.smoothed_start import smoothed_start
from bayesid.estimation.likelihood.weighted_fit import _first, weighted_fit
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.output_error.search import fit
from bayesid.estimation.output_error.trial_setup import trial_problem
from bayesid.estimation.parameters import coefficient_set
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import observe, plan_run, simulate, steady_start
from bayesid.trials.trial import Run, Trial

SIGMA = {"x": 0.1, "y": 0.1, "z": 0.05, "phi": 0.004, "theta": 0.004, "psi": 0.004, "u": 0.01, "r": 0.004}
FREE = ("Y_v", "Y_dr", "N_v|v|", "N_dr", "Z_w", "M_w", "M_ds", "M_q", "X_u|u|")
FACTORS = {"Y_v": 1.15, "N_dr": 0.85, "M_w": 0.88, "Z_w": 1.1, "X_u|u|": 1.1}


def trial_of(dof, name="remus100", seconds=80.0, factors=FACTORS, seed=1):
    """Two runs of a vehicle whose coefficients are other than those of its file."""
    vehicle = load_vehicle(name)
    model = build_model(vehicle, dof)
    nominal = dict(zip(model.kernel.parameters, model.nominal, strict=True))
    par = model.with_values({n: f * nominal[n] for n, f in factors.items() if n in nominal})
    rng, t, runs = np.random.default_rng(seed), np.arange(0.0, seconds, 0.5), []
    rudder, plane = np.deg2rad(8.0), np.deg2rad(3.0)
    for k, periods in enumerate(((9.0, 14.0), (13.0, 8.0))):
        orders = {
            "delta_r_cmd": rudder * np.sign(np.sin(2 * np.pi * t / periods[0])),
            "delta_s_cmd": plane * np.sign(np.sin(2 * np.pi * t / periods[1] + 0.3)),
            "n_cmd": np.full(t.size, vehicle.rpm_ref),
        }
        orders = {c: v for c, v in orders.items() if c.removesuffix("_cmd") in model.kernel.actuators}
        plan = plan_run(model, t, orders)
        readings = observe(model, par, plan, simulate(model, par, plan, steady_start(model)).states)
        sigma = {c: s for c, s in SIGMA.items() if c in model.kernel.channels}
        at = model.kernel.channels.index
        data = {c: readings[:, at(c)] + s * rng.standard_normal(t.size) for c, s in sigma.items()}
        runs.append(Run(f"run {k}", "steps", "identify", t, data, orders))
    trial = Trial("pond", None, vehicle.name, dof, tuple(runs), noise=sigma)
    truth = {n: f * nominal[n] for n, f in factors.items() if n in nominal}
    return model, trial, {n: truth.get(n, nominal[n]) for n in FREE if n in nominal}


def problem_of(model, trial, free=FREE):
    names = [n for n in free if n in model.index]
    return trial_problem(model, trial, coefficient_set(model, names))


@pytest.mark.thorough
@pytest.mark.parametrize("dof", [3, 6])
def test_it_lies_within_the_deviations_of_the_truth_where_the_given_coefficients_do_not(dof):
    model, trial, truth = trial_of(dof)
    problem = problem_of(model, trial)
    z = smoothed_start(problem, trial.identify)
    half = 0.5 * problem.n_readings
    assert problem.cost(problem.start) > 10 * half
    assert problem.cost(z) < 1.1 * half
    names = problem.params.names
    found = fit(problem, FitOptions(), begin=z)
    assert found.converged
    sd = found.sd[: len(names)]
    away = (z[: len(names)] - np.array([truth[n] for n in names])) / sd
    assert np.abs(away).max() < 4.0
    assert found.cost_start == pytest.approx(problem.cost(problem.start))
    np.testing.assert_array_equal(found.start, problem.start)


@pytest.mark.thorough
def test_in_six_degrees_of_freedom_the_search_begins_there_and_ends_lower(tmp_path):
    model, trial, _ = trial_of(6, factors=dict.fromkeys(("N_dr", "M_ds", "Y_v", "Z_w"), 0.5))
    problem = problem_of(model, trial)
    few = FitOptions(rounds=1, iterations=15, profile=False)
    plain = weighted_fit(problem, few, parts=NoiseParts())[1]
    begun: list[np.ndarray] = []

    def smoothed():
        begun.append(smoothed_start(problem, trial.identify))
        return begun[-1]

    found = weighted_fit(problem, few, parts=NoiseParts(), smoothed=smoothed)[1]
    assert len(begun) == 1
    assert found.converged and not plain.converged
    assert found.cost < 0.6 * problem.n_readings < plain.cost
    # an interrupted fit of another start is not gone on with
    once = fit(problem, few, tmp_path, begin=begun[0])
    lines = (tmp_path / "iterates.jsonl").read_text().count("iterate")
    again = fit(problem, few, tmp_path, begin=begun[0])
    np.testing.assert_array_equal(once.z, again.z)
    assert (tmp_path / "iterates.jsonl").read_text().count("iterate") == lines
    said: list[str] = []
    fit(problem, few, tmp_path, begin=begun[0] * (1 + 1e-9), say=said.append)
    assert said == ["begins anew: the iterates kept there are of another fit"]


def test_in_the_plane_a_search_that_converges_asks_for_no_other_start():
    model, trial, _ = trial_of(3)
    problem = problem_of(model, trial)

    def asked():
        raise AssertionError

    assert weighted_fit(problem, FitOptions(), parts=NoiseParts(), smoothed=asked)[1].converged


FEW = FitOptions(rounds=1, iterations=2, profile=False)


def test_in_the_plane_a_search_that_does_not_arrive_is_begun_again_at_the_smoothed_path(tmp_path):
    model, trial, _ = trial_of(3)
    problem = problem_of(model, trial)
    plain = weighted_fit(problem, FEW, parts=NoiseParts())[1]
    assert not plain.converged
    begin = smoothed_start(problem, trial.identify)
    found = weighted_fit(problem, FEW, tmp_path, parts=NoiseParts(), smoothed=lambda: begin)[1]
    assert found.cost < plain.cost
    assert (tmp_path / "second" / "iterates.jsonl").exists()
    worse = problem.start + 0.1 * problem.scale
    assert problem.cost(worse) > problem.cost(problem.start)
    kept = weighted_fit(problem, FEW, parts=NoiseParts(), smoothed=lambda: worse)[1]
    assert kept.cost == plain.cost


def searches(monkeypatch, *ends):
    """Searches end at these in turn (an error is raised); what they were asked."""
    asked, left = [], list(ends)

    def search(problem, options, folder, resume, watch, store, say=None, begin=None):
        asked.append((options.starts, begin is not None))
        end = left.pop(0)
        if isinstance(end, Exception):
            raise end
        return end

    monkeypatch.setattr(weighted_fit_module, "fit", search)
    return asked


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("cost", "arrived", "second"),
    [(0.0, True, True), (0.3, True, True), (5.0, True, False), (-5.0, False, True), (0.3, False, False)],
)
def test_the_likelier_of_two_ends_stands_and_of_the_same_the_one_that_arrived(
    monkeypatch, cost, arrived, second
):
    model, trial, _ = trial_of(3)
    problem = problem_of(model, trial)
    first = fit(problem, FEW)
    again = replace(first, cost=first.cost + cost, status="converged" if arrived else "budget", seconds=7.0)
    asked = searches(monkeypatch, first, again)
    begin = smoothed_start(problem, trial.identify)
    found = _first(problem, replace(FEW, starts=3), None, True, None, None, lambda: begin)
    assert asked == [(3, False), (1, True)]
    assert (found.fit.status, found.begin is not None) == ((again if second else first).status, second)
    assert found.fit.cost == (again if second else first).cost
    assert found.fit.seconds == first.seconds + 7.0
    assert len(found.fit.starts) == (2 if second else 1)


def test_ends_under_noise_of_their_own_are_compared_by_likelihood_and_not_by_cost(monkeypatch):
    model, trial, _ = trial_of(3)
    problem = problem_of(model, trial)
    first = replace(fit(problem, FEW), cost=39.0)
    loud = {**first.sigma, "x": 10 * first.sigma["x"]}
    first, again = replace(first, sigma=loud), replace(first, cost=400.0)
    searches(monkeypatch, first, again)
    begin = smoothed_start(problem, trial.identify)
    found = _first(problem, FEW, None, True, None, None, lambda: begin).fit
    readings = sum(np.isfinite(r.data["x"]).sum() for r in trial.identify)
    assert readings * np.log(10.0) > 400.0 - 39.0  # the louder end is the less likely
    assert found.sigma == again.sigma


def test_a_second_search_that_fails_leaves_the_first(monkeypatch):
    model, trial, _ = trial_of(3)
    problem = problem_of(model, trial)
    first = fit(problem, FEW)
    begin = smoothed_start(problem, trial.identify)
    for error in (FitError("no"), ModelError("it diverges")):
        searches(monkeypatch, first, error)
        assert _first(problem, FEW, None, True, None, None, lambda: begin).fit is first


@pytest.mark.thorough
def test_in_six_degrees_of_freedom_a_search_that_does_not_arrive_begins_at_the_start_values_too(monkeypatch):
    model, trial, _ = trial_of(6)
    problem = problem_of(model, trial)
    first = fit(problem, FEW)
    assert not first.converged
    begin = smoothed_start(problem, trial.identify)
    again = replace(first, cost=first.cost - 9.0)
    asked = searches(monkeypatch, first, again)
    found = _first(problem, FEW, None, True, None, None, lambda: begin)
    assert asked == [(1, True), (1, False)] and found.begin is None and found.fit.cost == again.cost
    asked = searches(monkeypatch, first)
    assert _first(problem, FEW, None, True, None, None, lambda: None).fit is first
    assert asked == [(1, False)]


def test_a_vehicle_that_diverges_as_given_is_fitted_from_where_it_does_not():
    model, trial, truth = trial_of(3)
    problem = problem_of(model, trial)
    begin = smoothed_start(problem, trial.identify)
    params = problem.params
    start = params.start[params.names.index("X_u|u|")]
    lost = problem.with_params(params.changed(["X_u|u|"], start=-1e4 * start, low=-np.inf, high=np.inf))
    assert not np.isfinite(lost.cost(lost.start))
    with pytest.raises(FitError, match="diverges"):
        fit(lost, FEW)
    found = fit(lost, FitOptions(), begin=begin)
    assert found.converged and found.cost_start == np.inf
    assert found.values["N_dr"] == pytest.approx(truth["N_dr"], rel=0.1)


def test_none_where_parameters_are_tied_or_the_vehicle_cannot_follow():
    model, trial, _ = trial_of(3)
    tied = coefficient_set(model, ("N_dr",), ties={"Y_dr": ("N_dr", -1.0, 0.0)})
    assert smoothed_start(trial_problem(model, trial, tied), trial.identify) is None
    wild = [replace(r, data={**r.data, "r": -50.0 * r.data["r"]}) for r in trial.identify]
    astray = replace(trial, runs=tuple(wild))
    problem = problem_of(model, astray)
    found = smoothed_start(problem, astray.identify)
    if found is not None:
        k = len(problem.params.names)
        inside = (problem.low[:k] <= found[:k]) & (found[:k] <= problem.high[:k])
        assert inside.all() and problem.cost(found) < np.inf


@pytest.mark.thorough
def test_fit_trial_hands_it_the_runs_that_are_fitted():
    model, trial, truth = trial_of(6)
    held = replace(trial, runs=(trial.runs[0], replace(trial.runs[1], role="holdout")))
    found = fit_trial(held, model.vehicle, free=[n for n in FREE if n in truth])
    assert found.fit.converged
    away = [(found.fit.values[n] - truth[n]) / found.fit.sd[found.fit.names.index(n)] for n in truth]
    assert np.abs(away).max() < 4.0
