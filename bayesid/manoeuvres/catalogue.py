"""The named manoeuvres with their options, sized by a vehicle.

Takes: a `Scale` (length, speed, rpm, limits) for whatever is left open.
Does not: read text (see `registry`) or load vehicles; whoever knows the vehicle makes the Scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from bayesid.errors import ManoeuvreError, raise_all
from bayesid.manoeuvres import excite, standard
from bayesid.manoeuvres.core import Manoeuvre
from bayesid.manoeuvres.table import read_table

RAD = math.pi / 180


@dataclass(frozen=True)
class Scale:
    """Size of a vehicle as far as a manoeuvre needs it.

    L [m], U [m/s] at `rpm`, largest rudder and plane angles [rad], dof 3 or 6, step [s] (0: about L/U/80).
    """

    L: float
    U: float
    rpm: float
    max_rudder: float
    max_plane: float = 0.0
    dof: int = 3
    dt: float = 0.0

    def __post_init__(self) -> None:
        problems = [
            f"{n} is {v}; it must be positive and finite"
            for n, v in (("L", self.L), ("U", self.U), ("rpm", self.rpm), ("max_rudder", self.max_rudder))
            if not (math.isfinite(v) and v > 0)
        ]
        if not (math.isfinite(self.dt) and self.dt >= 0):
            problems.append(f"dt is {self.dt} s; give a positive step, or 0 for one that fits the vehicle")
        if self.dof not in (3, 6):
            problems.append(f"dof is {self.dof}; it must be 3 or 6")
        if problems:
            raise_all(ManoeuvreError, "manoeuvre scale", problems)
        if not self.max_plane:
            object.__setattr__(self, "max_plane", self.max_rudder)

    @property
    def LU(self) -> float:
        """Time to travel one length [s]."""
        return self.L / self.U

    @property
    def step(self) -> float:
        """Time step [s]: dt, or L/U/80 rounded down to 1, 2 or 5 times a power of ten."""
        if self.dt:
            return self.dt
        wanted = self.LU / 80
        decade = 10.0 ** math.floor(math.log10(wanted))
        return max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= wanted * (1 + 1e-12))


@dataclass(frozen=True)
class ManoeuvreEntry:
    """One name a user may type.

    `options` maps an option to (kind, default); kinds: deg, s, rpm, m, hz, number, int, side, text, rpms. A
    default is a number in the unit of the kind, or a function of the scale giving SI. `positional` names
    what may stand after the colon, separated by slashes.
    """

    summary: str
    build: Callable[..., Manoeuvre]
    options: Mapping[str, tuple[str, Any]]
    positional: tuple[str, ...] = ()
    dof: int = 3
    required: tuple[str, ...] = ()


def _lu(count: float) -> Callable[[Scale], float]:
    return lambda s: count * s.LU


def _rudder(deg: float, share: float = 1.0) -> Callable[[Scale], float]:
    return lambda s: min(deg * RAD, share * s.max_rudder)


def _plane(deg: float, share: float = 1.0) -> Callable[[Scale], float]:
    return lambda s: min(deg * RAD, share * s.max_plane)


RPM = ("rpm", lambda s: s.rpm)
DT = ("s", lambda s: s.step)
APPROACH = ("s", _lu(4))
SIDE = ("side", 1.0)
SEED = ("int", 0)
FACTORS = ("rpms", (1.0,))
BAND = {"f0": ("hz", lambda s: 0.02 / s.LU), "f1": ("hz", lambda s: 0.4 / s.LU)}
HOLD = {
    "lookahead": ("m", lambda s: 3 * s.L),
    "max_pitch": ("deg", 15.0),
    "max_plane": ("deg", lambda s: s.max_plane),
    "k_q": ("s", lambda s: 0.5 * s.LU),
}


def _dieudonne(max_rudder: float, **given: Any) -> Manoeuvre:
    top = max_rudder / (standard.DIEUDONNE_DEG[0] * RAD)
    # a small limit squeezes the outer steps only: the loop of an unstable boat lies within a few degrees
    levels = tuple(
        d * RAD if abs(d) <= 5 or top >= 1 else math.copysign(max(5 * RAD, abs(d) * RAD * top), d)
        for d in standard.DIEUDONNE_DEG
    )
    return standard.dieudonne(
        levels=[x for i, x in enumerate(levels) if i == 0 or x != levels[i - 1]], **given
    )


REGISTRY: Mapping[str, ManoeuvreEntry] = MappingProxyType(
    {
        "spiral": ManoeuvreEntry(
            "one-sided spiral, rudder ramp to starboard",
            standard.spiral,
            {
                "rpm": RPM,
                "start": ("s", 10.0),
                "end": ("s", 600.0),
                "first": ("deg", -5.0),
                "last": ("deg", lambda s: -min(30 * RAD, s.max_rudder)),
                "dt": DT,
            },
        ),
        "dieudonne": ManoeuvreEntry(
            "rudder steps from port to starboard and back, each held",
            _dieudonne,
            {
                "max_rudder": ("deg", _rudder(15)),
                "hold": ("s", _lu(20)),
                "approach": APPROACH,
                "rpm": RPM,
                "dt": DT,
            },
            ("max_rudder",),
        ),
        "turn": ManoeuvreEntry(
            "turning circle",
            standard.turn,
            {
                "rudder": ("deg", _rudder(35)),
                "side": SIDE,
                "approach": APPROACH,
                "duration": ("s", _lu(60)),
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder",),
        ),
        "pullout": ManoeuvreEntry(
            "turn, then rudder amidships",
            standard.pull_out,
            {
                "rudder": ("deg", _rudder(20)),
                "side": SIDE,
                "approach": APPROACH,
                "turning": ("s", _lu(15)),
                "after": ("s", _lu(30)),
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder",),
        ),
        "zigzag": ManoeuvreEntry(
            "zig-zag rudder/heading",
            standard.zigzag,
            {
                "rudder": ("deg", _rudder(10)),
                "switch": ("deg", 10.0),
                "side": SIDE,
                "approach": APPROACH,
                "duration": ("s", _lu(40)),
                "executes": ("int", 0),
                "neutral": ("deg", 0.0),
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder", "switch"),
        ),
        "prbs": ManoeuvreEntry(
            "pseudo-random binary rudder",
            excite.prbs,
            {
                "amplitude": ("deg", _rudder(10, 0.75)),
                "clock": ("s", _lu(1.5)),
                "duration": ("s", _lu(95)),
                "seed": SEED,
                "rpm_factors": FACTORS,
                "rpm": RPM,
                "dt": DT,
            },
            ("amplitude",),
        ),
        "chirp": ManoeuvreEntry(
            "rudder sine of rising frequency",
            excite.chirp,
            {
                "amplitude": ("deg", _rudder(15, 0.75)),
                **BAND,
                "duration": ("s", _lu(80)),
                "rpm_factors": FACTORS,
                "rpm": RPM,
                "dt": DT,
            },
            ("amplitude",),
        ),
        "multisine": ManoeuvreEntry(
            "rudder sum of sines with a low peak",
            excite.multisine,
            {
                "amplitude": ("deg", _rudder(20, 0.9)),
                **BAND,
                "duration": ("s", _lu(80)),
                "count": ("int", 16),
                "seed": SEED,
                "rpm_factors": FACTORS,
                "rpm": RPM,
                "dt": DT,
            },
            ("amplitude",),
        ),
        "random": ManoeuvreEntry(
            "random rudder steps",
            excite.random_rudder,
            {
                "amplitude": ("deg", _rudder(20)),
                "shortest": ("s", _lu(1)),
                "longest": ("s", _lu(8)),
                "duration": ("s", _lu(80)),
                "seed": SEED,
                "rpm": RPM,
                "dt": DT,
            },
            ("amplitude",),
        ),
        "speedsteps": ManoeuvreEntry(
            "rpm levels, rudder amidships",
            standard.speed_steps,
            {
                "rpms": ("rpms", lambda s: tuple(f * s.rpm for f in (1.0, 0.5, 0.75, 1.1, 0.6, 1.0))),
                "hold": ("s", _lu(12)),
                "dt": DT,
            },
            ("rpms",),
        ),
        "coast": ManoeuvreEntry(
            "propeller stopped",
            standard.coast_down,
            {"approach": APPROACH, "duration": ("s", _lu(40)), "rpm": RPM, "dt": DT},
        ),
        "straight": ManoeuvreEntry(
            "constant rpm, rudder amidships",
            standard.straight,
            {"duration": ("s", _lu(30)), "rpm": RPM, "dt": DT},
        ),
        "meander": ManoeuvreEntry(
            "sinusoidal rudder",
            standard.meander,
            {
                "rudder": ("deg", _rudder(15)),
                "period": ("s", _lu(10)),
                "side": SIDE,
                "approach": APPROACH,
                "duration": ("s", _lu(50)),
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder",),
        ),
        "depth": ManoeuvreEntry(
            "depth change and return by stern planes",
            standard.depth_change,
            {
                "change": ("m", lambda s: 1.5 * s.L),
                "approach": APPROACH,
                "duration": ("s", _lu(60)),
                "back_after": ("s", _lu(30)),
                "k_theta": ("number", 1.5),
                **HOLD,
                "rpm": RPM,
                "dt": DT,
            },
            ("change",),
            dof=6,
        ),
        "vzigzag": ManoeuvreEntry(
            "vertical zig-zag plane/pitch",
            standard.vertical_zigzag,
            {
                "plane": ("deg", _plane(10)),
                "switch": ("deg", 5.0),
                "approach": APPROACH,
                "duration": ("s", _lu(30)),
                "executes": ("int", 4),
                "rpm": RPM,
                "dt": DT,
            },
            ("plane", "switch"),
            dof=6,
        ),
        "combined": ManoeuvreEntry(
            "rudder, planes and rpm at once",
            excite.combined,
            {
                "rudder": ("deg", _rudder(15)),
                "plane": ("deg", _plane(8)),
                **BAND,
                "duration": ("s", _lu(80)),
                "count": ("int", 10),
                "rpm_swing": ("number", 0.0),
                "seed": SEED,
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder", "plane"),
            dof=6,
        ),
        "combinedheld": ManoeuvreEntry(
            "the same with depth loosely held",
            excite.combined_held,
            {
                "rudder": ("deg", _rudder(15)),
                "plane": ("deg", _plane(8)),
                **BAND,
                "duration": ("s", _lu(80)),
                "count": ("int", 10),
                "rpm_swing": ("number", 0.0),
                "k_theta": ("number", 0.5),
                **HOLD,
                "seed": SEED,
                "rpm": RPM,
                "dt": DT,
            },
            ("rudder", "plane"),
            dof=6,
        ),
        "table": ManoeuvreEntry(
            "commands from a CSV file",
            read_table,
            {"path": ("text", None), "rudder_positive": ("text", "port")},
            ("path",),
            required=("path",),
        ),
    }
)
