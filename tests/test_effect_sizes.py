"""Sizes of effects: from few runs, and over all explanations that hold them."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest
from scipy import stats

from bayesid.diagnosis.hypotheses import sizes
from bayesid.diagnosis.hypotheses.candidate import widened_by_few
from bayesid.diagnosis.threshold_table import SIZE_DEVIATIONS


@pytest.mark.parametrize("runs", [3, 4, 7])
def test_deviations_from_few_runs_hold_95_of_100_means(runs):
    """Means of `runs` normal sizes: 1.96 of their widened deviation hold the truth, of the plain one less."""
    drawn = np.random.default_rng(runs).standard_normal((40_000, runs))
    mean, sd = drawn.mean(1), drawn.std(1, ddof=1) / np.sqrt(runs)
    assert np.mean(np.abs(mean) < 1.96 * widened_by_few(runs) * sd) == pytest.approx(0.95, abs=0.005)
    assert np.mean(np.abs(mean) < 1.96 * sd) < 0.91


def test_many_runs_widen_nothing_and_two_as_much_as_cauchy():
    assert widened_by_few(10_000) == pytest.approx(1.0, abs=1e-3)
    assert widened_by_few(2) == pytest.approx(stats.cauchy.ppf(0.975) / stats.norm.ppf(0.975))


@pytest.fixture
def world(monkeypatch):
    """Three explanations with a lag, one without; each with its table."""
    tables = {
        ("lag",): {"lag.tau": (2.0, 0.1)},
        ("lag", "wind"): {"lag.tau": (3.0, 0.2), "wind.u": (5.0, 1.0)},
        ("lag", "stall"): {"lag.tau": (9.0, 0.1)},
        ("wind",): {"wind.u": (7.0, 1.0)},
    }
    refits = [Plain(effects=k, widens=False, follows=k != ("lag", "stall")) for k in tables]
    monkeypatch.setattr(sizes, "parameters_told", lambda problem, c: dict(tables[c.effects]))
    monkeypatch.setattr(sizes, "explains", lambda c: c.follows)
    weights = {("lag",): 0.6, ("lag", "wind"): 0.2, ("lag", "stall"): 0.1, ("wind",): 0.1}
    return refits, Plain(refits=refits, sets=weights)


def test_a_size_is_that_of_the_mixture_of_all_explanations_that_hold_the_effect(world):
    refits, candidates = world
    found = sizes.sizes_told(Plain(form="a form"), candidates, refits[1])
    drawn = np.random.default_rng(0).choice([0, 1], 400_000, p=[0.75, 0.25])
    lags = np.random.default_rng(1).normal(np.array([2.0, 3.0])[drawn], np.array([0.1, 0.2])[drawn])
    assert found["lag.tau"] == pytest.approx((lags.mean(), SIZE_DEVIATIONS * lags.std()), abs=3e-3)
    assert found["wind.u"][0] == pytest.approx((0.2 * 5.0 + 0.1 * 7.0) / 0.3)
    assert sizes.sizes_told(Plain(form=None), candidates, refits[1])["lag.tau"] == (3.0, 0.2)


def test_an_effect_of_no_weighed_explanation_keeps_the_size_of_the_best(world):
    refits, candidates = world
    candidates.sets = {("wind",): 1.0}
    assert sizes.sizes_told(Plain(form="a form"), candidates, refits[0])["lag.tau"] == pytest.approx(
        (2.0, 0.1 * SIZE_DEVIATIONS)
    )
