"""A run cut into blocks of time over which displacements and integrals are compared.

Takes times and series. Noise and irregular sampling average out over a block; slower channels are
interpolated across their empty cells, the blocks begin and end where the compared channel was read.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg.lapack import dgtsv, zgtsv

from bayesid.trials.trial import Floats

LONGEST_HOLE = 5.0  # in median steps of a channel: farther apart, its readings are not joined


def middle(values: Floats) -> float:
    """Median of finite values, nan of none, as of numpy, whose own takes longer to begin than to find it."""
    if not values.size:
        return math.nan
    k = values.size // 2
    if values.size % 2:
        return float(np.partition(values, k)[k])
    low, high = np.partition(values, (k - 1, k))[k - 1 : k + 1]
    return float((low + high) / 2.0)


def joined(t: Floats, values: Floats) -> tuple[Floats, np.ndarray]:
    """Values interpolated between a channel's own readings, and where they are within `LONGEST_HOLE`."""
    good = np.flatnonzero(np.isfinite(values))
    if good.size < 2:
        return np.zeros(t.shape), np.zeros(t.shape, dtype=bool)
    if good.size == t.size:
        return values, np.ones(t.shape, dtype=bool)
    knots = t[good]
    gaps = np.diff(knots)
    long = gaps > LONGEST_HOLE * middle(gaps)
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
        lost = self.step > LONGEST_HOLE * max(middle(self.step), 1e-300)
        lost |= ~(known[1:] & known[:-1])
        before = np.concatenate(([0], np.cumsum(lost)))
        first, last = edge[:-1], edge[1:]
        whole = before[last] == before[first]
        self.first, self.last = first[whole], last[whole]
        self.span = t[self.last] - t[self.first]

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Integral over each block, of a cubic spline through the readings.

        The trapezoid rule falls short by a twelfth of (step times frequency) squared: 5 % of a rate that
        swings once in eight readings, which a scale of the instrument, or the clock, would be blamed for.

        Parameters
        ----------
        values : (m,), or (m, k) for k series at once
        """
        h = self.step.reshape(-1, *[1] * (values.ndim - 1))
        slope = self._slopes(values, h)
        running = np.zeros(values.shape, dtype=slope.dtype)
        part = 0.5 * (values[1:] + values[:-1]) * h + (slope[:-1] - slope[1:]) * h**2 / 12.0
        np.cumsum(part, axis=0, out=running[1:])
        return running[self.last] - running[self.first]

    def _slopes(self, values: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Slopes of the cubic spline at its knots; at either end that of a parabola."""
        if h.size < 3:
            return np.gradient(values, self.t, axis=0, edge_order=1)
        chord = np.diff(values, axis=0) / h
        slope = np.empty(values.shape, dtype=chord.dtype)
        slope[0] = chord[0] - h[0] * (chord[1] - chord[0]) / (h[0] + h[1])
        slope[-1] = chord[-1] + h[-1] * (chord[-1] - chord[-2]) / (h[-1] + h[-2])
        right = 3.0 * (h[1:] * chord[:-1] + h[:-1] * chord[1:])
        right[0] -= h[1] * slope[0]
        right[-1] -= h[-2] * slope[-1]
        solve = zgtsv if np.iscomplexobj(right) else dgtsv
        step = self.step
        *_, slope[1:-1], _ = solve(step[2:], 2.0 * (step[:-1] + step[1:]), step[:-2], right)
        return slope

    def change(self, values: np.ndarray) -> np.ndarray:
        """Last value less the first of each block."""
        return values[self.last] - values[self.first]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Time average over each block."""
        return self.integral(values) / self.span
