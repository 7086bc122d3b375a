"""The report of comparing manoeuvres: what each reveals, what stays open, which predicts which.

Takes results of `bayesid.analysis.design`. Does not compute them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.design import Crossing, Knowledge, Richness
from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.ridge_map import RidgeMap
from bayesid.analysis.design.run_selection import BestSet
from bayesid.analysis.excitation.row_selection import ENGINE
from bayesid.diagnosis.plain_words import number
from bayesid.report import manoeuvre_figures as figures
from bayesid.report import writer
from bayesid.report.manoeuvre_words import logger_words, note_blocks
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal
from bayesid.report.writer.text import table_text

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Comparison:
    """What `bayesid compare` found.

    Attributes
    ----------
    actual : (m, k) contraction of refits, rows as in `report`; None if none was made
    inclusion : (m, k) inclusion frequency of sparse regression, nan where it does not search a row; None if
        not asked
    crossing : None if not asked
    ranks : words -> rank correlation
    per_minute : (m, 3) nats per minute, least, mean, most of the vehicles drawn; rows as in `richness`
    ridges : what every manoeuvre leaves of coefficients that stand in for each other
    sets : best single run, pair and triple within `time` [s]
    """

    case: PlanningCase
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
    per_minute: Array
    ridges: RidgeMap
    sets: tuple[BestSet, ...] = ()
    time: float = math.inf


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


SET_COLUMNS = ("runs", "best set", "minutes", "adds [nats]", "least", "most", "variance left")


def set_rows(sets: Sequence[BestSet]) -> list[list[Any]]:
    """Rows of the table of the best single run, pair and triple."""
    return [
        [len(s.names), " + ".join(s.names), s.seconds / 60, s.adds[1], s.adds[0], s.adds[2], s.left]
        for s in sets
    ]


def set_lines(found: Comparison) -> list[str]:
    """The table of the best sets for a terminal, or why there is none."""
    if found.sets:
        return [table_text(SET_COLUMNS, set_rows(found.sets), digits=3)]
    shortest = min(c.duration for c in found.richness.criteria)
    return [f"No manoeuvre is as short as {found.time:.0f} s: the shortest takes {shortest:.0f} s (--time)."]


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
                "sparse_inclusion": None if found.inclusion is None else dict(
                    zip(names, found.inclusion[i].tolist(), strict=True)),
                "left_open": [{"name": n, "sd_over_prior": s} for n, s in found.flat.get(c.name, ())],
            }
            for i, (c, added) in enumerate(zip(found.richness.criteria, found.richness.added, strict=True))
        ],
        "crossing": None if crossing is None else {
            "names": list(crossing.names), "predicted": crossing.predicted, "refits": crossing.actual,
            "prior": crossing.prior,
        },
        "per_minute_nats": {
            n: {"least": float(r[0]), "mean": float(r[1]), "most": float(r[2])}
            for n, r in zip(found.richness.names, found.per_minute, strict=True)
        },
        "ridges": {
            f: {
                "coefficients": list(found.ridges.members[i]),
                "manoeuvres": {
                    n: {
                        "best": found.ridges.best[i][k], "best_sd_left": float(found.ridges.fixed[i, k]),
                        "worst": found.ridges.worst[i][k], "worst_sd_left": float(found.ridges.left[i, k]),
                    }
                    for k, n in enumerate(found.ridges.manoeuvres)
                },
            }
            for i, f in enumerate(found.ridges.families)
        },
        "best_sets": [
            {
                "manoeuvres": list(s.names), "seconds": s.seconds, "adds_nats": list(s.adds),
                "variance_left": s.left,
            }
            for s in found.sets
        ],
        "rank_correlations": dict(found.ranks),
        "left_out": dict(found.refused),
    }  # fmt: skip


def comparison_report(found: Comparison) -> Report:
    """The report of a comparison as plain data."""
    known = found.case.knowledge
    blocks: list[Block] = [
        Text(
            "Gain is the expected loss of uncertainty about all coefficients (Bayesian D), "
            "`adds` the same on "
            "top of the runs executed, `variance left` its mean share (A), `directions` how many "
            "combinations "
            "the run determines better than they were known, `condition` the modified E criterion with what "
            f"was known added. Expectations over {found.draws} drawn vehicles; the initial state "
            "of every run "
            f"is unknown. {logger_words(found.case)}"
        ),
        Table(RICHNESS_COLUMNS, richness_rows(known, found.richness), "Manoeuvres, richest first.", 3),
        *note_blocks(found.notes),
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
    title = f"Manoeuvres compared: {literal(found.case.model.vehicle.name)}"
    return Report(title, literal(headline(found)), sections, (), first_blocks(found))


def headline(found: Comparison) -> str:
    """Which manoeuvre teaches most in its time, and which ridge it leaves open."""
    single = next((s.names[0] for s in found.sets if len(s.names) == 1), found.richness.names[0])
    best = next(c for c in found.richness.criteria if c.name == single)
    left = next((s.left for s in found.sets if len(s.names) == 1), best.remaining)
    quick = int(np.argmax(found.per_minute[:, 1]))
    names = found.richness.names
    several = [s for s in found.sets if len(s.names) > 1]
    after = " on top of the runs executed" if found.case.executed else ""
    words = (
        f"The {best.name} teaches most{after}: after its {number(best.duration / 60)} minutes the "
        f"{len(found.case.knowledge.names)} coefficients keep {left:.0%} of their variance on average."
    )
    if names[quick] != best.name:
        words += f" Per minute the {names[quick]} teaches most."
    if several:
        best_of = "; ".join(
            f"best {'pair' if len(s.names) == 2 else 'triple'}: {', '.join(s.names)} ({s.left:.0%} left)"
            for s in several
        )
        words += f" {best_of[0].upper()}{best_of[1:]}."
    table = found.ridges
    if table.families:
        k = table.manoeuvres.index(best.name)
        i = int(np.argmax(table.left[:, k]))
        j = int(np.argmin(table.left[i]))
        words += (
            f" The {best.name} leaves {number(100 * table.left[i, k])} % of what was known along "
            f"{table.worst[i][k]} ({table.families[i]})"
        )
        words += (
            f"; the {table.manoeuvres[j]} leaves {number(100 * table.left[i, j])} % there."
            if j != k
            else ", and no other manoeuvre compared leaves less there."
        )
    return words


def first_blocks(found: Comparison) -> list[Block]:
    """Two figures: what each manoeuvre teaches per minute, and which ridge it closes."""
    order = np.argsort(-found.per_minute[:, 1])
    bars = figures.per_minute([found.richness.names[i] for i in order], found.per_minute[order])
    blocks: list[Block] = [
        Figure(
            "per_minute", bars,
            "What a minute of each manoeuvre teaches about all coefficients [nats]; whiskers: least and "
            "most of "
            f"{found.draws} vehicles drawn from what is known. All shown keep the limits; those that do "
            "not are "
            "listed under Left out.",
        )
    ]  # fmt: skip
    if found.sets:
        limit = f" within {found.time / 60:.3g} minutes" if math.isfinite(found.time) else ""
        blocks.append(
            Table(
                SET_COLUMNS, set_rows(found.sets),
                f"The single run, the pair and the triple of manoeuvres that teach most{limit}, on top of "
                "the runs executed; least and most of the vehicles drawn. A manoeuvre may come twice.", 3,
            )
        )  # fmt: skip
    table = found.ridges
    if table.families:
        drawn = figures.ridge_map(
            [f"{f}: {', '.join(m)}" for f, m in zip(table.families, table.members, strict=True)],
            table.manoeuvres, table.fixed, table.left,
        )  # fmt: skip
        blocks.append(
            Figure(
                "ridges",
                drawn,
                "Percent of the prior sd that each manoeuvre leaves: upper half along the combination of "
                "these "
                "coefficients it knows best, lower half along the one it knows least. Dark: known; light: "
                "open. A "
                "dark upper and a light lower half: the manoeuvre knows a sum and not its parts.",
            )
        )  # fmt: skip
    return blocks


def _map(found: Comparison) -> list[Block]:
    panels = {"expected from Fisher information": found.richness.contraction()}
    if found.actual is not None:
        panels["found by refits of virtual trials"] = found.actual
    if found.inclusion is not None:
        panels["inclusion frequency of sparse regression (no model)"] = found.inclusion
    return [
        Text(
            "Contraction is 1 - posterior sd / prior sd: 0 for a coefficient the run says "
            "nothing about, 1 for one "
            "it fixes. Inclusion is how often sparse regression on the logged motion, which "
            "knows no prior, keeps "
            f"the row; grey cells are rows it does not search. {ENGINE}"
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
    return writer.write(comparison_report(found), folder, {"seeds": [found.seed], "comparison": record})
