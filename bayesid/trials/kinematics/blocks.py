"""A run cut into blocks of time over which displacements and integrals are compared.

Takes times and series. Noise and irregular sampling average out over a block; slower channels are
interpolated across their empty cells, the blocks begin and end where the compared channel was read.
"""

from __future__ import annotations

import numpy as np

from bayesid.trials.trial import Floats

LONGEST_HOLE = 5.0  # in median steps of a channel: farther apart, its readings are not joined


def joined(t: Floats, values: Floats) -> tuple[Floats, np.ndarray]:
    """Values interpolated between a channel's own readings, and where they are within `LONGEST_HOLE`."""
    good = np.flatnonzero(np.isfinite(values))
    if good.size < 2:
        return np.zeros(t.shape), np.zeros(t.shape, dtype=bool)
    if good.size == t.size:
        return values, np.ones(t.shape, dtype=bool)
    knots = t[good]
    gaps = np.diff(knots)
    long = gaps > LONGEST_HOLE * np.median(gaps)
    at = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, gaps.size - 1)
    known = (t >= knots[0]) & (t <= knots[-1]) & ~(long[at] & (t != knots[at]) & (t != knots[at + 1]))
    return np.interp(t, knots, values[good]), known


class Blocks:
    """Consecutive blocks of about equal duration.

    Attributes
    ----------
    first, last : (n,) samples at which a block begins and ends
    span : (n,) duration [s]
    """

    def __init__(self, t: Floats, read: np.ndarray, known: np.ndarray, most: int, at_least: int) -> None:
        """
        Parameters
        ----------
        read : (m,) where the compared channels were read: blocks begin and end there
        known : (m,) where all channels are known or joined
        most : number of blocks at most
        at_least : readings in a block
        """
        self.t, self.step = t, np.diff(t)
        knots = np.flatnonzero(read & known)
        self.first = self.last = np.zeros(0, dtype=int)
        self.span = np.zeros(0)
        if knots.size < 2 * at_least:
            return
        count = max(2, min(most, (knots.size - 1) // at_least))
        edge = np.searchsorted(t[knots], np.linspace(t[knots[0]], t[knots[-1]], count + 1))
        edge = knots[np.unique(np.minimum(edge, knots.size - 1))]
        lost = self.step > LONGEST_HOLE * max(float(np.median(self.step)), 1e-300)
        lost |= ~(known[1:] & known[:-1])
        before = np.concatenate(([0], np.cumsum(lost)))
        first, last = edge[:-1], edge[1:]
        whole = before[last] == before[first]
        self.first, self.last = first[whole], last[whole]
        self.span = t[self.last] - t[self.first]

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Trapezoidal integral over each block."""
        running = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * self.step)))
        return running[self.last] - running[self.first]

    def change(self, values: np.ndarray) -> np.ndarray:
        """Last value less the first of each block."""
        return values[self.last] - values[self.first]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Time average over each block."""
        return self.integral(values) / self.span
