"""What a vehicle is: mass properties, coefficients, propulsion, limits and how well each number is known.

Takes: numbers already read and checked (`reading`). Gives SI coefficients.
Does not: read files, simulate, or judge whether the numbers make sense (`check`).
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from bayesid.model.actuators import Actuator, Fin, Pusher
from bayesid.model.propulsion import propulsion_rows
from bayesid.model.terms import Term, term
from bayesid.model.terms.mmg import AREAS

GRAVITY = 9.81  # m/s^2, as in the reference behaviour of the built-in sets
FINS = ("delta_r", "delta_s", "delta_b")
_LATER = ("effects", "effects_sd", "thrusters", "fins")
INERTIA = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


@dataclass(frozen=True)
class Propulsion:
    """Model name of `propulsion.MODELS` and its numbers as in the file."""

    model: str
    values: dict[str, float]

    @property
    def rpm_ref(self) -> float | None:
        """Shaft speed [rpm] of the vehicle's usual run, if the file names one."""
        return self.values.get("rpm_ref", self.values.get("rpm_max"))


@dataclass(frozen=True)
class Crossflow:
    """Strip drag: Cdy, Cdz [-] on constant height and width [m], trapezoid over `sections` stations."""

    Cdy: float
    Cdz: float
    height: float
    width: float
    sections: int


@dataclass(frozen=True)
class CoefficientPrior:
    """How far the true coefficients may lie from the file's, one sigma.

    Parameters
    ----------
    relative_sd : coefficient -> sigma / |value|, for every coefficient not named in `names`
    names, covariance : jointly known coefficients and their (k, k) covariance, in the units of the file
    """

    relative_sd: dict[str, float] = field(default_factory=dict)
    names: tuple[str, ...] = ()
    covariance: np.ndarray | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CoefficientPrior):
            return NotImplemented
        same = self.relative_sd == other.relative_sd and self.names == other.names
        if self.covariance is None or other.covariance is None:
            return same and self.covariance is other.covariance
        return same and np.array_equal(self.covariance, other.covariance)

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True)
class Vehicle:
    """A vehicle as its file states it, in one convention: SI and radians, x forward, y starboard, z down,
    positive rudder to PORT, coefficients Gertler-Hagen complete. Dicts and arrays are not to be changed.

    Parameters
    ----------
    coef : canonical name -> value, prime system if `nondimensional`, SI otherwise
    limits, rates : fin -> largest angle [rad] and rate [rad/s]; inf where the file states none
    U_ref : reference speed [m/s], needed only by prime coefficients that are not quadratic in velocity
    effects, effects_sd : effect parameter ("actuator_lag.tau") -> value, and one standard deviation [SI]:
        effects of the catalogue, or of a user's file of effects, that are part of this vehicle
    thrusters, fins : beside the propeller of `propulsion`, and beside rudder and planes; named
    completed : rows of `coef` that the file does not state, added from its convention; not kept when written
    in_file : rows of `coef` to which the convention of the file adds -> what the file states; likewise
    validation, confidence, sources : what the file says about its own numbers, kept as it is
    """

    name: str
    source: str
    nondimensional: bool
    plain_abs: bool
    planar_only: bool
    rho: float
    L: float
    mass: float
    Ixx: float
    Iyy: float
    Izz: float
    Ixy: float
    Ixz: float
    Iyz: float
    r_G: tuple[float, float, float]
    r_B: tuple[float, float, float]
    W: float
    B: float
    limits: dict[str, float]
    rates: dict[str, float]
    propulsion: Propulsion
    crossflow: Crossflow | None
    coef: dict[str, float]
    prior: CoefficientPrior | None = None
    U_ref: float | None = None
    dimensions: dict[str, float] = field(default_factory=dict)
    validation: dict[str, Any] = field(default_factory=dict)
    confidence: dict[str, list[str]] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    effects: dict[str, float] = field(default_factory=dict)
    effects_sd: dict[str, float] = field(default_factory=dict)
    thrusters: tuple[Pusher, ...] = ()
    fins: tuple[Fin, ...] = ()
    completed: tuple[str, ...] = field(default=(), compare=False)
    in_file: dict[str, float] = field(default_factory=dict, compare=False)

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Those of [actuators.NAME]."""
        return (*self.thrusters, *self.fins)

    @property
    def areas_stated(self) -> bool:
        """Whether the file states an area that the air pushes on."""
        return any(self.dimensions.get(name, 0.0) > 0.0 for name in AREAS)

    @property
    def main_shafts(self) -> tuple[Pusher, ...]:
        """Named thrusters that push ahead."""
        return tuple(thruster for thruster in self.thrusters if thruster.direction[0] > 0.5)

    @property
    def rpm_ref(self) -> float | None:
        return self.propulsion.rpm_ref

    @property
    def digest(self) -> str:
        """SHA-256 of every number and name, independent of comments, order and spelling in the file."""
        plain = asdict(self)
        del plain["completed"], plain["in_file"]  # the same numbers, whoever wrote them down
        for key in _LATER:  # a vehicle without keeps the digest it had before there were any
            if not plain[key]:
                del plain[key]
        if self.prior is not None and self.prior.covariance is not None:
            plain["prior"]["covariance"] = self.prior.covariance.tolist()
        return hashlib.sha256(json.dumps(plain, sort_keys=True, default=str).encode()).hexdigest()


# Relative prior sd of a coefficient whose vehicle file states none, in every command that needs one.
ASSUMED_RELATIVE_SD = 0.1


def with_relative_prior(vehicle: Vehicle, sd: float | None) -> Vehicle:
    """The vehicle with every coefficient known to this share of its value, whatever its file states.

    Parameters
    ----------
    sd : relative standard deviation; None gives the vehicle as it is
    """
    return (
        vehicle if sd is None else replace(vehicle, prior=CoefficientPrior(dict.fromkeys(vehicle.coef, sd)))
    )


def prime_scale(vehicle: Vehicle, row: Term | str) -> float:
    """SI value of a coefficient over its value in the file.

    1/2 rho L^k for a prime set, with U_ref^(2 - degree) where the row is not quadratic in velocity, and with
    prime_draught/L where the file states its draught so; 1 for a dimensional set, for propulsion rows, which
    are always SI, and for numbers.
    """
    row = term(row) if isinstance(row, str) else row
    plain = row.group in ("propulsion", "number") or not vehicle.nondimensional
    return 1.0 if plain else prime_unit(vehicle, row)


def prime_unit(vehicle: Vehicle, row: Term | str) -> float:
    """SI value of a coefficient whose prime value is 1, whatever the units of the file.

    nan for a propulsion row, which has no prime form, and for a row that needs a U_ref the vehicle lacks;
    1 for a number.
    """
    row = term(row) if isinstance(row, str) else row
    if row.group == "propulsion":
        return float("nan")
    if row.is_number:
        return 1.0
    scale = 0.5 * vehicle.rho * vehicle.L**row.length_power
    scale *= vehicle.dimensions.get("prime_draught", vehicle.L) / vehicle.L
    if row.velocity_power == 2:
        return scale
    return scale * (vehicle.U_ref or float("nan")) ** (2 - row.velocity_power)


def coef_si(vehicle: Vehicle) -> dict[str, float]:
    """SI values of all coefficients of the file and of the four propulsion rows (0 for `kt`)."""
    values = {name: value * prime_scale(vehicle, name) for name, value in vehicle.coef.items()}
    propulsion = vehicle.propulsion
    return values | propulsion_rows(propulsion.model, propulsion.values, vehicle.rho, vehicle.L)
