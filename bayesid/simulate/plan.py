"""Time steps and inputs of one run, laid out for the kernels.

Takes sample times, commands, measured actuator positions and measured wind. Gives a `Plan`.
Does not apply an actuator effect: those depend on parameters (`prepare`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.errors import ModelError
from bayesid.model import Model

Array = np.ndarray

STEP_PER_LENGTH = 0.08  # default RK4 step in units of L/U


@dataclass(frozen=True, eq=False)
class Plan:
    """Time grid and inputs of one run, ready for the kernels.

    Attributes
    ----------
    t : (n,) sample times [s]
    times, steps : (m,) start [s from the first sample] and length [s] of every RK4 step
    record : (n,) number of steps done when sample i is taken
    command : (m, na) commanded actuator positions, mean over the step, without any delay [rad, rpm]
    exogenous : (m, ne) measured wind and latent inputs, held over each step
    knots, levels : (k,) and (k, na) switching times and values of the held commands
    measured : names of actuators whose measured position is used instead of the command
    """

    t: Array
    times: Array
    steps: Array
    record: Array
    command: Array
    exogenous: Array
    knots: Array
    levels: Array
    measured: tuple[str, ...] = ()


def plan_run(
    model: Model,
    t: Array,
    inputs: Mapping[str, Array],
    measured: Mapping[str, Array] | None = None,
    exogenous: Mapping[str, Array] | None = None,
    max_step: float | None = None,
) -> Plan:
    """Time grid and inputs for a run.

    Parameters
    ----------
    model : Model
    t : (n,) sample times [s], increasing, not necessarily regular
    inputs : commands "delta_r_cmd" [rad], "n_cmd" [rpm] ... at the samples, held until the next; missing
        ones are 0, names the model does not read are left out
    measured : actuator positions "delta_r", "n" ... at the samples, linear in between; they replace the
        command and lift the vehicle's own rate and angle limits
    exogenous : "wind_speed" [m/s] and "wind_from" [rad]
    max_step : longest RK4 step [s]; default `STEP_PER_LENGTH` L/U

    Raises
    ------
    ModelError
        if times are not finite or do not increase, or if an input has another length than t or no finite
        value at all; single missing values are held from the last good one
    """
    t = _sample_times(t)
    scale = model.scales
    longest = STEP_PER_LENGTH * scale["L"] / max(scale["U"], 1e-3) if max_step is None else max_step
    if not longest > 0.0:
        raise ModelError(f"max_step = {longest:g} s: a step must be longer than 0")
    gaps = np.diff(t)
    count = np.maximum(1, np.ceil(gaps / longest - 1e-9)).astype(np.int64)
    steps = np.repeat(gaps / count, count)
    record = np.concatenate(([0], np.cumsum(count)))
    start = np.repeat(t[:-1], count) + steps * (np.arange(steps.size) - np.repeat(record[:-1], count))
    middle = start + 0.5 * steps
    owner = np.repeat(np.arange(t.size - 1), count)
    names = model.kernel.actuators
    measured = {k: v for k, v in (measured or {}).items() if k in names}
    levels = np.zeros((t.size, len(names)))
    command = np.zeros((steps.size, len(names)))
    for a, name in enumerate(names):
        if name in measured:
            levels[:, a] = _filled(measured[name], name, t.size)
            command[:, a] = np.interp(middle, t, levels[:, a])
        elif f"{name}_cmd" in inputs:
            levels[:, a] = _filled(inputs[f"{name}_cmd"], f"{name}_cmd", t.size)
            command[:, a] = levels[owner, a]
    exo = np.zeros((steps.size, len(model.kernel.exogenous)))
    if exogenous and "wind_speed" in exogenous and "wind_from" in exogenous:
        speed = _filled(exogenous["wind_speed"], "wind_speed", t.size)
        towards = _filled(exogenous["wind_from"], "wind_from", t.size) + math.pi
        for name, values in (("wind_north", speed * np.cos(towards)), ("wind_east", speed * np.sin(towards))):
            exo[:, model.kernel.exogenous.index(name)] = np.interp(middle, t, values)
    return Plan(t, start - t[0], steps, record, command, exo, t - t[0], levels, tuple(measured))


def plan_trial_run(model: Model, run: Any, max_step: float | None = None) -> Plan:
    """Plan of a logged run (`trials.Run`): measured actuators where logged, commands otherwise."""
    return plan_run(model, run.t, run.commands, run.measured_inputs, run.exogenous, max_step)


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
