"""An independent plant: vehicles with known faults, flown and logged for blind checks of the diagnosis.

Takes: a seed and factors. Gives campaigns, logs and their truth.
Does not: import effects, kernels, simulate or model (a contract in pyproject.toml): equations, servo, effects
and sensors are written anew, so that an error on either side shows.
"""

from bayesid.plant.campaign import Campaign, Planted, Weather, still
from bayesid.plant.draw import KINDS, SEAS, VEHICLES, draw_campaign
from bayesid.plant.flown import Flight, FlownRun, fly_campaign, true_response
from bayesid.plant.orders import RunPlan, ordered_run
from bayesid.plant.pack import truth, write_bundle, write_pack
from bayesid.plant.sensing import SUITES
from bayesid.plant.strangers import CASES

__all__ = [
    "CASES",
    "KINDS",
    "SEAS",
    "SUITES",
    "VEHICLES",
    "Campaign",
    "Flight",
    "FlownRun",
    "Planted",
    "RunPlan",
    "Weather",
    "draw_campaign",
    "fly_campaign",
    "ordered_run",
    "still",
    "true_response",
    "truth",
    "write_bundle",
    "write_pack",
]
