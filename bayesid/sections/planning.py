"""Reports of comparing manoeuvres and of the next one: what each reveals, what to fly, and why.

Takes results of `bayesid.design`. Does not compute them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesid import report
from bayesid.design import Crossing, Knowledge, Plan, Richness
from bayesid.design.compare import Case
from bayesid.figures import design as figures
from bayesid.report import Block, Figure, Report, Section, Table, Text, literal

Array = np.ndarray
UNITS = {"m": (1.0, "m"), "rad": (180 / math.pi, "deg")}


@dataclass(frozen=True, eq=False)
class Comparison:
    """What `bayesid compare` found.

    Attributes
    ----------
    actual : (m, k) contraction of refits, rows as in `richness`; None if none was made
    inclusion : (m, k) SINDy's inclusion frequency, nan where it does not search a row; None if not asked
    crossing : None if not asked
    ranks : words -> rank correlation
    """

    case: Case
    richness: Richness
    flat: Mapping[str, Sequence[tuple[str, float]]]
    actual: Array | None
    inclusion: Array | None
    crossing: Crossing | None
    ranks: Mapping[str, float]
    refused: Mapping[str, str]
    notes: tuple[str, ...]
    seed: int
    draws: int
    refits: int


RICHNESS_COLUMNS = (
    "manoeuvre", "gain [nats]", "adds [nats]", "variance left", "directions", "condition", "best seen",
)  # fmt: skip


def richness_rows(known: Knowledge, found: Richness, best: int = 3) -> list[list[Any]]:
    """Rows of the table of manoeuvres, richest first."""
    rows = []
    for c, added in zip(found.criteria, found.added, strict=True):
        order = np.argsort(-c.contraction)[:best]
        seen = ", ".join(f"{known.names[i]} {c.contraction[i]:.0%}" for i in order if c.contraction[i] > 0.05)
        rows.append([c.name, c.gain, float(added), c.remaining, c.identified, c.condition_posterior, seen])
    return rows


def logger_words(case: Case) -> str:
    """The logger in one sentence."""
    parts = [f"{c} {_sigma(c, s)}" for c, s in case.logging.sigma.items()]
    return f"Readings every {case.logging.dt:.3g} s with white noise of {', '.join(parts)}."


def _sigma(channel: str, value: float) -> str:
    if channel in ("phi", "theta", "psi"):
        return f"{math.degrees(value):.3g} deg"
    if channel in ("p", "q", "r"):
        return f"{math.degrees(value):.3g} deg/s"
    return f"{value:.3g} {'m' if channel in 'xyz' else 'm/s'}"


def comparison_record(found: Comparison) -> dict[str, Any]:
    """The comparison as plain data."""
    known, names = found.case.knowledge, found.case.knowledge.names
    crossing = found.crossing
    return {
        "vehicle": found.case.model.vehicle.name,
        "digest": found.case.model.digest,
        "dof": found.case.model.dof,
        "seed": found.seed,
        "vehicles_drawn": found.draws,
        "refits": found.refits,
        "duration_s": found.case.bounds.duration,
        "logging": {"dt_s": found.case.logging.dt, "sigma_SI": dict(found.case.logging.sigma)},
        "notes": list(found.notes),
        "coefficients": {
            n: {"value_SI": float(m), "prior_sd_SI": float(s)}
            for n, m, s in zip(names, known.mean, known.sd, strict=True)
        },
        "manoeuvres": [
            {
                "name": c.name, "duration_s": c.duration, "gain_nats": c.gain, "adds_nats": float(added),
                "variance_left": c.remaining, "mean_log_eigenvalue": c.log_det,
                "trace_inverse": c.trace_inverse,
                "smallest_eigenvalue": c.weakest, "condition": c.condition,
                "condition_with_prior": c.condition_posterior, "identified_directions": c.identified,
                "contraction": dict(zip(names, c.contraction.tolist(), strict=True)),
                "contraction_refits": None if found.actual is None else dict(
                    zip(names, found.actual[i].tolist(), strict=True)),
                "sindy_inclusion": None if found.inclusion is None else dict(
                    zip(names, found.inclusion[i].tolist(), strict=True)),
                "left_open": [{"name": n, "sd_over_prior": s} for n, s in found.flat.get(c.name, ())],
            }
            for i, (c, added) in enumerate(zip(found.richness.criteria, found.richness.added, strict=True))
        ],
        "crossing": None if crossing is None else {
            "names": list(crossing.names), "predicted": crossing.predicted, "refits": crossing.actual,
            "prior": crossing.prior,
        },
        "rank_correlations": dict(found.ranks),
        "left_out": dict(found.refused),
    }  # fmt: skip


def comparison_report(found: Comparison) -> Report:
    """The report of a comparison as plain data."""
    best = found.richness.criteria[0]
    known = found.case.knowledge
    lead = (
        f"**{literal(best.name)} tells most about {literal(found.case.model.vehicle.name)}**: "
        f"{best.gain:.1f} nats, {best.remaining:.0%} of the variance of {len(known.names)} "
        "coefficients left, "
        f"{best.identified:.0f} of their {len(known.names)} directions determined better than before."
    )
    blocks: list[Block] = [
        Text(
            "Gain is the expected loss of uncertainty about all coefficients (Bayesian D), "
            "`adds` the same on "
            "top of the runs flown, `variance left` its mean share (A), `directions` how many combinations "
            "the run determines better than they were known, `condition` the modified E criterion with what "
            f"was known added. Expectations over {found.draws} drawn vehicles; the initial state "
            "of every run "
            f"is unknown. {logger_words(found.case)}"
        ),
        Table(RICHNESS_COLUMNS, richness_rows(known, found.richness), "Manoeuvres, richest first.", 3),
        *_list(found.notes),
    ]
    sections = [
        Section("What each manoeuvre tells", blocks),
        Section("Which coefficient is seen", _map(found)),
    ]
    rows = [
        [c.name, text, sd]
        for c in found.richness.criteria
        for text, sd in list(found.flat.get(c.name, ()))[:2]
    ]
    sections.append(
        Section(
            "What stays open",
            [
                Text(
                    "Combinations (each coefficient in units of its own spread before) that "
                    "keep most of theirs."
                ),
                Table(["after", "combination", "sd left / before"], rows, "Flattest two per manoeuvre.", 3),
            ],
        )
    )
    if found.crossing is not None:
        sections.append(Section("Identify on one, predict another", _cross(found.crossing)))
    if found.ranks:
        sections.append(
            Section(
                "Do the measures agree?",
                [
                    Table(
                        ["measures", "rank correlation"],
                        [[k, v] for k, v in found.ranks.items()],
                        "Spearman.",
                        2,
                    )
                ],
            )
        )
    if found.refused:
        sections.append(
            Section("Left out", [Table(["manoeuvre", "why"], [[k, v] for k, v in found.refused.items()])])
        )
    return Report(f"Manoeuvres compared: {literal(found.case.model.vehicle.name)}", lead, sections)


def _list(notes: Sequence[str]) -> list[Block]:
    return [Text("\n".join(f"- {literal(n)}" for n in notes))] if notes else []


def _map(found: Comparison) -> list[Block]:
    panels = {"expected from Fisher information": found.richness.contraction()}
    if found.actual is not None:
        panels["found by refits of virtual trials"] = found.actual
    if found.inclusion is not None:
        panels["inclusion frequency of SINDy (no model)"] = found.inclusion
    return [
        Text(
            "Contraction is 1 - posterior sd / prior sd: 0 for a coefficient the run says "
            "nothing about, 1 for one "
            "it fixes. Inclusion is how often sparse regression on the logged motion, which "
            "knows no prior, keeps "
            "the row; grey cells are rows it does not search."
        ),
        Figure(
            "contraction",
            figures.contraction_map(panels, found.richness.names, found.case.knowledge.names),
            "Manoeuvres down, coefficients across.",
        ),
    ]  # fmt: skip


def _cross(table: Crossing) -> list[Block]:
    panels = {"from information": table.predicted}
    if np.isfinite(table.actual).any():
        panels["by refits"] = table.actual
    rows = []
    shown = table.actual if np.isfinite(table.actual).any() else table.predicted
    off = table.others(shown)
    for i in np.argsort(off):
        worst = int(np.nanargmax(np.where(np.arange(len(off)) == i, np.nan, shown[i])))
        rows.append([table.names[i], float(off[i]), table.names[worst], float(shown[i, worst])])
    return [
        Figure("crossing", figures.cross_map(panels, table.names), "Rms error over sensor noise."),
        Table(
            ["identified on", "error over the others", "worst predicted", "error there"], rows,
            "Geometric mean over the other manoeuvres, in units of sensor noise.", 3,
        ),
    ]  # fmt: skip


def write_comparison(found: Comparison, folder: str | os.PathLike[str], record: Mapping[str, Any]) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    return report.write(comparison_report(found), folder, {"seeds": [found.seed], "comparison": record})


# ---- the next manoeuvre ----
def plan_record(case: Case, plan: Plan, seed: int, notes: Sequence[str]) -> dict[str, Any]:
    """The plan as plain data."""
    b = case.bounds
    track = plan.flight.track
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
            "gain_nats": None if plan.told is None else plan.told.gain,
            "contraction": None if plan.told is None else dict(
                zip(case.knowledge.names, plan.told.contraction.tolist(), strict=True)),
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


def candidate_rows(plan: Plan) -> list[list[Any]]:
    """Rows of the table of candidates, best first."""
    return [[c.name, c.kind, c.shown, plan.before] for c in plan.candidates]


def plan_report(case: Case, plan: Plan, notes: Sequence[str], table: str) -> Report:
    """The report of a plan as plain data; `table` is the name of the command table beside it."""
    best = plan.best
    rivals = [c for c in plan.candidates if c.kind == "library"]
    versus = f" The best manoeuvre of the library, {literal(rivals[0].name)}, reaches {rivals[0].shown:.3g}."
    lead = (
        f"**Fly "
        f"{'the designed manoeuvre (`' + table + '`)' if best.kind == 'designed' else literal(best.name)} "
        f"to {literal(plan.goal)}**: {literal(plan.unit)} {plan.before:.3g} before, "
        f"{best.shown:.3g} expected "
        f"after it.{versus if rivals and best.kind == 'designed' else ''}"
    )
    track = plan.flight.track
    b = case.bounds
    room = f"{np.ptp(track['x']):.0f} m north by {np.ptp(track['y']):.0f} m east"
    orders: list[Block] = [
        Text(
            f"`{table}` is the command table: every row holds until the next; positive rudder "
            "turns to port. It "
            f"lasts {b.duration:.0f} s, keeps the rudder within {math.degrees(b.rudder):.3g} deg and "
            f"{math.degrees(b.rate):.3g} deg/s, the shaft within {b.rpm[0]:.4g} to "
            f"{b.rpm[1]:.4g} rpm, and takes "
            f"the nominal vehicle over {room}. `bayesid simulate VEHICLE table:{table}` flies it."
        ),
        Figure(
            "orders",
            figures.orders(track.t, plan.flight.commands, {n: track[n] for n in "xyz" if n in track.names}),
            "Orders and the track of the nominal vehicle.",
        ),
    ]  # fmt: skip
    randoms = np.array([c.shown for c in plan.randoms])
    ranked: list[Block] = [
        Figure(
            "candidates",
            figures.candidates(
                [c.name for c in plan.candidates], np.array([c.shown for c in plan.candidates]), "designed",
                plan.unit, randoms,
            ),
            f"{plan.unit}, with each candidate flown; grey: {len(randoms)} random designs within the limits.",
        ),
        Table(CANDIDATE_COLUMNS, candidate_rows(plan), f"{plan.unit}; best first.", 3),
        Text(
            f"Judged on vehicles the search had not seen; {plan.search.evaluations} manoeuvres were tried. "
            f"{logger_words(case)}"
        ),
        *_list(notes),
    ]  # fmt: skip
    sections = [Section("The designed manoeuvre", orders), Section("Against the others", ranked)]
    if plan.choice is not None:
        steps = zip(plan.choice.names, plan.choice.values, strict=True)
        rows = [[k, name, value] for k, (name, value) in enumerate(steps, 1)]
        sections.append(
            Section(
                "If only standard manoeuvres can be flown",
                [
                    Table(
                        ["order", "manoeuvre", "after it"], rows, f"{plan.unit}; {plan.before:.3g} before.", 3
                    )
                ],
            )
        )
    if plan.told is not None:
        order = np.argsort(-plan.told.contraction)
        rows = [
            [case.knowledge.names[i], *(float(a[i]) for a in (
                plan.told.contraction, plan.told.contraction_low, plan.told.contraction_high))]
            for i in order
        ]  # fmt: skip
        sections.append(
            Section(
                "What the coefficients gain",
                [
                    Table(
                        ["coefficient", "contraction", "least", "most"], rows,
                        "1 - posterior sd / prior sd with the designed manoeuvre on top of the "
                        "runs flown; least and "
                        "most among the vehicles drawn.", 3,
                    )
                ],
            )
        )  # fmt: skip
    if plan.refused:
        sections.append(
            Section("Left out", [Table(["manoeuvre", "why"], [[k, v] for k, v in plan.refused.items()])])
        )
    return Report(f"Next manoeuvre for {literal(case.model.vehicle.name)}", lead, sections)


def write_plan(
    case: Case,
    plan: Plan,
    folder: str | os.PathLike[str],
    record: Mapping[str, Any],
    notes: Sequence[str],
    table: str,
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {"seeds": [record["seed"]], "design": record}
    return report.write(plan_report(case, plan, notes, table), folder, results)
