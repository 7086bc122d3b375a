"""Short steps where a fin of given parameters moves, not where its command or the vehicle's own fin does.

Takes a `TimePlan` and a parameter vector. Gives the plan itself, or one with more of its steps cut: a dead
time, a lag or a slow servo move the fin later than the plan expects. Whole steps of the plan are cut, so
that no derivative meets a step whose length depends on a parameter.
"""

from __future__ import annotations

import math
import weakref
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.simulation.prepare import actuate, check_parameters, choose
from bayesid.simulation.time_plan import MOVING_STEP_PER_LENGTH, STEP_PER_LENGTH, STILL, TimePlan

Array = np.ndarray

# A fin held at its mean over a step h while it moves by D loses at most D h^2/8 of when it moved [rad s^2];
# what `STILL` lets pass is STILL h/4 L/U.
_LOSS = 2.0 * STILL * STEP_PER_LENGTH
# Bytes of cut plans kept per run: all of a usual one.
MOST_BYTES = 16_000_000
_WHOLE = round(STEP_PER_LENGTH / MOVING_STEP_PER_LENGTH)


def follow(model: Model, par: Array, plan: TimePlan, full: bool | None = None) -> TimePlan:
    """Plan whose short steps hold the motion of the fins of a parameter vector.

    Parameters
    ----------
    par : (n,) parameter vector, SI
    plan : Plan; returned as it is where `max_step` was given or the chains are the vehicle's own

    Returns
    -------
    Plan, the same object for all parameters with about the same timing
    """
    if plan.short == 0.0:
        return plan
    chain = list(choose(model, par, full).act_columns)
    own = check_parameters(model, plan, model.without_effects)
    if np.array_equal(check_parameters(model, plan, par)[chain], own[chain]):
        return plan
    servos, names = model.kernel.spec.servos, model.kernel.actuators
    fins = [a for a, name in enumerate(names) if name in servos and name not in plan.measured]
    least = _LOSS * (plan.short / MOVING_STEP_PER_LENGTH) ** 2
    known = plan.kept.get("model")
    if known is None or known() is not model:
        # by a weak reference: a plan outlives its model in what fits share, which is dropped with the model
        switches = _switches(plan, fins, least / plan.steps.max() ** 2)
        plan.kept.update(model=weakref.ref(model), own={}, switches=switches)
    if full not in plan.kept["own"]:
        plan.kept["own"][full] = actuate(model, own, plan, full=full)[0]
    late = (actuate(model, par, plan, full=full)[0] - plan.kept["own"][full])[:, fins]
    beside = np.abs(np.concatenate([late[1:], late[-1:]]) - np.concatenate([late[:1], late[:-1]]))
    long = plan.steps > 1.5 * plan.short
    moving = long & (beside.max(axis=1, initial=0.0) * plan.steps**2 > least)
    if not moving.any():
        return plan
    since, until = plan.kept["switches"]
    after = since <= until
    window = _rounded(since[moving & after], plan.short), _rounded(until[moving & ~after], plan.short)
    if window not in plan.kept:
        plan.kept[window] = _cut(plan, long & ((since <= window[0]) | (until <= window[1])))
        _drop(plan, window)
    return plan.kept[window]


def _drop(plan: TimePlan, newest: tuple[float, float]) -> None:
    """Forget the oldest cut plans of a long run, which are made anew where they are asked for."""
    room = MOST_BYTES
    for window in [newest, *reversed([k for k in plan.kept if isinstance(k, tuple) and k != newest])]:
        cut = plan.kept[window]
        room -= cut.times.nbytes + cut.steps.nbytes + cut.command.nbytes + cut.exogenous.nbytes
        if room < 0 and window != newest:
            del plan.kept[window]


def _switches(plan: TimePlan, fins: list[int], least: float) -> tuple[Array, Array]:
    """Time from the last switch of a command by more than `least` [rad] to every step, and to the next."""
    moved = np.abs(np.diff(plan.levels[:, fins], axis=0)).max(axis=1, initial=0.0) > least
    edges = np.concatenate([[-np.inf], plan.knots[1:][moved], [np.inf]])
    middle = plan.times + 0.5 * plan.steps
    last = np.searchsorted(edges, middle, side="right") - 1
    return middle - edges[last], edges[last + 1] - middle


def _rounded(times: Array, short: float) -> float:
    """Longest of some times, up to the next power of two of whole steps: few plans serve many parameters."""
    longest = float(times.max(initial=0.0))
    if longest == 0.0 or longest == math.inf:
        return longest
    unit = _WHOLE * short
    return unit * 2.0 ** max(0, math.ceil(math.log2(longest / unit)))


def _cut(plan: TimePlan, chosen: Array) -> TimePlan:
    """Plan with some steps cut into short ones; inputs stay as they are held."""
    pieces = np.where(chosen, np.ceil(plan.steps / plan.short - 1e-9), 1.0).astype(np.int64)
    whole = np.repeat(np.arange(pieces.size), pieces)
    done = np.concatenate(([0], np.cumsum(pieces)))
    steps = (plan.steps / pieces)[whole]
    return replace(
        plan,
        times=plan.times[whole] + steps * (np.arange(whole.size) - done[whole]),
        steps=steps, record=done[plan.record], command=plan.command[whole], exogenous=plan.exogenous[whole],
        short=0.0,
    )  # fmt: skip
