"""A map in the making: channels decided so far, questions, remarks and the recordings they are checked on.

Does not: decide anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.trials.importing.converting import Recording, resolve
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.rudder_clock import Shift


@dataclass
class Draft:
    """A map in the making; `weight` 0 is the most important question.

    by_part : series read by a part of their name -> their last word, where it stands for a unit not known
    resting : roles left out because they never change -> their value, in the log's unit
    wrong_speeds : u and v contradict a track and a heading that agree, so that they tell nothing more
    body_named : body axes that the names of velocities tell, as `dvl_port` does; None where they tell none
    unused : series that no channel is read from
    late : shifts of the rudder's clock at which the turns follow it, best first, where they do not as it is
    """

    map: LogMap
    recordings: list[Recording]
    stated: dict[str, bool] = field(default_factory=dict)
    axes_stated: bool = False
    body_stated: bool = False
    asked: list[tuple[int, str]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    handed: bool = False
    mirror: bool = False
    by_part: dict[str, str | None] = field(default_factory=dict)
    resting: dict[str, float] = field(default_factory=dict)
    wrong_speeds: bool = False
    body_named: str | None = None
    unused: list[str] = field(default_factory=list)
    late: list[Shift] = field(default_factory=list)

    @property
    def told(self) -> LogMap:
        """The map without speeds that are wrong, for what is told by the other series."""
        wrong = {"u", "v"} if self.wrong_speeds else set()
        return replace(self.map, channels={k: c for k, c in self.map.channels.items() if k not in wrong})

    def ask(self, weight: int, text: str) -> None:
        if text not in [t for _, t in self.asked]:
            self.asked.append((weight, text))

    def remark(self, text: str) -> None:
        if text not in self.remarks:
            self.remarks.append(text)

    def has(self, *roles: str) -> bool:
        return set(roles) <= set(self.map.channels)

    def change(self, role: str, **what: object) -> LogMap:
        channels = dict(self.map.channels)
        channels[role] = replace(channels[role], **what)  # type: ignore[arg-type]
        return replace(self.map, channels=channels)

    def rename(self, old: str, new: str) -> LogMap:
        channels = {new if k == old else k: v for k, v in self.map.channels.items()}
        return replace(self.map, channels=channels)

    def column(self, role: str) -> str:
        return repr(resolve(self.map, role)[1])

    @property
    def headed(self) -> bool:
        """Whether a heading, a yaw or a quaternion is read."""
        return self.has("psi") or self.has("heading") or self.has("qw")

    def raw(self, role: str, recording: Recording | None = None) -> np.ndarray:
        label, name = resolve(self.map, role)
        values = [
            r.logs[label].by_name[name].values
            for r in ([recording] if recording else self.recordings)
            if label in r.logs and name in r.logs[label].by_name
        ]
        joined = np.concatenate(values) if values else np.empty(0)
        return joined[np.isfinite(joined)]

    @property
    def liveliest(self) -> Recording:
        """The recording in which the heading changes most."""

        def span(recording: Recording) -> float:
            for role in ("psi", "heading", "r", "qz", "y", "latitude"):
                if role in self.map.channels:
                    raw = self.raw(role, recording)
                    if raw.size:
                        if role in ("psi", "heading"):  # noise about north is no turn
                            raw = np.unwrap(raw, period=360.0 if np.abs(raw).max() > 7.0 else 2 * math.pi)
                        return float(np.ptp(raw)) * math.log(raw.size + 1)
            return 0.0

        return max(self.recordings, key=span)
