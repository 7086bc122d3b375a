"""Vehicles: coefficient sets as TOML, six of them built in, read into one convention and written back.

Takes: a built-in name or a file. Gives `Vehicle`, SI coefficients, stability indices and findings.
Does not: simulate.
"""

from __future__ import annotations

from bayesid.model.vehicles.check import Finding, check_vehicle
from bayesid.model.vehicles.inertia import added_mass, rigid_body_mass
from bayesid.model.vehicles.reading import builtin_names, load_vehicle
from bayesid.model.vehicles.stability import (
    Stability,
    self_propulsion_speed,
    stability,
    usual_speed,
)
from bayesid.model.vehicles.vehicle import (
    ASSUMED_RELATIVE_SD,
    GRAVITY,
    CoefficientPrior,
    Crossflow,
    Propulsion,
    Vehicle,
    coef_si,
    prime_scale,
    prime_unit,
    with_relative_prior,
)
from bayesid.model.vehicles.writing import identified, write_vehicle

__all__ = [
    "ASSUMED_RELATIVE_SD",
    "GRAVITY",
    "Crossflow",
    "Finding",
    "CoefficientPrior",
    "Propulsion",
    "Stability",
    "Vehicle",
    "added_mass",
    "builtin_names",
    "check_vehicle",
    "coef_si",
    "identified",
    "load_vehicle",
    "prime_scale",
    "prime_unit",
    "rigid_body_mass",
    "self_propulsion_speed",
    "stability",
    "usual_speed",
    "with_relative_prior",
    "write_vehicle",
]
