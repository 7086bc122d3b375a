"""The first screen of an excitation: what the runs need, term by term or group by group, and how sure.

Takes PySINDy's `TermGroup`s, the stepwise `Excitation` and shares of Fisher information. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.analysis.excitation import Excitation
from bayesid.analysis.excitation.pysindy_regression import TermGroup
from bayesid.model.vehicles import Vehicle
from bayesid.report import coefficient_cells
from bayesid.report import excite_figures as figures
from bayesid.report.writer import Block, Figure, Table
from bayesid.words import first_few

COLUMNS = (
    "term or group", "PySINDy", "draws that keep it", "margin [nats]", "prime", "sd [%]", "share of force",
    "stepwise", "Fisher: the runs' share",
)  # fmt: skip
MOST_NAMED = 4
_BEYOND = "Beyond the vehicle file, its own terms held within their prior, the regression takes up"
_STAND_IN = (
    "The +- is the spread of bootstrap draws and leaves out error of the model: an effect the columns lack, "
    "or a sensor that errs, is shared out among them. `bayesid diagnose` puts them to the test."
)
METHOD = (
    "PySINDy: its FROLS proposes models on the weak form of the force balance, its STLSQ prunes them at 3.5 "
    "standard errors, and the size is chosen by evidence. Every draw resamples stretches of time, moves the "
    "velocities by errors of the size the smoother states, and the assumed added mass by its prior (10 % "
    "where "
    "none is stated). A term is found if 80 % of the draws keep it and the best model without it loses 4.5 "
    "nats; "
    "terms that can take its place within that are judged with it as a group, of which at least one is "
    "needed."
)


def headline(groups: Sequence[TermGroup]) -> str:
    """How much of the vehicle file the runs excite, in one sentence, then the names."""
    own = {s: [g for g in groups if g.in_model and g.status == s] for s in ("found", "cannot tell")}
    single = [g.names[0] for g in own["found"] if len(g.names) == 1]
    shared = [g for g in own["found"] if len(g.names) > 1]
    quiet = [n for g in groups if g.status in ("not needed", "not excited") for n in g.in_model]
    unsure = [n for g in own["cannot tell"] for n in g.in_model]
    count = sum(len(g.in_model) for g in groups)
    parts = [
        f"Of {count} terms of the vehicle file the runs show {len(single)} singly"
        + (f" ({', '.join(single)})" if single else "")
        + (f", and one or more of each of {'; '.join(_named(g) for g in shared)}" if shared else "")
        + "."
    ]
    if unsure:
        parts.append(f"They cannot tell whether {', '.join(unsure)} act.")
    if quiet:
        parts.append(f"Nothing is seen of {', '.join(quiet)}.")
    return " ".join(parts)


def beyond(found: Excitation) -> list[str]:
    """What the runs ask for beyond the vehicle file, by stepwise selection."""
    out = []
    if found.candidates:
        named = ", ".join(f"{w.name} = {w.value:.4g} +- {w.sd:.2g}" for w in found.candidates)
        out.append(f"{_BEYOND} {named}. {_STAND_IN}")
    if found.candidate_groups:
        sets = "; ".join("{" + ", ".join(g) + "}" for g in found.candidate_groups)
        out.append(f"It takes up one of each of these, without telling which: {sets}.")
    return out or [f"{_BEYOND} nothing."]


def group_rows(
    groups: Sequence[TermGroup],
    found: Excitation,
    fisher: Mapping[str, tuple[float, str]],
    vehicle: Vehicle | None,
    all_of_them: bool = False,
) -> list[list[Any]]:
    """Rows of `COLUMNS`: what is found, cannot be told, or stands in the vehicle file."""
    own = {w.name: w.status for w in found.terms}
    rows = []
    for g in groups:
        if not (all_of_them or g.in_model or g.status in ("found", "cannot tell")):
            continue
        spread = 100 * g.sd / abs(g.value) if math.isfinite(g.value) and g.value else None
        prime = coefficient_cells.prime(vehicle, g.names[0], g.value) if spread is not None else None
        shown = g.in_model or g.names
        rows.append(
            [
                _named(g), g.status, g.inclusion, g.margin if g.status != "not excited" else None, prime,
                spread, g.share, ", ".join(dict.fromkeys(own.get(n, "-") for n in shown)),
                ", ".join(f"{fisher[n][0]:.2f}" for n in shown if n in fisher) or None,
            ]
        )  # fmt: skip
    return rows


def first_blocks(
    groups: Sequence[TermGroup],
    found: Excitation,
    fisher: Mapping[str, tuple[float, str]],
    vehicle: Vehicle | None,
) -> list[Block]:
    """The table, and the bars of inclusion."""
    if not groups:
        return []
    rows = group_rows(groups, found, fisher, vehicle)
    shown = [g for g in groups if g.in_model or g.status in ("found", "cannot tell")]
    caption = (
        "Braces: terms that can stand in for one another. Stepwise: bayesid's own selection, for comparison. "
        "Fisher: share of the runs in the variance of each coefficient of the vehicle file when the whole "
        "tracks are fitted, 0 (the prior of 10 % or as stated decides) to 1 (the runs do). A term may be "
        "needed and "
        "its number stay unknown, or be too small to be needed and known well."
    )
    drawn = figures.inclusion(
        [_named(g) for g in shown], [g.inclusion for g in shown], [g.status for g in shown]
    )
    return [
        Table(COLUMNS, rows, caption, digits=3),
        Figure(
            "pysindy", drawn, "Share of draws in which PySINDy keeps a term, or one of a group; dotted: 80 %."
        ),
    ]


def _named(g: TermGroup) -> str:
    if len(g.names) == 1:
        return g.names[0]
    order = [*g.in_model, *(n for n in g.names if n not in g.in_model)]
    return "{" + first_few(order, MOST_NAMED) + "}"
