"""Which quantities a log may hold, their unit inside the program and what they mean.

One table, `CHANNELS`, after the trial bundle format; `channel(name)` looks one up.
Holds names and units only: reading logs is `bayesid.trials`, converting units is `bayesid.model.units`.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass

from bayesid.model.notation import POSE, VELOCITY


@dataclass(frozen=True)
class Channel:
    """One quantity a log may hold.

    kind : "time", "pose", "velocity", "command", "actuator", "propulsion" or "environment"
    circular : True for an angle that may be logged wrapped and is unwrapped on reading; an order is not, for
        which way it goes depends on the vehicle
    through_water : True for velocities measured against the water instead of the ground
    vertical : True if logging it makes the trial a 6-DOF one
    rudder : True for angles whose sign follows `rudder_positive`
    """

    name: str
    unit: str
    kind: str
    meaning: str
    circular: bool = False
    through_water: bool = False
    vertical: bool = False
    rudder: bool = False

    @property
    def base(self) -> str:
        """The state this channel reads: `u` for `u_water`, else its own name."""
        return self.name.removesuffix("_water") if self.through_water else self.name

    @property
    def shown(self) -> tuple[float, str]:
        """Factor from the unit inside, and the unit in tables, figures and files: degrees for angles."""
        in_degrees = {"rad": "deg", "rad/s": "deg/s"}
        return (180.0 / math.pi, in_degrees[self.unit]) if self.unit in in_degrees else (1.0, self.unit)


_VERTICAL = frozenset({"z", "phi", "theta", "w", "p", "q"})
_POSE_UNIT = {"x": "m", "y": "m", "z": "m"}
_MEANING = {
    "x": "position, first horizontal axis (north)",
    "y": "position, second horizontal axis (east)",
    "z": "depth, positive down",
    "phi": "roll",
    "theta": "pitch",
    "psi": "heading",
    "u": "surge velocity",
    "v": "sway velocity",
    "w": "heave velocity",
    "p": "roll rate",
    "q": "pitch rate",
    "r": "yaw rate",
}


def _measured() -> tuple[Channel, ...]:
    rows = []
    for name in POSE:
        angle = name not in _POSE_UNIT
        unit = _POSE_UNIT.get(name, "rad")
        rows.append(Channel(name, unit, "pose", _MEANING[name], circular=angle, vertical=name in _VERTICAL))
    for name in VELOCITY:
        unit = "m/s" if name in "uvw" else "rad/s"
        ground = ", body axes, over ground" if name in "uvw" else ", body axes"
        rows.append(Channel(name, unit, "velocity", _MEANING[name] + ground, vertical=name in _VERTICAL))
    for name in "uvw":
        meaning = _MEANING[name] + ", body axes, through the water"
        rows.append(
            Channel(
                f"{name}_water", "m/s", "velocity", meaning, through_water=True, vertical=name in _VERTICAL
            )
        )
    return tuple(rows)


#: names an actuator of a vehicle file may have
ACTUATOR_NAMES = ("port", "stbd", "bow", "stern", *map(str, range(1, 9)))
#: what a named actuator may be ordered beside its revolutions: first word of its column -> unit, meaning
TURNED = {
    "azimuth": ("rad", "direction of thruster", "from that of its file to starboard"),
    "nozzle": ("rad", "nozzle angle of waterjet", "to starboard"),
    "bucket": ("-", "bucket of waterjet", "1 up and -1 down"),
    "delta": ("rad", "angle of fin", "along the direction of its file"),
}


def _inputs() -> tuple[Channel, ...]:
    rows = []
    fins = (("delta_r", "rudder"), ("delta_s", "stern plane"), ("delta_b", "bow plane"))
    for suffix, kind, word in (("_cmd", "command", "commanded"), ("", "actuator", "measured")):
        for name, fin in fins:
            rows.append(
                Channel(
                    name + suffix,
                    "rad",
                    kind,
                    f"{word} {fin} angle",
                    vertical=name != "delta_r",
                    rudder=name == "delta_r",
                )
            )
        rows.append(Channel("n" + suffix, "rpm", kind, f"{word} propeller speed"))
        for name in ACTUATOR_NAMES:
            rows.append(Channel(f"n_{name}{suffix}", "rpm", kind, f"{word} speed of thruster {name}"))
        for first, (unit, meaning, sense) in TURNED.items():
            for name in ACTUATOR_NAMES:
                text = f"{word} {meaning} {name}, {sense}"
                rows.append(Channel(f"{first}_{name}{suffix}", unit, kind, text, circular=first == "azimuth"))
    return tuple(rows)


CHANNELS: tuple[Channel, ...] = (
    Channel("t", "s", "time", "time from any zero"),
    *_measured(),
    *_inputs(),
    Channel("thrust", "N", "propulsion", "measured propeller thrust"),
    Channel("torque", "N*m", "propulsion", "measured propeller torque"),
    Channel("wind_speed", "m/s", "environment", "true wind speed"),
    Channel("wind_from", "rad", "environment", "direction the true wind comes from", circular=True),
)
_BY_NAME = {row.name: row for row in CHANNELS}

MEASURED = tuple(row.name for row in CHANNELS if row.kind in ("pose", "velocity"))
COMMANDS = tuple(row.name for row in CHANNELS if row.kind == "command")
ACTUATORS = tuple(row.name for row in CHANNELS if row.kind == "actuator")


def is_channel(name: str) -> bool:
    """True if `name` is a canonical channel."""
    return name in _BY_NAME


def channel(name: str) -> Channel:
    """The row of a canonical name; KeyError with the nearest name otherwise."""
    try:
        return _BY_NAME[name]
    except KeyError:
        raise KeyError(f"no channel {name!r}{nearest_hint(name)}") from None


def nearest_hint(name: str) -> str:
    """Text such as `; did you mean 'psi'?`, empty when nothing is near."""
    near = difflib.get_close_matches(name[:40].strip().lower(), _BY_NAME, n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else ""
