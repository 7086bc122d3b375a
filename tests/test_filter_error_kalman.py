"""The filter against dense Gaussian algebra: every covariance written out, one solve, no recursion."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from bayesid.estimation.filter_error.kalman import whiten
from bayesid.estimation.filter_error.smoother import smooth, smooth_filtered

# Both sides are exact in exact arithmetic; what is left is the rounding of a 12-step recursion.
CLOSE = 1e-8


class Run:
    """A random run: 12 samples, 3 channels, 4 states, 2 latent inputs, 1 drift in two channels."""

    def __init__(self, seed, missing=0.2, nf=2, nd=1):
        rng = np.random.default_rng(seed)
        self.n, self.q, self.nx, self.nf, self.nd, self.c = 12, 3, 4, nf, nd, 3
        n, q, nx, c = self.n, self.q, self.nx, self.c
        self.phi = np.eye(nx) + 0.2 * rng.standard_normal((n - 1, nx, nx))
        self.gamma = 0.3 * rng.standard_normal((n - 1, nx, nf))
        self.slope = rng.standard_normal((n, q, nx))
        self.variance = rng.uniform(0.5, 1.0, q)
        self.decay_f = np.exp(-rng.uniform(0.1, 0.5, (n - 1, nf)))
        self.variance_f = rng.uniform(0.5, 1.5, nf)
        self.drift = np.zeros((q, nd))
        if nd:
            self.drift[:2, 0] = 1.0, 0.5
        self.decay_d = np.exp(-rng.uniform(0.05, 0.2, (n - 1, nd)))
        self.variance_d = rng.uniform(0.5, 1.0, nd)
        self.start = rng.uniform(0.1, 1.0, nx)
        self.columns = rng.standard_normal((n, q, c))
        self.drive = rng.standard_normal((n - 1, nx, c))
        self.first = rng.standard_normal((nx, c))
        self.valid = rng.uniform(size=(n, q)) > missing

    def settings(self):
        return (
            self.valid, self.slope, self.variance, self.phi, self.gamma, self.decay_f, self.variance_f,
            self.drift, self.decay_d, self.variance_d, self.start,
        )  # fmt: skip

    def whiten(self):
        out = np.full((self.n * self.q, self.c), np.nan)
        logdet, used = whiten(self.columns, self.drive, self.first, *self.settings(), out)
        return out, logdet, used

    def smooth(self, column=0):
        m = self.nx + self.nf + self.nd
        mean, var = np.empty((self.n, m)), np.empty((self.n, m))
        standard, alone = np.empty((self.n, self.q)), np.empty((self.n, self.q))
        data = [a[..., column].copy() for a in (self.columns, self.drive, self.first)]
        smooth(*data, *self.settings(), mean, var, standard, alone)
        return mean, var, standard, alone

    def dense(self):
        """Unknowns [dx, f, d]: mean, covariance. Readings: matrix, covariance, distance from their mean."""
        n, q, nx, nf, nd = self.n, self.q, self.nx, self.nf, self.nd
        m = nx + nf + nd
        lift = np.zeros((n * m, n * m))  # unknowns = lift @ independent increments
        noise = [np.diag(np.r_[self.start, self.variance_f, self.variance_d])]
        mean = np.zeros((n, m, self.c))
        mean[0, :nx] = self.first
        lift[:m, :m] = np.eye(m)
        for i in range(1, n):
            step = block_diag(self.phi[i - 1], np.diag(self.decay_f[i - 1]), np.diag(self.decay_d[i - 1]))
            step[:nx, nx : nx + nf] = self.gamma[i - 1]
            here, before = slice(i * m, (i + 1) * m), slice((i - 1) * m, i * m)
            lift[here] = step @ lift[before]
            lift[here, here] += np.eye(m)
            mean[i] = step @ mean[i - 1]
            mean[i, :nx] += self.drive[i - 1]
            fresh_f = self.variance_f * (1 - self.decay_f[i - 1] ** 2)
            fresh_d = self.variance_d * (1 - self.decay_d[i - 1] ** 2)
            noise.append(np.diag(np.r_[np.zeros(nx), fresh_f, fresh_d]))
        covariance = lift @ block_diag(*noise) @ lift.T
        read = np.zeros((n * q, n * m))
        for i in range(n):
            read[i * q : (i + 1) * q, i * m : i * m + nx] = self.slope[i]
            read[i * q : (i + 1) * q, i * m + nx + nf : (i + 1) * m] = self.drift
        kept = self.valid.ravel()
        read = read[kept]
        spread = read @ covariance @ read.T + np.diag(np.tile(self.variance, n)[kept])
        mean = mean.reshape(n * m, self.c)
        return mean, covariance, read, spread, self.columns.reshape(n * q, self.c)[kept] - read @ mean


CASES = [
    pytest.param(dict(seed=0), id="missing readings, forces, drift"),
    pytest.param(dict(seed=1, missing=0.0), id="nothing missing"),
    pytest.param(dict(seed=2, missing=0.8), id="most missing"),
    pytest.param(dict(seed=3, nf=0, nd=0), id="white noise only"),
    pytest.param(dict(seed=4, nd=0), id="no drift"),
]


@pytest.mark.parametrize("case", CASES)
def test_whitened_products_and_determinant_are_those_of_dense_algebra(case):
    run = Run(**case)
    out, logdet, used = run.whiten()
    _, _, _, spread, resid = run.dense()
    assert used == run.valid.sum()
    assert abs(logdet - np.linalg.slogdet(spread)[1]) < CLOSE
    # residual's square, columns' residual and columns' columns at once: all a likelihood needs
    np.testing.assert_allclose(out.T @ out, resid.T @ np.linalg.solve(spread, resid), rtol=CLOSE, atol=CLOSE)


@pytest.mark.parametrize("case", CASES)
def test_smoothed_mean_and_variance_are_those_of_dense_algebra(case):
    run = Run(**case)
    mean, var, _, _ = run.smooth()
    prior, covariance, read, spread, resid = run.dense()
    gain = np.linalg.solve(spread, read @ covariance).T
    np.testing.assert_allclose(mean.ravel(), prior[:, 0] + gain @ resid[:, 0], rtol=CLOSE, atol=CLOSE)
    left = np.diag(covariance - gain @ read @ covariance)
    np.testing.assert_allclose(var.ravel(), left, rtol=CLOSE, atol=CLOSE)


def test_standardised_innovations_are_the_whitened_residual():
    run = Run(5)
    out, _, _ = run.whiten()
    _, _, standard, _ = run.smooth()
    np.testing.assert_allclose(standard.ravel(), out[:, 0], rtol=CLOSE, atol=CLOSE)


@pytest.mark.parametrize("case", CASES)
def test_the_misfit_of_a_reading_given_all_others_is_that_of_dense_algebra(case):
    run = Run(**case)
    _, _, _, alone = run.smooth()
    _, _, _, spread, resid = run.dense()
    # leave one out: e_i - E[e_i | others] = (S^-1 e)_i / (S^-1)_ii, of variance 1/(S^-1)_ii
    inverse = np.linalg.inv(spread)
    expected = (inverse @ resid[:, 0]) / np.sqrt(np.diag(inverse))
    np.testing.assert_allclose(alone[run.valid], expected, rtol=CLOSE, atol=CLOSE)
    assert not alone[~run.valid].any()


def test_a_missing_reading_leaves_no_trace_whatever_stands_in_its_place():
    run, other = Run(6), Run(6)
    other.columns = np.where(run.valid[:, :, None], run.columns, 1e6)
    np.testing.assert_array_equal(run.whiten()[0], other.whiten()[0])
    np.testing.assert_array_equal(run.smooth()[0], other.smooth()[0])
    assert not run.whiten()[0][~run.valid.ravel()].any()


def test_a_filter_that_forgets_the_drive_is_caught_by_the_dense_algebra():
    # control: the comparison above must fail when one of its inputs is left out
    run = Run(0)
    _, _, _, spread, resid = run.dense()
    run.drive = np.zeros_like(run.drive)
    out, _, _ = run.whiten()
    assert np.abs(out.T @ out - resid.T @ np.linalg.solve(spread, resid)).max() > 1.0


def test_an_unstable_hull_does_not_spoil_long_runs():
    # sway, yaw rate and course of remus100 in a straight run at 2 Hz, growing by 1.4 a sample: what rounding
    # leaves unsymmetric grows by the square of that if left to itself
    rng, n = np.random.default_rng(7), 280
    step = np.array([[1.0, 0.466, 0.108, 0.033], [0.0, 1.0, 0.42, 0.484], [0.0, 0.0, 0.897, 0.207],
                     [0.0, 0.0, 1.586, 1.001]])  # fmt: skip
    phi = np.tile(step, (n - 1, 1, 1))
    assert abs(np.linalg.eigvals(step)).max() > 1.4
    slope = np.zeros((n, 2, 4))
    slope[:, 0, 0] = slope[:, 1, 3] = 1.0  # each reading is one state: its variance is on the diagonal
    sigma2 = np.array([0.05, 1e-6])

    def smoothed(valid):
        mean, var = np.empty((n, 5)), np.empty((n, 5))
        standard, alone = np.empty((n, 2)), np.empty((n, 2))
        smooth(
            resid, np.zeros((n - 1, 4)), np.zeros(4), valid, slope, sigma2, phi,
            0.01 * np.ones((n - 1, 4, 1)), np.full((n - 1, 1), 0.8), np.array([1.0]), np.zeros((2, 0)),
            np.zeros((n - 1, 0)), np.zeros(0), np.array([9.0, 0.09, 0.2, 0.3]), mean, var, standard, alone,
        )  # fmt: skip
        return mean, var, alone

    resid = np.sqrt(sigma2) * rng.standard_normal((n, 2))
    _, var, alone = smoothed(np.ones((n, 2), dtype=bool))
    assert (var >= 0.0).all() and np.isfinite(alone).all()
    for i, j in ((0, 1), (3, 0), (100, 1), (198, 0)):
        others = np.ones((n, 2), dtype=bool)
        others[i, j] = False
        mean, var, _ = smoothed(others)
        k = (0, 3)[j]
        expected = (resid[i, j] - mean[i, k]) / np.sqrt(sigma2[j] + var[i, k])
        assert abs(alone[i, j] - expected) < 1e-6


def test_a_run_smoothed_in_blocks_gives_the_very_same_numbers():
    run = Run(7)
    found = []
    for most in (run.n, 5, 1):
        m = run.nx + run.nf + run.nd
        out = [np.empty((run.n, k)) for k in (m, m, run.q, run.q, m)]
        data = [a[..., 0].copy() for a in (run.columns, run.drive, run.first)]
        smooth_filtered(*data, *run.settings(), *out, most)
        found.append(out)
    for other in found[1:]:
        for one, two in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(one, two)
