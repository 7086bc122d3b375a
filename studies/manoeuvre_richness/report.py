"""The report of the study of manoeuvre richness: what tells, what to run next, whether the advice held.

Takes the study's records (plain data). The sections themselves are in the modules `richness_*` beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bayesid.analysis.excitation.row_selection import ENGINE
from bayesid.report.writer import Report, Section, Table, Text, literal
from studies.manoeuvre_richness.sections import (
    contraction_blocks,
    logs_blocks,
    tell_blocks,
    vehicle_blocks,
    vertical_blocks,
)
from studies.manoeuvre_richness.summaries import paired_tests
from studies.manoeuvre_richness.targets import tell_targets, vehicle_targets


def richness_report(
    vehicles: Mapping[str, Any],
    level_motion: Mapping[str, Any],
    discrimination: Mapping[str, Any],
    logs: Mapping[str, Any],
    quick: bool,
) -> Report:
    """The report as plain data."""
    targets = [*vehicle_targets(vehicles, level_motion, logs), *tell_targets(discrimination)]
    missed = [row[0] for row in targets if not row[2]]
    lead = f"**{len(targets) - len(missed)} of {len(targets)} targets are met.** " + _finding(vehicles)
    if missed:
        lead += " Not met: " + "; ".join(literal(m) for m in missed) + "."
    if quick:
        lead += " Quick run: one vehicle, few draws; no conclusion."
    sections = [
        Section(
            "Targets",
            [Table(["target", "measured", "met"], targets, "Every number is of this run.", 3)],
        ),
        *[Section(f"{n}", vehicle_blocks(n, v)) for n, v in vehicles.items()],
        Section("Contraction: expected, refitted, sampled", contraction_blocks(vehicles)),
        Section("Two causes of a gap told apart", tell_blocks(discrimination)),
        Section("Vertical plane", vertical_blocks(level_motion)),
        *[Section(literal(v["title"]), logs_blocks(n, v)) for n, v in logs.items()],
        Section("What this does not show", [Text(LIMITS)]),
    ]
    return Report("Which manoeuvre tells what, and which to run next", lead, sections)


def _finding(vehicles: Mapping[str, Any]) -> str:
    """What designs brought, in one sentence of numbers."""
    parts = []
    for name, v in vehicles.items():
        worst = {goal: paired_tests(v, goal)[0] for goal in v["plans"]}
        words = ", ".join(f"to {g} {row[1]:.2f} times ({literal(row[0])})" for g, row in worst.items())
        parts.append(f"{name} {words}")
    return (
        "Left open by the posterior after the closest rival of each design, over that after the design "
        f"itself: {'; '.join(parts)}."
    )


LIMITS = (
    "- Noise is white and stated; forces of the sea and errors of the model cost information that is counted "
    "here.\n- Designs and their tests share the equations of motion: a coefficient the equations lack is not "
    "looked for by these criteria (that is what `bayesid excite` and `bayesid diagnose` are "
    "for).\n- The prior "
    "spread of 10 % per coefficient is assumed; another one changes the numbers, seldom the "
    "order.\n- Added mass "
    "X_udot, Y_vdot, N_rdot is taken as known: with it free every row of the equations can be scaled and no "
    "manoeuvre shows it.\n- Inclusion by sparse regression asks whether a row is needed, contraction whether "
    f"its number becomes known; they agree only in part. {ENGINE}"
)  # fmt: skip
