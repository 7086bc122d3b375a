"""A rudder, plane or fin beside the usual three, by its name: one of two rudders, a fin of an X tail.

Takes: nothing. Gives the declaration and the formulas of its force. Does not: stall, or see the drift angle;
what a fin that stands amidships does is in the rows of the hull (Y_v, N_r, ...).

Force along the direction per angle d, as of the rows u^2 delta (Gertler and Hagen 1967), turned about astern,
and in the race of a shaft n before it (Yasukawa and Yoshimura 2015: speed in the race by the revolutions):
    F = (F_uu a |a| + F_nn n |n| ahead) d,  drag D_uu a |a| d^2,    a = speed of the place ahead
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayesid.model.actuators.declare import (
    NAMES,
    PLACE,
    UNLIMITED,
    Actuator,
    Part,
    Shape,
    arms,
    inflow,
    own,
    place,
    place_names,
    servo,
    servo_keys,
    servo_names,
)
from bayesid.model.file_keys import FileKey

_KEYS: dict[str, FileKey] = {
    "F_uu": FileKey("number", "N s^2/(m^2 rad), force over u|u| and angle", required=True, low=-1e12,
                    high=1e12),
    "F_nn": FileKey("number", "N/(rpm^2 rad), force over n^2 and angle in the race of `behind`", default=0.0,
                    low=-1e9, high=1e9),
    "behind": FileKey("text", "name of the thruster in whose race it stands, or propeller",
                      choices=(*NAMES, "propeller")),
    "D_uu": FileKey("number", "N s^2/(m^2 rad^2), drag over u|u| and angle squared", default=0.0, low=0.0,
                    high=1e12),
    **servo_keys("", "the fin"),
}  # fmt: skip
_NUMBERS = ("F_uu", "F_nn", "D_uu")


@dataclass(frozen=True)
class Fin(Actuator):
    """One fin; it reads `delta_<name>_cmd` or `delta_<name>` [rad]; a positive angle pushes along `direction`
    when moving ahead."""

    F_uu: float
    F_nn: float = 0.0
    behind: str | None = None
    D_uu: float = 0.0
    max_deg: float = UNLIMITED
    rate_deg_s: float = UNLIMITED
    lag: float = 0.0

    kind = "fin"
    meaning = "A rudder, plane or fin beside delta_r, delta_s and delta_b."
    keys: ClassVar[Mapping[str, FileKey]] = {**PLACE, **_KEYS}

    @property
    def shape(self) -> Shape:
        return Shape(self.kind, self.name, () if self.behind is None else (self.behind,))

    @property
    def constants(self) -> dict[str, float]:
        (angle,) = self.turned_by(self.shape)
        return super().constants | servo(angle, self.rate_deg_s, self.lag, self.max_deg)

    @property
    def problems(self) -> tuple[str, ...]:
        if self.F_nn and self.behind is None:
            return ("F_nn needs `behind`, the name of the thruster in whose race the fin stands",)
        return ()

    @classmethod
    def signals_of(cls, shape: Shape) -> tuple[str, ...]:
        return cls.turned_by(shape)

    @classmethod
    def turned_by(cls, shape: Shape) -> tuple[str, ...]:
        return (f"delta_{shape.name}",)

    @classmethod
    def constants_of(cls, shape: Shape) -> tuple[str, ...]:
        (angle,) = cls.turned_by(shape)
        return (*(own(shape, key) for key in _NUMBERS), *place_names(shape), *servo_names(angle))

    @classmethod
    def parts(cls, shape: Shape) -> tuple[Part, ...]:
        at, along = place(shape)
        ahead, (angle,) = ("1", "0", "0"), cls.turned_by(shape)
        a = inflow(at, ahead)
        race = ""
        for before in shape.details:
            n = "n" if before == "propeller" else f"n_{before}"
            race = f" + {own(shape, 'F_nn')}*max({n}, 0)*max({n}, 0)"
        return (
            (f"({own(shape, 'F_uu')}*{a}*abs({a}){race})*{angle}", arms(at, along)),
            (f"-{own(shape, 'D_uu')}*{a}*abs({a})*{angle}*{angle}", arms(at, ahead)),
        )
