"""What straight runs have in common is told from disturbance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesid.estimation.filter_error.common_forces import COMMON_CORRELATION, agreement


def disturbance(rng, n, keep):
    return lfilter([1.0], [1.0, -keep], rng.standard_normal(n))


@pytest.mark.parametrize("keep", [0.0, 0.6, 0.9])
def test_independent_process_noise_agrees_by_chance_only(keep):
    rng = np.random.default_rng(1)
    found = np.array(
        [agreement(disturbance(rng, 300, keep), disturbance(rng, 300, keep)) for _ in range(400)]
    )
    assert abs(found.mean()) < 0.2
    assert 0.8 < found.std() < 1.25
    assert (found > COMMON_CORRELATION).mean() < 0.04


def test_a_force_that_comes_back_is_found_under_process_noise_of_its_own_size():
    rng = np.random.default_rng(2)
    common = disturbance(rng, 300, 0.6)
    found = [
        agreement(common + disturbance(rng, 300, 0.6), common + disturbance(rng, 300, 0.6)) for _ in range(50)
    ]
    assert np.mean(np.array(found) > COMMON_CORRELATION) > 0.95


def test_nothing_agrees_with_silence():
    assert agreement(np.zeros(50), np.arange(50.0)) == 0.0
