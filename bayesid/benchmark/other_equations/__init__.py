"""Plants whose equations are not bayesid's: an MMG ship and a strip-theory AUV that rolls, with known causes.

Takes: a vehicle name and a seed. Gives campaigns, their logs and what was planted, under the names of the
effect contract.
Does not: import effects, kernels, simulation or model (a contract in pyproject.toml), or tune the nominal
simulator a bundle carries (`studies.other_equations.tune`).
"""

from bayesid.benchmark.other_equations.campaign import (
    Campaign,
    Executed,
    draw_campaign,
    executed,
    replayed,
)
from bayesid.benchmark.other_equations.causes import LISTED, UNLISTED, Planted
from bayesid.benchmark.other_equations.runs import RunPlan
from bayesid.benchmark.other_equations.simulate import Record, simulate_run
from bayesid.benchmark.other_equations.vehicles import VEHICLES, OtherVehicle, other_vehicle

__all__ = [
    "LISTED",
    "UNLISTED",
    "VEHICLES",
    "Campaign",
    "Executed",
    "OtherVehicle",
    "Planted",
    "Record",
    "RunPlan",
    "draw_campaign",
    "executed",
    "other_vehicle",
    "replayed",
    "simulate_run",
]
