"""What a sampler needs of a posterior density, and the Gaussian it starts from.

Takes nothing of trials or models: a linear-Gaussian toy and a vehicle's posterior are sampled alike.
Does not sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri

Array = np.ndarray
SWEEPS = 50


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What is sampled, in natural units (SI), the model's parameters first.

    Attributes
    ----------
    names : (k,) parameters, then initial states "run:psi(0)", then "sigma:psi" and "phi:psi" of the noise
    n_params : how many of them are parameters of the model
    low, high : (k,) bounds, infinite where there are none
    prior_mean, prior_sd : (k,) of the prior; infinite sd where it is flat without bounds
    file_scale : (k,) SI value over value in the vehicle file, 1 for what a file does not hold
    """

    names: tuple[str, ...]
    n_params: int
    low: Array
    high: Array
    prior_mean: Array
    prior_sd: Array
    file_scale: Array


class Density(Protocol):
    """A posterior density in sampling coordinates q (k,), in which no unknown but the bounded is confined."""

    @property
    def unknowns(self) -> Unknowns: ...

    @property
    def digest(self) -> str:
        """Hash of all that decides the density; a stored chain is continued only under the same one."""
        ...

    def log_prob(self, q: Array) -> Array:
        """(b,) log density of (b, k) points by q, up to one constant; -inf where it is zero or unknown."""
        ...

    def natural(self, q: Array) -> Array:
        """(..., k) points in natural units."""
        ...


@dataclass(frozen=True, eq=False)
class Laplace:
    """Gaussian about the mode, in sampling coordinates, cut at the bounds.

    mode : (k,)
    covariance : (k, k); positive definite
    low, high : (k,) bounds; None for none
    """

    mode: Array
    covariance: Array
    low: Array | None = None
    high: Array | None = None

    @cached_property
    def root(self) -> Array:
        """(k, k) matrix A with A A^T = covariance; columns along the axes of the ellipsoid."""
        sd = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(sd, sd))
        return sd[:, None] * vectors * np.sqrt(np.maximum(values, 1e-14 * values.max()))

    @cached_property
    def inverse_root(self) -> Array:
        """(k, k) inverse of `root`."""
        return np.asarray(np.linalg.inv(self.root))

    def points(self, x: Array) -> Array:
        """Sampling coordinates of whitened ones (..., k)."""
        return np.asarray(self.mode + x @ self.root.T)

    def whitened(self, q: Array) -> Array:
        """Whitened coordinates, in which the Gaussian is standard normal."""
        return np.asarray((q - self.mode) @ self.inverse_root.T)

    def draw(self, count: int, spread: float, random: np.random.RandomState) -> Array:
        """(count, k) draws from a Gaussian `spread` times as wide, within the bounds.

        Draws outside are pulled towards the mode until they are inside and then moved by sweeps of a Gibbs
        sampler of the cut Gaussian: with eight parameters held by bounds alone one draw in fifty is inside.
        """
        x = self.mode + spread * random.standard_normal((count, self.mode.size)) @ self.root.T
        if self.low is None or self.high is None:
            return x
        low, high = self.low, self.high
        outside = ~np.all((x >= low) & (x <= high), axis=1)
        if not outside.any():
            return x
        step = x[outside] - self.mode
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (high - self.mode) / step, (low - self.mode) / step)
        room = np.where(step == 0, np.inf, np.maximum(room, 0.0))
        share = np.minimum(room.min(axis=1), 1.0) * random.uniform(size=step.shape[0])
        x[outside] = self._swept(self.mode + step * share[:, None], spread, random)
        return x

    def _swept(self, x: Array, spread: float, random: np.random.RandomState) -> Array:
        sd = np.sqrt(np.diag(self.covariance))
        precision = np.linalg.inv(self.covariance / np.outer(sd, sd)) / spread**2
        low, high = ((np.asarray(b) - self.mode) / sd for b in (self.low, self.high))
        z = (x - self.mode) / sd
        for _ in range(SWEEPS):
            for i in range(sd.size):
                width = 1.0 / np.sqrt(precision[i, i])
                centre = z[:, i] - (z @ precision[i]) / precision[i, i]
                a, b = ndtr((low[i] - centre) / width), ndtr((high[i] - centre) / width)
                value = ndtri(np.clip(a + (b - a) * random.uniform(size=a.size), 1e-15, 1 - 1e-15))
                z[:, i] = np.clip(centre + width * value, low[i], high[i])
        return np.asarray(self.mode + z * sd)
