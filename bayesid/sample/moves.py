"""How walkers move: emcee's stretch and differential evolution, and a step towards a Gaussian.

Takes weights. Gives emcee moves for whitened coordinates. emcee 3.1.6's DESnookerMove is not among them: it
samples a distribution that is too narrow (sd 0.90 instead of 1 in 20 dimensions; emcee pull request 531).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from emcee.moves import DEMove, StretchMove
from emcee.moves.red_blue import RedBlueMove

Array = np.ndarray

# Measured on whitened posteriors of vehicles: the Gaussian step does most of the work where they are near
# normal, differential evolution where they are not; stretches keep walkers of different scale in touch.
WEIGHTS: Mapping[str, float] = MappingProxyType({"gaussian": 0.5, "de": 0.4, "stretch": 0.1})
LENGTHS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, eq=False)
class Reference:
    """Gaussian the third move is made for.

    mean : (k,)
    root : (k, k) A with A A^T = covariance
    """

    mean: Array
    root: Array

    @staticmethod
    def standard(k: int) -> Reference:
        """Of whitened coordinates before anything was sampled."""
        return Reference(np.zeros(k), np.eye(k))

    @staticmethod
    def of(points: Array) -> Reference:
        """Moments of (n, k) points."""
        covariance = np.atleast_2d(np.cov(points, rowvar=False))
        values, vectors = np.linalg.eigh(covariance)
        return Reference(points.mean(axis=0), vectors * np.sqrt(np.maximum(values, 1e-12 * values.max())))


class GaussianMove(RedBlueMove):
    """Preconditioned Crank-Nicolson step with regard to a fixed Gaussian (Cotter et al. 2013).

    x' = m + sqrt(1 - b^2) (x - m) + b xi with xi ~ N(0, C) leaves N(m, C) as it is, so that only the ratio of
    the target to it decides on acceptance: long steps in any number of dimensions where the target is nearly
    normal. b is drawn per walker and step, so that some short steps are left where it is not. C is a little
    wider than the reference, for the tails.
    """

    def __init__(self, reference: Reference, widen: float = 1.1) -> None:
        super().__init__()
        self.mean, self.root = reference.mean, widen * reference.root
        self.inverse = np.linalg.inv(self.root)

    def get_proposal(self, s: Array, c: Any, random: Any) -> tuple[Array, Array]:
        """Proposals (n, k), and log of the ratio of the reference at the old and new points."""
        n, k = s.shape
        b = np.asarray(LENGTHS)[random.randint(len(LENGTHS), size=n)][:, None]
        old = (s - self.mean) @ self.inverse.T
        new = np.sqrt(1 - b * b) * old + b * random.randn(n, k)
        factor = 0.5 * (np.sum(new * new, axis=1) - np.sum(old * old, axis=1))
        return self.mean + new @ self.root.T, factor


def make_moves(reference: Reference, weights: Mapping[str, float] | None = None) -> list[tuple[Any, float]]:
    """Moves with their weights, as emcee's sampler takes them."""
    makers = {"gaussian": lambda: GaussianMove(reference), "de": DEMove, "stretch": StretchMove}
    chosen = WEIGHTS if weights is None else weights
    return [(makers[name](), weight) for name, weight in chosen.items() if weight > 0]
