"""A speed along the track that is read as u, along the hull: in turns with drift the two differ.

Takes runs weighed as they are. Gives the hypothesis, whose mend leaves the column out.
Does not: ask of a run that logs the sway too, or tell the two where the vehicle does not drift.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.trials.correction import Correction
from bayesid.trials.kinematics.blocks import Blocks
from bayesid.trials.kinematics.relations import BLOCKS, FEWEST, READINGS, Joined
from bayesid.trials.mistakes.judge import Base, Weighed
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.trial import Run

TEMPER = 3.0  # residuals of neighbouring blocks are alike: a deviation counts as that much less
MOST = 10.0  # nats of one run
NEAR = 0.35  # of the way from along the track to along the hull, up to which it is along the track


def along_track(base: Sequence[Base]) -> list[Weighed]:
    """Whether u is the speed along the track, by all runs in which the vehicle drifts."""
    found = [share_of_hull(one.run) for one in base]
    odds = np.zeros(len(base))
    for k, one in enumerate(found):
        if one is not None:
            share, sd = one
            nats = min(MOST, 0.5 * abs(1.0 - 2.0 * share) / (TEMPER * sd) ** 2)
            odds[k] = nats if abs(share) < NEAR else -nats if share > 0.5 else 0.0
    if not odds.any():
        return []
    mistake = Mistake(
        "speed along the track as u",
        "u is the speed along the track, which in a turn is not that along the hull",
        Correction(drop=("u",)),
        USUAL,
    )
    return [Weighed(mistake, odds, {"u against the speed of the track in turns": odds})]


def share_of_hull(run: Run) -> tuple[float, float] | None:
    """Where u lies between the speed along the track (0) and along the hull (1), and its sd.

    None where sway is logged, or the vehicle does not drift.
    """
    series = Joined(run)
    if not series.has("x", "y", "psi", "u") or {"v", "v_water"} & set(run.data):
        return None
    blocks = Blocks(series.t, series.read("x", "y"), series.known("x", "y", "psi", "u"), BLOCKS, READINGS)
    if blocks.span.size < FEWEST + 3:
        return None
    moved = blocks.change(series["x"]) + 1j * blocks.change(series["y"])
    # over the integral of the heading's direction: of the chord of an arc the velocity on it
    velocity = moved / blocks.integral(np.exp(1j * series["psi"]))
    read = blocks.integral(series["u"]) / blocks.span
    track, hull = np.abs(velocity), velocity.real
    design = np.column_stack((track, hull - track))
    good = np.isfinite(design).all(axis=1) & np.isfinite(read)
    if good.sum() < FEWEST + 3:
        return None
    design, read = design[good], read[good]
    weights, _, rank, _ = np.linalg.lstsq(design, read, rcond=None)
    if rank < 2:
        return None
    left = read - design @ weights
    spread = float(np.linalg.inv(design.T @ design)[1, 1])
    sd = math.sqrt(max(float(left @ left) / (read.size - 2) * spread, 1e-6))
    return float(weights[1]), sd
