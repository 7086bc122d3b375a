"""Mistakes that simulators make, as the numbers of a vehicle that would be right.

Takes the numbers of a model in SI. Gives those to change, of every mistake the file can hold. One row per
mistake: `MISTAKES`; a name in it stands nowhere else. Does not weigh them.

A mistake that is no pattern of the numbers cannot be in a vehicle file: the sign lost in v v for v|v| (our
rows have the sign), drag by speed over ground (ours go with the water), a step too long, degrees in a log.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from bayesid.model.terms import TERMS, Term
from bayesid.model.vehicles.convention import munk_and_coriolis

DEGREE = 0.017453292519943295
ROWS: dict[str, Term] = {row.name: row for row in TERMS}
INERTIA = tuple(name for name, row in ROWS.items() if row.is_inertia)
CROSS = ("Y_r", "N_v", "Z_q", "M_w")
# Potential flow alone: a cross row within this share of what added mass brings with it holds no lift.
POTENTIAL = 1e-3
# Size of a cross row that is left out, over 1/2 rho L^k.
CROSS_SIZE = 0.01


@dataclass(frozen=True)
class Numbers:
    """Numbers of a model [SI], and the scales L [m], U [m/s], rho [kg/m3] of its vehicle."""

    value: Mapping[str, float]
    scales: Mapping[str, float]
    rpm: float

    def rows(self) -> dict[str, float]:
        """Coefficients that are not zero."""
        return {n: v for n, v in self.value.items() if n in ROWS and v != 0.0}

    def potential(self) -> dict[str, float]:
        """Velocity rows that the added mass brings with it, those of the model."""
        inertia = {n: self.value[n] for n in INERTIA if self.value.get(n, 0.0) != 0.0}
        return {n: v for n, v in munk_and_coriolis(inertia).items() if n in self.value}


@dataclass(frozen=True)
class Change:
    """New values [SI] by name, and the deviation of those that are not known."""

    values: Mapping[str, float]
    sd: Mapping[str, float] = field(default_factory=dict)

    def within(self, names: Collection[str]) -> Change:
        """What a model with these names has of it."""
        return Change(
            {n: v for n, v in self.values.items() if n in names},
            {n: v for n, v in self.sd.items() if n in names},
        )

    def about(self, found: Mapping[str, float]) -> Change:
        """The same deviations about other values."""
        return Change({**self.values, **found}, self.sd)


Mend = Callable[[Numbers, float], Change | None]


@dataclass(frozen=True)
class SimulatorMistake:
    """One mistake.

    Attributes
    ----------
    name : unique
    says : what is wrong, a sentence; {size} is the size
    mend : numbers and size -> what would be right; None where the file cannot hold the mistake
    sizes : those tried; equally probable before any data
    source : where it was made
    """

    name: str
    says: str
    mend: Mend
    sizes: tuple[float, ...] = (1.0,)
    source: str = ""


def _added(times: float, of: tuple[str, ...] = ()) -> Mend:
    """Potential rows (all, or some) added so many times."""

    def mend(numbers: Numbers, size: float) -> Change | None:
        more = {n: v for n, v in numbers.potential().items() if not of or n in of}
        return Change({n: numbers.value[n] + times * v for n, v in more.items()}) if more else None

    return mend


def _inertia(factor: float) -> Mend:
    def mend(numbers: Numbers, size: float) -> Change | None:
        found = {n: factor * numbers.value[n] for n in INERTIA if numbers.value.get(n, 0.0) != 0.0}
        return Change(found) if found else None

    return mend


def _inertia_and_coriolis(numbers: Numbers, size: float) -> Change | None:
    half = _inertia(0.5)(numbers, size)
    back = _added(-0.5)(numbers, size)
    return Change({**half.values, **back.values}) if half and back else None


def _rates(factor: float) -> Mend:
    """Rows by their power of p, q, r."""

    def mend(numbers: Numbers, size: float) -> Change | None:
        found = {}
        for name, value in numbers.rows().items():
            power = sum(f.degree for f in ROWS[name].factors if f.symbol in ("p", "q", "r"))
            if power:
                found[name] = value * factor**power
        return Change(found) if found else None

    return mend


def _fins(factor: float, only: str = "") -> Mend:
    """Rows by their power of fin angles, of one fin where others have rows too."""

    def mend(numbers: Numbers, size: float) -> Change | None:
        found = {}
        if only and not {"delta_r", "delta_s"} <= {f.symbol for n in numbers.rows() for f in ROWS[n].factors}:
            return None
        for name, value in numbers.rows().items():
            power = sum(f.degree for f in ROWS[name].factors if f.symbol.startswith(only or "delta"))
            if power:
                found[name] = value * factor**power
        return Change(found) if found else None

    return mend


def _hull(numbers: Numbers) -> dict[str, float]:
    return {n: v for n, v in numbers.rows().items() if ROWS[n].group != "propulsion"}


def _length(numbers: Numbers, size: float) -> Change | None:
    return Change({n: v * size ** ROWS[n].length_power for n, v in _hull(numbers).items()})


def _factor(numbers: Numbers, size: float) -> Change | None:
    return Change({n: v * size for n, v in _hull(numbers).items()})


def _point(numbers: Numbers, size: float) -> Change | None:
    """Coefficients about a point at x = size L brought to the origin: v there is v + x r, and N gets x Y."""
    x = size * numbers.scales["L"]
    found: dict[str, float] = {}

    def put(name: str, value: float) -> None:
        if name in numbers.value and value:
            found[name] = found.get(name, numbers.value[name]) + value

    get = numbers.value.get
    for force, moment, arm, speed, rate in (("Y", "N", x, "v", "r"), ("Z", "M", -x, "w", "q")):
        for end in ("", "dot"):
            by_v, by_r = get(f"{force}_{speed}{end}", 0.0), get(f"{force}_{rate}{end}", 0.0)
            of_v = get(f"{moment}_{speed}{end}", 0.0)
            put(f"{force}_{rate}{end}", arm * by_v)
            put(f"{moment}_{speed}{end}", arm * by_v)
            put(f"{moment}_{rate}{end}", arm * (by_r + of_v) + arm * arm * by_v)
        for fin in ("dr", "ds"):
            put(f"{moment}_{fin}", arm * get(f"{force}_{fin}", 0.0))
        put(f"{moment}_{speed}|{speed}|", arm * get(f"{force}_{speed}|{speed}|", 0.0))
    return Change(found) if found else None


def _diagonal(numbers: Numbers, size: float) -> Change | None:
    """Cross rows that hold potential flow alone, or nothing, made free."""
    potential, s = numbers.potential(), numbers.scales
    bare = [
        n
        for n in CROSS
        if n in numbers.value
        and any(abs(numbers.value[n] - v) <= POTENTIAL * abs(v) for v in (0.0, potential.get(n, 0.0)))
    ]
    if len(bare) < 2:
        return None
    sd = {n: CROSS_SIZE * 0.5 * s["rho"] * s["L"] ** ROWS[n].length_power for n in bare}
    return Change({n: numbers.value[n] for n in bare}, sd)


def _quadratic(numbers: Numbers, size: float) -> Change | None:
    """Thrust by revolutions made one by their square, the same at the usual revolutions."""
    linear = numbers.value.get("X_prop_n", 0.0)
    if not linear:
        return None
    return Change({"X_prop_n": 0.0, "X_prop_n|n|": numbers.value["X_prop_n|n|"] + linear / numbers.rpm})


def _loaded(numbers: Numbers, size: float) -> Change | None:
    """Thrust that falls with speed, by `size` of itself from standstill to the usual speed."""
    if numbers.value.get("X_prop_un", 0.0) or not numbers.value.get("X_prop_n|n|", 0.0):
        return None
    thrust = numbers.value["X_prop_n|n|"]
    return Change({
        "X_prop_n|n|": thrust * (1.0 + size),
        "X_prop_un": -thrust * size * numbers.rpm / numbers.scales["U"],
    })  # fmt: skip


def _swapped(numbers: Numbers, size: float) -> Change | None:
    if "z_B" not in numbers.value:
        return None
    g, b = numbers.value["z_G"], numbers.value["z_B"]
    return Change({"z_G": b, "z_B": g}) if g != b else None


def _upright(numbers: Numbers, size: float) -> Change | None:
    """z of both centres turned down."""
    if "z_B" not in numbers.value:
        return None
    g, b = numbers.value["z_G"], numbers.value["z_B"]
    return Change({"z_G": -g, "z_B": -b}) if g != b else None


def _buoyancy(numbers: Numbers, size: float) -> Change | None:
    if "x_B" not in numbers.value:
        return None
    return Change({"x_B": numbers.value["x_B"] + size * numbers.scales["L"]})


_STEPS = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1)
_POINTS = (*(-s for s in _STEPS[::-1]), *_STEPS)
_RATIOS = (0.8, 0.85, 0.9, 0.94, 0.97, 1.03, 1.06, 1.1, 1.15, 1.2, 1.25)

MISTAKES: tuple[SimulatorMistake, ...] = (
    SimulatorMistake(
        "Munk moment missing",
        "the simulator leaves out the Munk moment, (Y_vdot - X_udot) u v",
        _added(1.0, ("N_v", "M_w")),
        source="Python Vehicle Simulator, remus100: four elements of C_A set to zero",
    ),
    SimulatorMistake(
        "Munk moment twice",
        "the simulator counts the Munk moment twice, in N_v and in its Coriolis matrix",
        _added(-1.0, ("N_v", "M_w")),
        source="a Gertler-Hagen set put into equations with C_A",
    ),
    SimulatorMistake(
        "added-mass Coriolis missing",
        "the simulator leaves out the Coriolis forces of the added mass",
        _added(1.0),
        source="a Fossen set read as a Gertler-Hagen set",
    ),
    SimulatorMistake(
        "added-mass Coriolis twice",
        "the simulator counts the Coriolis forces of the added mass twice",
        _added(-1.0),
        source="a Gertler-Hagen set put into equations with C_A",
    ),
    SimulatorMistake(
        "added-mass Coriolis of the wrong sign",
        "the Coriolis forces of the added mass have the wrong sign in the simulator",
        _added(2.0),
        source="UUV Simulator before pull request 7",
    ),
    SimulatorMistake(
        "added mass twice",
        "the simulator counts the added mass twice",
        _inertia(0.5),
        source="Gazebo with fluid added mass of the link beside the plugin's",
    ),
    SimulatorMistake(
        "added mass twice, its Coriolis forces too",
        "the simulator counts the added mass twice, and so its Coriolis forces",
        _inertia_and_coriolis,
        source="Gazebo with fluid added mass of the link beside the plugin's",
    ),
    SimulatorMistake(
        "added mass halved",
        "the added mass of the simulator is half of what it should be",
        _inertia(2.0),
        source="primes by rho read as primes by rho/2",
    ),
    SimulatorMistake(
        "rates in degrees",
        "the simulator's coefficients of p, q, r are per degree",
        _rates(1.0 / DEGREE),
        source="tables of coefficients per degree",
    ),
    SimulatorMistake(
        "fin angles in degrees",
        "the simulator's coefficients of fin angles are per degree",
        _fins(1.0 / DEGREE),
        source="tables of coefficients per degree",
    ),
    SimulatorMistake(
        "sign of the fins",
        "the sign of the fins is turned in the simulator, or in the log",
        _fins(-1.0),
        source="positive rudder to starboard and to port are both in use",
    ),
    SimulatorMistake(
        "sign of the rudder",
        "the sign of the rudder is turned in the simulator, or in the log",
        _fins(-1.0, "delta_r"),
        source="positive rudder to starboard and to port are both in use",
    ),
    SimulatorMistake(
        "sign of the stern planes",
        "the sign of the stern planes is turned in the simulator, or in the log",
        _fins(-1.0, "delta_s"),
        source="positive planes up and down are both in use",
    ),
    SimulatorMistake(
        "another length",
        "the coefficients are made dimensionless by another length, {size:.3g} times the stated one",
        _length,
        _RATIOS,
        "length over all and between perpendiculars",
    ),
    SimulatorMistake(
        "coefficients by a factor",
        "all coefficients of the hull are {size:.3g} times those of the simulator: prime system or density",
        _factor,
        (0.5, 2.0),
        "primes by rho and by rho/2",
    ),
    SimulatorMistake(
        "moments about another point",
        "the coefficients are about a point at x = {size:+.3g} L, not about the origin",
        _point,
        _POINTS,
        "midships and centre of gravity",
    ),
    SimulatorMistake(
        "diagonal damping",
        "the simulator has no cross terms of sway and yaw, of heave and pitch",
        _diagonal,
        source="Gazebo Hydrodynamics before its cross terms (pull request 1784)",
    ),
    SimulatorMistake(
        "thrust linear in revolutions",
        "thrust goes with the revolutions in the simulator, not with their square",
        _quadratic,
        source="thrusters with a linear conversion",
    ),
    SimulatorMistake(
        "thrust not reduced with speed",
        "thrust does not fall with speed in the simulator; it should by {size:.2g} of itself",
        _loaded,
        (0.15, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0),
        "thrusters with their bollard pull at every speed",
    ),
    SimulatorMistake(
        "centres of gravity and buoyancy exchanged",
        "the centres of gravity and buoyancy are exchanged in the simulator",
        _swapped,
        source="restoring moments of the wrong sign",
    ),
    SimulatorMistake(
        "z upwards",
        "the heights of the centres of gravity and buoyancy have the wrong sign in the simulator",
        _upright,
        source="z up in one file, down in the other",
    ),
    SimulatorMistake(
        "centre of buoyancy at the wrong point",
        "the centre of buoyancy is at another x, {size:+.3g} L from where the simulator has it",
        _buoyancy,
        (-0.02, -0.01, -0.005, -0.002, -0.001, 0.001, 0.002, 0.005, 0.01, 0.02),
        "buoyancy of a mesh taken at its origin",
    ),
)
