"""From the axes of a log to north-east-down and forward-starboard-down; quaternions to Euler angles.

Does not: choose axes; the map states them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.trials.trial import Floats

_FLIPPED = ("v", "w", "q", "r", "v_water", "w_water", "theta")


def euler(qw: Floats, qx: Floats, qy: Floats, qz: Floats) -> tuple[Floats, Floats, Floats]:
    """(roll, pitch, yaw) [rad], turned yaw first, of quaternions of body in world axes; any length but
    zero."""
    size = np.sqrt(qw**2 + qx**2 + qy**2 + qz**2)
    w, x, y, z = (q / np.where(size > 1e-9, size, np.nan) for q in (qw, qx, qy, qz))
    return (
        np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def heading_of(yaw: Floats, world: str) -> Floats:
    """Heading clockwise from north (or from x, `nwu`)."""
    return {"ned": yaw, "enu": 0.5 * np.pi - yaw, "nwu": -yaw}[world]


def position_of(series: Mapping[str, Floats], world: str) -> dict[str, Floats]:
    """x, y, z north-east-down of what there is of x, y, z in the axes of the log."""
    out: dict[str, Floats] = {}
    north, east = {"ned": ("x", "y"), "enu": ("y", "x"), "nwu": ("x", "y")}[world]
    if north in series:
        out["x"] = series[north]
    if east in series:
        out["y"] = -series[east] if world == "nwu" else series[east]
    if "z" in series:
        out["z"] = series["z"] if world == "ned" else -series["z"]
    return out


def body_of(name: str, values: Floats, body: str) -> Floats:
    """A velocity, rate or pitch of body axes, forward-starboard-down."""
    return -values if body == "flu" and name in _FLIPPED else values
