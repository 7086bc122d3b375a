"""A velocity log that reads the speed through the water for a stretch of a run: bottom lock lost.

Takes runs weighed as they are. Gives the hypothesis, whose mend leaves the velocities of the stretches out.
Does not: ask of a speed through the water, of velocities made from the track, or of a run without fixes; tell
a lost bottom from fixes that are pulled away evenly for as long.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.trials.correction import Correction
from bayesid.trials.kinematics.dead_reckoning import Difference, difference
from bayesid.trials.kinematics.derived_velocity import velocity_from_track
from bayesid.trials.kinematics.drifting_stretch import Stretch, drifting_stretch, walk_beside
from bayesid.trials.left_out import LeftOut
from bayesid.trials.mistakes.frozen import frozen_samples
from bayesid.trials.mistakes.judge import FOLLOWS, Base, Weighed
from bayesid.trials.mistakes.table import USUAL, Mistake
from bayesid.trials.trial import Run
from bayesid.words import and_list

# Nats a stretch has to explain, and has to explain beyond a jump, an offset of the fixes or a velocity that
# changes evenly. In 761 runs without a loss the best stretch explains up to 34 nats, as honest
# errors of other shapes do, but at most 1.6 beyond those rivals where it is above `SMALLEST`.
GAIN, BEYOND = 20.0, 8.0
# Of that, what velocities that change all over the run may explain beside the stretch, and by chance [nats]:
# more, and the velocity is no constant one between two edges. Ten free numbers explain 5 by chance.
LEFT, LEFT_BY_CHANCE = 0.2, 10.0
# Of the speed: below it scales that vary pass for a stretch; above it no vehicle is steered through a current
SMALLEST, LARGEST = 0.02, 0.6
# (m/s)^2 s over the squared speed: the least random walk that is usual, an error of 0.3 % that lasts a second
LEAST_WALK = 1e-5
MOST = 40.0  # nats of one run, as of a frozen column
MARGIN = 0.1  # of a stretch, by which the mend is wider at most
VELOCITIES = ("u", "v", "w")
READ = ("x", "y", "psi", "u", "v")  # that have to live


def lost_bottom(base: Sequence[Base]) -> list[Weighed]:
    """Whether the velocities are those through the water in stretches of some runs."""
    runs = [one.run for one in base]
    found = [_difference_of(one) for one in base]
    there = [d for d in found if d is not None]
    if not there or velocity_from_track(runs) is True:
        return []
    usual = float(np.median([walk_beside(d) for d in there]))
    told: dict[str, tuple[Run, Stretch]] = {}
    odds = np.zeros(len(base))
    for k, (run, d) in enumerate(zip(runs, found, strict=True)):
        if d is None:
            continue
        one = drifting_stretch(d, max(usual, LEAST_WALK * d.speed**2), 0.5 * GAIN)
        if one is not None and is_clear(one, d.speed):
            told[run.name], odds[k] = (run, one), min(MOST, one.gain)
    if not told:
        return []
    where = and_list([_words(run, one) for run, one in told.values()])
    says = (
        f"{where}: the velocity log seems to read the speed through the water there (bottom lock lost), or "
        "the fixes are pulled away (then leave out x and y instead)"
    )
    mend = Correction(leave_out=tuple(_left_out(run, one) for run, one in told.values()))
    return [Weighed(Mistake("bottom lock lost", says, mend, USUAL), odds, {"fixes": odds})]


def is_clear(one: Stretch, speed: float) -> bool:
    """Whether a stretch explains enough, is large enough, and nothing else explains as much."""
    return (
        one.gain >= GAIN
        and one.gain - one.rival >= BEYOND
        and one.left <= max(LEFT_BY_CHANCE, LEFT * one.gain)
        and SMALLEST * speed <= abs(one.velocity) <= LARGEST * speed
    )


def _difference_of(one: Base) -> Difference | None:
    """None too where track and velocities do not hold, or a column is frozen: another mistake tells."""
    track = one.held.get("track")
    if track is None or track.level > FOLLOWS or any(frozen_samples(one.run, name).any() for name in READ):
        return None
    return difference(one.run, one.travel)


def _words(run: Run, one: Stretch) -> str:
    digits = 0 if one.end - one.begin > 10.0 else 1
    towards = round(math.degrees(float(np.angle(one.velocity)))) % 360
    return (
        f"from {one.begin:.{digits}f} to {one.end:.{digits}f} s of {run.name} the fixes move on by "
        f"{abs(one.velocity):.2g} m/s towards {towards:03d} degrees more than the velocities say (fix noise "
        f"{one.noise:.2g} m)"
    )


def _left_out(run: Run, one: Stretch) -> LeftOut:
    """The stretch, wider by the time in which its velocity goes as far as a fix is noisy."""
    margin = min(one.noise / abs(one.velocity), MARGIN * (one.end - one.begin))
    names = tuple(name for name in VELOCITIES if name in run.data)
    return LeftOut(run.name, names, round(one.begin - margin, 2), round(one.end + margin, 2))
