"""Actuators of a vehicle file beside rudder, planes and propeller: a module per kind.

Adding a kind means adding a module with a subclass of `Actuator` and naming it here.
"""

from __future__ import annotations

from bayesid.model.actuators.azimuth import Azimuth
from bayesid.model.actuators.declare import NAMES, UNLIMITED, Actuator, Part, Shape
from bayesid.model.actuators.fin import Fin
from bayesid.model.actuators.thruster import Thruster
from bayesid.model.actuators.waterjet import Waterjet

__all__ = [
    "KINDS", "NAMES", "UNLIMITED", "Actuator", "Azimuth", "Fin", "Part", "Pusher", "Shape", "Thruster",
    "Waterjet", "kind_of",
]  # fmt: skip

#: word of `kind` -> class; a table without `kind` is a thruster
KINDS: dict[str, type[Actuator]] = {one.kind: one for one in (Thruster, Azimuth, Waterjet, Fin)}
#: those that have a shaft of their own and push the vehicle
Pusher = Thruster | Waterjet


def kind_of(shape: Shape) -> type[Actuator]:
    return KINDS[shape.kind]
