"""Readings of some channels of one run that are left out between two times: `leave_out` under [corrections].

Takes the entry of trial.toml, or values. Gives a `LeftOut` that empties cells and writes itself.
Does not: find out what to leave out (`bayesid.trials.mistakes`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.model.channels import channel, is_channel, nearest_hint
from bayesid.trials.trial import Floats

KEYS = ("run", "channels", "from", "to")
DIGITS = 12  # of a time in trial.toml: a log may count seconds from 1970 on


@dataclass(frozen=True)
class LeftOut:
    """One stretch.

    Attributes
    ----------
    run : name
    channels : whose readings are left out
    first, last : times in the log between which they are, these included [s]
    """

    run: str
    channels: tuple[str, ...]
    first: float
    last: float

    def of(self, t: Floats) -> np.ndarray:
        """Where in the times of the run."""
        inside: np.ndarray = (t >= self.first) & (t <= self.last)
        return inside

    def emptied(self, t: Floats, series: Mapping[str, Floats]) -> dict[str, Floats]:
        """Columns with empty cells there."""
        inside = self.of(t)
        return {k: np.where(inside, np.nan, v) if k in self.channels else v for k, v in series.items()}

    def without_effect(self, logged: Mapping[str, Mapping[str, tuple[Floats, Floats]]]) -> str:
        """Why it changes nothing, in words; empty where it does.

        Parameters
        ----------
        logged : run -> channel -> times and readings
        """
        if self.run not in logged:
            return f"there is no run {self.run}; there are {', '.join(logged)}"
        there = {k: v for k, v in logged[self.run].items() if k in self.channels}
        if not there:
            names = ", ".join(sorted(logged[self.run])) or "no channel"
            return f"{self.run} does not log {', '.join(self.channels)}; it holds {names}"
        if not any(np.isfinite(values[self.of(t)]).any() for t, values in there.values()):
            return f"{self.run} has no reading of {', '.join(there)} from {self.first:g} to {self.last:g} s"
        return ""

    def toml(self) -> str:
        """The entry as an inline table."""
        names = ", ".join(f'"{name}"' for name in self.channels)
        times = f"from = {self.first:.{DIGITS}g}, to = {self.last:.{DIGITS}g}"
        return f'{{ run = "{self.run}", channels = [{names}], {times} }}'


def schema() -> dict[str, Any]:
    """Of one entry, for an editor."""
    texts = {"type": "array", "items": {"type": "string"}, "minItems": 1}
    kinds = {
        "run": {"type": "string"},
        "channels": texts,
        "from": {"type": "number"},
        "to": {"type": "number"},
    }
    return {"type": "object", "properties": kinds, "required": list(KEYS), "additionalProperties": False}


def read_left_out(given: Any, place: str, problems: list[str]) -> tuple[LeftOut, ...] | None:
    """The list of entries, checked; what is wrong goes to `problems`."""
    if not isinstance(given, list) or not all(isinstance(one, dict) for one in given):
        example = LeftOut("r2", ("u", "v"), 30.0, 65.0).toml()
        problems.append(f"{place} must be a list of tables, e.g. [{example}]")
        return None
    found = [_read(one, f"{place}, entry {k}", problems) for k, one in enumerate(given, 1)]
    good = tuple(one for one in found if one is not None)
    return good if len(good) == len(found) else None


def _read(given: dict[str, Any], place: str, problems: list[str]) -> LeftOut | None:
    before = len(problems)
    problems += [f"{place}: {k!r} is not known; one of {', '.join(KEYS)}" for k in given if k not in KEYS]
    problems += [f"{place}: {k} is needed" for k in KEYS if k not in given]
    if len(problems) > before:
        return None
    run, names, times = given["run"], given["channels"], (given["from"], given["to"])
    if not isinstance(run, str):
        problems.append(f"{place}: run must be the name of a run")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        problems.append(f"{place}: channels must be a list of names")
    else:
        problems += [
            f"{place}: {name[:40]!r} is no channel{nearest_hint(name)}"
            for name in names
            if not is_channel(name) or name == "t"
        ]
        problems += [
            f"{place}: {name} is no reading of the motion; a simulation needs it throughout the run"
            for name in names
            if is_channel(name) and channel(name).kind not in ("pose", "velocity", "time")
        ]
    if not all(isinstance(s, int | float) and not isinstance(s, bool) and math.isfinite(s) for s in times):
        problems.append(f"{place}: from and to must be numbers, seconds of the log")
    elif times[0] > times[1]:
        problems.append(f"{place}: from = {times[0]:g} is after to = {times[1]:g}")
    return None if len(problems) > before else LeftOut(run, tuple(names), float(times[0]), float(times[1]))
