"""The report of the next manoeuvre: what to run, against which rivals, and what the coefficients gain.

Takes results of `bayesid.analysis.design`. Does not compute them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.design import ManoeuvrePlan
from bayesid.analysis.design.compare import PlanningCase
from bayesid.model.vehicles.orders import rudder_limits, rudders_together
from bayesid.report import design_first_screen as screen
from bayesid.report import manoeuvre_figures as figures
from bayesid.report import writer
from bayesid.report.manoeuvre_words import logger_words, note_blocks
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal


def plan_record(case: PlanningCase, plan: ManoeuvrePlan, seed: int, notes: Sequence[str]) -> dict[str, Any]:
    """The plan as plain data."""
    b = case.bounds
    track = plan.execution.track
    return {
        "vehicle": case.model.vehicle.name,
        "digest": case.model.digest,
        "dof": case.model.dof,
        "seed": seed,
        "goal": plan.goal,
        "unit": plan.unit,
        "before": plan.before,
        "best": {"name": plan.best.name, "kind": plan.best.kind, "after": plan.best.shown},
        "candidates": [{"name": c.name, "kind": c.kind, "after": c.shown} for c in plan.candidates],
        "random_designs": [c.shown for c in plan.randoms],
        "library_choice": None if plan.choice is None else {
            "order": list(plan.choice.names), "after_each": list(plan.choice.values),
        },
        "designed": {
            "gain_nats": None if plan.after is None else plan.after.gain,
            "contraction": None if plan.after is None else dict(
                zip(case.knowledge.names, plan.after.contraction.tolist(), strict=True)),
            "area_m": [float(np.ptp(track["x"])), float(np.ptp(track["y"]))],
            "evaluations": plan.search.evaluations,
        },
        "limits": {
            "duration_s": b.duration, "rudder_rad": b.rudder, "rate_rad_s": b.rate, "plane_rad": b.plane,
            "rpm": list(b.rpm), "box_m": None if math.isinf(b.box) else b.box,
            "depth_m": b.depth if case.model.dof == 6 else None,
        },
        "logging": {"dt_s": case.logging.dt, "sigma_SI": dict(case.logging.sigma)},
        "left_out": dict(plan.refused),
        "notes": list(notes),
    }  # fmt: skip


CANDIDATE_COLUMNS = ("manoeuvre", "kind", "with it", "before")


def candidate_rows(plan: ManoeuvrePlan) -> list[list[Any]]:
    """Rows of the table of candidates, best first."""
    return [[c.name, c.kind, c.shown, plan.before] for c in plan.candidates]


def _sense(case: PlanningCase) -> str:
    """Which way a positive rudder turns."""
    turns = {sign > 0.0 for sign in rudders_together(case.model.vehicle).values()} or {True}
    if len(turns) > 1:
        return "a positive rudder pushes along its direction in the vehicle file."
    return f"positive rudder turns to {'port' if turns == {True} else 'starboard'}."


def plan_report(case: PlanningCase, plan: ManoeuvrePlan, notes: Sequence[str], table: str) -> Report:
    """The report of a plan as plain data; `table` is the name of the command table beside it."""
    lead = " ".join(
        [f"**{literal(screen.headline(case, plan, table))}**", *map(literal, screen.cautions(plan))]
    )
    b = case.bounds
    stated = math.isfinite(rudder_limits(case.model.vehicle)[1])
    rate = f"The rudder moves at most {math.degrees(b.rate):.3g} deg/s. " if stated else ""
    orders: list[Block] = [
        Text(
            f"`{table}` is the command table; {_sense(case)} {rate}The shaft stays within "
            f"{b.rpm[0]:.4g} to {b.rpm[1]:.4g} rpm. "
            f"Goal: {literal(plan.goal)}."
        ),
    ]
    randoms = np.array([c.shown for c in plan.randoms])
    ranked: list[Block] = [
        Figure(
            "candidates",
            figures.candidates(
                [c.name for c in plan.candidates], np.array([c.shown for c in plan.candidates]), "designed",
                plan.unit, randoms,
            ),
            f"{plan.unit}, with each candidate executed; grey: {len(randoms)} random designs within the "
            f"limits.",
        ),
        Table(CANDIDATE_COLUMNS, candidate_rows(plan), f"{plan.unit}; best first.", 3),
        Text(
            f"Judged on vehicles the search had not seen; {plan.search.evaluations} manoeuvres were tried. "
            f"{logger_words(case)}"
        ),
        *note_blocks(notes),
    ]  # fmt: skip
    sections = [Section("How the designed manoeuvre is run", orders), Section("Against the others", ranked)]
    if plan.choice is not None:
        steps = zip(plan.choice.names, plan.choice.values, strict=True)
        rows = [[k, name, value] for k, (name, value) in enumerate(steps, 1)]
        sections.append(
            Section(
                "If only standard manoeuvres can be executed",
                [
                    Table(
                        ["order", "manoeuvre", "after it"], rows, f"{plan.unit}; {plan.before:.3g} before.", 3
                    )
                ],
            )
        )
    if plan.after is not None:
        order = np.argsort(-plan.after.contraction)
        rows = [
            [case.knowledge.names[i], *(float(a[i]) for a in (
                plan.after.contraction, plan.after.contraction_low, plan.after.contraction_high))]
            for i in order
        ]  # fmt: skip
        sections.append(
            Section(
                "What the coefficients gain",
                [
                    Table(
                        ["coefficient", "contraction", "least", "most"], rows,
                        "1 - posterior sd / prior sd with the designed manoeuvre on top of the "
                        "runs executed; least and "
                        "most among the vehicles drawn.", 3,
                    )
                ],
            )
        )  # fmt: skip
    if plan.refused:
        sections.append(
            Section("Left out", [Table(["manoeuvre", "why"], [[k, v] for k, v in plan.refused.items()])])
        )
    return Report(
        f"Next manoeuvre for {literal(case.model.vehicle.name)}", lead, sections,
        first=screen.first_blocks(case, plan, table),
    )  # fmt: skip


def write_plan(
    case: PlanningCase,
    plan: ManoeuvrePlan,
    folder: str | os.PathLike[str],
    record: Mapping[str, Any],
    notes: Sequence[str],
    table: str,
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {"seeds": [record["seed"]], "design": record}
    return writer.write(plan_report(case, plan, notes, table), folder, results)
