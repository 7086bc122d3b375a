"""The time in which a vehicle travels its length, where nobody states it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.trials.mistakes.judge import Base


def travel_time(base: Sequence[Base]) -> float | None:
    """Time to travel a length [s]: of the vehicle, or a fifth of the time of turning; None where unknown."""
    found = [one.travel for one in base if one.travel is not None]
    if found:
        return float(found[0])
    for one in base:
        psi = one.run.data.get("psi")
        rate = one.run.data.get("r")
        if rate is None and psi is not None:
            rate = np.gradient(psi, one.run.t)
        if rate is None:
            continue
        rms = float(np.sqrt(np.nanmean(rate**2)))
        if rms > 0:
            found.append(0.2 / rms)
    return float(np.median(found)) if found else None
