"""The turn of a run as a linear equation with a delay of its orders: its products for every delay tried.

Takes a run. Gives arrays. Does not judge.

    dr/dt = a U r + b r |r| + c r^3 / U + d U^2 + e U^2 delta(t - tau)

(K. Nomoto's model of first order, 1957, with a turn that is not linear, N.H. Norrbin 1963), integrated
against test functions, which spares the derivative of a noisy rate. What follows an order is not the order:
the angle has a rate, and a play; each of a few of both is tried.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.trials.trial import Floats, Run

REACH, STEP = 6.0, 0.1  # delays that are tried, and their distance, in the time to travel a length
ANSWERS = (-1.0, 3.0)  # delays of a vehicle whose orders are logged when they act
WIDTH = 1.0  # half the width of a test function, in the same time; at least three readings
LONGEST = 20_000  # steps of a run; the rest is not read
SWINGS = (0.5, 1.0, 2.0, 4.0)  # times the largest change of an order may take, in the same time
PLAYS = tuple(math.radians(x) for x in (1.0, 2.0, 4.0))  # half widths of a backlash
FEWEST = 20  # readings of a channel
OTHER_PLANE = ("delta_s", "delta_b")


@dataclass(frozen=True, eq=False)
class TurnEquation:
    """Products of the equation of one run, its own constant taken out.

    Attributes
    ----------
    products : (ways, delays, m, m) of the shared columns, the angles and the turn, in this order; a way is
        how angles follow their orders
    lengths : travelled where the equation is read
    row : between two readings [s]
    angles : number of columns of angles
    """

    products: Floats
    lengths: float
    row: float
    angles: int

    @property
    def turned(self) -> Floats:
        """The same with angles of the other sign."""
        sign = np.ones(self.products.shape[-1])
        sign[-1 - self.angles : -1] = -1.0
        return self.products * sign[:, None] * sign


def turn_equations(runs: Sequence[Run], travel: float) -> dict[int, TurnEquation]:
    """The equations of the runs that have one, by their number.

    Parameters
    ----------
    travel : time to travel a length [s]
    """
    measured = measured_angles(runs)
    angles = [_angles(run, measured) for run in runs]
    names = sorted({name for one in angles for name in one})
    ordered = [x for one in angles for name, x in one.items() if name not in measured]
    swing = max((float(np.ptp(x)) for x in ordered), default=0.0)
    made = {
        i: _turn_equation(run, one, [name for name in one if name not in measured], names, travel, swing)
        for i, (run, one) in enumerate(zip(runs, angles, strict=True))
    }
    return {i: one for i, one in made.items() if one is not None}


def measured_angles(runs: Sequence[Run]) -> frozenset[str]:
    """Angles that every run which logs them logs as measured; of the others the order is read, in all runs: a
    measured angle beside orders lags behind them, as a late run would."""
    some = {name for run in runs for name in _logged(run)}
    return frozenset(k for k in some if all(k in run.measured_inputs for run in runs if k in _logged(run)))


def _logged(run: Run) -> set[str]:
    """Angles that may turn a run, in any way."""
    inputs = {*run.measured_inputs, *(name.removesuffix("_cmd") for name in run.commands)}
    return {name for name in inputs - {*OTHER_PLANE} if name.startswith("delta")}


def _angles(run: Run, measured: Collection[str]) -> dict[str, Floats]:
    """Angles that move; none of a run that logs one in another way than the others."""
    out = {}
    for name in sorted(_logged(run)):
        values = run.measured_inputs[name] if name in measured else run.commands.get(f"{name}_cmd")
        if values is None or not np.isfinite(values).all():
            return {}
        if np.ptp(values) > 0.0:
            out[name] = values
    return out


def _turn_equation(
    run: Run,
    angles: Mapping[str, Floats],
    ordered: Collection[str],
    names: Sequence[str],
    travel: float,
    swing: float,
) -> TurnEquation | None:
    """The equation of a run; None where it does not turn by angles, or does not log how.

    Parameters
    ----------
    angles : its own that move [rad]
    ordered : those of them that follow an order
    names : angles of all runs
    swing : largest change of an order [rad]
    """
    step = STEP * travel
    row = float(np.median(np.diff(run.t))) if run.n_samples > 1 else math.inf
    half = max(WIDTH * travel, 3.0 * row)
    if not angles or run.duration < 2.0 * (REACH * travel + half) + 4.0 * half:
        return None
    t = np.arange(run.t[0], min(run.t[-1], run.t[0] + LONGEST * step), step)
    rate, speed = _rate(run, t), _speed(run, t, travel)
    if rate is None or speed is None or not float(np.median(speed)) > 0.0:
        return None
    count = round(half / step)
    s = np.linspace(-1.0, 1.0, 2 * count + 1)
    test, slope = (1.0 - s**2) ** 3, -6.0 * s * (1.0 - s**2) ** 2 / (count * step)

    def weak(values: Floats, by: Floats = test) -> Floats:
        return np.convolve(values, by[::-1], "valid") * step

    slow = np.maximum(speed, 0.1 * float(np.median(speed)))
    shared = [weak(speed * rate), weak(rate * np.abs(rate)), weak(rate**3 / slow)]
    constant, turn = weak(speed**2), -weak(rate, slope)
    shifts = np.arange(-round(REACH / STEP), round(REACH / STEP) + 1)
    apart = max(1, count // 2)
    at = np.arange(shifts[-1], turn.size - shifts[-1], apart)
    fixed = _without(np.array([*shared, turn])[:, at], constant[at])
    if not fixed[-1] @ fixed[-1] > 0.0:
        return None
    last = np.clip(np.searchsorted(run.t, t, side="right") - 1, 0, run.n_samples - 1)
    most = swing / np.array(SWINGS) * STEP
    followed = {k: _ways(values[last], most, k in ordered) for k, values in angles.items()}
    many = len(fixed) + len(names)
    products = np.empty((1 + len(SWINGS) + len(PLAYS), shifts.size, many, many))
    for way in range(len(products)):
        pushes = dict.fromkeys(names, np.zeros(turn.size))
        pushes |= {name: weak(values[way] * speed**2) for name, values in followed.items()}
        for k, shift in enumerate(shifts):
            pushed = _without(np.array([pushes[name][at - shift] for name in names]), constant[at])
            columns = np.concatenate((fixed[:-1], pushed, fixed[-1:]))
            products[way, k] = columns @ columns.T
    return TurnEquation(products, at.size * apart * STEP, row, len(names))


def answering() -> tuple[int, int]:
    """First and one past the last of the delays after which a vehicle may answer its orders."""
    first, last = (round((REACH + one) / STEP) for one in ANSWERS)
    return first, last + 1


def unexplained(products: Floats) -> Floats:
    """(...,) sum of squares that the columns leave of the turn, by least squares."""
    return solved(products)[1]


def solved(products: Floats) -> tuple[Floats, Floats]:
    """(..., m - 1) coefficients of least squares, and (...,) what they leave."""
    inner, with_turn, turn = products[..., :-1, :-1], products[..., :-1, -1], products[..., -1, -1]
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", inner), 1e-300))
    scaled = inner / (size[..., :, None] * size[..., None, :]) + 1e-9 * np.eye(size.shape[-1])
    right = with_turn / size
    found = np.linalg.solve(scaled, right[..., None])[..., 0]
    return found / size, np.asarray(turn - np.einsum("...i,...i->...", found, right))


def _ways(order: Floats, most: Floats, follows: bool) -> Floats:
    """(ways, n) an angle as it is read, at some rates, behind some plays; where measured always as read.

    Parameters
    ----------
    most : change in a step at each rate [rad]
    """
    out = np.tile(order, (1 + len(SWINGS) + len(PLAYS), 1))
    if not follows:
        return out
    play = np.array(PLAYS)
    slow, loose = out[1 : 1 + len(SWINGS)], out[1 + len(SWINGS) :]
    for k in range(1, order.size):
        slow[:, k] = slow[:, k - 1] + np.clip(order[k] - slow[:, k - 1], -most, most)
        loose[:, k] = np.clip(loose[:, k - 1], order[k] - play, order[k] + play)
    return out


def _without(columns: Floats, constant: Floats) -> Floats:
    return np.asarray(columns - np.outer(columns @ constant / (constant @ constant), constant))


def _rate(run: Run, t: Floats) -> Floats | None:
    """Yaw rate at evenly spaced times, of the heading where no rate is logged."""
    rate = _at(run, "r", t)
    if rate is not None:
        return rate
    psi = _at(run, "psi", t)
    return None if psi is None else np.gradient(psi, t)


def _speed(run: Run, t: Floats, travel: float) -> Floats | None:
    """Speed ahead, or along the track where none is logged."""
    for name in ("u", "u_water"):
        ahead = _at(run, name, t)
        if ahead is not None:
            return np.maximum(ahead, 0.0)
    x, y = _at(run, "x", t), _at(run, "y", t)
    if x is None or y is None:
        return None
    step = float(t[1] - t[0])
    count = max(1, round(travel / step))
    mean = np.ones(2 * count + 1) / (2 * count + 1)
    east, north = (np.convolve(np.gradient(one, t), mean, "same") for one in (y, x))
    return np.hypot(north, east)


def _at(run: Run, name: str, t: Floats) -> Floats | None:
    values = run.data.get(name)
    if values is None:
        return None
    read = np.isfinite(values)
    return np.interp(t, run.t[read], values[read]) if read.sum() >= FEWEST else None
