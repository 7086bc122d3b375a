"""New vehicles: scaled from a built-in one, estimated from a data sheet, read from a public simulator.

Takes: a vehicle, a `Sheet` or a simulator's file. Gives a `NewVehicle` with a comment for every number.
Does not: write files or judge the result (`check`).
"""

from __future__ import annotations

from bayesid.model.vehicles.new.estimate import estimate
from bayesid.model.vehicles.new.new_vehicle import NewVehicle, commented_toml, stable_share
from bayesid.model.vehicles.new.scaling import scaled
from bayesid.model.vehicles.new.sheet import EXAMPLE, EXAMPLE_FIN, KEYS, Sheet, read_sheet, sheet_of, template
from bayesid.model.vehicles.new.ship import estimate_ship
from bayesid.model.vehicles.new.ship_sheet import SHIP_EXAMPLE, ShipSheet, ship_sheet_of, ship_template
from bayesid.model.vehicles.new.simulators import from_simulator

__all__ = [
    "EXAMPLE",
    "EXAMPLE_FIN",
    "KEYS",
    "SHIP_EXAMPLE",
    "NewVehicle",
    "Sheet",
    "ShipSheet",
    "commented_toml",
    "estimate",
    "estimate_ship",
    "from_simulator",
    "read_sheet",
    "scaled",
    "sheet_of",
    "ship_sheet_of",
    "ship_template",
    "stable_share",
    "template",
]
