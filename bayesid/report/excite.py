"""The report of an excitation: what was found, what cannot be told apart, what the vehicle file lacks.

Takes PySINDy's groups, an `Excitation` by stepwise selection and its JSON record. Does not compute.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bayesid.analysis.excitation import Excitation, RowSelection
from bayesid.analysis.excitation.pysindy_regression import TermGroup
from bayesid.analysis.excitation.row_selection import ENGINE
from bayesid.model.vehicles import Vehicle
from bayesid.report import coefficient_cells, writer
from bayesid.report import excite_figures as figures
from bayesid.report import excite_first_screen as screen
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal
from bayesid.trials import Trial
from bayesid.words import first_few

TERM_COLUMNS = (
    "term", "status", "inclusion", *coefficient_cells.COLUMNS, "sd [%]", "share of force", "margin",
    "or else",
)  # fmt: skip
_MANY = 3


def term_rows(
    found: Excitation, all_of_them: bool = False, vehicle: Vehicle | None = None
) -> list[list[Any]]:
    """Rows of `TERM_COLUMNS`: every column of the vehicle file or kept in a fifth of the draws.

    Without a vehicle there are no prime values.
    """
    return [
        _row(w, vehicle)
        for w in found.terms
        if all_of_them or w.in_model or w.inclusion >= 0.2 or w.status == "found"
    ]


def _row(w: RowSelection, vehicle: Vehicle | None) -> list[Any]:
    others = first_few((n for n in w.group if n != w.name), _MANY)
    margin = w.margin if w.margin > 0 else None
    known = math.isfinite(w.value)
    value = coefficient_cells.cells(vehicle, w.name, w.value) if known else [None] * 3
    spread = 100 * w.sd / abs(w.value) if known and w.value and math.isfinite(w.sd) else None
    return [w.name, w.status, w.inclusion, *value, spread, w.share, margin, others]


def finding(found: Excitation) -> list[str]:
    """What the runs say, in sentences."""
    seen = [w.name for w in found.terms if w.status == "found"]
    dead = [w.name for w in found.terms if w.status == "not excited"]
    out = [
        f"Needed by the regression whatever the other {len(found.terms) - 1} columns may be, nothing known "
        "of any coefficient: " + (", ".join(seen) or "no single term") + "."
    ]
    if found.groups:
        out.append("Cannot be told apart: " + "; ".join("{" + ", ".join(g) + "}" for g in found.groups) + ".")
    if dead:
        out.append("Not excited above the noise: " + ", ".join(dead) + ".")
    if found.out_of_plane:
        out.append(
            f"Outside the plane and so not excited at all: {len(found.out_of_plane)} rows of the force table."
        )
    out += screen.beyond(found)
    return out


def write_excitation_report(
    found: Excitation,
    trial: Trial,
    folder: str | os.PathLike[str],
    record: Mapping[str, Any],
    vehicle: Vehicle | None = None,
    groups: Sequence[TermGroup] = (),
    fisher: Mapping[str, tuple[float, str]] | None = None,
    notes: Sequence[str] = (),
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": trial.name,
            "trial_digest": trial.digest,
            "vehicle": found.vehicle,
            "model": found.model,
            "attribution": trial.attribution,
        },
        "seeds": [found.seed],
        "excitation": record,
    }
    return writer.write(excitation_report(found, trial, vehicle, groups, fisher, notes), folder, results)


def excitation_report(
    found: Excitation,
    trial: Trial,
    vehicle: Vehicle | None = None,
    groups: Sequence[TermGroup] = (),
    fisher: Mapping[str, tuple[float, str]] | None = None,
    notes: Sequence[str] = (),
) -> Report:
    """The report as plain data."""
    # names of the force table and our own words: no foreign text
    lead = "\n\n".join([screen.headline(groups), *screen.beyond(found)] if groups else finding(found))
    lead += "".join(f"\n\nFisher information: {literal(note)}." for note in notes)
    if trial.attribution:
        lead += f"\n\n{literal(trial.attribution)}"
    sections = [
        Section("Every term by stepwise selection", _free(found, vehicle)),
        Section("Beyond the vehicle file", _beyond(found, vehicle)),
        Section("How this was done", [Text(_method(found))]),
    ]
    title = f"Forces excited by {literal(trial.name)}"
    return Report(title, lead, sections, (), screen.first_blocks(groups, found, fisher or {}, vehicle))


def _free(found: Excitation, vehicle: Vehicle | None) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "Nothing is known of any coefficient here. A term is **found** if it is kept in at least 80 % of "
            "the bootstrap draws and every model without it loses at least 4.5 nats after the price of its "
            "columns; where such a model does as well, the terms it brings are listed and the answer is "
            "**cannot tell**."
        )
    ]
    for fit in found.axes:
        shown = [w for w in fit.selections if w.status != "not needed" or w.inclusion >= 0.2 or w.in_model]
        if not shown:
            continue
        blocks.append(
            Figure(
                f"inclusion_{fit.axis}",
                figures.inclusion(
                    [w.name for w in shown], [w.inclusion for w in shown], [w.status for w in shown]
                ),
                f"{fit.axis}: how often each term is kept. The selected terms explain {fit.explained:.2%} of "
                "the mean square of the force.",
            )
        )
    blocks.append(
        Table(
            TERM_COLUMNS,
            [[literal(r[0]), *r[1:-1], literal(r[-1])] for r in term_rows(found, vehicle=vehicle)],
            f"{coefficient_cells.FORM} sd: spread of bootstrap draws. Share: rms of the term's force over "
            "that of the axis.",
        )
    )
    return blocks


def _beyond(found: Excitation, vehicle: Vehicle | None) -> list[Block]:
    rows = [
        _row(w, vehicle)
        for fit in found.beyond
        for w in fit.selections
        if not w.in_model and (w.status not in ("not needed", "not excited") or w.inclusion >= 0.2)
    ]
    text = Text(
        "The vehicle's own terms stay in every model, within the prior of the vehicle file. What is taken "
        "up in addition is a candidate for a gap diagnosis, not a cause: a sensor or actuator error looks "
        "like a force here, and no sd below knows of it."
    )
    if not rows:
        return [text, Text("Nothing is taken up in addition.")]
    return [text, Table(TERM_COLUMNS, rows, f"Terms beyond the vehicle file. {coefficient_cells.FORM}")]


def _method(found: Excitation) -> str:
    return (
        f"Runs: {', '.join(literal(r) for r in found.runs)}. Velocities and accelerations come from a Kalman "
        "smoother that knows kinematics and the sensor noise. Columns are the rows of the force table, "
        "evaluated by the simulator's own kernel, and a few more; accelerations times inertia, the rigid "
        "body's and the vehicle file's added mass, are the target, because a balance with free inertia could "
        f"be scaled at will. Form: {found.form}; {found.draws} draws over stretches of six hull lengths "
        f"travelled; seed {found.seed}. {screen.METHOD} {ENGINE}"
    )
