"""What a run refuses, and in which words."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.errors import BayesidError, ModelError
from bayesid.manoeuvres import turn
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, run_manoeuvre, simulate, simulate_batch, steady_start


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("generic_sub"), 3)


T = np.arange(0.0, 60.0, 2.0)


def straight(model):
    return plan_run(model, T, {"n_cmd": np.full(T.size, 60.0)})


def test_a_diverging_vehicle_is_an_error_with_the_time(model):
    par = model.with_values({"X_u|u|": 1e9})
    with pytest.raises(ModelError, match=r"diverges: .*from t = \d"):
        simulate(model, par, straight(model), steady_start(model))


def test_a_diverging_vehicle_in_a_batch_leaves_the_others_alone(model):
    pars = np.stack([model.nominal, model.with_values({"X_u|u|": 1e9})])
    states = simulate_batch(model, pars, straight(model), steady_start(model))
    assert np.isfinite(states[0]).all()
    assert not np.isfinite(states[1]).all()


def test_a_diverging_manoeuvre_is_an_error_with_the_time(model):
    with pytest.raises(ModelError, match=r"from t = \d"):
        run_manoeuvre(
            model, model.with_values({"X_u|u|": 1e9}), turn(0.1, 60.0, 0.0, 60.0, 2.0), steady_start(model)
        )


@pytest.mark.parametrize(
    "t", [[0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, np.nan, 2.0], [0.0, 1.0, np.inf]], ids=str
)
def test_times_that_do_not_increase_are_named(model, t):
    with pytest.raises(ModelError, match=r"sample \d at"):
        plan_run(model, np.array(t), {})


@pytest.mark.parametrize("t", [[], [1.0], [[0.0, 1.0]]], ids=str)
def test_a_run_needs_two_samples(model, t):
    with pytest.raises(ModelError, match="at least two"):
        plan_run(model, np.array(t), {})


def test_missing_commands_are_held_from_the_last_good_one(model):
    rudder = np.linspace(0.0, 0.1, T.size)
    rudder[5:8] = np.nan
    plan = plan_run(model, T, {"delta_r_cmd": rudder})
    assert np.array_equal(plan.levels[5:8, 0], np.full(3, rudder[4]))
    assert np.isfinite(plan.command).all()


def test_a_command_without_any_value_is_refused(model):
    with pytest.raises(ModelError, match="delta_r_cmd has no finite value"):
        plan_run(model, T, {"delta_r_cmd": np.full(T.size, np.nan)})


def test_a_command_of_another_length_is_refused(model):
    with pytest.raises(ModelError, match=r"n_cmd has shape \(3,\) beside 30"):
        plan_run(model, T, {"n_cmd": np.zeros(3)})


@pytest.mark.parametrize("size", [5, 12])
def test_a_start_of_the_other_kind_of_model_is_refused(model, size):
    with pytest.raises(ModelError, match="starts from x, y, psi, u, v, r"):
        simulate(model, model.nominal, straight(model), np.zeros(size))


def test_a_start_that_is_not_finite_is_refused(model):
    with pytest.raises(ModelError, match="not finite"):
        simulate(model, model.nominal, straight(model), np.full(6, np.nan))


def test_parameters_of_another_model_are_refused(model):
    with pytest.raises(ModelError, match=r"has \d+; start from model.nominal"):
        simulate(model, model.nominal[:-1], straight(model), steady_start(model))


def test_a_mass_matrix_without_inverse_is_refused(model):
    par = model.nominal.copy()
    par[model.positions(["m", "Izz", "X_udot", "Y_vdot", "Y_rdot", "N_vdot", "N_rdot"])] = 0.0
    with pytest.raises(ModelError, match="cannot be inverted"):
        simulate(model, par, straight(model), steady_start(model))


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan])
def test_a_step_must_be_positive(model, step):
    with pytest.raises(ModelError, match="longer than 0"):
        plan_run(model, T, {}, max_step=step)


def test_six_degrees_are_refused_for_a_planar_set():
    with pytest.raises(ModelError, match="planar only"):
        build_model(replace(load_vehicle("generic_sub"), planar_only=True), 6)


def test_other_degrees_of_freedom_are_refused():
    with pytest.raises(ModelError, match="choose 3"):
        build_model(load_vehicle("generic_sub"), 4)


def test_shaft_speed_without_thrust_is_refused(model):
    with pytest.raises(BayesidError, match="thrust"):
        steady_start(model, -10.0)
