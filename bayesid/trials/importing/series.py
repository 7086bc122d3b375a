"""Messages one after the other become channels: stamps and numbers collected per topic, field by field.

Shared by the readers of bags and telemetry. Does not: know any message.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping

import numpy as np

from bayesid.trials.importing.raw import RawChannel, Request


class Collected:
    """Series in the making; stamps are integers of nanoseconds, so that none loses digits."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self._stamps: dict[str, array] = {}
        self._values: dict[str, dict[str, array]] = {}
        self._before: dict[str, int] = {}
        self.kinds: dict[str, str] = {}  # topic -> type of its messages

    def add(self, topic: str, stamp_ns: int, fields: Mapping[str, float]) -> None:
        """One message; fields by their full names."""
        if self.request.step is not None:
            step, name = int(stamp_ns / (self.request.step * 1e9)), topic
            switched = any(
                key in self.request.switching and self._values[topic][key][-1] != value
                for key, value in fields.items()
                if topic in self._values and key in self._values[topic]
            )
            if self._before.get(name) == step and not switched:
                return
            self._before[name] = step
        stamps = self._stamps.setdefault(topic, array("q"))
        columns = self._values.setdefault(topic, {})
        for key, value in fields.items():
            if self.request.wants(key):
                if key not in columns:
                    columns[key] = array("d", [float("nan")] * len(stamps))
                columns[key].append(value)
        stamps.append(stamp_ns)
        for column in columns.values():
            if len(column) < len(stamps):
                column.append(float("nan"))

    def first(self) -> int:
        """The earliest stamp, ns; 0 if there is none."""
        return min((min(s) for s in self._stamps.values() if len(s)), default=0)

    def channels(
        self, zero_ns: int, roles: Mapping[str, str], units: Mapping[str, str], factors: Mapping[str, float]
    ) -> list[RawChannel]:
        """All series, times from `zero_ns`, sorted by time."""
        out = []
        for topic, columns in self._values.items():
            stamps = np.frombuffer(self._stamps[topic], dtype=np.int64)
            order = np.argsort(stamps, kind="stable")
            stride = 1
            if self.request.most is not None and stamps.size > self.request.most:
                stride = int(np.ceil(stamps.size / self.request.most))
            order = order[::stride]
            t = np.asarray((stamps[order] - zero_ns) * 1e-9, dtype=np.float64)
            for key, column in columns.items():
                values = np.asarray(
                    np.frombuffer(column, dtype=float)[order], dtype=np.float64
                ) * factors.get(key, 1.0)
                out.append(
                    RawChannel(
                        key,
                        t,
                        values,
                        units.get(key),
                        roles.get(key),
                        f"{topic} ({self.kinds.get(topic, 'message')}): {key}",
                    )
                )
        return out
