"""A thruster that keeps its direction: curve of thrust over revolutions and inflow.

Takes: nothing. Gives the declaration and the formulas of its force. Does not: know its shaft or its torque.

Thrust along the direction, ahead positive, m being the revolutions beyond the dead band and within the limit:
    T = (T_nn m |m| + T_un a m) (reverse where m < 0),    a = inflow along the direction
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayesid.model.actuators.declare import (
    PLACE,
    UNLIMITED,
    Actuator,
    Part,
    Shape,
    Vector,
    arms,
    inflow,
    own,
    place,
    place_names,
)
from bayesid.model.file_keys import FileKey

CURVE: dict[str, FileKey] = {
    "T_nn": FileKey("number", "N/rpm^2, thrust at rest over n |n|", required=True, low=-1e9, high=1e9),
    "T_un": FileKey("number", "N s/(m rpm), change with the inflow", default=0.0, low=-1e9, high=1e9),
    "reverse": FileKey("number", "thrust astern over thrust ahead", default=1.0, low=0.0, high=10.0),
    "dead_band": FileKey("number", "rpm, below which there is no thrust", default=0.0, low=0.0, high=1e6),
    "limit": FileKey("number", "rpm, largest revolutions", default=UNLIMITED, low=0.0, high=UNLIMITED),
}
# a property of the shaft, which reading turns into the effect thruster_<name>_lag
SHAFT: dict[str, FileKey] = {
    "lag": FileKey("number", "s, first-order lag of the revolutions", default=0.0, low=0.0, high=1e3),
}


@dataclass(frozen=True)
class Thruster(Actuator):
    """One thruster; it reads `n_<name>_cmd` or `n_<name>` [rpm]."""

    T_nn: float
    T_un: float = 0.0
    reverse: float = 1.0
    dead_band: float = 0.0
    limit: float = UNLIMITED

    kind = "thruster"
    meaning = "A thruster that keeps its direction."
    keys: ClassVar[Mapping[str, FileKey]] = {**PLACE, **CURVE, **SHAFT}

    @property
    def signal(self) -> str:
        return f"n_{self.name}"

    @classmethod
    def signals_of(cls, shape: Shape) -> tuple[str, ...]:
        return (f"n_{shape.name}",)

    @classmethod
    def constants_of(cls, shape: Shape) -> tuple[str, ...]:
        return (*(own(shape, key) for key in CURVE), *place_names(shape))

    @classmethod
    def parts(cls, shape: Shape) -> tuple[Part, ...]:
        at, along = place(shape)
        return ((thrust(shape, at, along), arms(at, along)),)


def thrust(shape: Shape, at: Vector, along: Vector) -> str:
    """Formula of the thrust [N] along a direction."""
    n, back = f"n_{shape.name}", own(shape, "reverse")
    m = f"(sgn({n})*min(max(abs({n}) - {own(shape, 'dead_band')}, 0), {own(shape, 'limit')}))"
    curve = f"({own(shape, 'T_nn')}*{m}*abs({m}) + {own(shape, 'T_un')}*{inflow(at, along)}*{m})"
    return f"{curve}*(1 + ({back} - 1)*step(-{n}))"
