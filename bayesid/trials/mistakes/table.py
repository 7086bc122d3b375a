"""The declared mistakes of a log: what it says, the correction that mends it, how common it is.

`MISTAKES` are those with one fixed correction; those with a size (clock, delay, north) are in `sized`.
A mistake planted into a log is the inverse of its correction. Does not judge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bayesid.trials.correction import EARTH_RADIUS, Correction
from bayesid.trials.handedness import Handedness

COMMON, USUAL, RARE = -4.0, -7.0, -10.0  # log odds before the data
NEVER_WEST = -6.0  # added to them for a latitude or longitude that counts the other way
# Neighbouring columns of one kind beside x and y.
EXCHANGED = (
    ("u", "v"), ("v", "w"), ("p", "q"), ("q", "r"), ("p", "r"), ("phi", "theta"), ("theta", "psi"),
    ("delta_r", "delta_s"),
)  # fmt: skip
# what forward-left-up has of the other sign than forward-right-down
BODY_AXES = ("v", "w", "q", "r", "theta", "v_water", "w_water")
_DEGREE = math.pi / 180.0
_KNOT, _FOOT, _RPM = 1852.0 / 3600.0, 0.3048, 2.0 * math.pi / 60.0


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes
    ----------
    name : short, in words: "sign of v"
    says : end of the sentence "in this log ..."
    correction : what mends it; None where there is no mend
    log_prior : log odds against a right log, before the data
    concerned : channels, where there is no correction to name them
    """

    name: str
    says: str
    correction: Correction | None
    log_prior: float = USUAL
    concerned: tuple[str, ...] = ()

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels concerned; "t" stands for the time."""
        return self.concerned if self.correction is None else tuple(sorted(self.correction.channels))

    @property
    def factors(self) -> dict[str, float]:
        """Channel -> factor on the logged numbers, for the density of the readings as logged."""
        if self.correction is None:
            return {}
        if self.correction.geographic:
            return {"x": EARTH_RADIUS * _DEGREE, "y": EARTH_RADIUS * _DEGREE}
        return dict(self.correction.scale)


def _signs() -> list[Mistake]:
    rows = []
    words = {
        "delta_r": "the rudder", "delta_s": "the stern plane", "delta_b": "the bow plane",
        "psi": "the heading",
        "r": "the yaw rate", "v": "the sway velocity", "w": "the heave velocity", "u": "the surge velocity",
        "x": "x", "y": "y", "z": "the depth", "theta": "the pitch angle", "q": "the pitch rate",
        "phi": "the roll angle", "p": "the roll rate",
    }  # fmt: skip
    for name, word in words.items():
        inputs = name.startswith("delta")
        scale = {name: -1.0, f"{name}_cmd": -1.0} if inputs else {name: -1.0}
        if name in "uvw":
            scale[f"{name}_water"] = -1.0
        prior = COMMON if name in ("delta_r", "z") else USUAL if name not in ("x", "u") else RARE
        rows.append(
            Mistake(f"sign of {name}", f"{word} has the opposite sign", Correction(scale=scale), prior)
        )
    return rows


def _units() -> list[Mistake]:
    """Channels together whose header names one unit while the numbers have another."""
    rows = []

    def mistaken(channels: tuple[str, ...], true: str, read: str, factor: float, prior: float) -> None:
        name = ", ".join(k for k in channels if not k.endswith(("_cmd", "_water")))
        verb = "are" if "," in name else "is"
        rows.append(
            Mistake(
                f"{name}: {true} read as {read}",
                f"{name} {verb} in {true} and read as {read}",
                Correction(scale=dict.fromkeys(channels, factor)),
                prior,
            )
        )

    def both(channels: tuple[str, ...], a: str, b: str, factor: float, prior: float = USUAL) -> None:
        """`b` is what a file without a unit is read as; the other way round somebody wrote the wrong unit."""
        mistaken(channels, a, b, factor, prior)
        mistaken(channels, b, a, 1.0 / factor, prior if b == "radians" else min(prior, RARE) + 1.0)

    for angle in (("psi",), ("theta",), ("phi",), ("theta", "phi"), ("psi", "theta", "phi")):
        both(angle, "degrees", "radians", _DEGREE)
    for rate in (("r",), ("q",), ("p",), ("p", "q", "r")):
        both(rate, "degrees per second", "radians per second", _DEGREE, USUAL)
        if rate == ("r",):
            mistaken(rate, "degrees per minute", "degrees per second", 1 / 60, RARE)
            mistaken(rate, "degrees per minute", "radians per second", _DEGREE / 60, RARE)
    for fin in ("delta_r", "delta_s", "delta_b"):
        both((fin, f"{fin}_cmd"), "degrees", "radians", _DEGREE)
    # not v alone: a lever arm does the same to it, and one instrument logs both
    for speed in (("u", "v", "w", "u_water", "v_water", "w_water"), ("u", "u_water")):
        prior = USUAL if len(speed) > 2 else RARE
        both(speed, "knots", "m/s", _KNOT, prior)
        both(speed, "feet per second", "m/s", _FOOT, prior)
        both(speed, "km/h", "m/s", 1 / 3.6, RARE)
        mistaken(speed, "cm/s", "m/s", 0.01, RARE)
        mistaken(speed, "mm/s", "m/s", 0.001, RARE)
    for place in (("x", "y"), ("z",)):
        both(place, "feet", "metres", _FOOT)
        mistaken(place, "mm", "metres", 0.001, RARE)
        mistaken(place, "cm", "metres", 0.01, RARE)
        mistaken(place, "km", "metres", 1000.0, RARE)
    both(("n", "n_cmd"), "revolutions per second", "rpm", 60.0)
    both(("n", "n_cmd"), "radians per second", "rpm", 1.0 / _RPM)
    return rows


def _exchanged(a: str, b: str) -> Mistake:
    """Two columns of one kind in each other's place, orders and measurements of fins together."""
    pairs = ((a, b), (f"{a}_cmd", f"{b}_cmd")) if a.startswith("delta") else ((a, b),)
    return Mistake(f"{a} and {b} exchanged", f"{a} and {b} are exchanged", Correction(exchange=pairs), RARE)


def _frames() -> list[Mistake]:
    swap = (("x", "y"),)
    port = {"v": -1.0, "v_water": -1.0}
    return [
        Mistake("x and y exchanged", "x and y are exchanged", Correction(exchange=swap)),
        Mistake(
            "heading from east",
            "the heading counts from east towards north",
            Correction(heading_from="east"),
        ),
        Mistake(
            "east-north-up",
            "x points east, y north, and the heading counts from east",
            Correction(exchange=swap, heading_from="east"),
        ),
        Mistake(
            "east-north-up, rates too",
            "x points east, y north, heading and yaw rate count from east towards north",
            Correction(exchange=swap, heading_from="east", scale={"r": -1.0}),
        ),
        Mistake(
            "east-north-up, forward-left-up",
            "x points east, y north, z up; heading, yaw rate and sway count to port",
            Correction(exchange=swap, heading_from="east", scale={"r": -1.0, **port}),
            USUAL,
        ),
        Mistake(
            "body axes forward-left-up",
            "the body axes are forward-left-up and are read as forward-right-down (or the reverse)",
            Correction(scale=dict.fromkeys(BODY_AXES, -1.0)),
        ),
        Mistake(
            "x and y exchanged, sway too",
            "x and y are exchanged and v is positive to port",
            Correction(exchange=swap, scale=port),
            RARE,
        ),
        Mistake(
            "north-west-up",
            "y points west, and heading, yaw rate and sway count to port",
            Correction(scale={"y": -1.0, "psi": -1.0, "r": -1.0, **port}),
            RARE,
        ),
        Mistake(
            "heading and yaw rate to port",
            "heading and yaw rate count to port",
            Correction(scale={"psi": -1.0, "r": -1.0}),
            RARE,
        ),
        Mistake(
            "x and y exchanged and reversed",
            "x points west and y south",
            Correction(exchange=swap, scale={"x": -1.0, "y": -1.0}),
            RARE,
        ),
        *(_exchanged(a, b) for a, b in EXCHANGED),
        Mistake(
            "latitude and longitude",
            "x and y are latitude and longitude in degrees",
            Correction(geographic=True),
        ),
        Mistake(
            "longitude and latitude",
            "x and y are longitude and latitude in degrees",
            Correction(geographic=True, exchange=swap),
        ),
        Mistake(
            "through the water as over ground",
            "u and v are through the water and are read as over ground",
            Correction(rename={"u": "u_water", "v": "v_water", "w": "w_water"}),
        ),
        Mistake(
            "earth-fixed velocities",
            "u and v are the velocities north and east, not along and across the vehicle",
            Correction(velocity_axes="earth"),
        ),
        Mistake("time in ms", "the time is in milliseconds and read as seconds", Correction(time_scale=1e-3)),
        Mistake(
            "time in minutes",
            "the time is in minutes and read as seconds",
            Correction(time_scale=60.0),
            RARE - 2,
        ),
        Mistake(
            "time in s read as ms",
            "the time is in seconds and read as milliseconds",
            Correction(time_scale=1e3),
            RARE - 2,
        ),
    ]  # fmt: skip


MISTAKES: tuple[Mistake, ...] = (*_signs(), *_units(), *_frames())


def mistakes_of(known: Handedness) -> tuple[Mistake, ...]:
    """The table; latitude and longitude nobody counts the other way."""
    if not known.geographic:
        return MISTAKES
    return tuple(
        replace(m, log_prior=m.log_prior + NEVER_WEST) if m.name in ("sign of x", "sign of y") else m
        for m in MISTAKES
    )
