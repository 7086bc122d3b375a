"""The report of faults, kills, damaged inputs and sizes.

Takes the parts as plain data. Does not run anything.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.robustness.figures import cost_curves
from studies.robustness.kills import SIGNALS, WORKER
from studies.robustness.scaling_report import scaling_sections
from studies.robustness.sizes import SIZES

VEHICLES = "Zig-zags of generic_sub, planar"
SIZE_WORDS = (
    "Exit code 3 is an answer with a reservation: a fit that is not final, too little input for a "
    "diagnosis. Dense readings are averaged above 5000 (diagnose) and 100 000 samples (fit)."
)
# Two lengths between which the growth of memory is told.
LENGTHS = ("length 3 h, diagnose", "length 10 h, diagnose")
DONE = (
    "Each command runs once unbroken, on a bundle of two runs of 50 samples. Then it is started again in an "
    "empty folder, gets a signal (the whole process group) after a random share of that processor time, and "
    "the same line is run again. Its files are compared byte for byte, but for times. A task that loses "
    "three workers ends the command in a sentence, exit code 1: with four killed in a run that may be, with "
    "two it may not. Mutations are those of tests/fuzz; a warning counts as an escape. Memory is the peak "
    "of the process; times are those of the processor, on a machine of two cores with other work on it."
)


def robustness_report(found: Mapping[str, Mapping[str, Any]]) -> Report:
    """Report of all parts."""
    rows = {name: part["rows"] for name, part in found.items()}
    return Report("What is lost when something fails", _lead(rows), [
        Section("Commands killed", [_kills(rows["kills"]), Text(_earlier_kills(found["kills"]))]),
        Section("Faults of the machine", [_faults(rows["faults"])]),
        Section("Mutated inputs", [_fuzz(rows["fuzz"]), Text(_earlier_fuzz(found["fuzz"]))]),
        *scaling_sections(rows["scaling"]),
        Section("Sizes", _sizes(rows["sizes"])),
        Section("How it was done", [Text(f"{DONE} {_commits(found)}")]),
    ])  # fmt: skip


def _lead(rows: Mapping[str, Any]) -> str:
    kills, fuzz, faults = rows["kills"], rows["fuzz"], rows["faults"]
    workers = sum(r["sent"] for r in kills if r["fault"] == WORKER)
    sent, finished, same = (
        sum(r[k] for r in kills if r["fault"] != WORKER) for k in ("sent", "finished", "same")
    )
    runs, lived = (sum(r[k] for r in kills if r["fault"] == WORKER) for k in ("finished", "same"))
    tried, hung = (sum(r[k] for r in fuzz) for k in ("tried", "hung"))
    escaped = sum(len(r["escaped"]) for r in fuzz)
    good, all_faults = sum(r["ok"] for r in faults), len(faults)
    return (
        f"**{same} of {finished} commands that were killed and run again gave the files of the unbroken "
        f"one** ({sent} signals met them at work). {workers} workers were killed in {runs} runs, of which "
        f"{lived} gave the files of the unbroken one. {good} of {all_faults} faults of the machine ended as "
        f"they should. Of {tried} mutated inputs {escaped} escaped and {hung} gave no answer within a minute."
    )


def _commits(found: Mapping[str, Mapping[str, Any]]) -> str:
    told = ", ".join(f"{name} {' and '.join(part['commits']) or 'not run'}" for name, part in found.items())
    return f"The last commit of the package under each count: {told}."


def _earlier_kills(part: Mapping[str, Any]) -> str:
    """What was counted with earlier code, which the table leaves out."""
    told = []
    for commit, rows in part["earlier"].items():
        finished, same = (sum(r[k] for r in rows) for k in ("finished", "same"))
        told.append(f"{same} of {finished} the same ({commit})")
    return f"Not in the table, with earlier code: {'; '.join(told)}." if told else ""


def _earlier_fuzz(part: Mapping[str, Any]) -> str:
    told = [f"{sum(r['tried'] for r in rows)} ({commit})" for commit, rows in part["earlier"].items()]
    return f"Not in the table, with earlier code: {'; '.join(told)}." if told else ""


def _kills(rows: list[dict[str, Any]]) -> Table:
    keys = ("command", "fault", "sent", "finished", "same")
    order = {name: k for k, name in enumerate((*SIGNALS, WORKER))}
    rows = sorted(rows, key=lambda r: (r["fault"] == WORKER, r["command"], order.get(r["fault"], 9)))
    cells = [[*(r[k] for k in keys), "; ".join(r["wrong"]) or None] for r in rows]
    columns = ["command", "signal", "met at work", "run again", "same files", "wrong"]
    return Table(
        columns,
        cells,
        "Where workers were killed, the command itself ran on, or ended at a task that lost three.",
    )


def _faults(rows: list[dict[str, Any]]) -> Table:
    cells = [[r["fault"], r["command"], r["code"], r["ok"], r["words"]] for r in rows]
    return Table(["fault", "command", "exit code", "as it should", "last words"], cells, "Each tried once.")


def _fuzz(rows: list[dict[str, Any]]) -> Table:
    cells = [[r["kind"], r["tried"], r["refused"], r["hung"], len(r["escaped"])] for r in rows]
    return Table(
        ["input", "tried", "refused", "no answer", "escaped"], cells, "Mutated inputs by kind.", digits=6
    )


def _sizes(rows: list[dict[str, Any]]) -> list[Table | Figure | Text]:
    if not rows:
        return []
    keys = ("size", "command", "rows", "hours", "rate", "runs", "free", "code", "cpu", "mb", "words")
    columns = ["size", "command", "rows", "hours", "Hz", "runs", "free", "exit code", "CPU [s]", "peak [MB]",
               "last words"]  # fmt: skip
    order = {name: k for k, name in enumerate(SIZES)}
    rows = sorted(rows, key=lambda r: order.get(r["size"], len(order)))
    cells = [[r[k] or None if k in ("free", "words") else r[k] for k in keys] for r in rows]
    alt = "Processor time and peak memory of diagnose and fit over length, rate, runs and free coefficients"
    return [
        Figure("cost", cost_curves(rows), "One thing varied at a time; the others as in the table.", alt),
        Table(columns, cells, f"{VEHICLES}; hours are those of all runs together.", digits=4),
        Text(f"{SIZE_WORDS} {growth_words(rows)}".strip()),
    ]


def growth_words(rows: Sequence[Mapping[str, Any]]) -> str:
    """By how much memory of a diagnosis grows with a sample that is left; "" where it was not measured."""
    by_size = {r["size"]: r for r in rows}
    short, long = (by_size.get(name) for name in LENGTHS)
    if short is None or long is None or short["mb"] is None or long["mb"] is None:
        return ""
    each = 1e3 * (long["mb"] - short["mb"]) / (long["rows"] - short["rows"])
    return (
        f"Memory of a diagnosis is not flat in length: from {short['rows']} to {long['rows']} samples it "
        f"grows by {each:.0f} kB for every sample that is left, the paths of the model and how they move "
        "with state and inputs."
    )
