"""One event and the logs without it.

Takes runs and logs. Gives runs without the readings an event spoiled, or with an actuator held where it
stuck, and logs that let go of the state it disturbed. Does not find events (see `event_search`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.run_data import RunData
from bayesid.trials import Run


@dataclass(frozen=True)
class Event:
    """Something that happened once.

    Attributes
    ----------
    run, start, end : where and when [s of the run's own time]
    channel : sensor channel, or the input or force that shows it best, as in `localisation`
    kind : "sensor" (its readings are wrong for a while), "jump" (a position that shifts and stays), "motion"
        (the vehicle moves as no model here explains) or "stuck" (it does but for an actuator that stays where
        it is, whatever is ordered: its readings count, its order does not)
    misfit : of its worst window over the median of all windows; None of a brief event and of a stuck actuator
    evidence : gain in log evidence of a free signal there over none, of a brief event less the logarithm of
        how many were tried, of a stuck actuator that of a refit; 0 for a sensor's fault
    brief : whether it is not gross, and was found by this gain beside an explanation (`brief_events`)
    value, sd : of a brief event, mean of that signal and its standard deviation, SI (revolutions in rpm),
        where it is a single one and not near zero; where an actuator stuck, its deflection or revolutions
    stuck : actuator that stays where it is, whatever is ordered, which explains a brief event as well
    opens : whether a brief event begins with its run
    """

    run: str
    start: float
    end: float
    channel: str
    kind: Literal["sensor", "jump", "motion", "stuck"]
    misfit: float | None
    evidence: float = 0.0
    brief: bool = False
    value: float | None = None
    sd: float | None = None
    stuck: str | None = None
    opens: bool = False

    @property
    def unexplained(self) -> bool:
        """Whether the vehicle moves as no effect here explains, not only its readings."""
        return self.kind in ("motion", "stuck")


def without_readings(run: Run, readings: Sequence[tuple[str, float, str]]) -> Run:
    """The run without single readings (run, time, channel)."""
    data = {c: v.copy() for c, v in run.data.items()}
    for name, time, channel in readings:
        if name == run.name and channel in data:
            data[channel][np.abs(run.t - time) < 1e-9] = np.nan
    return replace(run, data=data)


def blanked(run: Run, events: Sequence[Event]) -> Run:
    """The run without the readings of its events, and with the orders of its actuators as they stuck."""
    data = {c: v.copy() for c, v in run.data.items()}
    commands = {c: v.copy() for c, v in run.commands.items()}
    for event in events:
        if event.run != run.name:
            continue
        if event.kind == "stuck":
            commands[f"{event.stuck}_cmd"][(run.t >= event.start) & (run.t < event.end)] = event.value
            continue
        inside = (run.t >= event.start) & (run.t <= event.end)
        for c in data if event.kind == "motion" else event.channel.split(","):
            data[c][inside] = np.nan
    return replace(run, data=data, commands=commands)


def released(model: Model, log: RunData, events: Sequence[Event]) -> RunData:
    """The log whose state may be another one after each event that moved the vehicle or its position."""
    states = model.kernel.full.states
    jumps = np.zeros((log.n - 1, len(states)))
    for event in events:
        if event.run != log.name or event.kind in ("sensor", "stuck"):
            continue
        # the last sample without readings: what follows starts from a state of its own
        at = int(np.searchsorted(log.plan.t, event.end, side="right")) - 1
        if not 0 <= at < log.n - 1:
            continue
        for j, name in enumerate(states):
            if event.kind == "motion" or name in ("x", "y"):
                jumps[at, j] = max(log.initial_sd[j], _step(log, j, at))
    return replace(log, jumps=jumps) if jumps.any() else log


def _step(log: RunData, state: int, at: int) -> float:
    """How far the readings' own path moves around a sample: a jump may exceed what a first state is off."""
    near = log.path[max(0, at - 2) : at + 4, state]
    return float(np.ptp(near)) if near.size else 0.0
