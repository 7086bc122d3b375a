"""A rudder that was logged with the other sign in some runs, as the turns of all runs together tell.

Takes runs weighed as they are. Gives hypotheses. Of a run alone a turn to one side tells little: wind or a
screw may make it. That the same rudder turns the vehicle to the other side in all others tells it plainly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.table import COMMON, Mistake
from bayesid.trials.rudder_sides import other_side

SURE = 20.0  # nats of one run on the other side than all others
TOLD = "the side to which the rudder turns in the other runs"


def sides(base: Sequence[Base]) -> list[Weighed]:
    """That the rudder of some runs has the opposite sign; nothing where all turn to one side."""
    other = other_side([one.run for one in base])
    if not other:
        return []
    mistake = Mistake(
        "sign of delta_r in some runs",
        "the rudder has the opposite sign of that in the other runs",
        Correction(scale={"delta_r": -1.0, "delta_r_cmd": -1.0}),
        COMMON,
    )
    gain = np.array([SURE if one.run.name in other else -SURE for one in base])
    return [Weighed(mistake, gain, {TOLD: gain}, {})]
