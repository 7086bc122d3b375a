"""A fit of some coefficients says where its runs ask for those it holds; a form is what all of them lack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.estimation.likelihood.held_coefficients import OFF, held_coefficients, with_held
from bayesid.estimation.likelihood.model_form import form_rows, idle_fins, with_form
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.output_error import FitOptions, trial_problem
from bayesid.estimation.parameters import DEFAULT_RELATIVE_SD, coefficient_set
from bayesid.manoeuvres import zigzag
from bayesid.model.params import ParameterSet
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.vehicle import CoefficientPrior
from bayesid.report.fit_held import freeing_words, held_words
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Trial
from studies.coverage import run as coverage
from studies.coverage.campaigns import Condition, campaign, problem_of

FREE = ("X_u|u|", "N_r", "N_dr", "N_v")
OFF_BY = {"Y_v": 1.2, "Y_r": 0.85, "Y_dr": 1.15}


def fitted(rows=(), off=(), free=FREE, seed=3):
    """A fit of some coefficients (None: all but the added masses) to runs of another vehicle.

    Its coefficients `off` are not those that are held, its `rows` are in no file."""
    s = coverage.setting()
    truth = np.array(
        [p.start * OFF_BY.get(p.name, 1.0) if p.name in off else p.start for p in s.params.entries]
    )
    condition = Condition(rows=dict(rows))
    trial = campaign(s, condition, truth, np.random.default_rng(seed))
    problem = problem_of(s, trial)
    if free is not None:
        problem = problem.with_params(ParameterSet(tuple(p for p in problem.params if p.name in free)))
        assert len(problem.params.names) == len(free)
    assert held_coefficients(problem)
    found = weighted_fit(problem, FitOptions(profile=False))[1]
    assert found.converged
    return problem, found, dict(zip([p.name for p in s.params.entries], truth, strict=True))


@pytest.mark.thorough
def test_what_held_coefficients_are_off_by_is_no_force_the_equations_lack():
    problem, found, truth = fitted(off=OFF_BY)
    assert "form" not in found.uncertainty
    held = found.uncertainty["held"]
    assert held["evidence"] > 20
    assert set(held["moves"]) & set(OFF_BY)
    for name, (change, sd) in held["moves"].items():
        off = truth[name] - problem.base[problem.model.index[name]]
        assert abs(change - off) < 4 * sd
    surest = [abs(change / sd) for change, sd in held["moves"].values()]
    assert surest == sorted(surest, reverse=True) and surest[-1] > 2


def test_where_the_held_are_right_nothing_is_asked_for():
    _, found, _ = fitted()
    assert "held" not in found.uncertainty and "form" not in found.uncertainty


@pytest.mark.thorough
def test_rows_that_no_held_coefficient_makes_are_a_form():
    rows = coverage.CONDITIONS["other equations: three more rows"].rows
    _, found, _ = fitted(rows=rows, free=None)
    assert found.uncertainty["form"]["size"] > 0


def test_held_coefficients_are_free_within_what_was_known_or_as_given():
    s = coverage.setting()
    problem = problem_of(s, campaign(s, Condition(), s.params.start, np.random.default_rng(0)))
    problem = problem.with_params(ParameterSet(tuple(p for p in problem.params if p.name in FREE)))
    held = held_coefficients(problem)
    assert set(held) == set(problem.model.coefficients) - set(FREE)
    on, off = with_held(problem), with_held(problem, on=False)
    assert on.params.names == off.params.names and on.params.names[: len(FREE)] == problem.params.names
    for name, sd in held.items():
        assert on.params[name].prior.spread == pytest.approx(sd)
        assert off.params[name].prior.spread == pytest.approx(OFF * sd)
        assert on.params[name].start == problem.base[problem.model.index[name]]
    assert with_held(on) is on  # all are free
    fixed = problem.with_params(
        ParameterSet((*problem.params.entries, replace(on.params["Y_v"], role="fixed", prior=None)))
    )
    assert with_held(fixed).params["Y_v"].role == "free"


def test_coefficients_that_a_file_knows_together_are_free_together():
    s = coverage.setting()
    vehicle = s.model.vehicle
    names = ("Y_v", "Y_r")
    sd = np.array([0.3, 0.3]) * [abs(vehicle.coef[n]) for n in names]
    covariance = np.outer(sd, sd) * np.array([[1.0, 0.999], [0.999, 1.0]])
    known = replace(vehicle, prior=CoefficientPrior({}, names, covariance))
    model = build_model(known, 3)
    problem = problem_of(s, campaign(s, Condition(), s.params.start, np.random.default_rng(0)))
    for free in (("N_r",), ("N_r", "Y_v")):  # none of them is free, or one
        held = with_held(replace(problem, model=model, params=coefficient_set(model, free)))
        assert set(held.params.joint.names) == set(names)
        assert all(held.params[n].prior is None for n in names)
    alone = with_held(replace(problem, model=model, params=coefficient_set(model, ("N_r",))), on=False)
    assert alone.params.joint is None


def test_a_coefficient_that_is_zero_is_free_in_units_of_its_row_and_an_exact_one_stays():
    s = coverage.setting()
    vehicle = replace(
        s.model.vehicle,
        coef={**s.model.vehicle.coef, "N_v|v|": 0.0},
        prior=CoefficientPrior({"Y_v": 0.0, "N_v|v|": 0.2}),
    )
    model = build_model(vehicle, 3)
    problem = problem_of(s, campaign(s, Condition(), s.params.start, np.random.default_rng(0)))
    held = held_coefficients(replace(problem, model=model, params=coefficient_set(model, ("N_r",))))
    assert held["N_v|v|"] > 0 and "Y_v" not in held
    value = model.nominal[model.index["Y_r"]]
    assert held["Y_r"] == pytest.approx(DEFAULT_RELATIVE_SD * abs(value))


def test_the_rows_of_an_earlier_form_are_those_it_had_whatever_stands_still_now():
    s = coverage.setting()
    problem = problem_of(s, campaign(s, Condition(), s.params.start, np.random.default_rng(0)))
    rows = [n for n in form_rows(problem.model) if n.startswith("N_")]
    assert set(with_form(problem, 1e-4, rows).params.names) - set(problem.params.names) == set(rows)


def told(moves, free=("N_r",), zero=()):
    """A fit that says what it holds, as far as words need it."""
    s = coverage.setting()
    coefficients = ("N_r", "Y_v", "Y_r", "N_v", "N_dr")
    base = np.array([0.0 if n in zero else 2.0 for n in s.model.kernel.parameters])
    return SimpleNamespace(
        fit=SimpleNamespace(uncertainty={"held": {"evidence": 37.2, "moves": moves}}),
        problem=SimpleNamespace(base=base, params=SimpleNamespace(names=free)),
        model=SimpleNamespace(index=s.model.index, coefficients=coefficients),
    )


def test_what_is_held_wrongly_is_told_with_what_to_type():
    moves = {"Y_v": (0.2, 0.02), "N_v": (-0.1, 0.04)}
    (said,) = held_words(told(moves))
    assert "(log evidence +37)" in said and "Y_v +10 ± 1 %, N_v -5 ± 2 %" in said
    (step,) = freeing_words(told(moves))
    assert "`--fix 'Y_r,N_dr'`" in step  # shorter than the three that are to be free
    (step,) = freeing_words(told({"Y_v": (0.2, 0.02)}))
    assert "`--free 'N_r,Y_v'`" in step
    (said,) = held_words(told({"Y_v": (0.2, 0.02)}, zero=("Y_v",)))
    assert "Y_v 0.2 ± 0.02" in said and "%" not in said
    (said,) = held_words(told({}))
    assert "No single one" in said and "Free more" in freeing_words(told({}))[0]
    nothing = told({})
    nothing.fit.uncertainty.clear()
    assert held_words(nothing) == freeing_words(nothing) == []


def test_no_row_of_planes_that_stay_at_zero_is_part_of_a_form():
    vehicle = load_vehicle("generic_sub")
    coef = {k: v for k, v in vehicle.coef.items() if not k.endswith("db")}
    model = build_model(replace(vehicle, coef=coef), 6)
    planes = {n for n in form_rows(model) if n.endswith("db")}
    assert planes
    time, rpm = model.scales["L"] / model.scales["U"], float(vehicle.rpm_ref)
    order = zigzag(0.1, 0.1, rpm, approach=time, duration=6 * time, dt=0.2 * time)
    run = virtual_run(model, model.nominal, order, name="zz")
    noise = dict.fromkeys(run.data, 0.01)
    trial = Trial("still planes", Path("."), "", 6, (run,), noise)
    problem = trial_problem(model, trial, coefficient_set(model, ("Y_v", "N_r")))
    assert {"delta_b", "delta_s"} <= idle_fins(problem) and "delta_r" not in idle_fins(problem)
    rows = set(with_form(problem, 1e-4).params.names) - {"Y_v", "N_r"}
    assert rows < set(form_rows(model)) and not rows & planes and "N_v|r|" in rows
