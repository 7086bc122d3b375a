"""Sizes of a disturbance and of errors of channels from errors of predictions: known sizes, none, forms."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.prediction.disturbance_size import LEAST, PredictedRun, best_sizes

TIME = np.linspace(0.1, 1.0, 200)
# what a disturbance of size 1 does: it grows with time, on another channel each
GROWTH = np.stack([np.stack([TIME**2, 0.1 * TIME], axis=1), np.stack([0.1 * TIME, TIME**3], axis=1)]) * 1e6
FIXED = 1e-4


def runs(level: tuple[float, float], own: float = 0.0, count: int = 12, seed: int = 0) -> list[PredictedRun]:
    """Runs whose errors have the variance that two sizes give, and those of the second channel itself."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        variance = FIXED + np.einsum("a,anq->nq", np.square(level), GROWTH)
        variance[:, 1] += own**2
        error = np.sqrt(variance) * rng.standard_normal(variance.shape)
        out.append(PredictedRun(("u", "v"), error, np.full(error.shape, FIXED), GROWTH))
    return out


def test_known_sizes_are_found() -> None:
    found = best_sizes(runs((1e-4, 3e-5)))
    assert found.level == pytest.approx([1e-4, 3e-5], rel=0.1)
    assert found.channel == {}


def test_no_disturbance_has_no_size() -> None:
    found = best_sizes(runs((0.0, 0.0)))
    assert np.all(np.sqrt(GROWTH[:, -1].max(axis=1)) * found.level < 0.2 * np.sqrt(FIXED))
    assert found.channel == {}


def test_errors_of_a_channel_are_told_from_a_force_and_only_where_they_are() -> None:
    found = best_sizes(runs((1e-4, LEAST), own=0.05))
    assert set(found.channel) == {"v"}
    assert found.channel["v"] == pytest.approx(0.05, rel=0.1)
    assert found.level[0] == pytest.approx(1e-4, rel=0.15)


def test_errors_that_grow_are_not_errors_of_the_channel() -> None:
    """No force explains an error that grows otherwise than its response; the first readings bound it."""
    rng = np.random.default_rng(1)
    made = []
    for run in runs((LEAST, LEAST)):
        error = run.error.copy()
        error[:, 1] += 0.5 * TIME**4 * rng.standard_normal()
        made.append(PredictedRun(run.channels, error, run.fixed, 1e-6 * run.per_axis))
    assert best_sizes(made).channel.get("v", 0.0) < 0.05


def test_the_sizes_found_have_the_largest_density() -> None:
    made = runs((1e-4, 3e-5), own=0.02)
    found = best_sizes(made)

    def density(level: np.ndarray, own: float) -> float:
        total = 0.0
        for run in made:
            v = run.fixed + np.einsum("a,anq->nq", level**2, run.per_axis)
            v[:, 1] += own**2
            total += float(np.mean(-0.5 * np.log(2 * np.pi * v) - 0.5 * run.error**2 / v))
        return total / len(made)

    own = found.channel.get("v", 0.0)
    assert density(found.level, own) == pytest.approx(found.density, rel=1e-6)
    for factor in (0.8, 1.25):
        assert density(found.level * factor, own) < found.density


def test_a_channel_that_a_run_has_not_read_does_not_count_there() -> None:
    made = runs((1e-4, 3e-5))
    blind = [
        PredictedRun(r.channels, np.where([True, k % 2 == 0], r.error, np.nan), r.fixed, r.per_axis)
        for k, r in enumerate(made)
    ]
    assert best_sizes(blind).level == pytest.approx([1e-4, 3e-5], rel=0.2)
