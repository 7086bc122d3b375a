"""The report: errors of held-out runs by set of equations, and the marks that were set.

Takes the record of `run`. Does not compute a simulation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Report, Section, Table, Text, literal

SETS = {"published": "MMG as published", "mmg": "MMG fitted", "gertler_hagen": "Gertler-Hagen rows fitted",
        "mmg_all": "MMG fitted to all quadrants"}  # fmt: skip
TITLES = {"kvlcc2_hsva": "KVLCC2 (HSVA)", "esso_osaka": "Esso Osaka (pond)"}
MEASURES = {
    "psi": "heading [deg]", "r": "yaw rate [deg/s]", "position": "position [m]",
    "overshoot": "overshoot [deg]", "diameter": "diameter [%]", "drift": "drift [deg]",
}  # fmt: skip
#: what was asked of a fit: measure -> (mark, how runs are joined)
MARKS = {"overshoot": 1.5, "diameter": 5.0, "drift": 2.0}
SLOW = ("random", "berthing")
NOTE = (
    "`MMG as published` has the numbers of Yasukawa and Yoshimura (2015) for KVLCC2, with propeller, wake "
    "and resistance of the tested model, and of Miyauchi and others (2022) for Esso Osaka; without wind. In "
    "the fits the measured wind is given in every run of the pond. What the fit by MMG "
    "moves, and how much its readings count beside the prior, was chosen by runs left out in turn among "
    "those to identify; held-out runs were not read for it."
)


def models_report(record: Mapping[str, Any]) -> Report:
    """The report of all ships in the record."""
    sections = []
    for name, ship in record["ships"].items():
        sections.append(Section(TITLES[name], [*_marks(ship), *_runs(ship), *_fits(ship)]))
    lead = " ".join(_lead(name, ship) for name, ship in record["ships"].items())
    lead += (
        " Held-out runs are replayed with the logged rudder from their own first readings, in one go; "
        "nothing corrects the heading on the way, and an unstable ship doubles an error every few lengths."
    )
    thinned = [TITLES[name] for name, ship in record["ships"].items() if ship["quick"]]
    if thinned:
        lead += f" Every second sample of the logs was used (`--quick`): {', '.join(thinned)}."
    lead += "\n\n" + NOTE
    lead += "\n\n" + "\n\n".join(literal(ship["attribution"]) for ship in record["ships"].values())
    return Report("Two tankers by MMG and by Gertler-Hagen rows", lead, sections)


def joined(
    ship: Mapping[str, Any], key: str, measure: str, piece: bool = False, slow: bool = False
) -> tuple[float, int, int]:
    """Rms (marks) or median of a measure over held-out runs ahead, how many runs, and how many were lost."""
    rows = [
        row["errors"][key] for row in ship["runs"].values()
        if row["piece"] == piece and bool(row["manoeuvre"].startswith(SLOW)) == slow and key in row["errors"]
    ]  # fmt: skip
    values = [row[measure] for row in rows if measure in row]
    finite = [v for v in values if v is not None and math.isfinite(v)]
    if not finite:
        return math.nan, 0, len(values)
    size = np.sqrt(np.mean(np.square(finite))) if measure in MARKS else np.median(finite)
    return float(size), len(finite), len(values) - len(finite)


def _lead(name: str, ship: Mapping[str, Any]) -> str:
    words = []
    for measure, mark in MARKS.items():
        (mmg, n, _), (rows, _, _) = (joined(ship, key, measure) for key in ("mmg", "gertler_hagen"))
        if n:
            unit = " %" if measure == "diameter" else " degrees"
            verdict = "reached" if mmg <= mark else "missed"
            words.append(f"{measure} {mmg:.2g}{unit} (mark {mark:g}: {verdict}; rows {rows:.2g})")
    heading, rows = (joined(ship, key, "psi")[0] for key in ("mmg", "gertler_hagen"))
    words.append(f"heading {heading:.2g} degrees (median; rows {rows:.2g})")
    seconds = ship["sets"]["mmg"]["piece"]
    short = [joined(ship, key, m, True)[0] for m in ("psi", "position") for key in ("mmg", "gertler_hagen")]
    words.append(
        f"over {seconds:g} s {short[0]:.3g} degrees and {short[2]:.2g} m "
        f"(rows {short[1]:.3g} and {short[3]:.2g})"
    )
    lead = f"**{TITLES[name]}, MMG fitted: {', '.join(words)}.**"
    wide, runs, _ = joined(ship, "mmg_all", "psi", slow=True)
    if runs:
        place = joined(ship, "mmg_all", "position", slow=True)[0]
        (_, _, lost), given = (joined(ship, k, "psi", slow=True) for k in ("gertler_hagen", "published"))
        lead += (
            f" Fitted to all quadrants, it follows {runs} held-out random and berthing runs, of up to 17 "
            f"minutes, to {wide:.2g} degrees and {place:.2g} m (medians, in one go; published "
            f"{given[0]:.2g} degrees; rows fitted ahead leave all bounds in {lost} of them)."
        )
    return lead


def _marks(ship: Mapping[str, Any]) -> list[Any]:
    blocks = []
    ahead = "zig-zags and turns"
    for slow, runs in ((False, ahead), (True, "random four-quadrant and berthing runs")):
        for piece, words in ((False, "in one go"), (True, "in pieces, each from its own first readings")):
            table: list[list[Any]] = []
            for key, title in SETS.items():
                found = [joined(ship, key, measure, piece, slow) for measure in MEASURES]
                lost = found[0][2]
                if found[0][1] or lost:
                    table.append([title, *(size if n else None for size, n, _ in found), lost])
            if table:
                columns = [
                    "equations",
                    *(f"{m}{' rms' if k in MARKS else ''}" for k, m in MEASURES.items()),
                    "lost",
                ]
                text = f"Held-out {runs} {words}: medians of rms errors over runs that were not lost."
                blocks.append(Table(columns, table, text, 3))
    return blocks


def _runs(ship: Mapping[str, Any]) -> list[Any]:
    rows = []
    for name, row in ship["runs"].items():
        if not row["piece"]:
            cells = [" / ".join(_cell(row["errors"].get(key, {}), m) for key in SETS) for m in MEASURES]
            rows.append([name, row["manoeuvre"], row["seconds"], *cells])
    text = " / ".join(SETS.values()) + "; `lost` where the simulation left all bounds."
    return [Text(text), Table(["run", "manoeuvre", "time [s]", *MEASURES.values()], rows, "Run by run.", 3)]


def _cell(found: Mapping[str, Any], measure: str) -> str:
    if measure not in found:
        return "–"
    value = found[measure]
    return f"{value:.3g}" if value is not None and math.isfinite(value) else "lost"


def _fits(ship: Mapping[str, Any]) -> list[Any]:
    rows: Sequence[list[Any]] = [
        [SETS[key], found["unknowns"], found["status"]] for key, found in ship["sets"].items()
    ]
    blocks: list[Any] = [Table(["equations", "unknowns", "search"], rows, "The fits.", 3)]
    if "choice" in ship:
        measures = [m for m in MEASURES if any(m in row for row in ship["choice"]["tried"].values())]
        tried = [
            [key, *(row.get(m) for m in measures), row["score"]]
            for key, row in ship["choice"]["tried"].items()
        ]
        text = (
            "What a fit by MMG moves, tried on runs left out among those to identify, in two folds, whole "
            f"runs in one go. Taken: {ship['choice']['best']}. Score: mean of measures over their marks; a "
            "run that is lost counts as infinite."
        )
        blocks.append(Table(["moved", *(MEASURES[m] for m in measures), "score"], tried, text, 3))
    return blocks
