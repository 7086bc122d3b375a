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
    lead = f"**{len(targets) - len(missed)} of {len(targets)} targets are met.** "
    if missed:
        lead += "Not met: " + "; ".join(literal(m) for m in missed) + ". "
    lead += "\n\n".join(filter(None, (_of_logs(logs), _finding(vehicles))))
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
    """What designs brought: expected, really made by the independent plant, and where they lose."""
    parts = []
    for name, v in vehicles.items():
        count = len(v["test"]["left"][0])
        for goal in v["plans"]:
            pairs = paired_tests(v, goal)
            worst = pairs[0]
            lost = [
                f"{literal(r[0])} ({r[4]:.2f} times, won {round(r[5] * count)} of {count})"
                for r in pairs
                if r[4] < 1 or r[5] < 0.5
            ]
            parts.append(
                f"- {name}, to {goal}: the closest rival ({literal(worst[0])}) is expected to leave "
                f"{worst[1]:.2f} times what the design leaves; the error really made with it is "
                f"{worst[4]:.2f} times the design's, which wins {round(worst[5] * count)} of {count} true "
                f"vehicles. The design loses against {', '.join(lost) or 'none'}."
            )
    return (
        "What a design is expected to bring, and what it brought: medians over true vehicles that the "
        "independent plant executes, against every rival of the same length.\n\n" + "\n".join(parts)
    )


def _of_logs(logs: Mapping[str, Any]) -> str:
    """Does a richer real run predict the others better, and could one see it."""
    parts = []
    for v in logs.values():
        told = v["likelihoods"]["composite"]
        gain, theory = told["ranks"]["gain"], told["theory"]["gain"]
        error = told["ranks"]["expected error"]
        parts.append(
            f"{literal(v['title'])}: {gain['made']:.2f}, where posteriors that are exactly right would give "
            f"{theory[1]:.2f} ({theory[0]:.2f} to {theory[2]:.2f}); by the expected error of the others "
            f"{error['made']:.2f}"
        )
    return (
        f"Rank correlation of the information of a real run with the error it makes of the others: "
        f"{'; '.join(parts)}. So a target of 0.5 asks more of a dozen runs than theory does."
        if parts
        else ""
    )


LIMITS = (
    "- Noise is white and stated; forces of the sea and errors of the model cost information that is counted "
    "here.\n- The plant that executes the paired test shares the rows of forces: a coefficient the equations "
    "lack is not looked for by these criteria (that is what `bayesid excite` and `bayesid diagnose` are "
    "for).\n- The prior "
    "spread of 10 % per coefficient is assumed; another one changes the numbers, seldom the "
    "order.\n- Added mass "
    "X_udot, Y_vdot, N_rdot is taken as known: with it free every row of the equations can be scaled and no "
    "manoeuvre shows it.\n- Inclusion by sparse regression asks whether a row is needed, contraction whether "
    f"its number becomes known; they agree only in part. {ENGINE}"
)  # fmt: skip
