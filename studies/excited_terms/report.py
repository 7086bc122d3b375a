"""Counts and report of the excited terms: confusion matrices with intervals, and what the control says.

Takes the rows of every case. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from bayesid.report.writer import Report, Section, Table, Text

SHOWN = 12.25  # nats: two prices of a column, so that evidence alone would take it
VERDICTS = ("found", "found in a group", "cannot tell", "not needed", "not excited")
TRUTHS = ("absent", "acts, shows less", "acts and shows")
Row = Mapping[str, Any]


def verdict_of(row: Row) -> str:
    """PySINDy's verdict on one term."""
    return "found in a group" if row["pysindy"] == "found" and len(row["group"]) > 1 else str(row["pysindy"])


def stepwise_of(row: Row) -> str:
    """The verdict of stepwise selection, "uncertain" as "cannot tell"."""
    return "cannot tell" if row["stepwise"] == "uncertain" else str(row["stepwise"])


def plain_of(row: Row) -> str:
    """The control: kept by 80 % of PySINDy's ensemble of single rows."""
    return "found" if row["plain"] >= 0.8 else "not needed" if row["plain"] <= 0.2 else "cannot tell"


def truth_of(row: Row) -> str:
    return "absent" if not row["acts"] else TRUTHS[2] if row["shows"] >= SHOWN else TRUTHS[1]


def matrix(rows: Sequence[Row], judge: Callable[[Row], str]) -> dict[str, dict[str, int]]:
    """truth -> verdict -> count."""
    found = {t: dict.fromkeys(VERDICTS, 0) for t in TRUTHS}
    for row in rows:
        found[truth_of(row)][judge(row)] += 1
    return found


def interval(hits: int, count: int) -> str:
    """A share with its 95 % interval (Clopper-Pearson)."""
    if not count:
        return "none"
    low = beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return f"{hits} of {count} ({100 * hits / count:.0f} %; {100 * low:.0f} to {100 * high:.0f})"


def counted(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """All numbers of the report."""
    rows = [r for c in cases for r in c["terms"]]
    judges = {"PySINDy": verdict_of, "stepwise selection": stepwise_of, "control: plain ensemble": plain_of}
    groups = {
        (i, tuple(r["group"])): any(q["acts"] for q in c["terms"] if q["name"] in r["group"])
        for i, c in enumerate(cases)
        for r in c["terms"]
        if r["pysindy"] == "found" and len(r["group"]) > 1
    }
    values = [
        abs(r["value"] - r["true"]) / r["sd"] for r in rows
        if verdict_of(r) == "found" and r["acts"] and r["sd"]
    ]  # fmt: skip
    fisher = {}
    for low, high in ((0.0, 0.25), (0.25, 0.75), (0.75, 1.01)):
        some = [r for r in rows if r["acts"] and r["fisher"] is not None and low <= r["fisher"] < high]
        fisher[f"{low:g} to {min(high, 1):g}"] = {v: sum(verdict_of(r) == v for r in some) for v in VERDICTS}
    return {
        "terms": len(rows),
        "matrices": {name: matrix(rows, judge) for name, judge in judges.items()},
        "groups": {
            "found": len(groups),
            "with a term that acts": sum(groups.values()),
            "median size": float(np.median([len(names) for _, names in groups])) if groups else 0.0,
        },
        "values": {"within 3 sd": int(np.sum(np.array(values) <= 3)), "of": len(values)},
        "fisher": fisher,
        "seconds": {k: float(np.mean([c["seconds"][k] for c in cases])) for k in ("pysindy", "stepwise")},
    }


def excited_terms_report(cases: Sequence[Mapping[str, Any]], numbers: Mapping[str, Any]) -> Report:
    """The report as plain data."""
    lines = []
    for name, table in numbers["matrices"].items():
        named = sum(table[t]["found"] for t in TRUTHS)
        shown = sum(table["acts and shows"].values())
        caught = table["acts and shows"]["found"] + table["acts and shows"]["found in a group"]
        lines.append(
            f"- {name}: found singly and absent {interval(table['absent']['found'], named)}; of the terms "
            "that show, "
            f"found singly or in a group {interval(caught, shown)}."
        )
    g, v, s = numbers["groups"], numbers["values"], numbers["seconds"]
    lead = (
        f"{len(cases)} cases, {numbers['terms']} terms judged; 95 % intervals in brackets.\n\n"
        + "\n".join(lines)
        + f"\n\nGroups of which PySINDy says that one is needed hold a term that acts in "
        f"{interval(g['with a term that acts'], g['found'])}; half of them have at most {g['median size']:g} "
        "terms, so that a group found is a weaker statement than a term found. "
        f"Values of terms found singly lie within 3 of "
        "their "
        f"spreads in {interval(v['within 3 sd'], v['of'])}. Processor time a case: PySINDy "
        f"{s['pysindy']:.1f} s, "
        f"stepwise selection {s['stepwise']:.1f} s."
    )
    head = ["truth", *VERDICTS]
    sections = [
        Section(
            "Confusion matrices",
            [
                Text(
                    f"A term shows where who knows which others act would gain {SHOWN:g} nats and more by "
                    "it (Fisher "
                    "information of the force balance with its noise). The control resamples single rows and "
                    "thresholds single terms, as PySINDy's ensemble does by default; it must name terms "
                    "that are "
                    "absent."
                ),
                *(
                    Table(head, [[t, *(table[t][k] for k in VERDICTS)] for t in TRUTHS], name)
                    for name, table in numbers["matrices"].items()
                ),
            ],
        ),
        Section(
            "Beside Fisher information of the tracks",
            [
                Text(
                    "Terms that act, by the share of the runs in the variance of the coefficient when "
                    "whole tracks are "
                    "fitted with a prior of 10 %. The two ask different questions: a term may be needed "
                    "while its "
                    "number stays the prior's."
                ),
                Table(
                    ["share of the runs", *VERDICTS],
                    [[k, *(row[c] for c in VERDICTS)] for k, row in numbers["fisher"].items()],
                ),
            ],
        ),
        Section("By case", [Table(*_by_case(cases))]),
    ]
    return Report("Does PySINDy name the terms that act, and none that do not?", lead, sections)


def _by_case(cases: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    rows = []
    for c in cases:
        found = [r for r in c["terms"] if verdict_of(r) == "found"]
        absent = ", ".join(r["name"] for r in found if not r["acts"])
        rows.append([c["vehicle"], " + ".join(c["runs"]), c["truth"], len(found), absent or "none"])
    return ["vehicle", "runs", "truth", "found singly", "of these absent"], rows
