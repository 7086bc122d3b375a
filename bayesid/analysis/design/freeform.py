"""A manoeuvre of no name: orders at knots, moved until a goal is met as well as the limits allow.

Takes a score for orders and `OrderLimits`. Gives the best `OpenLoop` found and how the search went. The
search is a coordinate exchange (Meyer and Nachtsheim 1995) with shrinking steps from several starts: random
levels, multisines and library manoeuvres. Does not know what the score means.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.design.limits import OrderLimits
from bayesid.manoeuvres import OpenLoop, grid

Array = np.ndarray
Score = Callable[[OpenLoop], float]
SPACING = 2.0  # of rudder and plane knots [L/U]
APPROACH = 1.0  # straight ahead before a design begins [L/U]
SHAFT_LEVELS = 5
STEPS: tuple[float | None, ...] = (None, None, 0.5, 0.25, 0.12)  # None: try the five levels
LEVELS = (-1.0, -0.5, 0.0, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """How a vector in [-1, 1] becomes orders.

    First the approach: rudder amidships, usual shaft speed. Then rudder (and planes) on straight lines
    between knots, slewed at the allowed rate, and the shaft speed at levels for equal shares of the time.
    """

    bounds: OrderLimits
    approach: float
    knots: Array
    planes: bool
    shaft: int

    @property
    def size(self) -> int:
        return len(self.knots) * (2 if self.planes else 1) + self.shaft

    def orders(self, x: Array) -> OpenLoop:
        """Orders of a vector (size,)."""
        b, n = self.bounds, len(self.knots)
        t = grid(b.duration, b.dt)
        commands = {"delta_r_cmd": self._fin(t, x[:n] * b.rudder)}
        if self.planes:
            commands["delta_s_cmd"] = self._fin(t, x[n : 2 * n] * b.plane)
        levels = b.rpm[0] + 0.5 * (np.asarray(x[self.size - self.shaft :]) + 1.0) * (b.rpm[1] - b.rpm[0])
        if self.shaft:
            share = (t - self.approach) / (t[-1] - self.approach)
            slot = np.clip((share * self.shaft).astype(int), 0, self.shaft - 1)
            commands["n_cmd"] = np.where(t < self.approach, b.usual, levels[slot])
        else:
            commands["n_cmd"] = np.full(t.size, b.usual)
        if b.hold > b.dt:
            held = np.searchsorted(t, np.floor(t / b.hold + 1e-9) * b.hold - 1e-9)
            commands = {name: values[held] for name, values in commands.items()}
        return OpenLoop("designed", t, commands)

    def _fin(self, t: Array, values: Array) -> Array:
        wanted = np.interp(t, np.concatenate([[self.approach], self.knots]), np.concatenate([[0.0], values]))
        most = self.bounds.rate * self.bounds.dt
        out = np.empty_like(wanted)
        at = 0.0
        for i, w in enumerate(wanted):
            at += min(max(w - at, -most), most)
            out[i] = at
        return out

    def read(self, t: Array, commands: Mapping[str, Array]) -> Array:
        """The vector nearest to given orders."""
        b = self.bounds
        row = np.clip(np.searchsorted(t, self.knots, side="right") - 1, 0, t.size - 1)
        parts = [np.asarray(commands["delta_r_cmd"])[row] / b.rudder]
        if self.planes:
            parts.append(np.asarray(commands.get("delta_s_cmd", np.zeros(t.size)))[row] / b.plane)
        if self.shaft:
            middle = self.approach + (np.arange(self.shaft) + 0.5) / self.shaft * (b.duration - self.approach)
            at = np.clip(np.searchsorted(t, middle, side="right") - 1, 0, t.size - 1)
            shaft = np.asarray(commands.get("n_cmd", np.full(t.size, b.usual)))[at]
            parts.append(2.0 * (shaft - b.rpm[0]) / max(b.rpm[1] - b.rpm[0], 1e-12) - 1.0)
        return np.clip(np.concatenate(parts), -1.0, 1.0)

    def random(self, rng: np.random.Generator) -> Array:
        """A random vector: levels held for some knots, or a sum of sines, scaled to the limits."""
        n = len(self.knots)
        fins = []
        for _ in range(2 if self.planes else 1):
            if rng.random() < 0.5:
                hold = rng.integers(1, 5)
                fins.append(np.repeat(rng.uniform(-1, 1, n), hold)[:n])
            else:
                phase = rng.uniform(0, 2 * np.pi, 6)
                wave = np.sum(np.sin(np.outer(np.arange(n), np.pi * np.arange(1, 7) * 2 / n) + phase), axis=1)
                fins.append(wave / np.max(np.abs(wave)))
        return np.concatenate([*fins, rng.uniform(-1, 1, self.shaft)])


def frame(bounds: OrderLimits, time: float) -> Frame:
    """Knots for a vehicle whose L/U is `time` [s]."""
    approach = min(APPROACH * time, 0.05 * bounds.duration)
    count = max(3, round((bounds.duration - approach) / (SPACING * time)))
    knots = approach + np.arange(1, count + 1) * (bounds.duration - approach) / count
    usable = bounds.rpm[1] > bounds.rpm[0] * (1 + 1e-9)
    return Frame(bounds, approach, knots, bounds.plane > 0, SHAFT_LEVELS if usable else 0)


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found.

    Attributes
    ----------
    orders : the best orders
    value : of the score there
    starts : value of every start, then after its search
    evaluations : scores asked for
    """

    orders: OpenLoop
    vector: Array
    value: float
    starts: tuple[tuple[float, float], ...]
    evaluations: int


def search(
    shape: Frame,
    score: Score,
    rng: np.random.Generator,
    known: Sequence[tuple[Array, Mapping[str, Array]]] = (),
    evaluations: int = 1500,
    pool: int = 40,
    starts: int = 2,
    watch: Callable[[int, float], None] | None = None,
) -> Search:
    """Best orders found.

    Parameters
    ----------
    score : larger is better; -inf where the vehicle diverges
    known : times and commands of manoeuvres to start from too; the best of them is always taken
    evaluations : at most this many scores
    pool, starts : random vectors tried first, and how many of them are then improved
    watch : called with (scores so far, best value)
    """
    used = 0
    best, top = np.zeros(shape.size), -np.inf

    def ask(x: Array) -> float:
        nonlocal used, best, top
        used += 1
        value = score(shape.orders(x))
        if value > top:
            best, top = x.copy(), value
        if watch is not None:
            watch(used, top)
        return value

    def ranked(vectors: list[Array]) -> list[tuple[float, Array]]:
        return sorted(((ask(x), x) for x in vectors), key=lambda pair: -pair[0])

    given = ranked([shape.read(t, c) for t, c in known])
    drawn = ranked([shape.random(rng) for _ in range(pool)])
    begin = [*given[:1], *drawn[: max(starts - bool(given), 1)]]
    history = []
    for k, (value, x) in enumerate(begin):
        left = (evaluations - used) // (len(begin) - k)
        history.append((value, _exchange(ask, x, value, rng, left)))
    return Search(shape.orders(best), best, top, tuple(history), used)


def _exchange(
    ask: Callable[[Array], float], x: Array, value: float, rng: np.random.Generator, left: int
) -> float:
    """One knot at a time, twice through the levels, then by steps that halve, until the budget is spent."""
    x = x.copy()
    for step in STEPS:
        for i in rng.permutation(x.size):
            at = x[i]
            tries = LEVELS if step is None else (at - step, at + step)
            for level in tries:
                level = float(np.clip(level, -1.0, 1.0))
                if abs(level - at) < 1e-9:
                    continue
                y = x.copy()
                y[i] = level
                if left <= 0:
                    return value
                left -= 1
                new = ask(y)
                if new > value:
                    x, value = y, new
    return value


def random_design(shape: Frame, rng: np.random.Generator) -> OpenLoop:
    """Orders nobody chose, within the same limits: what a design must beat."""
    return shape.orders(shape.random(rng))
