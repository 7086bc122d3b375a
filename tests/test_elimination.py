"""Initial states taken out run by run, against the dense problem."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.estimation.output_error.curvature import predicted_gain, root_of_covariance
from bayesid.estimation.output_error.elimination import eliminated

K, STARTS, READINGS = 3, (2, 0, 3), (9, 7, 11)


def problem_of(seed, unfelt=False):
    """Three runs of random slopes, priors on two parameters and on all initial states but those not felt."""
    rng = np.random.default_rng(seed)
    blocks = [
        (rng.standard_normal(n), rng.standard_normal((n, K + s)))
        for n, s in zip(READINGS, STARTS, strict=True)
    ]
    total = K + sum(STARTS)
    prior = np.zeros((2 + sum(STARTS), total))
    prior[[0, 1], [0, 2]] = 0.7
    prior[2 + np.arange(sum(STARTS)), K + np.arange(sum(STARTS))] = 0.3
    if unfelt:
        blocks[0][1][:, -1] = 0.0
        prior[3] = 0.0
    resid = rng.standard_normal(len(prior))
    bound = np.concatenate([[0.05, np.inf, np.inf], np.full(sum(STARTS), np.inf)])
    runs = [
        SimpleNamespace(initial=("x",) * s, initial_sd=np.ones(s), readings=np.ones((n, 1)), sigma=np.ones(1))
        for n, s in zip(READINGS, STARTS, strict=True)
    ]
    scale = rng.uniform(0.5, 2.0, total)
    found = SimpleNamespace(
        params=SimpleNamespace(names=("a", "b", "c")), runs=runs, scale=scale, low=-bound, high=bound,
        prior=lambda z: (resid, prior),
        triangles=lambda z: [np.linalg.qr(np.column_stack([j, r]), mode="r") for r, j in blocks],
    )  # fmt: skip
    rows, at = [], K
    for (_, jac), s in zip(blocks, STARTS, strict=True):
        wide = np.zeros((len(jac), total))
        wide[:, :K], wide[:, at : at + s] = jac[:, :K], jac[:, K:]
        at += s
        rows.append(wide)
    whole = np.vstack([*rows, prior]) * scale
    return found, whole, np.concatenate([*(r for r, _ in blocks), resid])


@pytest.mark.parametrize("seed", range(3))
def test_covariance_and_squares_are_those_of_the_dense_problem(seed):
    problem, jac, resid = problem_of(seed)
    at = np.zeros(jac.shape[1])
    left = eliminated(problem, at, problem.triangles(at))
    dense = np.linalg.inv(jac.T @ jac)
    root = root_of_covariance(left.jac)
    np.testing.assert_allclose(root @ root.T, dense[:K, :K], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(left.state_variance(root), np.diag(dense)[K:], rtol=1e-9)
    assert left.squares == pytest.approx(resid @ resid, rel=1e-12)


@pytest.mark.parametrize("unfelt", [False, True])
def test_gain_is_that_of_the_best_step_within_the_bounds(unfelt):
    """By brute force: the bounded parameter on either bound or free, all others by least squares."""
    problem, jac, resid = problem_of(7, unfelt)
    gains = []
    for fixed in (None, -0.05 / problem.scale[0], 0.05 / problem.scale[0]):
        free = jac if fixed is None else jac[:, 1:]
        target = -resid if fixed is None else -resid - jac[:, 0] * fixed
        step = np.linalg.lstsq(free, target, rcond=1e-12)[0]
        first = step[0] if fixed is None else fixed
        if abs(first) <= 0.05 / problem.scale[0] * (1 + 1e-9):
            gains.append(0.5 * (resid @ resid - np.sum((free @ step - target) ** 2)))
    assert predicted_gain(problem, np.zeros(jac.shape[1]))[0] == pytest.approx(max(gains), rel=1e-6)


def test_an_initial_state_that_nothing_holds_has_no_deviation():
    problem, jac, _ = problem_of(3, unfelt=True)
    at = np.zeros(jac.shape[1])
    left = eliminated(problem, at, problem.triangles(at))
    root = root_of_covariance(left.jac)
    variance = left.state_variance(root)
    assert np.isinf(variance[:2]).all() and np.isfinite(variance[2:]).all()
    seen = np.delete(jac, K + 1, axis=1)
    np.testing.assert_allclose(root @ root.T, np.linalg.inv(seen.T @ seen)[:K, :K], rtol=1e-9)
