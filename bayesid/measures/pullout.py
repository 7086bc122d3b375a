"""Pull-out: whether a vehicle stops turning when the rudder comes amidships.

Takes: arrays t, psi and rudder of one run, simulated or logged (noise, NaN, uneven sampling).
Does not: need a track or velocities.

Definition: IMO Resolution MSC.137(76), section 2.2 and appendix; ITTC Recommended Procedure 7.5-04-02-01.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.measures.tools import channel, checked, orders, slope

DEG = math.pi / 180


@dataclass(frozen=True)
class PullOut:
    """Pull-out: yaw rate in the turn and what remains of it after rudder amidships [rad/s].

    Both are positive in the sense of the turn; a straight-line stable vehicle keeps nothing. `neutral` [rad]
    is the rudder of the approach, taken as amidships.
    """

    side: str
    execute: float
    turning_rate: float
    residual_rate: float
    neutral: float
    reasons: Mapping[str, str] = field(default_factory=dict)


def pull_out(t: np.ndarray, psi: np.ndarray, rudder: np.ndarray, settle: float = 0.5) -> PullOut:
    """Residual yaw rate after a turn, from the heading.

    Parameters
    ----------
    t, psi, rudder : (n,) array    time [s], heading [rad], rudder [rad]
    settle : share of the time after amidships left for the yaw rate to die out; the rest is averaged

    Returns
    -------
    PullOut    NaN with a reason if the rudder does not come back, or the rate has not settled (its change
    over the
               averaged part exceeds 2 % of the rate in the turn)
    """
    t, data = checked("pull-out", t, psi=psi, rudder=rudder)
    c = channel(t, data["rudder"])
    heading = channel(t, data["psi"], angle=True)
    largest = float(np.quantile(np.abs(c.y - np.median(c.y[:3])), 0.98)) if c.t.size else 0.0
    found = orders(c, max(0.5 * largest, 6 * c.sigma, 0.2 * DEG)) if c.t.size > 1 else []
    back = next((k for k, o in enumerate(found) if k and abs(o.after - found[0].before) < 0.2 * largest), 0)
    if not back:
        why = "no rudder order followed by rudder amidships"
        names = ("execute", "turning_rate", "residual_rate", "neutral")
        return PullOut(
            side="", reasons=dict.fromkeys((*names, "side"), why), **dict.fromkeys(names, math.nan)
        )
    release, neutral = found[back].t, found[0].before
    end = found[back + 1].t if len(found) > back + 1 else float(t[-1])
    begin = found[back - 1].t
    turning = heading.between(begin + 0.75 * (release - begin), release)
    after = heading.between(release + settle * (end - release), end)
    reasons: dict[str, str] = {}
    rate = slope(turning)
    sign = -1.0 if rate < 0 else 1.0
    if math.isnan(rate):
        reasons["turning_rate"] = "too few headings before the rudder came back"
    residual = slope(after)
    if math.isnan(residual):
        reasons["residual_rate"] = "too few headings after the rudder came back"
    else:
        middle = 0.5 * (after.t[0] + after.t[-1])
        early, late = slope(after.between(-math.inf, middle)), slope(after.between(middle, math.inf))
        # the slope of noisy headings over n samples and a span s is known to sigma*sqrt(12/n)/s
        blur = 6 * heading.sigma * math.sqrt(12 / (after.t.size / 2)) / (0.5 * (after.t[-1] - after.t[0]))
        if not abs(late - early) <= max(0.02 * abs(rate), blur):
            reasons["residual_rate"] = (
                f"the yaw rate still changes ({abs(early) / DEG:.3g} to "
                f"{abs(late) / DEG:.3g} deg/s); run on for longer"
            )
            residual = math.nan
    return PullOut("starboard" if sign > 0 else "port", release, abs(rate), sign * residual, neutral, reasons)
