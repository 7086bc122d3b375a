"""The report of one log at several sampling rates.

Takes records as plain data (`studies.sampling_rate.thinned`). Does not score beyond counting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Report, Section, Table, Text
from studies.sampling_rate.thinned import disjoint, wrong


def sampling_rate_report(records: Sequence[Mapping[str, Any]]) -> Report:
    """Report of all campaigns."""
    return Report("One log at several sampling rates", _lead(records), [
        Section("Verdicts", [_table(records)]),
        Section("How it was done", [Text(
            "Campaigns of the independent plant, executed once at 10 Hz with white sensor noise, a calm sea "
            "and full sensors. The very same readings are then thinned: every second, fifth or tenth one is "
            "kept, and commands keep the times at which they switched. What was planted is known here, not "
            "to the diagnosis. Held-out runs are left out: no verdict reads them before it stands."
        )]),
    ])  # fmt: skip


def _lead(records: Sequence[Mapping[str, Any]]) -> str:
    apart = [r for r in records if disjoint(r["rates"])]
    count = sum(len(r["rates"]) for r in records)
    false = sum(len(wrong(r)) for r in records)
    same = sum(len({(x["word"], tuple(sorted(x["named"]))) for x in r["rates"]}) == 1 for r in records)
    failed = sum(bool(x["failure"]) for r in records for x in r["rates"])
    text = (
        f"**Of {len(records)} campaigns {len(apart)} got two names that contradict one another at two "
        f"sampling rates** (bar: none); {same} got the same verdict at every rate. Of {count} verdicts "
        f"{false} named a cause that was not planted."
    )
    return text + (f" {failed} diagnoses ended in an error." if failed else "")


def _table(records: Sequence[Mapping[str, Any]]) -> Table:
    intervals = [x["interval"] for x in records[0]["rates"]] if records else []
    columns = ["planted", "vehicle", "L/U [s]", *(f"{1 / i:.3g} Hz" for i in intervals), "CPU [s]"]
    rows = []
    for r in records:
        rows.append([
            " + ".join(r["causes"]).replace("_", " ") or "none", r["vehicle"], r["length_time"],
            *(_said(x) for x in r["rates"]), " / ".join(f"{x['cpu_seconds']:.0f}" for x in r["rates"]),
        ])  # fmt: skip
    return Table(
        columns, rows,
        "Verdict at every rate, with the probability that what is named acts; (readings coarse) where the "
        "report says that they are too far apart for the rudder. CPU seconds in the order of the rates.",
        digits=2,
    )  # fmt: skip


def _said(x: Mapping[str, Any]) -> str:
    if x["failure"]:
        return f"error: {x['failure']}"
    names = ", ".join(f"{n.replace('_', ' ')} ({x['acting'][n]:.2f})" for n in x["named"])
    word = x["word"].replace("_", " ")
    small = [n.replace("_", " ") for n in x["set95"]] if x["word"] == "ambiguous" else []
    some = f" {{{', '.join(small[:3])}{', ...' if len(small) > 3 else ''}}}" if small else ""
    return (f"{word}: {names}" if names else word + some) + (" (readings coarse)" if x["coarse"] else "")
