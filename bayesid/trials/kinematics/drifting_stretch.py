"""Does a stretch of a run have a constant velocity over ground of its own, beside honest errors of sensors?

Takes a `Difference` of fixes and dead reckoning. Gives begin, end and velocity of the stretch that explains
it best, how much it explains, and how much other shapes do. Does not judge.

A velocity within a stretch is a path that rises from its begin on, less one that rises from its end on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bayesid.trials.kinematics.dead_reckoning import Difference
from bayesid.trials.kinematics.local_level import LocalLevel, Pair
from bayesid.trials.trial import Floats

EDGES = 48  # steps into which a run is cut for begins and ends
LARGEST_STEPS = 32  # from one time to the next, at which a jump is looked for beside the grid
FINE = 8  # parts of such a step, about the best ones
SHORTEST, LONGEST = 0.08, 0.62  # of the run; a longer stretch is what the rest of the run is off by
FEWEST = 8  # times in a stretch
SMOOTH = 3  # degree in time of a difference that bends all over the run: a velocity that changes evenly
REST = 5  # the same of what is left beside a stretch


@dataclass(frozen=True)
class Stretch:
    """The stretch that explains most.

    Attributes
    ----------
    begin, end : [s]
    velocity : of the fixes less that of the log there, north + i east [m/s]
    gain : log density over no stretch [nats]
    rival : the most that explains without one: a jump of the fixes, an offset of some of them, a velocity
        that changes evenly over the run [nats]
    left : what velocities that change all over the run explain beside it [nats]
    noise : white noise of a fix, each component [m]
    """

    begin: float
    end: float
    velocity: complex
    gain: float
    rival: float
    left: float
    noise: float


def walk_beside(d: Difference) -> float:
    """Power of the random walk beside the stretch that explains most, [m^2/s]."""
    best = _stretch(d, LocalLevel(d, math.inf), _grid(d), _grid(d))
    return 0.0 if best is None else best[0].walk


def drifting_stretch(d: Difference, usual_walk: float, least: float = 0.0) -> Stretch | None:
    """The stretch that explains most; None where the run leaves no room for one.

    Parameters
    ----------
    usual_walk : power of the random walk [m^2/s], as of other runs
    least : gain of the coarse grid below which nothing is told [nats]
    """
    level = LocalLevel(d, usual_walk)
    coarse = _stretch(d, level, _grid(d), _grid(d))
    if coarse is None or coarse[0].gain < least:
        return None
    about = np.linspace(-1.0, 1.0, 2 * FINE + 1) * d.span / EDGES
    near = [np.clip(edge + about, d.t[0], d.t[-1]) for edge in coarse[1:]]
    best, begin, end = _stretch(d, level, near[0], near[1]) or coarse
    even = 2.0 * (d.t - d.t[0]) / d.span - 1.0
    shapes: Floats = np.polynomial.legendre.legvander(even, REST)[:, 1:]
    path = _rises(d.t, np.array([begin])) - _rises(d.t, np.array([end]))
    left = level.gain(np.column_stack((path, shapes))) - level.gain(path)
    rival = max(0.0, level.gain(shapes[:, :SMOOTH]), _jump(d, level))
    noise = best.noise * math.sqrt(d.grouped)
    return Stretch(begin, end, best.number, best.gain, rival, left, noise)


def _grid(d: Difference) -> Floats:
    return np.linspace(d.t[0], d.t[-1], EDGES + 1)


def _stretch(
    d: Difference, level: LocalLevel, begins: Floats, ends: Floats
) -> tuple[Pair, float, float] | None:
    """The best pair of some begins and ends, and their times."""
    long = ends[None, :] - begins[:, None]
    times = np.searchsorted(d.t, ends)[None, :] - np.searchsorted(d.t, begins)[:, None]
    allowed = (long >= SHORTEST * d.span) & (long <= LONGEST * d.span) & (times >= FEWEST)
    best = level.pair(_rises(d.t, begins), _rises(d.t, ends), allowed)
    return None if best is None else (best, float(begins[best.begin]), float(ends[best.end]))


def _jump(d: Difference, level: LocalLevel) -> float:
    """The most that an offset of the fixes from some time on, or between two times, explains [nats]."""
    never = d.t[-1] + d.span
    between = 0.5 * (d.t[1:] + d.t[:-1])
    most = np.argsort(np.abs(np.diff(d.y)))[-LARGEST_STEPS:]
    begins = np.unique(np.append(_grid(d)[1:-1], between[most]))
    ends = np.append(begins, never)
    gain = 0.0
    for _ in range(2):
        best = level.pair(_steps(d.t, begins), _steps(d.t, ends), ends[None, :] > begins[:, None])
        if best is None:
            break
        gain = max(gain, best.gain)
        begins, ends = (
            _edges_near(d, float(e)) if e < never else np.array([never])
            for e in (begins[best.begin], ends[best.end])
        )
    return gain


def _edges_near(d: Difference, edge: float) -> Floats:
    """Times between two fixes within a step of the grid."""
    between = 0.5 * (d.t[1:] + d.t[:-1])
    near: Floats = between[np.abs(between - edge) <= d.span / EDGES]
    return near if near.size else np.array([edge])


def _rises(t: Floats, edges: Floats) -> Floats:
    return np.maximum(t[:, None] - edges, 0.0)


def _steps(t: Floats, edges: Floats) -> Floats:
    return (t[:, None] >= edges).astype(float)
