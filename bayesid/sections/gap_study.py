"""The report of planted gaps: what was planted, what was said, how far the gap shrank.

Takes the rows of `studies/sim_to_real_gap.py`. Does not diagnose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report import Report, Section, Table, Text

_RIGHT = {"none": "none", "outside": "outside"}


def gap_report(rows: Sequence[Mapping[str, Any]]) -> Report:
    """Report of the planted campaigns as plain data."""
    judged = [(row, _judged(row)) for row in rows]
    right = sum(j == "right" for _, j in judged)
    wrong = sum(j == "wrong name" for _, j in judged)
    lead = (
        f"**{right} of {len(rows)} campaigns of an independent plant were diagnosed as planted; {wrong} "
        f"got a wrong "
        "name.** The plant shares no code with the diagnosed model; the diagnosis saw commands, noisy "
        "readings and the "
        "nominal vehicle only, and read the held-out runs after its verdict."
    )
    table = [
        [
            row["vehicle"],
            row["sea"],
            " + ".join(_words(n) for n in row["planted"]) or "nothing",
            row["found"]["verdict"],
            ", ".join(_words(n) for n in row["found"]["set95"]),
            _parameters(row["found"]),
            outcome,
        ]
        for row, outcome in judged
    ]
    ladder = []
    for row in rows:
        gap = row["found"]["gap"]
        worth = any(h["worth_shrinking"] for h in gap["horizons"])
        told = "nothing to shrink" if not worth or gap["shrink"] is None else f"{gap['shrink']:.1%}"
        ladder.append(
            [
                " + ".join(_words(n) for n in row["planted"]) or "nothing",
                gap["before_nominal"],
                gap["before"],
                gap["after"],
                told,
            ]
        )
    return Report(
        "Planted gaps, found and closed",
        lead,
        [
            Section(
                "What was planted and what was said",
                [
                    Table(
                        ["vehicle", "sea", "planted", "verdict", "95 % set", "parameters found", "outcome"],
                        table,
                        "An honest set that holds the cause counts as right; a wrong name is the worst "
                        "outcome.",
                    )
                ],
            ),
            Section(
                "How far the gap shrank on held-out runs",
                [
                    Text(
                        "Mean squared prediction error above the floor in noise variances, longest "
                        "horizon with a gap."
                    ),
                    Table(
                        ["planted", "nominal", "recalibrated", "with the effect", "shrinks by"],
                        ladder,
                        "Held-out runs.",
                    ),
                ],
            ),
        ],
    )


def _words(name: str) -> str:
    return name.replace("_", " ")


def _judged(row: Mapping[str, Any]) -> str:
    found, planted, kind = row["found"], set(row["planted"]), row["kind"]
    named = {e["name"] for e in found["effects"]}
    if kind in _RIGHT:
        if found["verdict"] == _RIGHT[kind]:
            return "right"
        return "wrong name" if found["verdict"] in ("effect", "several") else "not sure"
    if found["verdict"] in ("effect", "effect_with_remainder", "several"):
        if planted <= named:
            return "right"
        return "in part" if planted & named else "wrong name"
    return "right" if planted & set(found["set95"]) and "none" not in found["set95"] else "not found"


def _parameters(found: Mapping[str, Any]) -> str:
    parts = []
    for effect in found["effects"]:
        for name, p in effect["parameters"].items():
            unit = "" if p["unit"] == "-" else f" {p['unit']}"
            parts.append(f"{_words(name)} {p['value']:.3g} ± {p['sd']:.1g}{unit}")
    return "; ".join(parts)
