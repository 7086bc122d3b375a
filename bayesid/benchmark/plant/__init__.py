"""An independent plant: vehicles with known faults, executed and logged for blind checks of the diagnosis.

Takes: a seed and factors. Gives campaigns, logs and their truth.
Does not: import effects, kernels, simulate or model (a contract in pyproject.toml): equations, servo, effects
and sensors are written anew, so that an error on either side shows.
"""

from bayesid.benchmark.plant.bundles import truth, write_bundle, write_pack
from bayesid.benchmark.plant.campaign import Campaign, Disturbance, Planted, still
from bayesid.benchmark.plant.draw import KINDS, SEAS, VEHICLES, draw_campaign
from bayesid.benchmark.plant.execute_campaign import (
    ExecutedCampaign,
    ExecutedRun,
    execute_campaign,
    true_response,
)
from bayesid.benchmark.plant.orders import RunPlan, ordered_run
from bayesid.benchmark.plant.sensing import SUITES
from bayesid.benchmark.plant.unlisted_causes import CASES

__all__ = [
    "CASES",
    "KINDS",
    "SEAS",
    "SUITES",
    "VEHICLES",
    "Campaign",
    "ExecutedCampaign",
    "ExecutedRun",
    "Planted",
    "RunPlan",
    "Disturbance",
    "draw_campaign",
    "execute_campaign",
    "ordered_run",
    "still",
    "true_response",
    "truth",
    "write_bundle",
    "write_pack",
]
