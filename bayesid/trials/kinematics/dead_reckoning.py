"""Position fixes of one run less dead reckoning, with what sensors honestly do to that difference.

Takes a `Run` with x, y, psi, u, v. Gives the difference at the fixes and its columns, at a few hundred times.
Does not: weigh (`local_level`), or look for a stretch (`drifting_stretch`).

Dead reckoning integrates the logged velocity turned by the logged angles. The fixes differ from it by an
offset, their noise, a random walk (noise of the velocities, integrated), and for every honest error of a
sensor by a known path times a number: scale and misalignment of the velocities, compass deviation, lever
arms, latencies, and one constant velocity over the whole run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.trials.kinematics.blocks import LONGEST_HOLE, middle
from bayesid.trials.kinematics.relations import (
    ANGLE,
    DEVIATION,
    DRIFT,
    LATENCY,
    LEVER,
    SCALE,
    Joined,
    level_velocity,
    turning_time,
)  # fmt: skip
from bayesid.trials.trial import Floats, Run

FEWEST_FIXES = 30  # below which ten honest errors and a stretch are too many for a run
MOST_TIMES = 300  # more fixes are averaged in groups: edges are then known to a third of a percent of a run
OUTLIER = 6.0  # robust deviations off the median of five, from which on a fix is left out


@dataclass(frozen=True, eq=False)
class Difference:
    """Fixes less dead reckoning.

    Attributes
    ----------
    t : (n,) times [s], ascending
    y : (n,) north + i east [m]
    columns : (n, k) paths of the honest errors, north + i east; the number of each is real
    sd : (k,) prior standard deviation of each number
    fresh : (n,) whether dead reckoning begins anew there, as velocity or heading were lost before
    speed : rms of the logged speed [m/s]
    grouped : fixes averaged for one time
    """

    t: Floats
    y: np.ndarray
    columns: np.ndarray
    sd: Floats
    fresh: np.ndarray
    speed: float
    grouped: int

    @property
    def span(self) -> float:
        """From the first to the last time [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def fix_noise(self) -> float:
        """White noise of one component [m], by how the difference bends from time to time."""
        bends = np.diff(self.y, 2)
        return 1.4826 * middle(np.abs(np.concatenate((bends.real, bends.imag)))) / 6.0**0.5


def difference(run: Run, travel: float | None = None) -> Difference | None:
    """None where the run has few fixes, or lacks a channel.

    A vehicle that dives moves over ground by less than u: where depth, pitch or heave are logged, pitch, roll
    and heave have to be, or a dive passes for a slow stretch.

    Parameters
    ----------
    travel : time in which the vehicle travels its length [s], where it is known
    """
    series = Joined(run, travel)
    steep = any(series.has(name) for name in ("z", "theta", "w"))
    names = ("x", "y", "psi", "u", "v", *(("phi", "theta", "w") if steep else ()))
    if not series.has(*names):
        return None
    known = series.known(*names)
    at = np.flatnonzero(series.read("x", "y") & known)
    if at.size < FEWEST_FIXES:
        return None
    t, psi = series.t, series["psi"]
    turned = level_velocity(series, "u", "v") * np.exp(1j * psi)
    speed = float(np.sqrt(np.mean(np.abs(turned[known]) ** 2)))
    if not speed > 0.0:
        return None
    step = np.diff(t)
    rates = (turned, 1j * turned * np.gradient(psi, t), 1j * turned * np.sin(psi), 1j * turned * np.cos(psi))
    paths = np.zeros((t.size, len(rates)), dtype=complex)
    mean = 0.5 * (np.column_stack(rates)[1:] + np.column_stack(rates)[:-1])
    np.cumsum(mean * step[:, None], axis=0, out=paths[1:])
    reckoned, swept, east_west, north_south = paths.T
    rate = np.diff(psi[at]) / np.maximum(np.diff(t[at]), 1e-300)
    length = series.travel_time(turning_time(rate, float(t[-1] - t[0])))
    head, since = np.exp(1j * psi), t - t[at[0]] + 0j
    honest = (
        (reckoned, SCALE), (1j * reckoned, ANGLE),
        (east_west, DEVIATION), (north_south, DEVIATION),
        (swept, LATENCY * length), (turned, LATENCY * length),
        (head, LEVER * speed * length), (1j * head, LEVER * speed * length),
        (since, DRIFT * speed), (1j * since, DRIFT * speed),
    )  # fmt: skip
    columns, sd = np.column_stack([path for path, _ in honest]), np.array([s for _, s in honest])
    lost = (step > LONGEST_HOLE * max(middle(step), 1e-300)) | ~(known[1:] & known[:-1])
    piece = np.concatenate(([0], np.cumsum(lost)))[at]
    y = (series["x"] + 1j * series["y"] - reckoned)[at]
    rest = _without_honest(y, columns[at])
    good = _near_others(rest, piece)
    group = piece[good] + np.cumsum(np.append(False, _jumps(rest[good])))
    return _averaged(t[at][good], y[good], columns[at][good], piece[good], group, sd, speed)


def _without_honest(y: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """The difference less what honest errors explain: arms and latencies swing from fix to fix in a turn."""
    every = np.column_stack((columns, np.ones(y.size), 1j * np.ones(y.size)))
    stacked = np.concatenate((every.real, every.imag))
    numbers = np.linalg.lstsq(stacked, np.concatenate((y.real, y.imag)), rcond=None)[0]
    rest: np.ndarray = y - every @ numbers
    return rest


def _near_others(rest: np.ndarray, piece: np.ndarray) -> np.ndarray:
    """Whether a fix is within `OUTLIER` of the median of five."""
    near = np.lib.stride_tricks.sliding_window_view(np.pad(rest, 2, mode="reflect"), 5)
    off = _largest(rest - (np.median(near.real, axis=1) + 1j * np.median(near.imag, axis=1)))
    same = piece[1:] == piece[:-1]
    inner = np.append(same, True) & np.append(True, same)
    good: np.ndarray = ~inner | (off <= OUTLIER * 1.4826 * max(middle(off), 1e-12))
    return good


def _jumps(rest: np.ndarray) -> np.ndarray:
    """Whether the fixes jump from one to the next, between which no mean may be taken."""
    step = _largest(np.diff(rest))
    jumps: np.ndarray = step > OUTLIER * 1.4826 * max(middle(step), 1e-12)
    return jumps


def _largest(values: np.ndarray) -> np.ndarray:
    out: np.ndarray = np.maximum(np.abs(values.real), np.abs(values.imag))
    return out


def _averaged(
    t: Floats,
    y: np.ndarray,
    columns: np.ndarray,
    piece: np.ndarray,
    group: np.ndarray,
    sd: Floats,
    speed: float,
) -> Difference | None:
    """Means of so many fixes in a row of one group; dead reckoning begins anew with each piece."""
    many = -(-t.size // MOST_TIMES)
    begins = np.flatnonzero(np.append(True, np.diff(group) > 0))
    rank = np.arange(t.size) - np.repeat(begins, np.diff(np.append(begins, t.size)))
    first = np.flatnonzero(rank % many == 0)
    whole = np.diff(np.append(first, t.size)) == many  # a mean of fewer fixes has another noise
    if whole.sum() < FEWEST_FIXES:
        return None
    mean = np.add.reduceat(np.column_stack((t, y, columns)), first, axis=0)[whole] / many
    fresh = np.append(True, np.diff(piece[first][whole]) > 0)
    return Difference(mean[:, 0].real.copy(), mean[:, 1], mean[:, 2:], sd, fresh, speed, many)
