"""What vehicles do, for many parameter vectors: indices, turns, zig-zags and bands of tracks."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.analysis.identifiability import derived, full_vectors, identify, indices, predict
from bayesid.equations.model import build_model
from bayesid.estimation.output_error import coefficient_set, trial_problem
from bayesid.manoeuvres import turn
from bayesid.model.vehicles import builtin_names, load_vehicle, stability
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01}


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("generic_sub"), 3)


@pytest.mark.parametrize("name", builtin_names())
def test_indices_are_those_of_the_vehicle_module(name):
    vehicle = load_vehicle(name)
    model = build_model(vehicle)
    known = stability(vehicle)
    found = indices(model, model.nominal[None], known.U)
    for key in ("G_H", "G_V"):
        expected = getattr(known, key)
        if key in found and expected is not None:
            assert found[key][0] == pytest.approx(expected, rel=1e-9)


def test_a_better_rudder_turns_tighter_and_a_vehicle_that_diverges_has_no_circle(model):
    pars = np.repeat(model.nominal[None], 3, axis=0)
    pars[1, model.index["N_dr"]] *= 1.2
    pars[2, model.index["Y_v|v|"]] *= -40.0  # damping that pushes
    found = derived(model, pars, zigzags=2)
    diameter = found.values["tactical diameter"]
    assert diameter[1] < diameter[0] and np.isnan(diameter[2])
    assert found.missing("tactical diameter") == 1
    assert found.values["first overshoot"].size == 2
    middle, low, high = found.interval("tactical diameter")
    assert low <= middle <= high


def test_data_narrow_what_the_vehicle_does_though_no_equation_is_scaled(model):
    # 22 coefficients from one turn: most are not fixed, the circle is
    trial = virtual_trial(
        model, model.nominal, {"turn": turn(-0.35, 90.0, 20.0, 300.0, 1.0)}, title="t",
        vehicle_ref="generic_sub", noise=NOISE, rng=np.random.default_rng(0),
    )  # fmt: skip
    problem = trial_problem(model, trial, coefficient_set(model))
    found = identify(problem, level=0.05, profile=False)
    rng = np.random.default_rng(1)
    prior, posterior = (
        derived(model, full_vectors(problem, found.information.draws(100, rng, before)), zigzags=0)
        for before in (True, False)
    )
    assert sum(e.verdict == "fixed by data" for e in found.entries) < 22 / 3
    assert posterior.spread("tactical diameter") < 0.1 * prior.spread("tactical diameter")


def test_ties_are_kept_in_full_vectors(model):
    trial = virtual_trial(
        model, model.nominal, {"turn": turn(-0.35, 90.0, 5.0, 50.0, 1.0)}, title="t",
        vehicle_ref="generic_sub", noise=NOISE, rng=np.random.default_rng(0),
    )  # fmt: skip
    params = coefficient_set(model, ("N_rdot", "N_vdot"), ties={"Y_rdot": ("N_vdot", 1.0, 0.0)})
    problem = trial_problem(model, trial, params)
    draws = problem.params.start * np.array([[1.0, 1.1], [0.9, 0.8]])
    full = full_vectors(problem, draws)
    assert full[:, model.index["Y_rdot"]].tolist() == draws[:, 1].tolist()
    assert full[:, model.index["m"]].tolist() == [model.vehicle.mass] * 2


def test_bands_hold_the_median_track_and_widen_with_the_parameters(model):
    order = turn(0.3, 90.0, 10.0, 200.0, 2.0)
    plan, x0 = plan_run(model, order.t, order.commands), steady_start(model, 90.0)
    rng = np.random.default_rng(2)
    bands = []
    for sd in (0.01, 0.05):
        pars = np.repeat(model.nominal[None], 64, axis=0)
        pars[:, model.index["N_dr"]] *= 1.0 + sd * rng.standard_normal(64)
        bands.append(predict(model, pars, plan, x0))
    truth = simulate(model, model.nominal, plan, x0).states
    assert bands[0].end_spread < 0.5 * bands[1].end_spread
    assert bands[1].coverage(truth) == 1.0
    wrong = truth + np.where(np.arange(6) == 0, 50.0, 0.0)
    assert bands[0].coverage(wrong) < 0.1
