"""Orders of one run that are earlier or later against its motion than those of the other runs.

Takes runs weighed as they are. Gives one hypothesis per run.
Does not: find what all runs share (a dead time, a lag), tell late orders from early motion, or say which of
several runs are off.

Orders and motion are often logged by two clocks and joined run by run. All runs share the coefficients of
`turn_equation`, each has a constant of its own, and one may have a delay of its own. It has to explain more
than coefficients of its own would, some way from those of the others, which take what the equation lacks: at
one frequency a delay is a phase.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.mistakes.travel import travel_time
from bayesid.trials.mistakes.turn_equation import (
    REACH,
    STEP,
    TurnEquation,
    answering,
    measured_angles,
    solved,
    turn_equations,
    unexplained,
)
from bayesid.trials.trial import Floats, Run

ONE_FOR = 2.0  # lengths travelled that bring one independent residual: what the equation lacks lasts as long
LEAST, LEAST_ROWS = 0.3, 1.2  # a difference in lengths travelled, and in rows: less is what equations lack
FALLS = 0.75  # of what is unexplained: what only bends the equation takes less of it away
KEEPS = 0.3  # share of the turn of the run that may stay unexplained: at a wrong time of a zig-zag more does
APART, ANOTHER_TIME = 1.0, 4.0  # lengths, and nats within which another time explains the run as well
LITTLE = 1e-12  # of the turns, numerically nothing
SILENT = 1e-6  # size of a column over that of all runs, up to which a run has none
LARGE = 1e6  # over those of the run, from which on coefficients of the others are none
OWN = 0.5  # share by which damping and force of a run may differ from those of the others
MOST = 25.0  # nats of the surest run; a rudder of the other sign, which `sides` gives 20, has been ruled out


@dataclass(frozen=True)
class LateRuns:
    """Every run whose orders fit the motion of the vehicle of the other runs at another time, and whether
    times differ while it is not told of which: then nothing else is to be told of how runs turn."""

    told: tuple[Weighed, ...] = ()
    withheld: bool = False


def late_runs(base: Sequence[Base]) -> LateRuns:
    """Runs with orders at another time than those of the others."""
    travel = travel_time(base)
    if travel is None or not travel > 0.0:
        return LateRuns()
    turns = turn_equations([one.run for one in base], travel)
    if len(turns) < 2:
        return LateRuns()
    every: Floats = np.sum([turn.products for turn in turns.values()], axis=0)
    independent = sum(turn.lengths for turn in turns.values()) / ONE_FOR
    turned = (unexplained(every - one.products + one.turned).min() for one in turns.values())
    same = min(float(unexplained(every).min()), *map(float, turned))
    found = {i: _alone(every, turn, independent) for i, turn in turns.items()}
    score = {
        i: (USUAL if one.others_before else 0.0) - 0.5 * independent * math.log(one.left)
        for i, one in found.items()
    }
    best = max(score, key=lambda i: score[i])
    measured = bool(measured_angles([one.run for one in base]))
    if not _clear(found[best], same, turns, travel):
        return LateRuns()
    # no vehicle answers before its orders: where all others would, they are late rather than this one early
    if found[best].others_before or _another(best, found[best], every, turns, travel):
        return LateRuns(withheld=True)
    nats = min(MOST, 0.5 * independent * math.log(min(same, found[best].own)) + score[best])
    out = []
    for i, one in found.items():
        odds = np.zeros(len(base))
        odds[i] = nats + score[i] - score[best]
        mistake = _mistake(base[i].run, one.late * travel, len(turns), measured)
        out.append(Weighed(mistake, odds, {"orders": odds}))
    return LateRuns(tuple(out))


@dataclass(frozen=True)
class _Alone:
    """One run at a time of its own; times in those to travel a length.

    Attributes
    ----------
    way, others_at, own_at : of the products
    left : sum of squares left of the turns of all runs
    own : the same at one time for all, with coefficients of its own for this run
    kept : share of its turn that is left
    others : time after which the vehicle answers in all other runs
    late : by which the orders are later in this one
    one_time : whether no other time does as well, nor one beyond those tried
    """

    way: int
    others_at: int
    own_at: int
    left: float
    own: float
    kept: float
    others: float
    late: float
    one_time: bool

    @property
    def others_before(self) -> bool:
        """Whether the vehicle would answer before its orders in the others, and not in this one."""
        return self.others < -LEAST <= self.others - self.late


def _alone(every: Floats, turn: TurnEquation, independent: float) -> _Alone:
    """The best times of one run and of the others."""
    rest = every - turn.products
    first, end = answering()
    each = unexplained(rest[:, first:end, None] + turn.products[:, None])
    way, a, b = (int(k) for k in np.unravel_index(np.argmin(each), each.shape))
    curve, count = np.maximum(each[way, a], LITTLE * every[way, 0, -1, -1]), each.shape[2]
    low = (k for k in range(1, count - 1) if curve[k] <= min(curve[k - 1], curve[k + 1]))
    rivals = [k for k in low if abs(k - b) > round(APART / STEP)]
    one_time = 1 < b < count - 2 and all(
        0.5 * independent * math.log(curve[k] / curve[b]) > ANOTHER_TIME for k in rivals
    )
    own = turn.products[way, b]
    coefficients = np.append(solved(rest[way, first + a] + own)[0], -1.0)
    others = STEP * (first + a + _between(each[way, :, b], a)) - REACH
    return _Alone(
        way,
        first + a,
        b,
        float(curve[b]),
        _coefficients_of_its_own(rest, turn),
        float(coefficients @ own @ coefficients / own[-1, -1]),
        others,
        others - STEP * (b + _between(curve, b)) + REACH,
        one_time,
    )


def _coefficients_of_its_own(rest: Floats, turn: TurnEquation) -> float:
    """What is left of the turns of all runs at one time for all, with damping and force of the angles of one
    run some way from those of the others, and nonlinear rows of its own."""
    near = slice(*answering())
    others, own = rest[:, near], turn.products[:, near]
    shared, left = solved(others)
    # at the best time of the others, and, where these tell little of it, of all
    tried = {np.unravel_index(np.argmin(one), one.shape) for one in (left, unexplained(others + own))}
    return min(_differing(others[at], own[at], shared[at]) for at in tried)


def _differing(others: Floats, own: Floats, usual: Floats) -> float:
    """What is left where coefficients of one run differ within bounds from those of the others.

    All are found together: of large turns the others, which have `usual` alone, may tell nothing.
    """
    if not np.abs(usual).max() < LARGE * np.abs(solved(own)[0]).max():
        return float(unexplained(others) + unexplained(own))
    bound = np.append(OWN * np.abs(usual), np.inf)[[0, -1, -1, *range(3, usual.size)]]
    bound[bound == 0.0] = np.inf  # of an angle that the others do not move they tell nothing
    size = np.sqrt(np.diag(own + others))[:-1]
    read, there = size > 0.0, np.sqrt(np.diag(own))[:-1] > SILENT * size
    # coefficients of all, then by how much those of the run differ
    both = np.block([[own + others, own], [own, own]])
    turn, kept = size.size, [*np.flatnonzero(read), *(size.size + 1 + np.flatnonzero(there))]
    inner, right = both[np.ix_(kept, kept)], both[kept, turn]
    scale = np.sqrt(np.diag(inner))
    root = np.linalg.cholesky(inner / np.outer(scale, scale) + 1e-9 * np.eye(scale.size))
    limits = np.append(np.full(int(read.sum()), np.inf), bound[there]) * scale
    found = lsq_linear(root.T, np.linalg.solve(root, right / scale), (-limits, limits), "bvls").x / scale
    return float(both[turn, turn] - 2.0 * found @ right + found @ inner @ found)


def _least(turns: Mapping[int, TurnEquation], travel: float) -> float:
    """The least difference of times that is told, in those to travel a length."""
    return max(LEAST, LEAST_ROWS * max(turn.row for turn in turns.values()) / travel)


def _clear(one: _Alone, same: float, turns: Mapping[int, TurnEquation], travel: float) -> bool:
    """Whether a time of its own explains a run clearly."""
    if not one.one_time or abs(one.late) < _least(turns, travel):
        return False
    return one.left <= FALLS * min(same, one.own) and one.kept <= KEEPS


def _another(i: int, one: _Alone, every: Floats, turns: Mapping[int, TurnEquation], travel: float) -> bool:
    """Whether, beside one run at a time of its own, a second is explained better at another as well."""
    own = turns[i].products[one.way]
    for j, turn in turns.items():
        if j == i:
            continue
        other = turn.products[one.way]
        rest = (
            every[one.way, one.others_at] - turns[i].products[one.way, one.others_at] - other[one.others_at]
        )
        left = unexplained(rest + own[one.own_at] + other)
        apart = abs(int(np.argmin(left)) - one.others_at) * STEP
        if left.min() < FALLS * one.left and apart >= _least(turns, travel):
            return True
    return False


def _mistake(run: Run, late: float, runs: int, measured: bool) -> Mistake:
    """Late orders, or early ones where `late` [s] is negative; with measured angles where these tell it."""
    columns = sorted({*run.commands, *(run.measured_inputs if measured else ())})
    what = "orders and measured angles" if measured else "orders"
    seconds = float(f"{late:.3g}")
    side = "later" if late > 0 else "earlier"
    says = f"{what} are logged {abs(seconds):g} s {side} against the motion than those of the other runs"
    if late < 0:
        says += ", or the vehicle answers so much later"
    correction = Correction(late=dict.fromkeys(columns, seconds), runs=(run.name,))
    return Mistake(f"orders of {run.name} against its motion", says, correction, USUAL - math.log(runs))


def _between(left: Floats, k: int) -> float:
    """Where a parabola through a smallest value and its neighbours is smallest, from it, in steps."""
    if not 0 < k < left.size - 1:
        return 0.0
    before, least, after = left[k - 1 : k + 2]
    bend = before - 2.0 * least + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0
