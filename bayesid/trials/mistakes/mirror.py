"""The mirror image of a log: heading, what follows it, and the rudder all count to the other side.

Against the track this is the same as y of the other sign, so that kinematics cannot tell the two; a compass
that counts anticlockwise leads to it, as the side of the rudder is then taken from the turns of that compass.
Takes runs weighed as they are. Does not: read what is known apart from the numbers (`handedness`).
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.trials.correction import Correction
from bayesid.trials.handedness import Handedness
from bayesid.trials.mistakes.judge import Base, Weighed, weigh_one
from bayesid.trials.mistakes.table import COMMON, RARE, USUAL, Mistake

MIRRORED = ("psi", "phi", "p", "r", "v", "v_water", "delta_r", "delta_r_cmd")
SECOND = -0.1  # nats: of two that are equally probable the one with fewer signs is said first


def mirrored(base: Sequence[Base], known: Handedness) -> list[Weighed]:
    """The mirror image weighed: nothing where no heading is logged."""
    there = {name for one in base for name in (*one.run.data, *one.run.commands, *one.run.measured_inputs)}
    names = tuple(name for name in MIRRORED if name in there)
    if "psi" not in names or not {"delta_r", "delta_r_cmd"} & set(names):
        return []
    alone = set(names) <= {"psi", "delta_r", "delta_r_cmd"}
    prior = (USUAL if alone else RARE) + (COMMON if known.side_stated else 0.0) + SECOND
    factors = ", ".join(f"{name} = -1" for name in names)
    one = weigh_one(
        base,
        Mistake(
            f"heading and side of the rudder mirrored ({factors})",
            "the heading counts anticlockwise, and the side of the rudder was taken from it",
            Correction(scale=dict.fromkeys(names, -1.0)),
            prior,
        ),
    )
    return [] if one is None else [one]
