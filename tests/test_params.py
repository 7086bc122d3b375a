"""Free, fixed and tied parameters reach the model as stated, and priors are residuals with their slope."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bayesid.errors import FitError
from bayesid.estimation.parameters import known_together
from bayesid.model.params import JointPrior, Parameter, ParameterSet, Prior

INDEX = {"a": 0, "b": 1, "c": 2, "d": 3}


def small_set() -> ParameterSet:
    return ParameterSet(
        (
            Parameter("b", 2.0, low=1.0, high=3.0, scale=2.0, file_scale=10.0),
            Parameter("d", 7.0, role="fixed"),
            Parameter("a", 0.0, role="tied", tie=("b", 3.0, 1.0)),
            Parameter("c", -1.0, low=-5.0, high=0.0),
        )
    )


def test_tied_and_fixed_entries_are_written_into_the_model_vector():
    out = small_set().place(np.full(4, 99.0), INDEX, np.array([2.5, -2.0]))
    assert out.tolist() == [1.0 + 3.0 * 2.5, 2.5, -2.0, 7.0]


def test_the_chain_is_the_slope_of_the_placement():
    params, base, x = small_set(), np.zeros(4), np.array([2.5, -2.0])
    where, slopes = params.chain(INDEX)
    for k in range(2):
        step = np.eye(2)[k] * 0.25
        moved = params.place(base, INDEX, x + step) - params.place(base, INDEX, x)
        assert moved[where] == pytest.approx(slopes[:, k] * 0.25)


@pytest.mark.parametrize(
    ("kind", "centre", "value"), [("normal", 2.0, 2.7), ("lognormal", 2.0, 2.7), ("lognormal", -2.0, -1.1)]
)
def test_a_prior_is_a_residual_with_the_slope_it_states(kind, centre, value):
    prior = Prior(kind, centre, 0.3)
    resid, slope = prior.residual(value)
    up, down = (prior.residual(value + h)[0] for h in (1e-6, -1e-6))
    assert slope == pytest.approx((up - down) / 2e-6, rel=1e-6)
    expected = (value - centre) / 0.3 if kind == "normal" else math.log(value / centre) / 0.3
    assert resid == pytest.approx(expected)


def test_a_joint_prior_is_the_mahalanobis_distance():
    covariance = np.array([[4.0, 1.8], [1.8, 1.0]])
    joint = JointPrior(("b", "c"), np.array([2.0, -1.0]), covariance)
    params = ParameterSet(small_set().entries, joint)
    away = np.array([0.5, -0.4])
    resid, slopes = params.prior_residuals(np.array([2.0, -1.0]) + away)
    assert resid @ resid == pytest.approx(away @ np.linalg.solve(covariance, away))
    assert slopes.T @ slopes == pytest.approx(np.linalg.inv(covariance))


def test_all_problems_of_a_set_are_reported_at_once():
    with pytest.raises(FitError) as error:
        ParameterSet(
            (
                Parameter("b", 5.0, low=1.0, high=3.0),
                Parameter("b", 1.0),
                Parameter("a", 0.0, role="tied", tie=("d", 1.0, 0.0)),
            )
        )
    text = str(error.value)
    assert "3 problems" in text and "given twice" in text and "outside" in text and "not free" in text


def test_what_is_known_exactly_together_is_known_to_a_millionth():
    """A singular covariance (a, b and their sum) has no direction without a prior."""
    rows = np.array([[1.0, 0.0], [0.0, 2.0], [1.0, 2.0]])
    names = ("X_uu", "Y_v", "N_v")
    entries = tuple(Parameter(n, 1.0) for n in names)
    joint = JointPrior(names, np.ones(3), rows @ rows.T)
    precision = np.eye(3) + known_together(ParameterSet(entries, joint))
    sd = np.sqrt(np.diag(joint.covariance))
    assert np.linalg.eigvalsh(precision).min() > 0.3
    exact = np.array([1.0, 1.0, -1.0]) * sd  # a + b - c, in units of the deviations
    assert exact @ precision @ exact > 1e6 * exact @ exact


def test_independent_parameters_know_nothing_more_together():
    names = ("X_uu", "Y_v")
    joint = JointPrior(names, np.ones(2), np.diag([4.0, 9.0]))
    entries = tuple(Parameter(n, 1.0) for n in names)
    assert known_together(ParameterSet(entries, joint)) == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    assert known_together(ParameterSet(entries)) is None
