"""Which shifts of the rudder's clock explain the turns, as first-order turns to either side.

A zig-zag repeats itself: a shift by half its period with the other side explains it as well. So all runs are
taken together, from their beginnings on, and what else explains them nearly as well is told with the best.
Takes series. Does not: ask; `clock_agreement` does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.trials.importing.agreement import held, in_gaps
from bayesid.trials.importing.converting import Series, at_times
from bayesid.trials.trial import Floats

CONSTANTS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # s, of first-order turns that are tried
FOLLOWS = 0.5  # share of the turns that the best shift may leave unexplained
# times what the best shift leaves, and share beyond it: one that leaves less explains nearly as well, as no
# vehicle turns as a first-order turn to better than that
RIVAL, MORE = 2.0, 0.01
NEAR = 2.0  # s, of the lag of servo and hull, within which two shifts are one
LEAST, MOST = 40, 5000  # samples of a run


@dataclass(frozen=True)
class Shift:
    """seconds : added to the clock of the rudder; side : 1 where positive rudder turns to starboard, else -1;
    constant : of the first-order turn [s]; left : share of the turns that stays unexplained"""

    seconds: float
    side: int
    constant: float
    left: float

    @property
    def is_lag(self) -> bool:
        """Whether it may be the lag of servo and hull."""
        return -0.5 <= self.seconds <= 1.0 + self.constant

    @property
    def turns_to(self) -> str:
        return "starboard" if self.side > 0 else "port"


def rudder_shifts(pairs: Sequence[tuple[Series, Series]], longest: float = 40.0) -> list[Shift]:
    """The best shift first, then the best of each other stretch of shifts and side, by what they leave.

    Parameters
    ----------
    pairs : (rudder, yaw rate) of each run, on the clocks as they are
    """
    spans = [min(a[0][-1], b[0][-1]) - max(a[0][0], b[0][0]) for a, b in pairs]
    longest = float(np.floor(min(longest, 0.25 * max(spans, default=0.0))))
    if longest < 2.0:
        return []
    shifts = np.arange(-longest, longest + 0.5, 1.0)
    left = np.zeros((2, len(CONSTANTS), shifts.size))
    total = np.zeros(shifts.size)
    for rudder, rate in pairs:
        one = _left_of(rudder, rate, shifts)
        if one is not None:
            left, total = left + one[0], total + one[1]
    if not np.all(total > 0.0):
        return []
    best = np.min(left, axis=1) / total
    found = [
        Shift(float(shifts[k]), side, CONSTANTS[int(np.argmin(left[row, :, k]))], float(best[row, k]))
        for row, side in ((0, 1), (1, -1))
        for k in range(shifts.size)
        if best[row, k] == np.min(best[row, max(0, k - 2) : k + 3])
    ]
    return sorted((s for s in found if s.left < 1.0), key=lambda s: s.left)


def left_without(pairs: Sequence[tuple[Series, Series]]) -> float:
    """Share of the turns that stays unexplained on the clocks as they are."""
    each = [one for a, b in pairs if (one := _left_of(a, b, np.zeros(1))) is not None]
    left, power = (np.sum(values, axis=0) for values in zip(*each, strict=True))
    return float(np.min(left) / power[0])


def sides_apart(pairs: Sequence[tuple[Series, Series]]) -> tuple[float, list[int]]:
    """(share of the turns unexplained if each run has a side of its own, those sides) on the clocks as they
    are; 0 for a run that does not tell its side plainly."""
    left = power = 0.0
    sides = []
    for rudder, rate in pairs:
        one = _left_of(rudder, rate, np.zeros(1))
        if one is None or not one[1][0] > 0.0:
            sides.append(0)
            continue
        each = np.min(one[0][:, :, 0], axis=1)
        left, power = left + float(each.min()), power + float(one[1][0])
        plain = each.min() < min(FOLLOWS * float(one[1][0]), float(each.max()) / RIVAL)
        sides.append((1 if each[0] < each[1] else -1) if plain else 0)
    return (left / power if power else 1.0), sides


def rivals_of(found: Sequence[Shift]) -> list[Shift]:
    """Shifts that explain the turns nearly as well as the best, which is the first."""
    best = found[0]
    return [
        s
        for s in found[1:]
        if s.left < max(RIVAL * best.left, best.left + MORE)
        and (s.side != best.side or abs(s.seconds - best.seconds) > NEAR)
    ]


def _left_of(rudder: Series, rate: Series, shifts: Floats) -> tuple[Floats, Floats] | None:
    """(sum of squares left by side, constant and shift; that of the turns by shift) of a run.

    Only turns are looked at during which the shifted rudder is known; how fast the vehicle turned before is
    free.
    """
    from scipy.signal import lfilter

    good = np.isfinite(rudder[1])
    if not good.any():
        return None
    first, last = float(rudder[0][good][0]), float(rudder[0][good][-1])
    low, high = max(first, rate[0][0]), min(last, rate[0][-1])
    step = max(0.25, (high - low) / MOST)
    if (high - low) / step < LEAST:
        return None
    grid = np.arange(rate[0][0], rate[0][-1], step)
    turn = np.where(in_gaps(rate, grid), np.nan, at_times(rate, grid))
    wide = np.arange(first, last + step, step)
    whole = held(rudder, wide)
    left = np.zeros((2, len(CONSTANTS), shifts.size))
    power = np.zeros(shifts.size)
    for k, shift in enumerate(shifts):
        known = np.isfinite(turn) & (grid >= first + shift) & (grid <= last + shift)
        if known.sum() < LEAST:
            return None
        t, wanted = grid[known], turn[known]
        power[k] = float(np.sum((wanted - wanted.mean()) ** 2))
        for i, constant in enumerate(CONSTANTS):
            a = np.exp(-step / constant)
            followed = lfilter([1.0 - a], [1.0, -a], whole, zi=[a * whole[0]])[0]
            free, _ = np.linalg.qr(np.column_stack((np.ones(t.size), np.exp((t[0] - t) / constant))))
            both = np.column_stack((wanted, np.interp(t - shift, wide, followed)))
            both = both - free @ (free.T @ both)
            rest, column = both[:, 0], both[:, 1]
            size, along = float(column @ column), float(column @ rest)
            left[:, i, k] = float(rest @ rest)
            if size > 0.0:
                left[0 if along > 0.0 else 1, i, k] -= along**2 / size
    return (left, power) if np.max(power) > 0.0 else None
