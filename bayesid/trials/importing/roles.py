"""What a series of a raw log can be: bayesid's own channels, and what they can be computed from.

One table, `ROLES`. A role that bayesid has as a channel is read in the axes the map states (`world`, `body`);
`heading`, `north`, `latitude` and their like mean the same in all axes.
"""

from __future__ import annotations

from dataclasses import dataclass

from bayesid.model.channels import CHANNELS

WORLDS = ("ned", "enu", "nwu")
BODIES = ("frd", "flu")
WORLD_WORDS = {
    "ned": "x north, y east, z down; yaw clockwise from x",
    "enu": "x east, y north, z up; yaw counter-clockwise from x",
    "nwu": "x ahead or north, y to port, z up; yaw counter-clockwise from x",
}
BODY_WORDS = {"frd": "forward, starboard, down", "flu": "forward, port, up"}


@dataclass(frozen=True)
class Role:
    """unit: inside unit, as of `bayesid.model.units`, "" for a number without one; bare: unit where none is
    stated."""

    unit: str
    meaning: str
    bare: str = ""


ROLES: dict[str, Role] = {
    **{row.name: Role(row.unit, row.meaning, row.unit) for row in CHANNELS if row.name != "t"},
    "latitude": Role("rad", "latitude, WGS84", "deg"),
    "longitude": Role("rad", "longitude, WGS84", "deg"),
    "height": Role("m", "height, positive up", "m"),
    "depth": Role("m", "depth, positive down", "m"),
    "north": Role("m", "position, north", "m"),
    "east": Role("m", "position, east", "m"),
    "heading": Role("rad", "heading, clockwise from north", "deg"),
    "qw": Role("", "quaternion of body axes in world axes, scalar part"),
    "qx": Role("", "quaternion of body axes in world axes, x part"),
    "qy": Role("", "quaternion of body axes in world axes, y part"),
    "qz": Role("", "quaternion of body axes in world axes, z part"),
    "v_north": Role("m/s", "velocity over ground, north", "m/s"),
    "v_east": Role("m/s", "velocity over ground, east", "m/s"),
    "v_down": Role("m/s", "velocity over ground, down", "m/s"),
    "speed_over_ground": Role("m/s", "speed over ground", "m/s"),
    "course": Role("rad", "course over ground, clockwise from north", "deg"),
    "speed_through_water": Role("m/s", "speed through the water, taken as u_water", "m/s"),
}
QUATERNION = ("qw", "qx", "qy", "qz")
