"""A vehicle made here, with a comment for every number and what to know before using it.

Takes: a `Vehicle` and words. Gives the text of a commented vehicle file, and how likely its prior makes it
stable. Does not: write files.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.vehicles.stability import stability
from bayesid.model.vehicles.vehicle import Vehicle, coef_si
from bayesid.model.vehicles.writing import vehicle_toml

SHIP_DRAWS = 200  # each takes 2 ms


@dataclass(frozen=True)
class NewVehicle:
    """comments: (section, key) -> where the number is from; notes: what was assumed or is doubtful, the
    important first; references: what the comments cite."""

    vehicle: Vehicle
    comments: Mapping[tuple[str, str], str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    references: tuple[str, ...] = ()


def commented_toml(new: NewVehicle) -> str:
    """Vehicle file as text; `load_vehicle` reads it back to the same digest."""
    head = [
        "# Made by `bayesid vehicle new`. Every number may be edited; [prior] says how far each may be off."
    ]
    for note in new.notes:
        head += textwrap.wrap(note, 108, initial_indent="#  - ", subsequent_indent="#    ")
    if new.references:
        head += ["#", "# Formulas:", *(f"#  {text}" for text in new.references), ""]
    return "\n".join(head) + "\n" + vehicle_toml(new.vehicle, None, new.comments)


def stable_share(vehicle: Vehicle, draws: int = 2000, seed: int = 1) -> float | None:
    """Share of draws from the prior that are straight-line stable in the horizontal plane (G_H > 0); None
    where the vehicle states no prior, no usual speed or no such rows."""
    if vehicle.prior is None or not vehicle.prior.relative_sd:
        return None
    try:
        base = stability(vehicle)
    except VehicleError:
        return None
    if base.G_H is None:
        return None
    si, spread, random = coef_si(vehicle), vehicle.prior.relative_sd, np.random.default_rng(seed)
    if vehicle.propulsion.model == "mmg":
        return _stable_ships(vehicle, base.U, min(draws, SHIP_DRAWS), random)
    mass, arm = vehicle.mass, vehicle.mass * vehicle.r_G[0]

    def slope(name: str) -> np.ndarray:
        own = si.get(name, 0.0) * (1.0 + spread.get(name, 0.0) * random.standard_normal(draws))
        return own + si.get(f"{name}0", 0.0) / base.U

    index = 1.0 - slope("N_v") * (slope("Y_r") - mass) / (slope("Y_v") * (slope("N_r") - arm))
    return float(np.mean(index > 0.0))


def _stable_ships(vehicle: Vehicle, speed: float, draws: int, random: np.random.Generator) -> float:
    """The share among ships whose rudder stands in the wake of hull and propeller, one by one."""
    spread = vehicle.prior.relative_sd if vehicle.prior else {}
    stable = 0
    for _ in range(draws):
        coef = {n: x * (1.0 + spread.get(n, 0.0) * random.standard_normal()) for n, x in vehicle.coef.items()}
        G_H = stability(replace(vehicle, coef=coef), speed).G_H
        stable += G_H is not None and G_H > 0.0
    return stable / draws
