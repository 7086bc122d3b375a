"""Mistakes of the columns of a measured wind, of which not the channels of a log tell but how a ship moves.

A declaration each, as in `table`. Does not judge (`bayesid.diagnosis.input.measured_wind`).
"""

from __future__ import annotations

import math

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.table import RARE, USUAL, Mistake
from bayesid.trials.true_wind import APPARENT, APPARENT_BY_COMPASS, FROM_BOW

_KNOT = 1852.0 / 3600.0
_SPEED, _FROM = "wind_speed", "wind_from"

WIND_MISTAKES: tuple[Mistake, ...] = (
    Mistake(
        "wind_from: where it blows to",
        "wind_from is where the wind blows to, not where it comes from",
        Correction(offset={_FROM: math.pi}),
        USUAL,
    ),
    Mistake(
        "wind_from: from the bow",
        "wind_from counts from the bow and is read as from north",
        Correction(wind=FROM_BOW),
        USUAL,
    ),
    Mistake(
        "apparent wind",
        "the wind is the apparent one, past the moving vehicle and from the bow, and is read as the true one",
        Correction(wind=APPARENT),
        USUAL,
    ),
    Mistake(
        "apparent wind by compass",
        "the wind is the apparent one, past the moving vehicle, and is read as the true one",
        Correction(wind=APPARENT_BY_COMPASS),
        RARE,
    ),
    Mistake(
        "wind_from: from east",
        "wind_from counts from east towards north and is read as from north towards east",
        Correction(scale={_FROM: -1.0}, offset={_FROM: 0.5 * math.pi}),
        RARE,
    ),
    Mistake(
        "wind_speed: knots read as m/s",
        "wind_speed is in knots and read as m/s",
        Correction(scale={_SPEED: _KNOT}),
        USUAL,
    ),
    Mistake(
        "wind_speed: m/s read as knots",
        "wind_speed is in m/s and read as knots",
        Correction(scale={_SPEED: 1.0 / _KNOT}),
        RARE,
    ),
)
