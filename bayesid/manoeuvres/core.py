"""What the operator orders: command histories fixed beforehand, or computed from the motion as it happens.

Takes: arrays of commands, or a law that reads the state; SI, radians, port-positive rudder, rpm.
Does not: simulate, nor clip to the limits of a vehicle; actuators belong to the model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from bayesid.errors import ManoeuvreError, raise_all
from bayesid.model.channels import COMMANDS

KNOWN = f"{', '.join(COMMANDS[:4])}, or of a named actuator, such as {COMMANDS[4]}"

Commands = Mapping[str, float]
Controller = Callable[[float, np.ndarray], Commands]


class Law(Protocol):
    """A recipe for controllers; frozen, so that a manoeuvre can be run any number of times."""

    def __call__(self) -> Controller:
        """Fresh controller without memory of an earlier run: (t [s], state (12,)) -> commands."""


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Commands known beforehand; row k holds on [t_k, t_k+1), the first also before t_0.

    Parameters
    ----------
    name : short name for tables
    t : (n,) array            time [s], increasing; the run ends at the last row
    commands : channel -> (n,) array or number    among COMMANDS, [rad] and [rpm]
    parameters : plain values the history was made from, for reports

    Raises
    ------
    ManoeuvreError            all problems at once
    """

    name: str
    t: np.ndarray
    commands: Mapping[str, np.ndarray]
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t = np.array(self.t, dtype=float)
        problems = _time_problems(t)
        commands = {}
        for channel, values in self.commands.items():
            column = np.array(values, dtype=float)
            if column.ndim == 0:
                column = np.full(t.shape, float(column))
            if channel not in COMMANDS:
                problems.append(f"{channel} is not a command; use {KNOWN}")
            elif column.shape != t.shape:
                problems.append(f"{channel} has shape {column.shape}, time has {t.shape}")
            elif not np.isfinite(column).all():
                row = int(np.argmin(np.isfinite(column)))
                problems.append(f"{channel} is not finite at row {row}; a command must be a number")
            column.flags.writeable = False
            commands[channel] = column
        if not self.commands:
            problems.append(f"no command given; use at least one of {KNOWN}")
        if problems:
            raise_all(ManoeuvreError, f"manoeuvre {self.name!r}", problems)
        t.flags.writeable = False
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "commands", MappingProxyType(commands))
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    @property
    def duration(self) -> float:
        """Time from the first to the last row [s]."""
        return float(self.t[-1] - self.t[0])


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Commands computed from the motion once per step and held over it.

    Parameters
    ----------
    name : short name for tables
    duration, dt : length of the run and of a step [s]
    start : channel -> number    commands held before the run starts; also names every channel used
    controller : `controller()` returns a fresh callable (t [s] from the start, state (12,)) -> commands,
        state in the order x y z phi theta psi u v w p q r with psi unwrapped; it keeps its own memory and
        must be called once per step, in order of time
    parameters : plain values for reports
    """

    name: str
    duration: float
    dt: float
    start: Commands
    controller: Law
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problems = []
        if not (np.isfinite(self.dt) and self.dt > 0):
            problems.append(f"dt is {self.dt} s; it must be positive")
        elif not (np.isfinite(self.duration) and self.duration >= self.dt):
            problems.append(f"duration is {self.duration} s, shorter than one step of {self.dt} s")
        problems += [f"{c} is not a command; use {KNOWN}" for c in self.start if c not in COMMANDS]
        problems += [
            f"{c} starts at {v}; it must be finite" for c, v in self.start.items() if not np.isfinite(v)
        ]
        if problems:
            raise_all(ManoeuvreError, f"manoeuvre {self.name!r}", problems)
        object.__setattr__(self, "start", MappingProxyType({c: float(v) for c, v in self.start.items()}))
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    @property
    def t(self) -> np.ndarray:
        """(n,) array  step times [s], from 0 to the duration."""
        return grid(self.duration, self.dt)


Manoeuvre = OpenLoop | ClosedLoop


def _time_problems(t: np.ndarray) -> list[str]:
    if t.ndim != 1 or t.size < 2:
        return [f"time has shape {t.shape}; at least two rows are needed"]
    if not np.isfinite(t).all():
        return [f"time is not finite at row {int(np.argmin(np.isfinite(t)))}"]
    late = np.flatnonzero(np.diff(t) <= 0)
    if late.size:
        k = int(late[0])
        return [f"time does not increase at row {k + 1} ({t[k + 1]:g} s after {t[k]:g} s)"]
    return []


MAX_ROWS = 2_000_000


def grid(duration: float, dt: float) -> np.ndarray:
    """(n,) array of step times 0, dt, ... up to the duration [s]; k*dt, so that no error accumulates."""
    if not (np.isfinite(dt) and dt > 0 and np.isfinite(duration) and duration >= dt):
        raise ManoeuvreError(
            f"a run of {duration:g} s in steps of {dt:g} s has no rows; "
            "give a positive step and a longer duration"
        )
    if duration / dt > MAX_ROWS:
        raise ManoeuvreError(
            f"a run of {duration:g} s in steps of {dt:g} s has more than {MAX_ROWS} rows; use a longer step"
        )
    return np.arange(int(round(duration / dt, 9)) + 1) * dt


def first_orders(manoeuvre: Manoeuvre) -> dict[str, float]:
    """What is ordered as the run begins: channel -> number [rad, rpm]."""
    if isinstance(manoeuvre, OpenLoop):
        return {channel: float(values[0]) for channel, values in manoeuvre.commands.items()}
    return dict(manoeuvre.start)


def held(manoeuvre: OpenLoop, t: np.ndarray) -> dict[str, np.ndarray]:
    """Commands at any times t [s] under zero-order hold; the first and last rows extend outwards."""
    row = np.clip(np.searchsorted(manoeuvre.t, np.asarray(t, float), side="right") - 1, 0, None)
    return {channel: values[row] for channel, values in manoeuvre.commands.items()}


def on_grid(manoeuvre: OpenLoop, dt: float) -> OpenLoop:
    """The same commands on a regular grid that starts at the first row.

    A change between two grid points takes effect at the next one, at most dt [s] late.
    """
    t = manoeuvre.t[0] + grid(manoeuvre.duration, dt)
    # a grid time a rounding error before its row must still see that row
    return replace(manoeuvre, t=t, commands=held(manoeuvre, t + 1e-9 * dt))


def mirrored(manoeuvre: Manoeuvre) -> Manoeuvre:
    """The manoeuvre seen in a mirror: port and starboard exchanged, planes and rpm as they were."""
    if isinstance(manoeuvre, OpenLoop):
        flipped = {c: -v if c == "delta_r_cmd" else v for c, v in manoeuvre.commands.items()}
        return replace(manoeuvre, commands=flipped, parameters={**manoeuvre.parameters, "mirrored": True})
    if not hasattr(manoeuvre.controller, "mirrored"):
        raise ManoeuvreError(
            f"manoeuvre {manoeuvre.name!r}: its law cannot be mirrored; give it a mirrored() method"
        )
    start = {c: -v if c == "delta_r_cmd" else v for c, v in manoeuvre.start.items()}
    return replace(
        manoeuvre,
        start=start,
        controller=manoeuvre.controller.mirrored(),
        parameters={**manoeuvre.parameters, "mirrored": True},
    )


def describe(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """Plain values for a report: name, kind, duration and step [s], channels, parameters, ranges."""
    closed = isinstance(manoeuvre, ClosedLoop)
    parameters = dict(manoeuvre.parameters)
    law = manoeuvre.controller if isinstance(manoeuvre, ClosedLoop) else None
    if law is not None and is_dataclass(law):
        values = {f.name: getattr(law, f.name) for f in fields(law)}
        plain = {k: v for k, v in values.items() if isinstance(v, (int, float, str, bool, tuple))}
        parameters = plain | parameters
    out: dict[str, Any] = {
        "name": manoeuvre.name,
        "kind": "closed loop" if closed else "open loop",
        "duration": float(manoeuvre.duration),
        "parameters": parameters,
    }
    if isinstance(manoeuvre, ClosedLoop):
        out |= {
            "dt": float(manoeuvre.dt),
            "channels": sorted(manoeuvre.start),
            "start": dict(manoeuvre.start),
        }
    else:
        out |= {
            "dt": float(np.median(np.diff(manoeuvre.t))),
            "channels": sorted(manoeuvre.commands),
            "ranges": {c: (float(v.min()), float(v.max())) for c, v in manoeuvre.commands.items()},
        }
    return out
