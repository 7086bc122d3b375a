"""Actuators of a run: from commands to what the equations read of their positions over every step.

Takes a `Model`, parameters in SI and a `TimePlan`. Gives, for every step, the straight line with the mean and
the first moment of the true positions. The links of an actuator (dead time, lag, servo, stops) are followed
in shorter pieces where it moves and cut where a delayed command switches. The equations need no shorter steps
for that: a force that is linear in the position leaves the same velocity and heading at the end of a step, up
to damping within it. A force that is quadratic in it, the drag of a fin or the thrust of a shaft, misses what
the mean square loses to the line where it moves within a step: a shaft that lags or is late by less than one.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.equations import Functions
from bayesid.equations.model import Model
from bayesid.simulation.prepare import check_parameters, choose
from bayesid.simulation.time_plan import PIECE_PER_LENGTH, STEP_PER_LENGTH, TimePlan

Array = np.ndarray

STILL = 1e-4  # rad L/U: a move times its duration that makes no difference
# A position held at its mean over a step h while it moves by D loses at most D h^2/8 of when it moved
# [rad s^2]; what `STILL` lets pass is STILL h/4 L/U.
_LOSS = 2.0 * STILL * STEP_PER_LENGTH
MOST_KNOWN = 4  # chains of a run whose moving steps are kept


@dataclass(frozen=True, eq=False)
class Pieces:
    """Commands over pieces of steps.

    A servo at its rate limit does not feel the mean of a command over a step, only when it begins to move;
    with uncut steps a delay shorter than one would be lost.

    Attributes
    ----------
    owner : (k,) the step a piece belongs to
    middle, lengths : (k,) [s]
    command : (k, na) held over each piece
    delay_slope, stretch : (k, na) derivatives of command and lengths by the delay of each actuator
    weight, tilt : (k,) what a value held over the piece adds to mean and change of its step
    weight_slope, tilt_slope : (k, na) their derivatives by the delay of each actuator
    """

    owner: Array
    middle: Array
    lengths: Array
    command: Array
    delay_slope: Array
    stretch: Array
    weight: Array
    tilt: Array
    weight_slope: Array
    tilt_slope: Array


def actuate(
    model: Model, par: Array, plan: TimePlan, slopes: bool = False, full: bool | None = None
) -> tuple[Array, Array]:
    """Means of the actuator positions over each step and their changes from its start to its end.

    Both are those of the straight line with the mean and the first moment of the positions. With `slopes`
    also the derivatives by the parameters of the chains.

    Returns
    -------
    (m, 2 na) [rad, rpm], means first, and (m, 2 na, c), c columns in the order of the kernel's `act_columns`
    """
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    count, steps = _moving(model, fun, plan, par), plan.steps.size
    act, dact = run_chains(fun, par, _pieces(fun, plan, par, count, False), steps, False)
    if slopes:
        dact = run_chains(fun, par, _pieces(fun, plan, par, count, True), steps, True)[1]
    return act, dact


def mean_positions(model: Model, par: Array, plan: TimePlan, full: bool | None = None) -> Array:
    """(n-1, na) mean positions of the actuators over the sample intervals [rad, rpm]."""
    act = actuate(model, par, plan, full=full)[0][:, : len(model.kernel.actuators)]
    mean = np.add.reduceat(act * plan.steps[:, None], plan.record[:-1], axis=0)
    return np.asarray(mean / np.diff(plan.t)[:, None])


def positions_at_samples(model: Model, par: Array, plan: TimePlan, full: bool | None = None) -> Array:
    """(n, na) positions of the actuators after the samples, those before at the last one [rad, rpm]."""
    act, na = actuate(model, par, plan, full=full)[0], len(model.kernel.actuators)
    at = np.minimum(plan.record, plan.steps.size - 1)
    return act[at, :na] + np.where(plan.record < plan.steps.size, -0.5, 0.5)[:, None] * act[at, na:]


def cut(
    times: Array,
    steps: Array,
    command: Array,
    piece: Array | None = None,
    delays: Mapping[int, float] | None = None,
    knots: Array | None = None,
    levels: Array | None = None,
    slopes: bool = False,
) -> Pieces:
    """Pieces of steps that follow each other.

    Parameters
    ----------
    times, steps : (m,) start and length of the steps [s]
    command : (m, na) held over each step
    piece : (m,) number of equal pieces of every step; default one
    delays, knots, levels : delay [s] of some actuators, times at which the commands switch [s] and what they
        are then; the first and last level count outside the knots. Steps are cut where these switch
    slopes : with derivatives by the delays
    """
    m, na = command.shape
    delays = delays or {}
    count = np.ones(m, dtype=np.int64) if piece is None else piece
    first = np.concatenate(([0], np.cumsum(count)))
    of = np.repeat(np.arange(m), count)
    edges = np.append(
        times[of] + (steps / count)[of] * (np.arange(of.size) - first[of]), times[-1] + steps[-1]
    )
    born = np.full(edges.size, -1)
    if delays:
        assert knots is not None and levels is not None
        for a, delay in delays.items():
            switches = knots[1:][np.diff(levels[:, a]) != 0.0] + delay
            switches = switches[(switches > edges[0]) & (switches < edges[of.size])]
            edges, born = np.append(edges, switches), np.append(born, np.full(switches.size, a))
        order = np.argsort(edges, kind="stable")
        edges, born = edges[order], born[order]
    lengths = np.diff(edges)
    kept = lengths > 1e-12 * steps[0]
    middle = edges[:-1] + 0.5 * lengths
    owner = np.searchsorted(times, middle, side="right") - 1 if delays else of
    out = command[owner]
    for a, delay in delays.items():
        assert knots is not None and levels is not None
        at = np.searchsorted(knots, middle - delay, side="right") - 1
        out[:, a] = levels[np.clip(at, 0, knots.size - 1), a]
    whole = steps[owner]
    low = edges[:-1] - times[owner] - 0.5 * whole
    high = low + lengths
    nothing = np.zeros((1, na))
    stretch = by_weight = by_tilt = nothing
    if slopes and delays:
        moved = (born[:, None] == np.arange(na)).astype(float)
        # edges at one time are one, which moves with the delays of all whose switches it is
        one = np.cumsum(np.concatenate(([True], kept))) - 1
        moved = np.maximum.reduceat(moved, np.flatnonzero(np.concatenate(([True], kept))), axis=0)[one]
        stretch = np.diff(moved, axis=0)
        by_weight = stretch / whole[:, None]
        by_tilt = 12.0 * (high[:, None] * moved[1:] - low[:, None] * moved[:-1]) / whole[:, None] ** 2
        stretch, by_weight, by_tilt = stretch[kept], by_weight[kept], by_tilt[kept]
    elif slopes:
        stretch = by_weight = by_tilt = np.zeros_like(out)
    return Pieces(
        owner[kept], middle[kept], lengths[kept], out[kept],
        np.zeros_like(out[kept]) if slopes else nothing, stretch,
        (lengths / whole)[kept], (6.0 * (high**2 - low**2) / whole**2)[kept], by_weight, by_tilt,
    )  # fmt: skip


def run_chains(
    fun: Functions,
    par: Array,
    pieces: Pieces,
    steps: int,
    slopes: bool,
    memory: Array | None = None,
    carried: Array | None = None,
    restart: bool = True,
) -> tuple[Array, Array]:
    """Means and changes over the steps of the actuators, and their derivatives by the chains' parameters.

    Parameters
    ----------
    memory, carried : what the links remember and its derivatives, set in place
    restart : the links have long rested at the first command, whatever they remember
    """
    na, nc = pieces.command.shape[1], len(fun.act_columns)
    act, dact = np.zeros((steps, 2 * na)), np.zeros((steps if slopes else 1, 2 * na, nc))
    if memory is None or carried is None:
        memory, carried = np.zeros(fun.act_memory), np.zeros((fun.act_memory, nc))
    fun.actuate(
        np.ascontiguousarray(pieces.command), pieces.delay_slope, pieces.stretch, pieces.lengths,
        pieces.owner, pieces.weight, pieces.tilt, pieces.weight_slope, pieces.tilt_slope, par, slopes,
        restart, memory, carried, act, dact,
    )  # fmt: skip
    return act, dact


def _moving(model: Model, fun: Functions, plan: TimePlan, par: Array) -> Array:
    """(m,) number of pieces of every step: several where a chain moves an actuator noticeably."""
    one = np.ones(plan.steps.size, dtype=np.int64)
    servos, names = model.kernel.spec.servos, model.kernel.actuators
    fins = [a for a, name in enumerate(names) if name in servos]
    if plan.piece == 0.0 or not fins:
        return one
    known = plan.kept.get("moving")
    if known is None or known[0]() is not model:
        # by a weak reference: a plan outlives its model in what fits share, which is dropped with the model
        known = plan.kept["moving"] = (weakref.ref(model), {})
    counts: dict[tuple[str, bytes], Array] = known[1]
    key = (fun.prefix, par[list(fun.act_columns)].tobytes())
    if key not in counts:
        act = run_chains(fun, par, _pieces(fun, plan, par, one, False), plan.steps.size, False)[0][:, fins]
        beside = np.abs(np.concatenate([act[1:], act[-1:]]) - np.concatenate([act[:1], act[:-1]]))
        least = _LOSS * (plan.piece / PIECE_PER_LENGTH) ** 2
        moving = beside.max(axis=1, initial=0.0) * plan.steps**2 > least
        counts[key] = np.where(moving, np.ceil(plan.steps / plan.piece - 1e-9), 1).astype(np.int64)
        while len(counts) > MOST_KNOWN:
            del counts[next(iter(counts))]
    return counts[key]


def _pieces(fun: Functions, plan: TimePlan, par: Array, piece: Array, slopes: bool) -> Pieces:
    """Commands of a plan after pure delays; with `slopes` no switch falls on the edge of a piece."""
    delays = {a: float(sum(par[i] for i in ids)) for a, ids in fun.act_delays.items() if ids}
    measured = [a for a, name in enumerate(fun.module.ACTUATORS) if name in plan.measured]
    held = {a: d for a, d in delays.items() if a not in measured}
    held |= {a: held.get(a, 0.0) - s for a, s in enumerate(plan.sooner.tolist()) if s}
    if slopes:  # seen from the side of longer delays, a hair beyond the edge
        held = {a: d + 1e-7 * float(plan.steps.min()) for a, d in held.items()}
    held = {a: d for a, d in held.items() if d != 0.0}
    out = cut(plan.times, plan.steps, plan.command, piece, held, plan.knots, plan.levels, slopes)
    for a in measured:
        at = out.middle - delays.get(a, 0.0)
        out.command[:, a], change = _between(plan.knots, plan.levels[:, a], at)
        if slopes and a in delays:
            out.delay_slope[:, a] = -change
    return out


def _between(knots: Array, levels: Array, s: Array) -> tuple[Array, Array]:
    """Straight lines between samples, and their slope; level outside."""
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 2)
    rise = np.where((s < knots[0]) | (s > knots[-1]), 0.0, (np.diff(levels) / np.diff(knots))[i])
    return np.interp(s, knots, levels), rise
