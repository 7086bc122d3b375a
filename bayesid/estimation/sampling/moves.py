"""How walkers move: emcee's stretch and differential evolution, and a step towards a Gaussian.

Takes weights. Gives emcee moves for whitened coordinates. emcee 3.1.6's DESnookerMove is not among them: it
samples a distribution that is too narrow (sd 0.90 instead of 1 in 20 dimensions; emcee pull request 531).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from emcee import State
from emcee.moves import DEMove, StretchMove
from emcee.moves.move import Move
from emcee.moves.red_blue import RedBlueMove

Array = np.ndarray

# Measured on whitened posteriors of vehicles: the Gaussian step does most of the work where they are near
# normal, differential evolution where they are not; stretches keep walkers of different scale in touch.
WEIGHTS: Mapping[str, float] = MappingProxyType({"gaussian": 0.6, "de": 0.3, "stretch": 0.1})
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
    def of(points: Array, worth: float) -> Reference:
        """Moments of (n, k) whitened points worth so many independent ones.

        The covariance is drawn towards that of the Laplace approximation, which counts as five points per
        dimension: of few points it is nearly flat in some direction, and steps along it would all be short.
        The mean is not, beyond one point: a fit weighs channels by stated noise, and where the sampled noise
        is another the posterior lies many of its widths from the fit.
        """
        k = points.shape[1]
        share = worth / (worth + 5.0 * k)
        covariance = share * np.atleast_2d(np.cov(points, rowvar=False)) + (1 - share) * np.eye(k)
        values, vectors = np.linalg.eigh(covariance)
        return Reference(worth / (worth + 1.0) * points.mean(axis=0), vectors * np.sqrt(values))


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


class SideBySide(Move):
    """One move made by several ensembles at once, each among its own walkers only.

    The ensembles lie one after the other in emcee's list of walkers. They share calls of the density and the
    stream of random numbers, nothing else: a call for all costs a third of one for each.
    """

    def __init__(self, moves: Sequence[Any], splits: int) -> None:
        self.moves, self.splits = tuple(moves), splits

    def propose(self, model: Any, state: Any) -> tuple[Any, Array]:
        """State after the move, and which walkers accepted; as emcee's `RedBlueMove.propose`."""
        count, k = len(self.moves), state.coords.shape[1]
        size = state.coords.shape[0] // count
        part = np.stack([model.random.permutation(np.arange(size) % self.splits) for _ in self.moves])
        accepted = np.zeros(state.coords.shape[0], dtype=bool)
        for split in range(self.splits):
            found = []
            for move, points, own in zip(self.moves, state.coords.reshape(count, size, k), part, strict=True):
                move.setup(points)
                others = [points[own == j] for j in range(self.splits) if j != split]
                found.append(move.get_proposal(points[own == split], others, model.random))
            proposed, factors = (np.concatenate([f[i] for f in found]) for i in (0, 1))
            here = (part == split).ravel()
            values, _ = model.compute_log_prob_fn(proposed)
            gain = factors + values - state.log_prob[here]
            accepted[here] = gain > np.log(model.random.uniform(size=gain.size))
            state = self.update(state, State(proposed, log_prob=values), accepted, here)
        return state, accepted


def make_moves(
    references: Sequence[Reference], weights: Mapping[str, float] | None = None
) -> list[tuple[Any, float]]:
    """Moves of ensembles side by side, one per reference, and their weights, as emcee takes them."""
    makers: dict[str, tuple[Callable[[Reference], Any], int]] = {
        "gaussian": (GaussianMove, 1),  # walkers do not look at each other: all move at once
        "de": (lambda _: DEMove(), 2),
        "stretch": (lambda _: StretchMove(), 2),
    }
    found = []
    for name, weight in (WEIGHTS if weights is None else weights).items():
        make, splits = makers[name]
        if weight > 0:
            found.append((SideBySide([make(r) for r in references], splits), weight))
    return found
