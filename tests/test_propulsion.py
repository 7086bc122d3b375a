"""Propulsion models: rows against the equation each one states, and the propeller curve at its limits."""

import numpy as np
import pytest

from bayesid.model.propulsion import (
    MODELS,
    ROWS,
    propulsion_force,
    propulsion_problems,
    propulsion_rows,
    with_defaults,
)
from bayesid.model.terms import REFERENCES, term

RHO, LENGTH = 1025.0, 3.0
U, N = (axis.ravel() for axis in np.meshgrid(np.linspace(-3.0, 3.0, 7), np.linspace(-900.0, 900.0, 7)))
VALUES = {
    "polynomial": {"a": -0.002, "b": -0.001, "c": 0.003, "uc_per_rpm": 0.004, "rpm_ref": 500.0},
    "thrust": {"T_ref": 40.0, "rpm_ref": 600.0},
    "linear_thrust": {"T_max": 55.0, "rpm_max": 1200.0},
    "nps": {"Cd0": 0.004, "k": 0.0036},
    "kt": {"Kt0": 0.3, "a": 0.9, "b": 1.4, "w": 0.3, "t": 0.1, "D": 0.2},
    "mmg": {"D_P": 0.2, "H_R": 0.3, "A_R": 0.05},
    "quadratic": {"X_prop_u|u|": -3.0, "X_prop_un": -0.01, "X_prop_n|n|": 1e-4, "X_prop_n": 0.02},
}
HALF = 0.5 * RHO * LENGTH**2
STATED = {
    "polynomial": lambda u, n: (
        HALF * (-0.002 * u * abs(u) - 0.001 * u * 0.004 * n + 0.003 * 0.004 * n * abs(0.004 * n))
    ),
    "thrust": lambda u, n: 40.0 * (n / 600.0) * abs(n / 600.0),
    "linear_thrust": lambda u, n: 55.0 * n / 1200.0,
    "nps": lambda u, n: HALF * 0.004 * (0.0036**2 * n * abs(n) - u * abs(u)),
    "quadratic": lambda u, n: -3.0 * u * abs(u) - 0.01 * u * n + 1e-4 * n * abs(n) + 0.02 * n,
}
EVERY = pytest.mark.parametrize("model", MODELS)


@EVERY
def test_every_model_has_a_case_here_and_a_source(model):
    assert model in VALUES
    assert MODELS[model].source in REFERENCES or MODELS[model].source.startswith("assumed: ")


@pytest.mark.parametrize("model", STATED)
def test_force_is_the_equation_of_the_model(model):
    force = propulsion_force(model, with_defaults(model, VALUES[model]), RHO, LENGTH, U, N)
    np.testing.assert_allclose(force, STATED[model](U, N), rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("model", STATED)
def test_rows_times_their_regressors_give_the_force(model):
    values = with_defaults(model, VALUES[model])
    rows = propulsion_rows(model, values, RHO, LENGTH)
    names = {"u": U, "n": N, "abs": np.abs}
    total = sum(value * eval(term(name).regressor, {}, names) for name, value in rows.items())
    np.testing.assert_allclose(total, propulsion_force(model, values, RHO, LENGTH, U, N), atol=1e-12)
    assert tuple(rows) == ROWS


def test_propeller_curve_at_bollard_at_its_zero_and_astern():
    """Closed form: Kt0 at J = 0, nothing at J = a, the whole reversed thrust against the flow, 0 at n = 0."""
    values = VALUES["kt"]
    bollard = (1.0 - 0.1) * RHO * 10.0**2 * 0.2**4 * 0.3

    def force(u, n):
        return float(propulsion_force("kt", values, RHO, LENGTH, u, n))

    assert force(0.0, 600.0) == pytest.approx(bollard, rel=1e-14)
    assert force(0.9 * 10.0 * 0.2 / 0.7, 600.0) == pytest.approx(0.0, abs=1e-12 * bollard)
    assert force(1.0, -600.0) == pytest.approx(-bollard, rel=1e-14)
    assert force(-1.0, -600.0) == -force(1.0, 600.0)
    assert force(1.0, 0.0) == 0.0


@EVERY
def test_missing_and_impossible_numbers_are_all_named(model):
    required = {k for k, p in MODELS[model].parameters.items() if p.required and p.default is None}
    assert set(propulsion_problems(model, {})) == required
    bad = {key: -1.0 for key in VALUES[model] if MODELS[model].parameters[key].low == 1e-9}
    assert set(bad) <= set(propulsion_problems(model, VALUES[model] | bad))
    assert propulsion_problems(model, VALUES[model]) == {}


def test_the_shape_of_a_torque_that_is_not_stated_is_told():
    shaped = {**VALUES["kt"], "Kq_a": 1.1}
    assert propulsion_problems("kt", shaped) == {
        "Kq_a": "Kq_a shapes a torque that is not stated: give Kq0 too"
    }
    assert propulsion_problems("kt", {**shaped, "Kq0": 0.03}) == {}
