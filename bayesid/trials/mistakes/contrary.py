"""A measured angle, or number of revolutions, that is the mirror image of its own order.

Takes runs weighed as they are. Gives hypotheses: the reading has the wrong sign, or the order has. Which of
the two is told by the turn after the rudder, where there is one; else neither is told from the other.
Does not: judge an actuator whose order is near zero, or whose angle hardly moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.model.channels import channel
from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import Base, Weighed, weigh_one
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.trial import Floats, Run
from bayesid.words import and_list

SURE = 15.0  # nats of one run in which a reading follows its order, or the mirror image of it
# left beside the one, over left beside the other: a rudder that moves half of the time leaves 0.56
CLEAR = 0.6
# rms of an order from which on it is seen: of an angle beside its mean, which may be an offset
LEAST = {"rad": math.radians(1.0), "rpm": 10.0, "-": 0.1}


def contrary(base: Sequence[Base]) -> list[Weighed]:
    """Every actuator, and all of them together, whose reading is the mirror image of its order."""
    names = dict.fromkeys(name for one in base for name in one.run.measured_inputs)
    nats = {name: np.array([follows(one.run, name) for one in base]) for name in names}
    mirrored = [name for name in names if nats[name].min() < 0.0]
    groups = [(name,) for name in mirrored] + ([tuple(mirrored)] if len(mirrored) > 1 else [])
    return [
        _weighed(base, group, which, -np.sum([nats[name] for name in group], axis=0))
        for group in groups
        for which in ("measured", "ordered")
    ]


def _weighed(base: Sequence[Base], group: Sequence[str], which: str, gain: Floats) -> Weighed:
    """The hypothesis that these readings, or these orders, have the wrong sign."""
    end = "_cmd" if which == "ordered" else ""
    said, many = and_list(list(group)), len(group) > 1
    other = "orders" if which == "measured" else "readings"
    mistake = Mistake(
        f"sign of {', '.join(group)} as {which}",
        f"{said} as {which} {'have' if many else 'has'} the opposite sign, the mirror image of "
        f"{'their' if many else 'its'} {other if many else other[:-1]}",
        Correction(scale={name + end: -1.0 for name in group}),
        USUAL,
    )
    told = f"what is measured against what is ordered of {said}"
    known = weigh_one(base, mistake) or Weighed(mistake, np.zeros(len(base)), {})
    return Weighed(mistake, known.odds + gain, {told: gain, **known.gain}, known.levels)


def follows(run: Run, name: str) -> float:
    """Nats by which a reading is its order (above zero), or its mirror image (below); 0 where neither is
    seen."""
    read, order = run.measured_inputs.get(name), run.commands.get(f"{name}_cmd")
    if read is None or order is None:
        return 0.0
    good = np.isfinite(read) & np.isfinite(order)
    if good.sum() < 10:
        return 0.0
    read, order, unit = read[good], order[good], channel(name).unit
    if channel(name).circular:
        read, order = np.sin(read), np.sin(order)
    if unit == "rad":
        read, order = read - read.mean(), order - order.mean()
    if min(_rms(read), _rms(order)) < LEAST[unit]:
        return 0.0
    same, mirror = _rms(read - order), _rms(read + order)
    return SURE if same < CLEAR * mirror else -SURE if mirror < CLEAR * same else 0.0


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
