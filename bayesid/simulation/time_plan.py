"""Time steps and inputs of one run, laid out for the kernels.

Takes sample times, commands, measured actuator positions and measured wind. Gives a `TimePlan`.
Does not apply an actuator effect: those depend on parameters (`prepare`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.model.actuators import UNLIMITED
from bayesid.model.channels import channel
from bayesid.model.vehicles.orders import spread, together

Array = np.ndarray

# Default RK4 steps in units of L/U, and the pieces in which a fin on its way is followed (`actuation`). A
# rudder put over from 20 to 20 degrees every 1.6 L/U for 40 L/U leaves 0.02 m (nps_auv2), 0.06 m
# (generic_sub) and 0.07 m (suboff_full, unstable); held at its mean over the steps 0.15, 1.8 and 8 m.
STEP_PER_LENGTH = 0.08
PIECE_PER_LENGTH = 0.01
LEAST_PART = 0.1  # of a step: no edge is set so near to another one
ENDLESS = 0.5 * math.radians(UNLIMITED)  # stops beyond are none


@dataclass(frozen=True, eq=False)
class TimePlan:
    """Time grid and inputs of one run, ready for the kernels.

    Attributes
    ----------
    t : (n,) sample times [s]
    times, steps : (m,) start [s since the run began] and length [s] of every RK4 step
    record : (n,) number of steps done when sample i is taken
    command : (m, na) commanded actuator positions, mean over the step, without any delay [rad, rpm]
    exogenous : (m, ne) measured wind (its mean over `wind_average` of the vehicle) and latent inputs, held
        over each step
    knots, levels : (k,) and (k, na) times [s since the run began] and values of the held commands
    sooner : (na,) time [s] by which the command of an actuator switches before its knot
    measured : names of actuators whose measured position is used instead of the command
    began : when the run began [s], from which effects that change with time count: the first sample, or one
        before it of which this is a part
    piece : length [s] of the pieces in which a moving fin is followed, 0 where a step is one piece
    kept : what `actuate` and `chain_of` have worked out for this plan
    """

    t: Array
    times: Array
    steps: Array
    record: Array
    command: Array
    exogenous: Array
    knots: Array
    levels: Array
    sooner: Array
    measured: tuple[str, ...] = ()
    piece: float = 0.0
    began: float = 0.0
    kept: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what was worked out for this process."""
        return {**self.__dict__, "kept": {}}


def plan_run(
    model: Model,
    t: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array] | None = None,
    exogenous: Mapping[str, Array] | None = None,
    max_step: float | None = None,
    longer: float = 1.0,
    began: float | None = None,
    acts_before: Mapping[str, float] | None = None,
) -> TimePlan:
    """Time grid and inputs for a run.

    Parameters
    ----------
    model : Model
    t : (n,) sample times [s], increasing, not necessarily regular
    inputs : commands "delta_r_cmd" [rad], "n_cmd" [rpm] ... at the samples, held until the next; missing
        ones are 0, names the model does not read are left out. Those of rudder and shaft order the named
        rudders and shafts of a vehicle that has them in their place
    measured : actuator positions "delta_r", "n" ... at the samples, linear in between; they replace the
        command and lift the vehicle's own rate and angle limits
    exogenous : "wind_speed" [m/s] and "wind_from" [rad]
    max_step : longest RK4 step [s]; default `STEP_PER_LENGTH` L/U, steps where a fin moves being followed in
        pieces of `PIECE_PER_LENGTH`, those at its own rate ending when it stops
    longer : how much longer the default steps are: maps of single sample intervals gather no error
    began : when the run began [s], of a part of one; default the first sample
    acts_before : command -> time [s] by which it switches before the sample that holds it

    Raises
    ------
    ModelError
        if times are not finite or do not increase, or if an input has another length than t or no finite
        value at all; single missing values are held from the last good one
    """
    t = _sample_times(t)
    names = model.kernel.actuators
    inputs = spread(model.vehicle, inputs, measured)
    measured = {k: v for k, v in (measured or {}).items() if k in names}
    levels = np.zeros((t.size, len(names)))
    sooner = _sooner(model, acts_before or {}, measured)
    moving, servos = np.zeros(t.size - 1), model.kernel.spec.servos
    for a, name in enumerate(names):
        if name in measured:
            levels[:, a] = _filled(measured[name], name, t.size)
        elif f"{name}_cmd" in inputs:
            levels[:, a] = _filled(inputs[f"{name}_cmd"], f"{name}_cmd", t.size)
        if name in servos and channel(name).circular:
            levels[:, a] = _turns(levels[:, a], model.nominal[model.index[f"limit_{servos[name]}"]])
        if name in servos and name not in measured and f"{name}_cmd" in inputs and max_step is None:
            moving = np.maximum(moving, _moving(model, servos[name], t, levels[:, a]))
    long, piece = _longest(model, max_step, longer)
    start, steps, record = _steps(t, moving, long)
    middle = start + 0.5 * steps
    command = levels[np.repeat(np.arange(t.size - 1), np.diff(record))]
    for a, name in enumerate(names):
        if name in measured:
            command[:, a] = np.interp(middle, t, levels[:, a])
    exo = np.zeros((steps.size, len(model.kernel.exogenous)))
    if exogenous and "wind_speed" in exogenous and "wind_from" in exogenous:
        speed = _filled(exogenous["wind_speed"], "wind_speed", t.size)
        towards = _filled(exogenous["wind_from"], "wind_from", t.size) + math.pi
        over = model.vehicle.dimensions.get("wind_average", 0.0)
        for name, values in (("wind_north", speed * np.cos(towards)), ("wind_east", speed * np.sin(towards))):
            exo[:, model.kernel.exogenous.index(name)] = np.interp(middle, t, _averaged(t, values, over))
    began = float(t[0]) if began is None else began
    return TimePlan(
        t,
        start - began,
        steps,
        record,
        command,
        exo,
        t - began,
        levels,
        sooner,
        tuple(measured),
        piece,
        began,
    )


def plan_trial_run(model: Model, run: Any, max_step: float | None = None, longer: float = 1.0) -> TimePlan:
    """Plan of a logged run (`trials.Run`): measured actuators where logged, commands otherwise."""
    return plan_run(
        model, run.t, run.commands, run.measured_inputs, run.exogenous, max_step, longer, run.began,
        run.acts_before,
    )  # fmt: skip


def _sooner(model: Model, acts_before: Mapping[str, float], measured: Mapping[str, Array]) -> Array:
    """(na,) time [s] by which commands act before their samples; one of several actuators is that of each."""
    own = {name.removesuffix("_cmd"): s for name, s in acts_before.items()}
    orders: dict[str, list[float]] = {}  # a fin of an X obeys two: they act at the mean of their times
    for common, signs in together(model.vehicle).items():
        for name in signs:
            orders.setdefault(name, []).append(own.get(common, 0.0))
    own = {name: float(np.mean(times)) for name, times in orders.items()} | own
    names = model.kernel.actuators
    return np.array([0.0 if name in measured else own.get(name, 0.0) for name in names])


def _longest(model: Model, max_step: float | None, longer: float) -> tuple[float, float]:
    """Longest step and the pieces of a step where a fin moves [s]; 0 for steps of one piece."""
    time = model.scales["L"] / max(model.scales["U"], 1e-3)
    if max_step is None:
        return longer * STEP_PER_LENGTH * time, longer * PIECE_PER_LENGTH * time
    if not max_step > 0.0:
        raise ModelError(f"max_step = {max_step:g} s: a step must be longer than 0")
    return max_step, 0.0


def _moving(model: Model, servo: str, t: Array, levels: Array) -> Array:
    """(n-1,) time [s] after each sample for which a fin still runs at the vehicle's rate."""
    inverse, limit = (model.nominal[model.index[f"{k}_{servo}"]] for k in ("inverse_rate", "limit"))
    inverse = float(inverse)
    out = np.zeros(t.size - 1)
    held = np.clip(levels, -limit, limit).tolist()  # numbers of Python: four times as fast in a loop
    at = held[0]
    for i, (gap, level) in enumerate(zip(np.diff(t).tolist(), held[:-1], strict=True)):
        if level == at:
            continue
        left = abs(level - at) * inverse
        out[i] = min(left, gap)
        at = level if left <= gap else at + math.copysign(gap / inverse, level - at)
    return out


def _steps(t: Array, moving: Array, long: float) -> tuple[Array, Array, Array]:
    """Start and length of every step, and the number of steps done at each sample."""
    gaps = np.diff(t)
    moving = np.where(np.minimum(moving, gaps - moving) < LEAST_PART * long, 0.0, moving)
    parts = np.stack([moving, gaps - moving], axis=1)
    count = np.ceil(parts / long - 1e-9).astype(np.int64)
    pieces = count.ravel()
    steps = np.repeat(parts.ravel() / np.maximum(pieces, 1), pieces)
    begin = np.stack([t[:-1], t[:-1] + moving], axis=1).ravel()
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    start = np.repeat(begin, pieces) + steps * (np.arange(steps.size) - first)
    return start, steps, np.concatenate(([0], np.cumsum(count.sum(axis=1))))


def _sample_times(t: Array) -> Array:
    t = np.asarray(t, dtype=float)
    if t.ndim != 1 or t.size < 2:
        raise ModelError(f"a run needs at least two sample times; got an array of shape {t.shape}")
    wrong = np.flatnonzero(~(np.diff(t) > 0.0))
    if wrong.size or not np.isfinite(t[-1]):
        i = int(wrong[0]) + 1 if wrong.size else t.size - 1
        raise ModelError(
            f"sample times must be finite and increase; sample {i} at {t[i]:g} s follows {t[i - 1]:g} s"
        )
    return t


def _turns(angle: Array, limit: float) -> Array:
    """A direction as it is followed: the shorter way round, or, with stops, from side to side; as it is
    logged where the stops let it go beyond astern."""
    if limit >= ENDLESS:
        out: Array = np.unwrap(angle)
    else:
        out = angle if limit > math.pi else np.arctan2(np.sin(angle), np.cos(angle))
    return out


def _averaged(t: Array, values: Array, over: float) -> Array:
    """First-order mean of a signal over a time [s], exact for what is linear between samples; it starts at
    the first sample."""
    if over == 0.0:
        return values
    out = values.copy()
    for i, h in enumerate(np.diff(t).tolist()):
        behind = over * (values[i + 1] - values[i]) / h  # a ramp is followed this far behind
        out[i + 1] = values[i + 1] - behind + (out[i] - values[i] + behind) * math.exp(-h / over)
    return out


def _filled(values: Array, name: str, size: int) -> Array:
    """Input with missing samples held from the last good one."""
    values = np.array(values, dtype=float)
    if values.shape != (size,):
        raise ModelError(f"input {name} has shape {values.shape} beside {size} sample times")
    good = np.isfinite(values)
    if not good.any():
        raise ModelError(f"input {name} has no finite value")
    if not good.all():
        last = np.maximum.accumulate(np.where(good, np.arange(values.size), -1))
        last[last < 0] = np.argmax(good)
        values = values[last]
    return values
