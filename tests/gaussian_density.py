"""Densities whose moments are known, for tests of samplers."""

from __future__ import annotations

import numpy as np

from bayesid.estimation.sampling import Laplace, Unknowns


class GaussianDensity:
    """N(mean, covariance), optionally unknown (nan) where the first coordinate exceeds `edge`."""

    def __init__(self, mean, covariance, edge=np.inf):
        self.mean, self.covariance, self.edge = np.asarray(mean), np.asarray(covariance), edge
        k = self.mean.size
        wide = np.full(k, np.inf)
        self.unknowns = Unknowns(
            tuple(f"p{i}" for i in range(k)), k, -wide, wide, np.zeros(k), wide, np.ones(k)
        )
        self.digest = f"gaussian {k}"
        self._precision = np.linalg.inv(self.covariance)

    def log_prob(self, q):
        d = q - self.mean
        out = -0.5 * np.einsum("bi,ij,bj->b", d, self._precision, d)
        return np.where(q[:, 0] > self.edge, np.nan, out)

    def natural(self, q):
        return np.array(q)


def correlated(k: int, seed: int = 1) -> tuple[GaussianDensity, Laplace]:
    """Strongly correlated Gaussian, and a Laplace approximation that is off by a third."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((k, k))
    covariance = a @ a.T + 0.01 * np.eye(k)
    mean = rng.standard_normal(k)
    return GaussianDensity(mean, covariance), Laplace(
        mean + 0.3 * np.sqrt(np.diag(covariance)), 1.3 * covariance
    )
