"""A path that diverges is refused with words or is no small step; numpy's warnings stay off the screen."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.evidence.holdout import _expected
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import normal_equations, posterior
from bayesid.estimation.filter_error.fit import _joined
from bayesid.simulation.prepare import require_finite


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize("huge", [1e200, np.inf, np.nan])
def test_products_that_overflow_are_refused(huge):
    columns = np.array([[1.0, 2.0], [huge, 1.0], [-huge, 3.0]])
    with pytest.raises(ModelError):
        posterior(normal_equations(np.array([1.0, huge, 1.0]), columns, 0.0, 3))


@pytest.mark.parametrize(("step", "small"), [(1e-9, True), (1.0, False), (1e200, False), (np.nan, False)])
def test_a_step_that_diverges_is_not_a_small_one(step, small):
    states = np.zeros((4, 2))
    before = SimpleNamespace(
        slope=np.ones((4, 1, 2)), log=SimpleNamespace(sigma=np.ones(1)), point=SimpleNamespace(states=states)
    )
    assert _joined([before], [SimpleNamespace(states=states + step)]) is small


def test_draws_that_diverge_expect_any_error():
    """Control: one of forty draws lies beyond what 95 % stay below, and does not count."""
    few = np.concatenate([np.arange(39.0), [np.inf]])
    many = np.concatenate([np.arange(30.0), np.full(10, np.inf)])
    assert _expected([SimpleNamespace(chance=many)], 1.0) == np.inf
    assert 30.0 < _expected([SimpleNamespace(chance=few)], 1.0) < 39.0


def test_a_state_no_vehicle_has_is_a_divergence_before_its_square_overflows():
    t, states = np.arange(3.0), np.array([[0.0], [1e20], [1e200]])
    with pytest.raises(ModelError, match=r"diverges: u beyond all bounds from t = 2 s"):
        require_finite(t, states, ("u",))
    require_finite(t[:2], states[:2], ("u",))  # control
