"""What ships are held to: the manoeuvring criteria of IMO Resolution MSC.137(76), section 5.3.

Takes: length and approach speed. Does not: apply to submarines or AUVs; they serve as orientation there.
"""

from __future__ import annotations

import math

DEG = math.pi / 180


def imo_limits(L: float, U: float) -> dict[str, float]:
    """Largest values allowed to a ship of 100 m or more.

    Parameters
    ----------
    L, U : length between perpendiculars [m], test speed [m/s]

    Returns
    -------
    dict    advance, tactical_diameter, initial_turning_distance [m]; first and second overshoot of the 10/10
    and
            first of the 20/20 zig-zag [rad]
    """
    ratio = L / U
    first = 10.0 if ratio < 10 else 20.0 if ratio >= 30 else 5 + 0.5 * ratio
    second = 25.0 if ratio < 10 else 40.0 if ratio >= 30 else 17.5 + 0.75 * ratio
    return {
        "advance": 4.5 * L,
        "tactical_diameter": 5.0 * L,
        "initial_turning_distance": 2.5 * L,
        "overshoot_10_10_first": first * DEG,
        "overshoot_10_10_second": second * DEG,
        "overshoot_20_20_first": 25.0 * DEG,
    }
