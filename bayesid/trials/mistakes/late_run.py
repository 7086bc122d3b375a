"""Orders of one run that are earlier or later against its motion than those of the other runs.

Takes runs weighed as they are. Gives one hypothesis per run.
Does not: find what all runs share (a dead time, a lag), or tell late orders from early motion.

Orders and motion are often logged by two clocks and joined run by run. The turn of every run is written as

    dr/dt = a U r + b r |r| + c r^3 / U + d_i U^2 + e U^2 delta(t - tau_i)

(K. Nomoto's model of first order, 1957, with a turn that is not linear, N.H. Norrbin 1963; the force of a
thruster goes with the square of its revolutions instead), a to c and e shared by all runs, d_i and the delay
tau_i of each. Integrated against test functions, which spares the derivative of a noisy rate, it is linear in
all but the delays. Angles follow their orders at a rate that is found, too: where it is slow, a large order
acts later than a small one, in every run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.mistakes.travel import travel_time
from bayesid.trials.trial import Floats, Run

REACH, STEP = 4.0, 0.1  # delays that are tried, and their distance, in the time to travel a length
WIDTH = 1.0  # half the width of a test function, in the same time; at least three readings
ONE_FOR = 2.0  # lengths travelled that bring one independent residual: what the equation lacks lasts as long
LONGEST = 20_000  # steps of a run
SWINGS = (0.0, 0.5, 1.0, 2.0, 4.0)  # times the largest change of an order takes, in the same time
FEWEST = 20  # readings of a channel
LEAST, LEAST_ROWS = 0.3, 1.2  # a difference in lengths travelled, and in rows: less is what equations lack
FALLS = 0.75  # of what is unexplained: what only bends the equation takes less of it away
MOST = 40.0  # nats of the surest run
NO_TURN = ("n", "delta_s", "delta_b")  # inputs of another plane


@dataclass(frozen=True, eq=False)
class _Turn:
    """Products of the equation of one run, its own constant taken out.

    Attributes
    ----------
    products : (rates, delays, m, m) of shared columns, inputs and turn, in this order
    lengths : travelled
    row : between two readings [s]
    """

    products: Floats
    lengths: float
    row: float


def late_run(base: Sequence[Base]) -> list[Weighed]:
    """Every run whose orders fit the motion of the vehicle of the other runs at another time."""
    travel = travel_time(base)
    if travel is None or not travel > 0.0:
        return []
    names = sorted({name for one in base for name in _steering(one.run)})
    swing = max((float(np.ptp(_ordered(one.run, k))) for one in base for k in _angles(one.run)), default=0.0)
    turns = [_turn(one.run, names, travel, swing) for one in base]
    there = [(i, turn) for i, turn in enumerate(turns) if turn is not None]
    if len(there) < 2:
        return []
    every: Floats = np.sum([turn.products for _, turn in there], axis=0)
    same = float(_unexplained(every).min())
    turned = min(_turned(every, turn, len(names)) for _, turn in there)
    independent = sum(turn.lengths for _, turn in there) / ONE_FOR
    least = max(LEAST * travel, LEAST_ROWS * max(turn.row for _, turn in there))
    found = {i: one for i, turn in there if (one := _alone(every, turn, travel)) and one.left < turned}
    nats = {
        # no vehicle answers before its orders: those of all other runs would be late
        i: 0.5 * independent * math.log(same / one.left) + (USUAL if one.others < -LEAST * travel else 0.0)
        for i, one in found.items()
    }
    best = max(nats, key=lambda i: nats[i], default=None)
    if best is None or found[best].left > FALLS * same or abs(found[best].late) < least:
        return []
    out = []
    for i, one in found.items():
        odds = np.zeros(len(base))
        odds[i] = nats[i] - max(0.0, nats[best] - MOST)
        out.append(Weighed(_mistake(base[i].run, one.late, len(there)), odds, {"orders": odds}))
    return out


@dataclass(frozen=True)
class _Alone:
    """One run at a time of its own.

    Attributes
    ----------
    left : sum of squares left of the turns of all runs
    others : time after which the vehicle answers in all other runs [s]
    late : by which the orders are later in this one [s]
    """

    left: float
    others: float
    late: float


def _alone(every: Floats, turn: _Turn, travel: float) -> _Alone | None:
    """The best times of one run and of the others; None where they lie at the end of what is tried."""
    each = _unexplained((every - turn.products)[:, :, None] + turn.products[:, None])
    rate, a, b = (int(k) for k in np.unravel_index(np.argmin(each), each.shape))
    left = each[rate]
    if b in (0, left.shape[1] - 1) or not left[a, b] > 0.0:
        return None
    others = STEP * (a + _between(left[:, b], a)) - REACH
    own = STEP * (b + _between(left[a], b)) - REACH
    return _Alone(float(left[a, b]), others * travel, (others - own) * travel)


def _mistake(run: Run, late: float, runs: int) -> Mistake:
    """Late orders, or early ones where `late` [s] is negative."""
    columns = sorted({*run.commands, *(k for k in run.measured_inputs if k in _steering(run))})
    seconds = float(f"{late:.3g}")
    side = "later" if late > 0 else "earlier"
    says = (
        f"in {run.name} orders are logged {abs(seconds):g} s {side} against the motion than in the other runs"
    )
    if late < 0:
        says += ", or the vehicle answers so much later there"
    correction = Correction(late=dict.fromkeys(columns, seconds), runs=(run.name,))
    return Mistake(f"orders of {run.name} against its motion", says, correction, USUAL - math.log(runs))


def _steering(run: Run) -> list[str]:
    """Inputs that turn it and move."""
    inputs = {*run.measured_inputs, *(name.removesuffix("_cmd") for name in run.commands)} - {*NO_TURN}
    moves = {k: x for k in inputs if (x := run.input(k)) is not None and np.isfinite(x).all()}
    return sorted(k for k, x in moves.items() if np.ptp(x) > 0.0)


def _angles(run: Run) -> list[str]:
    """Of these the angles that follow an order."""
    return [k for k in _steering(run) if k.startswith("delta") and k not in run.measured_inputs]


def _turn(run: Run, names: Sequence[str], travel: float, swing: float) -> _Turn | None:
    """The equation of a run; None where it does not turn by orders, or does not log how.

    Parameters
    ----------
    swing : largest change of an order [rad]
    """
    own = _steering(run)
    row = float(np.median(np.diff(run.t))) if run.n_samples > 1 else math.inf
    half = max(WIDTH * travel, 3.0 * row)
    if not own or run.duration < 2.0 * (REACH * travel + half) + 4.0 * half:
        return None
    step = max(STEP * travel, run.duration / LONGEST)
    t = np.arange(run.t[0], run.t[-1], step)
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
    delays = np.arange(-round(REACH / STEP), round(REACH / STEP) + 1) * STEP * travel
    margin = math.ceil(REACH * travel / step)
    at = np.arange(margin, turn.size - margin, max(1, count // 2))
    fixed = _without(np.array([*shared, turn])[:, at], constant[at])
    many = len(fixed) + len(names)
    products = np.empty((len(SWINGS), delays.size, many, many))
    rates = [swing / (one * travel) if one else math.inf for one in SWINGS]
    inputs = {name: _followed(_held(run, name, t), rates, step, name in _angles(run)) for name in own}
    for i in range(len(SWINGS)):
        forces = dict.fromkeys(names, np.zeros(turn.size))
        forces |= {name: weak(_force(name, values[i], speed)) for name, values in inputs.items()}
        for k, delay in enumerate(delays):
            moved = at - round(float(delay) / step)
            pushed = _without(np.array([forces[name][moved] for name in names]), constant[at])
            columns = np.concatenate((fixed[:-1], pushed, fixed[-1:]))
            products[i, k] = columns @ columns.T
    return _Turn(products, run.duration / travel, row)


def _ordered(run: Run, name: str) -> Floats:
    values = run.input(name)
    assert values is not None
    return values


def _held(run: Run, name: str, t: Floats) -> Floats:
    last = np.searchsorted(run.t, t, side="right") - 1
    return np.asarray(_ordered(run, name)[np.clip(last, 0, run.n_samples - 1)])


def _followed(order: Floats, rates: Sequence[float], step: float, moves: bool) -> Floats:
    """(rates, n) an angle that follows its order at some rates [rad/s]; the order itself where none does."""
    out = np.tile(order, (len(rates), 1))
    most = np.array(rates) * step
    for k in range(1, order.size if moves else 0):
        out[:, k] = out[:, k - 1] + np.clip(order[k] - out[:, k - 1], -most, most)
    return out


def _force(name: str, values: Floats, speed: Floats) -> Floats:
    """What an input pushes with, up to a factor: an angle with the speed squared, revolutions with theirs."""
    return np.asarray(values * speed**2 if name.startswith("delta") else values * np.abs(values))


def _without(columns: Floats, constant: Floats) -> Floats:
    return np.asarray(columns - np.outer(columns @ constant / (constant @ constant), constant))


def _unexplained(products: Floats) -> Floats:
    """(...,) sum of squares that the columns leave of the turn."""
    inner, with_turn, turn = products[..., :-1, :-1], products[..., :-1, -1], products[..., -1, -1]
    size = np.sqrt(np.maximum(np.einsum("...ii->...i", inner), 1e-300))
    scaled = inner / (size[..., :, None] * size[..., None, :]) + 1e-9 * np.eye(size.shape[-1])
    right = with_turn / size
    found = np.linalg.solve(scaled, right[..., None])[..., 0]
    return np.asarray(turn - np.einsum("...i,...i->...", found, right))


def _turned(every: Floats, turn: _Turn, inputs: int) -> float:
    """What is left where the orders of a run have the other sign, and no run another time."""
    sign = np.ones(every.shape[-1])
    sign[-1 - inputs : -1] = -1.0
    return float(_unexplained(every - turn.products + turn.products * sign[:, None] * sign).min())


def _between(left: Floats, k: int) -> float:
    """Where a parabola through a smallest value and its neighbours is smallest, from it, in steps."""
    if not 0 < k < left.size - 1:
        return 0.0
    before, least, after = left[k - 1 : k + 2]
    bend = before - 2.0 * least + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0


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
