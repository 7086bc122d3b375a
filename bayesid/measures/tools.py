"""Reading a level crossing, a value, a peak or a rudder order out of a logged or simulated channel.

Takes: times [s] and a channel with noise, gaps (NaN) and uneven sampling. Noise-free data are interpolated
as they are; noisy data are fitted locally over a window that follows the noise.
Does not: know what a manoeuvre is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bayesid.errors import ManoeuvreError, raise_all

NOISE_FREE = 1e-4  # relative to the scale of interest: below it interpolation beats a local fit


@dataclass(frozen=True, eq=False)
class Series:
    """Finite samples of one channel: t [s], y, and `sigma`, the white noise estimated from neighbours."""

    t: np.ndarray
    y: np.ndarray
    sigma: float

    def between(self, start: float, end: float) -> Series:
        """Samples with start <= t <= end; the noise estimate is kept."""
        keep = (self.t >= start) & (self.t <= end)
        return Series(self.t[keep], self.y[keep], self.sigma)


def channel(t: np.ndarray, y: np.ndarray, angle: bool = False) -> Series:
    """Samples without NaN; angles [rad] unwrapped.

    The noise is 1.4826 times the median distance of a sample from the parabola through three neighbours,
    scaled for white noise: blind to steps and to smooth motion.
    """
    t, y = np.asarray(t, float), np.asarray(y, float)
    keep = np.isfinite(t) & np.isfinite(y)
    t, y = t[keep], y[keep]
    if angle:
        y = np.unwrap(y)
    if t.size < 8:
        return Series(t, y, 0.0)
    at, a, b, c = t[1:-2], t[:-3], t[2:-1], t[3:]
    wa = (at - b) * (at - c) / ((a - b) * (a - c))
    wb = (at - a) * (at - c) / ((b - a) * (b - c))
    wc = (at - a) * (at - b) / ((c - a) * (c - b))
    off = y[1:-2] - wa * y[:-3] - wb * y[2:-1] - wc * y[3:]
    return Series(t, y, 1.4826 * float(np.median(np.abs(off) / np.sqrt(1 + wa**2 + wb**2 + wc**2))))


def checked(
    where: str, t: np.ndarray, **columns: np.ndarray | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Arrays of one length with increasing time; optional columns that are None are left out.

    Raises
    ------
    ManoeuvreError    length, dimension or time order wrong; all problems at once
    """
    t = np.asarray(t, float)
    out = {name: np.asarray(column, float) for name, column in columns.items() if column is not None}
    problems = [
        f"{name} has shape {column.shape}, time has {t.shape}"
        for name, column in out.items()
        if column.shape != t.shape
    ]
    if t.ndim != 1:
        problems.append(f"time has {t.ndim} dimensions; give one row of samples")
    elif not np.isfinite(t).all():
        problems.append(f"time is not finite at row {int(np.argmin(np.isfinite(t)))}")
    elif t.size > 1 and (np.diff(t) <= 0).any():
        row = int(np.argmax(np.diff(t) <= 0)) + 1
        problems.append(f"time does not increase at row {row} ({t[row]:g} s after {t[row - 1]:g} s)")
    if problems:
        raise_all(ManoeuvreError, where, problems)
    return t, out


def crossing(c: Series, level: float, span: float) -> float:
    """First time [s] the channel rises through a level; NaN if it never does or only across a gap.

    `span` is the change of the channel over which its curvature may be neglected; with noise, a parabola
    t(y) is fitted to the samples within span, or six sigma, of the level around the first crossing.
    """
    above = np.flatnonzero(c.y >= level)
    if c.t.size < 2 or above.size == 0 or above[0] == 0:
        return math.nan
    k = int(above[0])
    if c.y[k] - c.y[k - 1] > max(3 * span, 12 * c.sigma):
        return math.nan
    if c.sigma > NOISE_FREE * span:
        band = max(span, 6 * c.sigma)
        # one pass only: walk from the first crossing while the channel stays near the level
        far = np.abs(c.y - level) > band
        low = int(np.flatnonzero(far[:k])[-1]) + 1 if far[:k].any() else 0
        high = k + int(np.argmax(far[k:])) if far[k:].any() else c.t.size
        if high - low >= 5:
            # y(t) is fitted, not t(y): the noise is in y
            tau = c.t[low:high] - c.t[k]
            a2, a1, a0 = np.polyfit(tau, c.y[low:high] - level, 2)
            roots = np.roots([a2, a1, a0])
            real = roots[np.abs(roots.imag) < 1e-12].real
            rising = [x for x in real if 2 * a2 * x + a1 > 0 and tau[0] <= x <= tau[-1]]
            if rising:
                return float(c.t[k] + rising[0])
    share = (level - c.y[k - 1]) / (c.y[k] - c.y[k - 1])
    return float(c.t[k - 1] + share * (c.t[k] - c.t[k - 1]))


def slope(c: Series) -> float:
    """Mean rate of change, by a straight line; NaN for fewer than three samples."""
    return float(np.polyfit(c.t - c.t.mean(), c.y, 1)[0]) if c.t.size >= 3 else math.nan


def value(c: Series, at: float, window: float, scale: float) -> float:
    """Value at a time [s]; with noise, of a parabola over +-window [s]. NaN outside or in a gap."""
    if c.t.size < 2 or not (c.t[0] <= at <= c.t[-1]):
        return math.nan
    k = int(np.clip(np.searchsorted(c.t, at), 1, c.t.size - 1))
    if c.t[k] - c.t[k - 1] > 2 * window:
        return math.nan
    if c.sigma > NOISE_FREE * scale:
        near = np.abs(c.t - at) <= window
        if near.sum() >= 5:
            return float(np.polyval(np.polyfit(c.t[near] - at, c.y[near], 2), 0.0))
    return float(np.interp(at, c.t, c.y))


def between(c: Series, at: float, longest: float) -> float:
    """Value at a time [s] of a channel read seldom but evenly: of the cubic through two before it and two
    after. NaN where these are farther apart than `longest` [s] or than its readings usually are.
    """
    k = int(np.searchsorted(c.t, at))
    if not 2 <= k <= c.t.size - 2:
        return math.nan
    near = slice(k - 2, k + 2)
    if np.diff(c.t[near]).max() > min(longest, 1.5 * float(np.median(np.diff(c.t)))):
        return math.nan
    return float(np.polyval(np.polyfit(c.t[near] - at, c.y[near], 3), 0.0))


def peak(c: Series, window: float, scale: float) -> tuple[float, float]:
    """Time [s] and height of the maximum: a parabola through three samples, with noise over +-window.

    (NaN, NaN) if the maximum is the first or last sample: then it is an end, not a peak.
    """
    if c.t.size < 3:
        return math.nan, math.nan
    k = int(np.argmax(c.y))
    noisy = c.sigma > NOISE_FREE * scale
    near = np.abs(c.t - c.t[k]) <= window
    if noisy and near.sum() >= 5:
        for _ in range(2):  # the highest sample is a noisy centre; once more around the first vertex
            centre = float(c.t[near].mean())
            a2, a1, a0 = np.polyfit(c.t[near] - centre, c.y[near], 2)
            if a2 >= 0:
                return math.nan, math.nan
            at = centre - a1 / (2 * a2)
            near = np.abs(c.t - at) <= window
            if near.sum() < 5:
                return math.nan, math.nan
        if not c.t[0] < at < c.t[-1]:
            return math.nan, math.nan
        return at, float(a0 - a1 * a1 / (4 * a2))
    if k in (0, c.t.size - 1):
        return math.nan, math.nan
    tau = c.t[k - 1 : k + 2] - c.t[k]
    a2, a1, a0 = np.polyfit(tau, c.y[k - 1 : k + 2], 2)
    if a2 >= 0:
        return float(c.t[k]), float(c.y[k])
    return float(c.t[k] - a1 / (2 * a2)), float(a0 - a1 * a1 / (4 * a2))


@dataclass(frozen=True)
class Order:
    """A rudder order found in a channel: when it was given and the deflections before and after [s, rad]."""

    t: float
    before: float
    after: float


def orders(c: Series, smallest: float) -> list[Order]:
    """Rudder orders: changes of at least `smallest` [rad] between deflections that are held.

    A command steps and dates its order exactly. A measured rudder moves at a finite rate: the straight line
    through 10 and 50 % of the travel is extended back to its foot.
    """
    if c.t.size < 2:
        return []
    tolerance = max(0.15 * smallest, 4 * c.sigma)
    levels, starts = _plateaus(c.y, tolerance)
    found, last = [], None
    for (begin, end), level in zip(starts, levels, strict=True):
        if last is None:
            last = (begin, end, level)
            continue
        if abs(level - last[2]) < smallest:
            continue
        found.append(Order(_foot(c, last[0], end, last[2], level), last[2], level))
        last = (begin, end, level)
    return found


def _plateaus(y: np.ndarray, tolerance: float) -> tuple[list[float], list[tuple[int, int]]]:
    """Stretches that stay within a tolerance of their median, merged when neighbours agree.

    A surface that travels at a finite rate stays in any band for a while, too: a stretch whose ends differ
    as a ramp's do is travel, however long the sampling makes it.
    """
    levels: list[float] = []
    spans: list[tuple[int, int]] = []
    begin = 0
    while begin < y.size:
        end, low, high = begin, y[begin], y[begin]
        while end < y.size and max(high, y[end]) - min(low, y[end]) <= 2 * tolerance:
            low, high = min(low, y[end]), max(high, y[end])
            end += 1
        third = max(1, (end - begin) // 3)
        drift = abs(np.median(y[begin : begin + third]) - np.median(y[end - third : end]))
        if begin == 0 and drift > tolerance:
            # a short hold before the first order: what little there is of it
            end = int(np.argmax(np.abs(y - y[0]) > 0.25 * tolerance))
            drift = 0.0
        if end - begin >= 3 and drift <= tolerance:
            level = float(np.median(y[begin:end]))
            if levels and abs(level - levels[-1]) <= 2 * tolerance:
                old = spans[-1]
                spans[-1] = (old[0], end)
                levels[-1] = float(np.median(y[old[0] : end]))
            else:
                levels.append(level)
                spans.append((begin, end))
        begin = max(end, begin + 1)
    return levels, spans


def _foot(c: Series, begin: int, end: int, before: float, after: float) -> float:
    """Time at which the travel between two held deflections began; rows `begin` to `end` hold both."""
    t, share = c.t[begin:end], (c.y[begin:end] - before) / (after - before)
    k50 = int(np.argmax(share > 0.5))
    low = np.flatnonzero(share[:k50] <= 0.1)
    k10 = int(low[-1]) + 1 if low.size else k50
    if k10 == k50:
        return float(t[k50])

    def at(k: int, level: float) -> float:
        return float(t[k - 1] + (level - share[k - 1]) / (share[k] - share[k - 1]) * (t[k] - t[k - 1]))

    t10, t50 = at(k10, 0.1), at(k50, 0.5)
    return t10 - (t50 - t10) * 0.25
