"""What an actuator of a vehicle file is: its columns, its numbers and the forces they make.

Takes: nothing. Gives the base of every kind and the formulas they share. Does not: know a kind by name.

A kernel is printed from the `Shape` alone, so the formulas of a kind read the shape and never a number;
the numbers go into the model's parameter vector under the names of `constants_of`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

from bayesid.model.channels import ACTUATOR_NAMES
from bayesid.model.file_keys import FileKey

NAMES = ACTUATOR_NAMES
UNLIMITED = 1e9
_FASTEST = 1e6  # rad/s and 1/s, of what has no limit of its rate

Vector = tuple[str, str, str]
#: formula of a force [N] and, by axis, of what it is multiplied by
Part = tuple[str, dict[str, str]]

PLACE: dict[str, FileKey] = {
    "at": FileKey("numbers", "m, where the force acts, body axes", length=3, required=True),
    "direction": FileKey("numbers", "of positive force, body axes; any length", length=3, required=True),
}


@dataclass(frozen=True)
class Shape:
    """What a kernel is printed from: kind, name, and details that change the equations."""

    kind: str
    name: str
    details: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        return "_".join((self.kind, self.name, *self.details))


@dataclass(frozen=True)
class Actuator:
    """One actuator of [actuators.NAME]; fields are the keys of the file, `direction` of length 1.

    A kind adds its numbers, `keys` and the functions of a `Shape` below.
    """

    name: str
    at: tuple[float, float, float]
    direction: tuple[float, float, float]

    kind: ClassVar[str]
    meaning: ClassVar[str]
    keys: ClassVar[Mapping[str, FileKey]]

    @property
    def shape(self) -> Shape:
        return Shape(self.kind, self.name)

    @property
    def constants(self) -> dict[str, float]:
        """Numbers under their names in a model's parameter vector [SI]."""
        return place_constants(self)

    @property
    def signals(self) -> tuple[str, ...]:
        return self.signals_of(self.shape)

    @property
    def problems(self) -> tuple[str, ...]:
        """What is wrong with the numbers together, a sentence each."""
        return ()

    @classmethod
    def signals_of(cls, shape: Shape) -> tuple[str, ...]:
        """Inputs it reads: columns of the log, there with `_cmd` for an order."""
        raise NotImplementedError

    @classmethod
    def turned_by(cls, shape: Shape) -> tuple[str, ...]:
        """Of these inputs, those behind a servo with limit, rate limit and lag."""
        return ()

    @classmethod
    def constants_of(cls, shape: Shape) -> tuple[str, ...]:
        """Names of its numbers in the parameter vector."""
        raise NotImplementedError

    @classmethod
    def parts(cls, shape: Shape) -> tuple[Part, ...]:
        """Its forces; formulas read the constants, the motion through the water and the inputs."""
        raise NotImplementedError


def own(shape: Shape, key: str) -> str:
    """Name of a number in the parameter vector."""
    return f"{shape.kind}_{shape.name}_{key}"


def place_constants(actuator: Actuator) -> dict[str, float]:
    """Numbers of the fields and of place and direction, by their names in the parameter vector."""
    values: dict[str, float] = {}
    for f in fields(actuator):
        value = getattr(actuator, f.name)
        if isinstance(value, float) and own(actuator.shape, f.name) in actuator.constants_of(actuator.shape):
            values[own(actuator.shape, f.name)] = value
    for key, names in (("at", ("x", "y", "z")), ("direction", ("dx", "dy", "dz"))):
        parts = zip(names, getattr(actuator, key), strict=True)
        values |= {own(actuator.shape, part): float(value) for part, value in parts}
    return values


def place_names(shape: Shape) -> tuple[str, ...]:
    return tuple(own(shape, key) for key in ("x", "y", "z", "dx", "dy", "dz"))


def place(shape: Shape) -> tuple[Vector, Vector]:
    """Symbols of place and direction."""
    x, y, z, dx, dy, dz = place_names(shape)
    return (x, y, z), (dx, dy, dz)


def arms(at: Vector, along: Vector) -> dict[str, str]:
    """Force and moment about the origin, by axis, over a force along a direction."""
    (x, y, z), (dx, dy, dz) = at, along
    return {
        "X": dx, "Y": dy, "Z": dz,
        "K": f"({y}*{dz} - {z}*{dy})", "M": f"({z}*{dx} - {x}*{dz})", "N": f"({x}*{dy} - {y}*{dx})",
    }  # fmt: skip


def inflow(at: Vector, along: Vector) -> str:
    """Speed through the water [m/s] of a place along a direction."""
    (x, y, z), (dx, dy, dz) = at, along
    return (
        f"({dx}*(u + q*{z} - r*{y}) + {dy}*(v + r*{x} - p*{z})"
        f" + {dz}*(w + p*{y} - q*{x}))"
    )  # fmt: skip


def turned(along: Vector, angle: str) -> Vector:
    """A direction turned about the vertical axis of the body, positive to starboard."""
    dx, dy, dz = along
    return (f"({dx}*cos({angle}) - {dy}*sin({angle}))", f"({dx}*sin({angle}) + {dy}*cos({angle}))", dz)


def servo_keys(stem: str, of: str, without: str = "") -> dict[str, FileKey]:
    """Largest angle, rate and lag of what a servo turns, as keys of the file.

    Parameters
    ----------
    stem : what the keys begin with
    of : what is turned
    without : of the angle, what holds where it is not given
    """
    return {
        f"{stem}max_deg": FileKey("number", f"deg, largest angle of {of}{without}", default=UNLIMITED,
                                  low=0.0, high=UNLIMITED),
        **travel_keys(f"{stem}rate_deg_s", f"{stem}lag", of, f"deg/s, of {of}"),
    }  # fmt: skip


def travel_keys(rate: str, lag: str, of: str, meaning: str) -> dict[str, FileKey]:
    """Rate and lag of a servo under these names; `meaning` of the rate, with its unit."""
    return {
        rate: FileKey("number", meaning, default=UNLIMITED, low=1e-6, high=UNLIMITED),
        lag: FileKey("number", f"s, first-order lag of {of}", default=0.0, low=0.0, high=1e3),
    }


def servo_names(signal: str) -> tuple[str, str, str]:
    return (f"inverse_rate_{signal}", f"servo_lag_{signal}", f"limit_{signal}")


def servo(
    signal: str, rate: float, lag: float, limit: float, unit: float = math.pi / 180
) -> dict[str, float]:
    """Numbers of a servo; rate and limit as in the file, in `unit`s of what the equations read."""
    limited = 1.0 / min(rate * unit, _FASTEST), lag, min(limit * unit, UNLIMITED)
    return dict(zip(servo_names(signal), limited, strict=True))
