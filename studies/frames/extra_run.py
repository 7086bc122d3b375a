"""Look-alikes of a poor campaign: does the manoeuvre the diagnosis asks for tell them apart?

Takes seeds. Plants an effect that one zig-zag cannot tell from another, asks, runs one more run with the
same truth and fresh noise: the zig-zag again, or the first proposal of the diagnosis, cut to the same length.
Gives plain records and their scores. Does not write reports.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from bayesid.benchmark.plant import VEHICLES, Campaign, RunPlan, draw_campaign, execute_campaign, ordered_run
from bayesid.benchmark.plant.body import cruising_speed
from bayesid.benchmark.protocol.detectability import Detectability, detectability
from bayesid.benchmark.protocol.judgement import CONFOUNDED_SHARE, DETECTABLE_NONCENTRALITY
from bayesid.benchmark.protocol.make_pack import SIZE_RANGE, SIZE_TO_START
from bayesid.benchmark.protocol.scores import Quantity, at_least, at_most, average, share
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.manoeuvres import library
from studies.frames.diagnose_campaign import DiagnosedCampaign, aimed, diagnose_campaign, plain

# Design note, section 5: what a zig-zag alone does not tell apart; a sensor, an actuator with a look-alike.
EFFECTS = (
    "rudder_offset",
    "propeller_side_force",
    "rudder_asymmetry",
    "hull_asymmetry",
    "gyro_scale",
    "actuator_rate_limit",
)
# A still sea, which the bundle states: one run does not tell process noise from a gap, and what is asked is
# which gap. Coefficients are known to ten percent.
SEA, PRIOR = "still", 0.10
LEAST_NONCENTRALITY = 30.0  # least noncentrality to aim at
LENGTHS = 40.0  # of the zig-zag [L/U], as long as the library's
EXPECTED_MARGIN = 0.5  # expected margin [nats] over the nearest other family in the poor campaign
ALIKE_MARGIN = 5.0  # expected margin [nats] over the nearest other family below which two are a group
CAMPAIGNS_DRAWN = 8  # campaigns drawn until the effect is in a group
ARMS = {"first": "one zig-zag", "repeat": "zig-zag again", "proposed": "proposed run"}


@dataclass(frozen=True)
class ExtraRun:
    """One campaign to make; seeds count up until its effect is in an ambiguity group."""

    seed: int
    effect: str
    turn: int

    @property
    def name(self) -> str:
        return f"{self.seed}-{self.effect}"


def extra_run_tasks(replicates: int, seed: int, effects: Sequence[str] = EFFECTS) -> list[ExtraRun]:
    """Every effect as often as asked, each with a block of seeds of its own; all effects once, then again."""
    return [
        ExtraRun(seed + CAMPAIGNS_DRAWN * (i * replicates + k), effect, i + 2 * k)
        for k in range(replicates)
        for i, effect in enumerate(effects)
    ]


def extra_run_case(task: ExtraRun) -> dict[str, Any]:
    """Find a campaign in which the effect has a look-alike; ask after none and after either extra run."""
    tried = []
    for k in range(CAMPAIGNS_DRAWN):
        vehicle = VEHICLES[(task.turn + k) % len(VEHICLES)]
        seed = task.seed + k
        try:
            campaign, shown = level(partial(poor, task.effect, seed, vehicle))
        except BayesidError as error:
            tried.append({"seed": seed, "vehicle": vehicle, "left out": str(error)})
            continue
        if alike(shown[0]):
            return asdict(task) | {"tried": tried} | _asked(campaign, shown)
        tried.append({"seed": seed, "vehicle": vehicle, "left out": "no look-alike", **asdict(shown[0])})
    return asdict(task) | {"tried": tried, "arms": {}}


def poor(effect: str, seed: int, vehicle: str, size: float) -> Campaign:
    """One zig-zag of `LENGTHS`."""
    campaign = draw_campaign(
        seed, effects=(effect,), vehicle=vehicle, dof=3, sea=SEA, prior_sd=PRIOR, rich=False,
        sizes=(size, size),
    )  # fmt: skip
    zigzag = next(run for run in campaign.runs if run.kind == "zigzag")
    rpm = float(campaign.vehicle.rpm_ref or zigzag.rpm)
    seconds = LENGTHS * campaign.vehicle.L / cruising_speed(campaign.vehicle, rpm)
    zigzag = replace(
        zigzag,
        duration=min(zigzag.duration, math.floor(seconds / zigzag.dt) * zigzag.dt),
        manoeuvre=zigzag.manoeuvre.removesuffix(" repeat"),
    )
    return replace(campaign, runs=_named([zigzag]))


def level(make: Callable[[float], Campaign]) -> tuple[Campaign, tuple[Detectability, ...]]:
    """Campaign of the size at which the margin is about `EXPECTED_MARGIN`, and how plainly its effect then
    shows.

    Smaller sizes are told apart by no manoeuvre, larger ones without another. Margin and noncentrality are
    linear in the square of a small size; the size found is kept at a noncentrality of `LEAST_NONCENTRALITY`
    at least.
    """
    near, far = aimed(make, LEAST_NONCENTRALITY), make(SIZE_TO_START)
    a, b = detectability(near)[0], detectability(far)[0]
    x, y = near.planted[0].size ** 2, far.planted[0].size ** 2
    slope = (b.margin - a.margin) / (y - x) if y != x else 0.0
    wanted = x + (EXPECTED_MARGIN - a.margin) / slope if slope > 0.0 else x
    size = math.sqrt(min(max(wanted, x), SIZE_RANGE[1] ** 2))
    made = make(size)
    return made, detectability(made)


def alike(shown: Detectability) -> bool:
    """Whether an effect shows, is not hidden by coefficients, and has a look-alike of another family.

    What coefficients hide no manoeuvre reveals.
    """
    return (
        shown.noncentrality >= DETECTABLE_NONCENTRALITY
        and shown.absorbed <= CONFOUNDED_SHARE
        and shown.margin < ALIKE_MARGIN
    )


def _named(runs: Sequence[RunPlan]) -> tuple[RunPlan, ...]:
    return tuple(replace(run, name=f"r{k + 1}") for k, run in enumerate(runs))


def _asked(campaign: Campaign, shown: Sequence[Detectability]) -> dict[str, Any]:
    zigzag = campaign.runs[-1]
    first = diagnose_campaign(campaign, shown, plan_next=True)
    arms = {"first": _arm(first, shown[0], None)}
    again = replace(zigzag, manoeuvre=f"{zigzag.manoeuvre} repeat")
    arms["repeat"] = _with(campaign, again)
    proposal, refused = proposed(first, campaign, zigzag)
    # without a proposal that can be executed the engineer knows no more than before
    arms["proposed"] = _with(campaign, proposal) if proposal else arms["first"]
    return {
        "campaign_seed": campaign.seed,
        "vehicle": campaign.vehicle_name,
        "sensors": campaign.sensors,
        "size": campaign.planted[0].size,
        "zigzag": zigzag.manoeuvre,
        "proposals": list((first.verdict or {}).get("next_manoeuvre", ())),
        "refused": refused,
        "arms": arms,
    }


def _with(campaign: Campaign, run: RunPlan) -> dict[str, Any]:
    more = replace(campaign, runs=_named([*campaign.runs, run]))
    shown = detectability(more)
    return _arm(diagnose_campaign(more, shown), shown[0], run)


def _arm(asked: DiagnosedCampaign, shown: Detectability, run: RunPlan | None) -> dict[str, Any]:
    executed = {"manoeuvre": run.manoeuvre, "seconds": run.duration} if run else None
    return {"flown": executed, "shown": asdict(shown), **plain(asked)}


def proposed(asked: DiagnosedCampaign, campaign: Campaign, like: RunPlan) -> tuple[RunPlan | None, list[str]]:
    """First proposal the true vehicle can fly, no longer than `like`, and those it cannot."""
    refused: list[str] = []
    if asked.diagnosis is None:
        return None, refused
    known = manoeuvres_of(asked.diagnosis.model)
    for proposal in asked.diagnosis.result.next_manoeuvre:
        run = ordered_run(known[proposal.name], like, "next", longest=like.duration)
        try:
            execute_campaign(replace(campaign, runs=_named([*campaign.runs, run])))
        except BayesidError as error:
            refused.append(f"{proposal.name}: {error}")
            continue
        return replace(run, manoeuvre=proposal.name), refused
    return None, refused


def manoeuvres_of(model: Model) -> dict[str, Any]:
    """The library as the diagnosis sizes it for its proposals."""
    limit = float(min(model.nominal[model.index["limit_r"]], 0.6))
    return library(model.scales["L"], model.scales["U"], model.vehicle.rpm_ref or 1.0, limit, dof=model.dof)


def extra_run_scores(records: Sequence[Mapping[str, Any]]) -> list[Quantity]:
    """The row with a bar, for each arm."""
    chosen = [r["arms"] for r in records if r["arms"]]
    bars = {"first": at_most(0.6), "repeat": None, "proposed": at_least(0.9)}
    about = "D ≥ 25, margin < 5 after one"
    out = []
    for arm, words in ARMS.items():
        outcomes = [arms[arm] for arms in chosen]
        out += [
            share(f"{words}: top-1 by family", about, [a["right"] for a in outcomes], bars[arm]),
            average(f"{words}: P(family)", about, [a["p_right"] for a in outcomes]),
            average(f"{words}: families in the set", about, [float(a["size"]) for a in outcomes]),
            share(f"{words}: 95 % set holds it", about, [a["covered"] for a in outcomes]),
            share(f"{words}: named by the verdict", about, [a["names_it"] for a in outcomes]),
            share(f"{words}: wrong name", about, [a["outcome"] == "wrong name" for a in outcomes]),
        ]
    return out
