"""Ranks, bands and coverage on cases whose answer is known."""

import numpy as np
import pytest
from scipy.stats import binom

from bayesid.estimation.sampling.rank_statistics import bands, coverage, distribution, inside, rank_of


def replicates(count, shift=0.0, width=1.0, unknowns=5, seed=0):
    """Conjugate toy: truth and draws of the same normal, unless shifted or stretched."""
    rng = np.random.default_rng(seed)
    ranks, hits = [], []
    for _ in range(count):
        centre = rng.standard_normal(unknowns)
        truth = centre + rng.standard_normal(unknowns)
        draws = centre + shift + width * rng.standard_normal((500, unknowns))
        ranks.append(rank_of(draws, truth, 99))
        hits.append(inside(draws, truth, 0.9))
    return np.array(ranks), np.array(hits)


def test_right_posteriors_stay_in_the_bands_and_cover_nine_in_ten():
    ranks, hits = replicates(200)
    assert bands(200, 5, 99).holds(distribution(ranks, 99)).all()
    found = coverage(hits)
    assert abs(found["share"] - 0.9) < 4 * found["standard_error"]


@pytest.mark.parametrize("wrong", [dict(shift=0.5), dict(width=0.7), dict(width=1.5)])
def test_shifted_narrow_and_wide_posteriors_leave_the_bands(wrong):
    ranks, _ = replicates(200, **wrong)
    assert not bands(200, 5, 99).holds(distribution(ranks, 99)).any()


def test_bands_hold_all_unknowns_at_once_as_often_as_they_say():
    band, rng = bands(100, 8, 49, trials=1500), np.random.default_rng(9)
    kept = [band.holds(distribution(rng.integers(0, 50, (100, 8)), 49)).all() for _ in range(400)]
    # 400 trials at 0.95: sd 0.011; discreteness makes the bands a little wide, never narrow
    assert 0.95 - 3.5 * 0.011 < np.mean(kept) <= 1.0


def test_bands_of_one_unknown_at_one_rank_are_wider_than_the_pointwise_interval():
    band = bands(200, 1, 99)
    low, high = binom.interval(0.95, 200, 0.5)
    assert band.low[49] < low / 200 and band.high[49] > high / 200


def test_a_rank_counts_draws_below_the_truth():
    draws = np.arange(100.0)[:, None]
    assert rank_of(draws, np.array([-1.0]), 99) == 0
    assert rank_of(draws, np.array([1000.0]), 99) == 99
    assert inside(draws, np.array([50.0]), 0.5) and not inside(draws, np.array([99.0]), 0.5)
