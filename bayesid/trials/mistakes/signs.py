"""Log evidence for the signs that any steered vehicle has: rudder to turn, turn to sway.

Takes a `Run`. A positive rudder turns to port; a hull that turns slides outwards, so that sway and yaw rate
have opposite signs near midship. The laws are coarse, so their evidence is tempered and bounded.
"""

from __future__ import annotations

import math
from collections.abc import Container

import numpy as np
from scipy.special import log_ndtr

from bayesid.trials.consistency import check_rudder
from bayesid.trials.trial import Run

# sign -> channels that turn it
SIGNS = {
    "rudder": frozenset({"delta_r", "delta_r_cmd", "psi", "r", "u"}),
    "sway": frozenset({"v", "r", "psi", "u", "v_water"}),
}
# Rudder and rate follow no first-order law: a t value counts as that much less.
RUDDER_TEMPER = 3.0
RUDDER_MOST = 10.0  # nats in one run
BOTH_SIDES = 0.1  # share of the time on either side: a single step tells its transient alone
SWAY_MOST = 2.0  # nats in one run: a sensor far ahead of the pivot point has the other sign
SWAY_CORRELATION = 0.5  # below it sway says nothing


def sign_evidence(run: Run, only: Container[str] = SIGNS) -> dict[str, float]:
    """Sign -> log probability that it is as it must be; "... against" of the contrary.

    Parameters
    ----------
    only : signs that are asked for
    """
    out: dict[str, float] = {}
    with np.errstate(all="ignore"):
        found = check_rudder(run) if "rudder" in only else None
        if found is not None and math.isfinite(found.t_value) and _both_sides(run):
            z = found.t_value / RUDDER_TEMPER
            out["rudder"] = max(float(log_ndtr(-z)), -RUDDER_MOST)
            out["rudder against"] = max(float(log_ndtr(z)), -RUDDER_MOST)
        sway = _sway(run) if "sway" in only else None
        if sway is not None:
            out["sway"], out["sway against"] = (min(0.0, -SWAY_MOST * s * sway) for s in (1.0, -1.0))
    return out


def _both_sides(run: Run) -> bool:
    rudder = run.input("delta_r")
    if rudder is None:
        return False
    least = 0.2 * float(np.max(np.abs(rudder)))
    return min(float(np.mean(rudder > least)), float(np.mean(rudder < -least))) >= BOTH_SIDES


def _sway(run: Run) -> float | None:
    """Correlation of sway and turn; None where it is faint or the vehicle goes astern."""
    side = next((k for k in ("v", "v_water") if k in run.data), None)
    along = run.data.get("u", run.data.get("u_water"))
    if side is None or along is None:
        return None
    known = along[np.isfinite(along)]
    if not known.size or not float(np.median(known)) > 0:
        return None
    if "r" in run.data:
        rate = run.data["r"]
    elif "psi" in run.data:
        rate = np.gradient(run.data["psi"], run.t)
    else:
        return None
    v = run.data[side]
    good = np.isfinite(v) & np.isfinite(rate)
    if good.sum() < 10 or not (np.std(v[good]) > 0 and np.std(rate[good]) > 0):
        return None
    correlation = float(np.corrcoef(v[good], rate[good])[0, 1])
    return correlation if abs(correlation) > SWAY_CORRELATION else None
