"""The first screen of a design: what to run, how long, in how much room, and what it is worth.

Takes a `PlanningCase` and a `ManoeuvrePlan`. Gives sentences and blocks. Does not search or simulate.
"""

from __future__ import annotations

import math

import numpy as np

from bayesid.analysis.design import ManoeuvrePlan
from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.plan import CandidateManoeuvre
from bayesid.diagnosis.plain_words import number
from bayesid.report import manoeuvre_figures as figures
from bayesid.report.writer import Block, Figure, Section, Text

CLOSE = 1.05  # a design this near to a standard manoeuvre is not worth a table of its own
LITTLE = 0.03  # a change of the goal by less than this share is hardly one


def chosen(plan: ManoeuvrePlan) -> CandidateManoeuvre:
    """The manoeuvre to run: the best one, but a standard one where the design is hardly better."""
    library = [c for c in plan.candidates if c.kind == "library"]
    if plan.best.kind == "designed" and library and near(plan.best, library[0]):
        return library[0]
    return plan.best


def headline(case: PlanningCase, plan: ManoeuvrePlan, table: str) -> str:
    """What to run and what it is worth."""
    best, b = chosen(plan), case.bounds
    track = plan.execution.track
    room = f"{np.ptp(track['x']):.0f} m north by {np.ptp(track['y']):.0f} m east"
    if best.kind == "designed":
        what = (
            f"Run the designed manoeuvre, {table}: {b.duration:.0f} s, rudder within "
            f"{math.degrees(b.rudder):.3g} degrees, about {room}"
        )
    else:
        what = f"Run the standard manoeuvre {best.name} of the library (a run of up to {b.duration:.0f} s)"
    return f"{what}. {worth(plan, best)}"


def worth(plan: ManoeuvrePlan, best: CandidateManoeuvre) -> str:
    """The goal before, after it, and after its best rival."""
    said = f"It takes the {_unit(plan)} from {_value(plan, plan.before)} to {_value(plan, best.shown)}"
    rival = next((c for c in plan.candidates if c.name != best.name), None)
    if rival is None:
        return f"{said}."
    who = "designed one" if rival.kind == "designed" else f"best standard manoeuvre, {rival.name},"
    return f"{said}; the {who} to {_value(plan, rival.shown)}."


def _unit(plan: ManoeuvrePlan) -> str:
    if plan.unit.startswith("mean share of variance"):
        return "variance left in the combinations of coefficients that are open"
    return plan.unit


def _value(plan: ManoeuvrePlan, value: float) -> str:
    if plan.unit.startswith("mean share of variance"):
        return f"{100 * value:.3g} %"
    return number(value)


def cautions(plan: ManoeuvrePlan) -> list[str]:
    """Where the design does not deliver."""
    out = []
    if abs(plan.best.shown - plan.before) <= LITTLE * abs(plan.before):
        out.append(
            f"Nothing within these limits does much: {_value(plan, plan.before)} before, "
            f"{_value(plan, plan.best.shown)} after the best. Allow longer runs, more rudder or other "
            "speeds, or take for known what no run of this kind can tell (--fix)."
        )
    if plan.best.kind != "designed":
        out.append("The search found no manoeuvre that beats the standard ones.")
    elif chosen(plan) is not plan.best:
        out.append("The designed manoeuvre is hardly better than the standard one.")
    if plan.randoms and plan.best.value < max(c.value for c in plan.randoms):
        out.append("A random manoeuvre within the limits does better: search longer with --tries.")
    return out


def near(design: CandidateManoeuvre, rival: CandidateManoeuvre) -> bool:
    """Whether the two are within 5 % of each other, in the goal's unit."""
    a, b = sorted((abs(design.shown), abs(rival.shown)))
    return b <= CLOSE * a


def first_blocks(case: PlanningCase, plan: ManoeuvrePlan, table: str) -> list[Block]:
    """Orders and track, and what next."""
    track = plan.execution.track
    drawn = figures.orders(track.t, plan.execution.commands, {n: track[n] for n in "xyz" if n in track.names})
    if chosen(plan).kind == "designed":
        steps = [
            f"Load `{table}` into the autopilot, or steer by it: every row holds until the next, and a "
            "positive rudder turns to port, whatever the log counts.",
            f"`bayesid simulate VEHICLE table:{table}` runs it with another vehicle first; look at the room "
            "it takes if the coefficients are wrong.",
        ]
    else:
        steps = [
            f"`bayesid manoeuvre list` says how the {chosen(plan).name} is run. `{table}` and the picture "
            "are those of the designed manoeuvre, which is hardly better.",
        ]
    steps.append(
        "After the trial add the log to the bundle and run `bayesid fit` and `bayesid design` again."
    )
    return [
        Figure(
            "orders", drawn,
            "Orders over time, and the track the vehicle as given takes under them.",
            alt="Orders and track of the designed manoeuvre",
        ),
        Section("What to do next", [Text("\n".join(f"- {s}" for s in steps))]),
    ]  # fmt: skip
