"""A difference of paths as white noise, a random walk and columns: how much a further column explains.

Takes a `Difference`. Gives log densities of it with further columns, each with a number of its own north and
east. Does not: know what the columns mean.

For a ratio of random walk to noise the innovations of the Kalman filter are white (Harvey, Forecasting,
Structural Time Series Models and the Kalman Filter, 1989, sections 2.4 and 3.4), so that least squares of the
filtered difference on filtered columns is its likelihood. The ratio has its own best value for each set of
columns. Numbers of the honest errors have their prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bayesid.trials.kinematics.dead_reckoning import Difference
from bayesid.trials.trial import Floats

# power of the random walk in a median step over that of the noise; and none at all
RATIOS: Floats = np.array([0.0, *np.geomspace(1e-5, 30.0, 15)])
# of the log power of the random walk above the usual one: twice as much at one deviation. Without that a
# random walk of one run explains any stretch of a wrong velocity, which is one, too.
WANDER = 0.7
SINGULAR = 1e-8  # of the product of two powers: two columns that are nearly one have no numbers


@dataclass(frozen=True)
class Pair:
    """The best begin and end.

    Attributes
    ----------
    begin, end : indices
    number : north + i east
    gain : log density over none [nats]
    noise : white noise of one component [m]
    walk : power of the random walk [m^2/s]
    """

    begin: int
    end: int
    number: complex
    gain: float
    noise: float
    walk: float


class LocalLevel:
    """The difference and its columns as innovations, at all ratios."""

    def __init__(self, d: Difference, usual_walk: float) -> None:
        """
        Parameters
        ----------
        usual_walk : power of the random walk up to which none is less likely than another [m^2/s]; may be inf
        """
        self.t, self._usual = d.t, usual_walk
        step = np.diff(d.t, prepend=d.t[0])
        self._step = max(float(np.median(step[1:])), 1e-300)
        self._grows = np.outer(RATIOS, step / self._step)
        self._fresh = d.fresh
        self._readings, self._numbers = 2 * int(np.sum(~d.fresh)), d.sd.size
        filtered = self._innovations(np.column_stack((d.y, d.columns)))
        prior = np.diag(d.fix_noise / np.maximum(d.sd, 1e-300))
        self._bases, left = [], []
        for one in filtered:
            stacked = np.concatenate((one.real, one.imag))
            basis = np.linalg.qr(np.vstack((stacked[:, 1:], prior)))[0]
            y = np.append(stacked[:, 0], np.zeros(self._numbers))
            self._bases.append(basis)
            left.append(y - basis @ (basis.T @ y))
        self._left = np.array(left)
        self._squares = np.sum(self._left**2, axis=1)
        self._none = float(self._log_density(self._squares).max())

    def _innovations(self, columns: np.ndarray) -> np.ndarray:
        """(ratios, m, k) of columns (n, k), scaled to equal variance; keeps the sums of logs of scales."""
        ratios, n = self._grows.shape
        out = np.zeros((ratios, n, columns.shape[1]), dtype=columns.dtype)
        level = np.zeros((ratios, columns.shape[1]), dtype=columns.dtype)
        spread, self._scales = np.ones(ratios), np.zeros(ratios)
        for k in range(n):
            if self._fresh[k]:
                level[:], spread = columns[k], np.ones(ratios)
                continue
            ahead = spread + self._grows[:, k]
            size = ahead + 1.0
            new = columns[k] - level
            out[:, k] = new / np.sqrt(size)[:, None]
            level += (ahead / size)[:, None] * new
            spread = ahead / size
            self._scales += np.log(size)
        return out[:, ~self._fresh]

    def _log_density(self, squares: Floats) -> Floats:
        """Of sums of squares (ratios, ...), less what all have in common; components share the scales."""
        shape = (-1, *[1] * (squares.ndim - 1))
        power = np.maximum(squares, 1e-300) / self._readings
        walk = np.maximum(RATIOS.reshape(shape) * power / self._step, 1e-300)
        above = np.maximum(np.log(walk) - math.log(max(self._usual, 1e-300)), 0.0) / WANDER
        fit: Floats = -self._scales.reshape(shape) - 0.5 * self._readings * np.log(power) - 0.5 * above**2
        return fit

    def _beside(self, k: int, columns: Floats) -> Floats:
        """Filtered columns (m, j) of the k-th ratio, north then east, less what honest errors explain."""
        none, rows = np.zeros(columns.shape), np.zeros((self._numbers, 2 * columns.shape[1]))
        both = np.vstack((np.block([[columns, none], [none, columns]]), rows))
        basis = self._bases[k]
        out: Floats = both - basis @ (basis.T @ both)
        return out

    def gain(self, columns: Floats) -> float:
        """Log density with all of the columns (n, j) over that without [nats]."""
        squares = np.empty(RATIOS.size)
        for k, one in enumerate(self._innovations(columns)):
            both = self._beside(k, one)
            numbers = np.linalg.lstsq(both, self._left[k], rcond=SINGULAR)[0]
            squares[k] = np.sum((self._left[k] - both @ numbers) ** 2)
        return float(self._log_density(squares).max()) - self._none

    def pair(self, begins: Floats, ends: Floats, allowed: np.ndarray) -> Pair | None:
        """The begin and end whose columns' difference explains most; None where no pair is allowed.

        Parameters
        ----------
        begins, ends : (n, b) and (n, e) columns
        allowed : (b, e)
        """
        if not allowed.any():
            return None
        b, size = begins.shape[1], begins.shape[1] + ends.shape[1]
        filtered = self._innovations(np.column_stack((begins, ends)))
        squares, numbers = [], []
        for k, one in enumerate(filtered):
            both = self._beside(k, one)
            gram, seen = both.T @ both, both.T @ self._left[k]
            p, q, r = (_products(gram, b, size, i, j) for i, j in ((0, 0), (1, 1), (0, 1)))
            north, east = (seen[i : i + b][:, None] - seen[i + b : i + size][None, :] for i in (0, size))
            det = p * q - r * r
            det = np.where(det > SINGULAR * p * q, det, np.inf)
            number = (q * north - r * east) / det + 1j * (p * east - r * north) / det
            squares.append(self._squares[k] - number.real * north - number.imag * east)
            numbers.append(number)
        density = np.where(allowed, self._log_density(np.array(squares)), -np.inf)
        k, i, j = (int(at) for at in np.unravel_index(int(np.argmax(density)), density.shape))
        power = max(float(squares[k][i, j]), 0.0) / self._readings
        gain = float(density[k, i, j]) - self._none
        walk = float(RATIOS[k]) * power / self._step
        return Pair(i, j, complex(numbers[k][i, j]), gain, power**0.5, walk)


def _products(gram: Floats, b: int, size: int, i: int, j: int) -> Floats:
    """(b, e) products of component i of each difference of a begin and an end with its component j."""
    begin, end = np.arange(b), np.arange(b, size)
    rows, columns = i * size, j * size
    out: Floats = (
        gram[rows + begin, columns + begin][:, None]
        + gram[rows + end, columns + end][None, :]
        - gram[np.ix_(rows + begin, columns + end)]
        - gram[np.ix_(columns + begin, rows + end)]
    )
    return out
