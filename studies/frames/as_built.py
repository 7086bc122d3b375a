"""Effects that free coefficients hide: what a clean identification of the vehicle as built makes of them.

Takes seeds. Plants one such effect per campaign on a vehicle whose coefficients an earlier identification
knows to one percent, and asks twice: with that knowledge (as-built frame) and with the spread its file states
(structure frame). Gives plain records and their scores. Does not write reports.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bayesid.benchmark.plant import VEHICLES, draw_campaign
from bayesid.benchmark.protocol.detectability import Detectability, detectability
from bayesid.benchmark.protocol.judgement import (
    CONFOUNDED_SHARE,
    DETECTABLE_NONCENTRALITY,
    ISOLABLE_NONCENTRALITY,
)
from bayesid.benchmark.protocol.scores import Quantity, at_least, at_most, average, share
from studies.frames.diagnose_campaign import aimed, diagnose_campaign, identify_only, plain

# Design note, section 5: absorbed by more than 0.98 under a prior of ten percent.
EFFECTS = (
    "thrust_loss",
    "hull_fouling",
    "ballast_mass",
    "cg_offset_x",
    "rudder_effectiveness",
    "added_mass_error",
)
AS_BUILT_SD, STATED_SD = (
    0.01,
    0.10,
)  # relative sd of the coefficients: as built, and as the vehicle file has it
NONCENTRALITY_RANGE = (30.0, 500.0)  # noncentrality in the as-built frame, log-uniform
FRAMES = {"as-built": AS_BUILT_SD, "structure": STATED_SD}


@dataclass(frozen=True)
class AsBuilt:
    """One campaign to make."""

    seed: int
    effect: str
    vehicle: str

    @property
    def name(self) -> str:
        return f"{self.seed}-{self.effect}-{self.vehicle}"


def as_built_tasks(count: int, seed: int) -> list[AsBuilt]:
    """Effects and vehicles in turn, so that each effect meets different vehicles."""
    return [AsBuilt(seed + k, EFFECTS[k % len(EFFECTS)], VEHICLES[k % len(VEHICLES)]) for k in range(count)]


def as_built_case(task: AsBuilt) -> dict[str, Any]:
    """Make the campaign, ask in both frames."""
    aim = float(np.exp(np.random.default_rng([task.seed, 9]).uniform(*np.log(NONCENTRALITY_RANGE))))

    def made(size: float) -> Any:
        return identify_only(draw_campaign(
            task.seed, effects=(task.effect,), vehicle=task.vehicle, dof=3, prior_sd=AS_BUILT_SD,
            sizes=(size, size)
        ))  # fmt: skip

    campaign = aimed(made, aim)
    # the bundle states the wide spread in both frames: the narrow one is what the engineer knows besides
    bundle = replace(campaign, prior_sd=STATED_SD)
    frames = {}
    for frame, known in FRAMES.items():
        shown = detectability(replace(campaign, prior_sd=known))
        asked = diagnose_campaign(bundle, shown, AS_BUILT_SD if frame == "as-built" else None)
        frames[frame] = {"shown": _plain(shown[0]), **plain(asked)}
    return asdict(task) | {
        "size": campaign.planted[0].size,
        "sensors": campaign.sensors,
        "sea": campaign.disturbance.sea,
        "campaign": "rich" if campaign.rich else "zig-zags",
        "frames": frames,
    }


def _plain(shown: Detectability) -> dict[str, Any]:
    return asdict(shown)


def counted(record: Mapping[str, Any]) -> bool:
    """Whether the effect shows as built and free coefficients hide it, by what is true of the campaign."""
    built, free = (record["frames"][f]["shown"] for f in FRAMES)
    return built["noncentrality"] >= DETECTABLE_NONCENTRALITY and free["absorbed"] > CONFOUNDED_SHARE


def as_built_scores(records: Sequence[Mapping[str, Any]]) -> list[Quantity]:
    """The row with a bar, what it leaves out, and the structure frame on the same campaigns."""
    chosen = [r for r in records if counted(r)]
    seen = [
        r for r in records if r["frames"]["as-built"]["shown"]["noncentrality"] >= DETECTABLE_NONCENTRALITY
    ]
    built, free = ([r["frames"][f] for r in chosen] for f in FRAMES)
    apart = [f for f in built if (f["shown"]["margin"] or 0.0) >= ISOLABLE_NONCENTRALITY]
    alone = [(f["alone"] or 0.0) > CONFOUNDED_SHARE for f in free]
    same = "the same campaigns"
    return [
        share("as built: top-1 by family", "hidden when free, D ≥ 25 as built",
              [f["right"] for f in built], at_least(0.9)),
        share("as built: top-1, isolable", "of these, margin ≥ 10", [f["right"] for f in apart]),
        share("as built: top-1, hidden or not", "all with D ≥ 25 as built",
              [r["frames"]["as-built"]["right"] for r in seen]),
        share("as built: named by the verdict", "hidden when free, D ≥ 25 as built",
              [f["names_it"] for f in built]),
        share("as built: wrong name", same, [f["outcome"] == "wrong name" for f in built]),
        share("as built: 95 % set holds it", same, [f["covered"] for f in built]),
        average("as built: families in the set", same, [float(f["size"]) for f in built]),
        average("as built: P(family)", same, [f["p_right"] for f in built]),
        share("free: top-1 by family", "the same campaigns; the control, must fail",
              [f["right"] for f in free], at_least(0.9)),
        share("free: hidden effect named alone", same, alone, at_most(0.0)),
        average("free: P(family)", same, [f["p_right"] for f in free]),
    ]  # fmt: skip
