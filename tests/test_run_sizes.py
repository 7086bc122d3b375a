"""Sizes run by run: when a run may be without a cause."""

import numpy as np
import pytest

from bayesid.diagnosis.run_sizes import _sizes

RUNS = [f"r{k}" for k in range(6)]


def told(sizes, sd=0.02):
    return np.array(sizes), np.diag(np.broadcast_to(np.square(sd), len(sizes)))


@pytest.mark.parametrize(
    ("sizes", "absent"),
    [
        ([1.0, 1.1, 0.9, 1.05, 0.95, 1.0], False),
        ([1.0, 1.0, 1.0, 1.0, 1.0, 0.0], True),  # one run of six is without it
        ([1.5, 0.3, 2.2, -0.4, 1.0, 0.5], True),  # as different as they are large
    ],
)
def test_a_run_may_be_without_what_differs_by_half_its_size_or_is_none_in_one(sizes, absent):
    found = _sizes([told(sizes)], np.array([np.mean(sizes)]), ["a.size"], np.array([2.0]), RUNS)
    assert found.may_be_absent == absent
    assert found.sizes["a.size"]["r1"].value == 2.0 * sizes[1] and found.sizes["a.size"]["r1"].sd == 0.04


def test_a_run_that_hardly_tells_is_not_one_without_it():
    sizes, sd = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0], np.array([0.02] * 5 + [0.6])
    found = _sizes([told(sizes, sd)], np.array([1.0]), ["a.size"], np.array([1.0]), RUNS)
    assert not found.may_be_absent
    sd[-1] = np.inf
    silent = _sizes([told(sizes, sd)], np.array([1.0]), ["a.size"], np.array([1.0]), RUNS)
    assert not silent.may_be_absent and "r5" not in silent.sizes["a.size"]


def test_an_effect_acts_where_one_of_its_sizes_does_and_its_share_is_that_of_all_together():
    """A wind of 1 along that is the same in all runs, 0.01 across that is not."""
    along, across = [1.0] * 6, [0.3, -0.3, 0.2, -0.2, 0.1, -0.04]
    found = _sizes([told(along), told(across)], np.array([1.0, 0.01]), ["w.a", "w.b"], np.ones(2), RUNS)
    assert not found.may_be_absent and found.scatter["w.a"] == 0.0
    assert found.share == pytest.approx(found.scatter["w.b"], rel=1e-3) and 0.15 < found.share < 0.35
