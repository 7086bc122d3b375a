"""When a gap acts: planted stretches are found, and a gap of every run has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses import stretch
from bayesid.diagnosis.hypotheses.localisation import locate
from bayesid.diagnosis.hypotheses.stretch import CLEAR, shortest
from bayesid.estimation.filter_error.linearise import linearise_runs
from bayesid.estimation.filter_error.noise_model import LatentInputs

BEGIN, LASTS = 25.0, 8.0  # L/U


@pytest.mark.parametrize(("first", "last"), [(0, 1000), (120, 180), (0, 7), (990, 1000)])
def test_the_shortest_stretch_is_the_one_that_holds_the_gain(first, last):
    """Ten nats for every sample inside, and a hundredth lost for every one allowed outside."""

    def gain(a, b):
        inside = max(min(b, last) - max(a, first), 0)
        return 10.0 * inside - 0.01 * (b - a - inside)

    assert shortest(gain, 1000) == (first, last)


def test_a_stretch_loses_what_is_clear_once_and_no_more():
    assert shortest(lambda a, b: float(b - a), 100) == (int(CLEAR), 100)


def located(runs):
    """Where the gap of a turning moment lies that acts for 8 L/U of some runs."""
    model = model_of("remus100")
    L, U, rho = (model.scales[k] for k in ("L", "U", "rho"))

    def force(run, t):
        inside = (t > BEGIN * L / U) & (t < (BEGIN + LASTS) * L / U) & (run in runs)
        return {"N": 4e-4 * 0.5 * rho * L**3 * U**2 * inside}

    problem = build_problem(model, planted_trial(model, other_vehicle(model, 3), 3, force, samples=160))
    none = fit_with(problem, ())
    return L / U, locate(problem, none.points, problem.coefficients)


@pytest.mark.thorough
def test_a_moment_in_one_run_is_dated_and_one_in_every_run_is_not():
    time, one = located(("turn",))
    found = one.stretch
    assert found is not None and found.run == "turn" and found.gain > one.places[0].evidence
    assert found.start / time == pytest.approx(BEGIN, abs=2.0)
    assert found.end / time == pytest.approx(BEGIN + LASTS, abs=2.0)
    _, every = located(("turn", "zigzag"))
    assert every.places[0].evidence > 20.0 and every.stretch is None
    assert located(())[1].stretch is None


def test_of_the_only_run_a_part_is_told_and_the_whole_is_not(monkeypatch):
    model = model_of("remus100")
    trial = planted_trial(model, other_vehicle(model, 3), 3, None, samples=160)
    problem = build_problem(model, replace(trial, runs=trial.runs[:1]))
    none, noise = fit_with(problem, ()), problem.environment.noise_model
    paths = linearise_runs(model, problem.logs, none.points, problem.coefficients.where)
    latent = LatentInputs(("delta_r",), (), (0.03,), model.scales["L"] / model.scales["U"])
    monkeypatch.setattr(stretch, "CLEAR", -np.inf)  # as if a signal were clear
    for (first, last), told in (((0, 160), False), ((40, 80), True)):
        monkeypatch.setattr(stretch, "shortest", lambda gain, size, at=(first, last): at)
        found = stretch.stretch_of(problem, paths, problem.coefficients, noise, latent)
        assert (found is not None) == told
