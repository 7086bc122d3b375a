"""How large a diagnosis took the environment to be, over what it was.

Takes an `Answer` of the plant and a verdict. Gives a ratio. A cause that acts in straight runs too (a vortex,
a moment that is always there) is measured as process noise: this is where that shows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.benchmark.plant.body import cruising_speed
from bayesid.benchmark.protocol.answers import Answer
from bayesid.errors import BayesidError
from bayesid.model.vehicles import load_vehicle

OVERESTIMATED_FROM = 2.0
PLANT_AXES, AXES = "XYNZM", {3: "XYN", 6: "XYZKMN"}


def noise_overestimate(answer: Answer, verdict: Mapping[str, Any]) -> dict[str, float]:
    """Axis -> disturbance in the verdict over the true one; empty where either is unknown."""
    true = (answer.source.get("environment") or {}).get("force_rms")
    force_stated = (verdict.get("environment") or {}).get("force")
    dof = int(answer.factors.get("dof") or 3)
    if not true or not any(true) or not force_stated or len(force_stated) != len(AXES[dof]):
        return {}
    try:
        v = load_vehicle(answer.factors["vehicle"])
    except (BayesidError, KeyError):
        return {}
    force = 0.5 * v.rho * v.L**2 * cruising_speed(v, float(v.rpm_ref or math.nan)) ** 2
    unit = {a: force * (1.0 if a in "XYZ" else v.L) for a in PLANT_AXES}
    level = dict(zip(AXES[dof], force_stated, strict=True))
    amplitude = dict(zip(PLANT_AXES, true, strict=True))
    return {
        a: float(level[a]) / (amplitude[a] * unit[a])
        for a in PLANT_AXES
        if a in level and amplitude[a] > 0 and np.isfinite(unit[a])
    }


def largest_overestimate(answer: Answer, verdict: Mapping[str, Any]) -> str:
    """Words for an environment more than twice overestimated or too quiet, "" where it was about right."""
    ratio = noise_overestimate(answer, verdict)
    if not ratio:
        return ""
    high, low = max(ratio, key=lambda a: ratio[a]), min(ratio, key=lambda a: ratio[a])
    if ratio[high] > OVERESTIMATED_FROM:
        return f"disturbance in {high} taken {ratio[high]:.2g} times overestimated"
    if ratio[low] < 1.0 / OVERESTIMATED_FROM:
        return f"disturbance in {low} taken {1.0 / max(ratio[low], 1e-6):.2g} times too quiet"
    return ""
