"""The lowest point is found whatever the units of the unknowns."""

import numpy as np
import pytest

from bayesid.estimation.filter_error.minimise_scaled import minimise_scaled, spread_left

SD = np.array([1.0, 0.3, 0.002, 0.05])
TURN = np.linalg.cholesky(0.5 * np.eye(4) + 0.5)  # unknowns correlated by a half


def hill(top):
    """Negative log density of a Gaussian of standard deviations `SD` about `top`, and what it was asked."""
    asked = []

    def cost(x):
        asked.append(x)
        z = np.linalg.solve(TURN, (x - top) / SD)
        return 1e5 + 0.5 * float(z @ z)

    return cost, asked


@pytest.mark.parametrize("seed", range(5))
def test_a_gaussian_of_standard_deviations_500_apart_is_climbed_within_a_few_steps(seed):
    rng = np.random.default_rng(seed)
    top = 10.0 * SD * rng.standard_normal(4)
    cost, asked = hill(top)
    wide = np.full(4, 50.0)
    found = minimise_scaled(cost, np.zeros(4), -wide, wide, np.full(4, 2.0), steps=12)
    # two slopes' steps of 0.01 sd and a gain of 0.05 nats are left
    assert cost(found) - 1e5 < 0.05
    assert len(asked) < 100


def test_a_bound_is_kept_and_the_rest_is_lowest_beside_it():
    top = np.array([2.0, 0.0, 0.01, 0.0])
    cost, _ = hill(top)
    high = np.array([1.0, 9.0, 9.0, 9.0])
    found = minimise_scaled(cost, np.zeros(4), -np.full(4, 9.0), high, np.full(4, 2.0), steps=20)
    assert found[0] == pytest.approx(1.0, abs=1e-12)
    # conditional mean of the others: half a deviation each for one
    expected = top + 0.5 * SD * (1.0 - 2.0) / SD[0]
    np.testing.assert_allclose(found[1:], expected[1:], atol=0.3 * SD[1:].max())
    np.testing.assert_allclose((found - expected)[1:] / SD[1:], 0.0, atol=0.3)


def test_a_flat_unknown_stays_where_it_began():
    found = minimise_scaled(
        lambda x: 0.5 * (x[0] / 1e-3 - 4.0) ** 2, np.zeros(2), -np.ones(2), np.ones(2), np.ones(2), 9
    )
    assert found == pytest.approx([4e-3, 0.0], abs=1e-4)


def test_the_spread_left_is_that_of_each_unknown_with_the_others_held_and_at_most_the_priors():
    top = 0.3 * SD
    cost, _ = hill(top)
    precision = np.linalg.inv(np.outer(SD, SD) * (TURN @ TURN.T))
    alone = 1.0 / np.sqrt(np.diag(precision))
    np.testing.assert_allclose(spread_left(cost, top, np.full(4, 2.0)), alone, rtol=1e-3)
    tight = np.array([0.1, 2.0, 1e-4, 2.0])
    np.testing.assert_allclose(spread_left(cost, top, tight), np.minimum(alone, tight), rtol=1e-3)


def test_an_unknown_the_cost_does_not_bend_by_keeps_the_spread_of_its_prior():
    prior = np.array([0.4, 3.0])
    assert spread_left(lambda x: x[1] - x[0] ** 2, np.zeros(2), prior) == pytest.approx(prior)
