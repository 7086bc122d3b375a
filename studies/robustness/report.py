"""The report of faults, kills, damaged inputs and sizes.

Takes the parts as plain data. Does not run anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bayesid.report.writer import Report, Section, Table, Text

USUAL = "three zig-zags"
DONE = (
    "Each command runs once unbroken, on a bundle of two runs of 50 samples. Then it is started again in an "
    "empty folder, gets a signal (the whole process group) after a random share of that processor time, and "
    "the same line is run again. Its files are compared byte for byte, but for times. Mutations are those of "
    "tests/fuzz; a warning counts as an escape. Memory is the peak of the process."
)


def robustness_report(found: Mapping[str, Mapping[str, Any]]) -> Report:
    """Report of all parts."""
    rows = {name: part["rows"] for name, part in found.items()}
    codes = ", ".join(f"{name} {part['code']}" for name, part in found.items())
    return Report("What is lost when something fails", _lead(rows), [
        Section("Commands killed", [_kills(rows["kills"])]),
        Section("Faults of the machine", [_faults(rows["faults"])]),
        Section("Mutated inputs", [_fuzz(rows["fuzz"])]),
        Section("Long logs", [_sizes(rows["sizes"])]),
        Section("How it was done", [Text(f"{DONE} State of the deciding code: {codes}.")]),
    ])  # fmt: skip


def _lead(rows: Mapping[str, Any]) -> str:
    kills, fuzz, faults = rows["kills"], rows["fuzz"], rows["faults"]
    sent, finished, same = (sum(r[k] for r in kills) for k in ("sent", "finished", "same"))
    tried, hung = (sum(r[k] for r in fuzz) for k in ("tried", "hung"))
    escaped = sum(len(r["escaped"]) for r in fuzz)
    good = sum(r["ok"] for r in faults)
    return (
        f"**{same} of {finished} commands that were killed and run again gave the files of the unbroken "
        f"one** ({sent} signals met them at work). {good} of {len(faults)} faults of the machine ended as "
        f"they should. Of {tried} mutated inputs {escaped} escaped and {hung} gave no answer within a minute."
    )


def _kills(rows: list[dict[str, Any]]) -> Table:
    keys = ("command", "fault", "sent", "finished", "same")
    cells = [[*(r[k] for k in keys), "; ".join(r["wrong"]) or None] for r in rows]
    return Table(["command", "signal", "met at work", "run again", "same files", "wrong"], cells, "Kills.")


def _faults(rows: list[dict[str, Any]]) -> Table:
    cells = [[r["fault"], r["command"], r["code"], r["ok"], r["words"]] for r in rows]
    return Table(["fault", "command", "exit code", "as it should", "last words"], cells, "Each tried once.")


def _fuzz(rows: list[dict[str, Any]]) -> Table:
    cells = [[r["kind"], r["tried"], r["refused"], r["hung"], len(r["escaped"])] for r in rows]
    return Table(
        ["input", "tried", "refused", "no answer", "escaped"], cells, "Mutated inputs by kind.", digits=6
    )


def _sizes(rows: list[dict[str, Any]]) -> Table:
    cells = [
        [
            r.get("log", USUAL),
            *(r[k] for k in ("command", "hours", "rate", "code", "cpu", "mb")),
            r["words"] or None,
        ]
        for r in rows
    ]
    columns = ["log", "command", "hours", "Hz", "exit code", "CPU [s]", "peak [MB]", "last words"]
    return Table(columns, cells, "Planar vehicles; hours are those of all runs together.", digits=4)
