"""What the next manoeuvre may ask for: rudder, rate, shaft speed, time, room, depth; the library within it.

Takes a `Model` and the operator's numbers. Gives frozen `OrderLimits`, manoeuvres of one duration, and what a
track violates. Does not judge information.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ManoeuvreError, ModelError, raise_all
from bayesid.manoeuvres import REGISTRY, Manoeuvre, Scale, parse
from bayesid.model.vehicles.orders import has_planes, plane_limit, rudder_limits
from bayesid.simulation import Track

Array = np.ndarray
LARGEST_ANGLE = 0.61  # rad: 35 deg, where a vehicle states no limit
USUAL_LENGTHS = 45.0  # duration [L/U] where none is given
ORDERS_PER_LENGTH = 20.0  # orders per L/U


@dataclass(frozen=True)
class OrderLimits:
    """Bounds of a manoeuvre.

    Attributes
    ----------
    duration : [s]
    rudder, plane : largest orders [rad]; a plane of 0 leaves the planes alone
    rate : of rudder and planes [rad/s]
    rpm : lowest and highest order
    usual : shaft speed of the approach [rpm]
    box : longest side of the area swept, north or east [m]
    depth : largest change of depth either way [m]
    pitch : largest pitch angle [rad]
    dt : time between orders [s]
    hold : orders change only every so many seconds, as in an autopilot's table; 0: at every `dt`
    """

    duration: float
    rudder: float
    plane: float
    rate: float
    rpm: tuple[float, float]
    usual: float
    box: float
    depth: float
    pitch: float
    dt: float
    hold: float = 0.0

    @property
    def bind(self) -> bool:
        """Whether a track can break a limit that orders cannot."""
        return self.box < math.inf or self.plane > 0

    def violations(self, track: Track) -> dict[str, float]:
        """What a track overdoes, as share beyond the limit (0.1: ten percent)."""
        north, east = np.ptp(track["x"]), np.ptp(track["y"])
        used = {"area": (max(north, east), self.box)}
        if "z" in track.names:
            z, theta = track["z"], track["theta"]
            used["depth"] = (float(np.max(np.abs(z - z[0]))), self.depth)
            used["pitch"] = (float(np.max(np.abs(theta))), self.pitch)
        return {name: float(value / limit - 1.0) for name, (value, limit) in used.items() if value > limit}


def limits(
    model: Model,
    duration: float | None = None,
    rudder: float | None = None,
    rate: float | None = None,
    rpm: tuple[float, float] | None = None,
    box: float = math.inf,
    depth: float | None = None,
    plane: float | None = None,
    pitch: float = math.radians(20.0),
    hold: float = 0.0,
) -> OrderLimits:
    """Limits of a vehicle, narrowed by what is given.

    Defaults: 45 L/U, the vehicle's angles and rates, half to 1.1 of its usual shaft speed, no limit of area,
    three lengths of depth (6-DOF).

    Raises
    ------
    ManoeuvreError
        all at once: a number that is not positive, more than the vehicle can do, no usual shaft speed
    """
    vehicle, length, speed = model.vehicle, model.scales["L"], model.scales["U"]
    problems = []
    usual = vehicle.rpm_ref or 0.0
    if not usual:
        problems.append("it names no usual shaft speed, so no straight run to start from")
    angle, own_rate = rudder_limits(vehicle)
    able = {
        "rudder": min(angle, LARGEST_ANGLE),
        "plane": min(plane_limit(vehicle), LARGEST_ANGLE) if model.dof == 6 and has_planes(vehicle) else 0.0,
        "rate": min(own_rate, 10.0 * LARGEST_ANGLE * speed / length),
    }
    asked = {"rudder": rudder, "plane": plane, "rate": rate}
    for name, value in asked.items():
        if value is not None and not 0.0 <= value <= able[name] * (1 + 1e-9):
            problems.append(f"{name} of {value:.4g} is beyond what it can do, {able[name]:.4g} [rad, rad/s]")
    chosen = {n: able[n] if v is None else v for n, v in asked.items()}
    lowest, highest = rpm or (0.5 * usual, 1.1 * usual)
    seconds = duration if duration is not None else USUAL_LENGTHS * length / speed
    deep = depth if depth is not None else 3.0 * length
    for name, value in (("duration", seconds), ("rudder", chosen["rudder"]), ("rate", chosen["rate"]),
                        ("box", box), ("depth", deep)):  # fmt: skip
        if not value > 0:
            problems.append(f"{name} of {value:g} must be positive")
    if hold and not 0.0 < hold <= 0.1 * seconds:
        problems.append(
            f"orders held for {hold:g} s leave fewer than ten in {seconds:.4g} s; hold them for less, or "
            "make the run longer"
        )
    if not lowest <= highest:
        problems.append(f"rpm from {lowest:g} to {highest:g} is no range")
    if problems:
        raise_all(ManoeuvreError, f"limits for {vehicle.name}", problems)
    dt = length / speed / ORDERS_PER_LENGTH
    if hold:
        dt = hold / math.ceil(hold / dt)  # orders then change at whole steps
    return OrderLimits(
        seconds, chosen["rudder"], chosen["plane"], chosen["rate"], (lowest, highest), usual, box, deep,
        pitch, dt, hold,
    )  # fmt: skip


def library_within(model: Model, bounds: OrderLimits) -> dict[str, Manoeuvre]:
    """Every manoeuvre of the library, as long as asked and sized within rudder and plane limits.

    Raises
    ------
    ManoeuvreError
        a duration too short for any
    """
    time = model.scales["L"] / model.scales["U"]
    scale = Scale(
        model.scales["L"], model.scales["U"], bounds.usual, bounds.rudder, bounds.plane, model.dof, bounds.dt
    )
    total = bounds.duration
    before = min(2.0 * time, 0.1 * total)
    rest = total - before
    begun = {"approach": before, "duration": rest}
    sized: dict[str, Mapping[str, float]] = {
        "straight": {"duration": total},
        "spiral": {"start": before, "end": total},
        "dieudonne": {"approach": before, "hold": rest / 25},
        "turn": begun,
        "pullout": {"approach": before, "turning": 0.4 * rest, "after": 0.6 * rest},
        "zigzag": begun,
        "prbs": {"duration": total},
        "chirp": {"duration": total, "f0": max(0.02 / time, 1.0 / total)},
        "multisine": {"duration": total, "f0": max(0.02 / time, 1.0 / total)},
        "random": {"duration": total},
        "speedsteps": {"hold": total / 6},
        "coast": begun,
        "meander": begun,
        "depth": {**begun, "change": min(1.5 * scale.L, 0.7 * bounds.depth), "back_after": 0.5 * rest},
        "vzigzag": {**begun, "executes": 4},
        "combined": {"duration": total, "f0": max(0.02 / time, 1.0 / total)},
        "combinedheld": {"duration": total, "f0": max(0.02 / time, 1.0 / total)},
    }
    found: dict[str, Manoeuvre] = {}
    for key, text in _texts(model.dof, bounds.plane > 0).items():
        name, _, rest_of = text.partition(":")
        options = ",".join([*(f"{k}={v!r}" for k, v in sized.get(name, {}).items())])
        whole = f"{name}:" + ",".join(p for p in (rest_of, options) if p)
        try:
            found[key] = parse(whole, scale)
        except ManoeuvreError:  # a 20 degree zig-zag with a rudder of 15
            continue
    if not found:
        raise ManoeuvreError(f"no manoeuvre of the library fits into {total:g} s; allow a longer run")
    return found


def _texts(dof: int, planes: bool) -> dict[str, str]:
    """Library texts without lengths of their own; every one of them once per side where sides differ."""
    texts = {
        "straight": "straight", "spiral": "spiral", "dieudonne": "dieudonne", "turn": "turn",
        "pullout": "pullout", "zigzag_10": "zigzag:10/10", "zigzag_20": "zigzag:20/20",
        "zigzag_modified": "zigzag:switch=5", "prbs": "prbs", "chirp": "chirp:rpm_factors=1/0.7/1.1/0.85",
        "multisine": "multisine", "random": "random", "speedsteps": "speedsteps", "coast": "coast",
        "meander": "meander",
    }  # fmt: skip
    if dof == 6 and planes:
        texts |= {k: k for k in ("depth", "vzigzag", "combined", "combinedheld")}
    return {k: v for k, v in texts.items() if v.partition(":")[0] in REGISTRY}


def within_limits(bounds: OrderLimits, track: Track, commands: Mapping[str, Array]) -> str:
    """Empty if a run keeps within the limits, else what it overdoes, in words."""
    over = bounds.violations(track)
    words = [f"{name} {100 * share:.0f} % beyond its limit" for name, share in over.items()]
    for name, limit in (("delta_r_cmd", bounds.rudder), ("delta_s_cmd", bounds.plane)):
        if name in commands and float(np.max(np.abs(commands[name]))) > limit * (1 + 1e-6):
            words.append(f"{name} beyond {math.degrees(limit):.3g} deg")
    shaft = commands.get("n_cmd")
    if shaft is not None and not (
        bounds.rpm[0] * (1 - 1e-9) <= shaft.min() and shaft.max() <= bounds.rpm[1] * (1 + 1e-9)
    ):
        words.append(f"shaft speed outside {bounds.rpm[0]:g} to {bounds.rpm[1]:g} rpm")
    return ", ".join(words)


def allowed_manoeuvres(model: Model, draw: Array, bounds: OrderLimits) -> bool:
    """Whether a drawn vehicle survives a hard turn; used to sort out impossible draws."""
    from bayesid.simulation import run_manoeuvre, steady_start

    scale = Scale(
        model.scales["L"], model.scales["U"], bounds.usual, bounds.rudder, bounds.plane, model.dof, bounds.dt
    )
    text = f"turn:{math.degrees(bounds.rudder)!r},approach=1LU,duration=20LU"
    try:
        track, _ = run_manoeuvre(model, draw, parse(text, scale), steady_start(model, bounds.usual))
    except ModelError:
        return False
    return bool(np.all(track["u"] > 0.0))
