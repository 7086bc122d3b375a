"""A thruster that turns about the vertical: azimuth thruster, pod, outboard.

Takes: nothing. Gives the declaration and the formulas of its force. Does not: know the drag of a strut that
stands across the flow, which is the hull's.

The thrust of a thruster, with `direction` turned by the angle of a column of its own, positive to starboard
(at the stern that turns the bow to port, as a positive rudder does). Inflow is taken along the turned
direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayesid.model.actuators.declare import (
    UNLIMITED,
    Part,
    Shape,
    arms,
    place,
    servo,
    servo_keys,
    servo_names,
    turned,
)
from bayesid.model.actuators.thruster import Thruster, thrust
from bayesid.model.file_keys import FileKey

TURN = servo_keys("turn_", "the turn", " to either side; it turns right round without")


@dataclass(frozen=True)
class Azimuth(Thruster):
    """One azimuth thruster; it reads `n_<name>` [rpm] and `azimuth_<name>` [rad], measured or `_cmd`."""

    turn_max_deg: float = UNLIMITED
    turn_rate_deg_s: float = UNLIMITED
    turn_lag: float = 0.0

    kind = "azimuth"
    meaning = "A thruster that turns about the vertical: azimuth thruster, pod, outboard."
    keys: ClassVar[Mapping[str, FileKey]] = {**Thruster.keys, **TURN}

    @property
    def constants(self) -> dict[str, float]:
        (angle,) = self.turned_by(self.shape)
        return super().constants | servo(angle, self.turn_rate_deg_s, self.turn_lag, self.turn_max_deg)

    @classmethod
    def signals_of(cls, shape: Shape) -> tuple[str, ...]:
        return (*super().signals_of(shape), *cls.turned_by(shape))

    @classmethod
    def turned_by(cls, shape: Shape) -> tuple[str, ...]:
        return (f"azimuth_{shape.name}",)

    @classmethod
    def constants_of(cls, shape: Shape) -> tuple[str, ...]:
        (angle,) = cls.turned_by(shape)
        return (*super().constants_of(shape), *servo_names(angle))

    @classmethod
    def parts(cls, shape: Shape) -> tuple[Part, ...]:
        at, along = place(shape)
        across = turned(along, f"azimuth_{shape.name}")
        return ((thrust(shape, at, across), arms(at, across)),)
