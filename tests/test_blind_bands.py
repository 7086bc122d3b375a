"""Bands widened by runs left out of the fit: closed forms, and coverage of runs nobody read."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.prediction.prediction import Prediction
from bayesid.trials import Run
from studies.blind_predictions.widening import (
    HORIZONS,
    chosen_level,
    covered,
    factors,
    left_out_coverage,
    misses,
    widened,
)

T = np.arange(0.0, 120.0, 4.0)


def predicted(sd, rng):
    draws = sd * rng.standard_normal((1000, 1, 2)) * np.ones((1, T.size, 1))
    return Prediction("p", "turn", T, ("x", "psi"), draws, {}, None, 10.0, 0, np.array([np.nan, np.nan]))


def logged(name, x, psi):
    return Run(name, "turn", "holdout", T, {"x": x, "psi": psi}, {})


def families(rng, count, size, p=None):
    """Runs whose error is one random offset, `size` times as large as the draws say."""
    p = predicted(1.0, rng) if p is None else p
    for k in range(count):
        error = size * rng.standard_normal(2)
        yield misses(p, logged(f"r{k}", np.full(T.size, error[0]), np.full(T.size, 2 * np.pi)), "turn")


@pytest.mark.thorough
def test_band_three_times_too_narrow_is_widened_threefold_and_holds_fresh_runs():
    rng = np.random.default_rng(4)
    p = predicted(1.0, rng)
    found = list(families(rng, 400, 3.0, p))
    scale = factors(found, 0.95)
    usual, factor = scale["x"][0]  # half of |N(0, 3)| lie below 2.02; the limit of the draws is 1.96
    assert usual == pytest.approx(2.02, rel=0.2)
    assert factor * (1.96 + usual) == pytest.approx(3.0 * 1.96, rel=0.15)
    fresh = [covered(one, scale)["x"] for one in families(rng, 400, 3.0, p)]
    assert 0.92 < np.mean(fresh) < 0.98
    unscaled = [covered(one, {"x": [[0.0, 1.0]] * len(HORIZONS)})["x"] for one in families(rng, 100, 3.0, p)]
    assert np.mean(unscaled) < 0.6  # control


def test_few_runs_raise_the_level_until_the_one_left_out_is_covered():
    found = list(families(np.random.default_rng(1), 8, 2.0))
    level = chosen_level(found)
    shares = [np.mean(list(row.values())) for row in left_out_coverage(found, level).values()]
    assert level > 0.95 and np.mean(shares) >= 0.93
    assert np.mean([np.mean(list(r.values())) for r in left_out_coverage(found, 0.5).values()]) < 0.9


def test_whole_turns_of_heading_are_no_error():
    (one,) = families(np.random.default_rng(2), 1, 1.0)
    assert one.error["psi"].max() < 0.2


def test_sides_keep_their_own_width():
    rng = np.random.default_rng(3)
    p = predicted(1.0, rng)
    skewed = Prediction(
        "p", "turn", T, p.channels, np.exp(p.draws), {}, None, 10.0, 0, np.array([np.nan, np.nan])
    )
    low, high = widened(skewed, {"x": [[0.0, 2.0]] * len(HORIZONS)})
    a, b = skewed.band()
    assert skewed.mean[0, 0] - low[0, 0] == pytest.approx(2 * (skewed.mean - a)[0, 0])
    assert high[0, 0] - skewed.mean[0, 0] == pytest.approx(2 * (b - skewed.mean)[0, 0])
    assert high[0, 1] == pytest.approx(b[0, 1])  # no factor, no change


def test_draws_that_agree_by_chance_do_not_make_the_other_bands_wide():
    rng = np.random.default_rng(7)
    sure, unsure = predicted(0.01, rng), predicted(1.0, rng)
    found = [*families(rng, 6, 1.0, sure), *families(rng, 6, 1.0, unsure)]
    low, high = widened(unsure, factors(found, 0.95))
    assert (high - low)[0, 0] < 20.0  # a factor alone makes it 4 times 100


def test_later_horizons_have_factors_of_their_own():
    p = predicted(1.0, np.random.default_rng(5))
    late = np.where(T > 70.0, 6.0, 0.5)
    scale = factors([misses(p, logged("r", late, 0 * T), "turn")], 0.95)
    sides = [factor * (1.96 + usual) for usual, factor in scale["x"]]
    assert sides[2] == pytest.approx(6.0, rel=0.2) and sides[0] < 1.0 and sides[-1] == sides[2]
