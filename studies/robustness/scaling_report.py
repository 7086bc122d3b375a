"""The section on one machine and many: measured, and what follows for a hundred machines.

Takes rows of `scaling_row`. Does not run anything.
"""

from __future__ import annotations

from typing import Any

from bayesid.report.writer import Section, Table, Text
from studies.robustness.scaling import DASK, HERE, KILLED, WAYS

EMPTY, PACK, REPLICATES = "500 tasks without work", "pack of 40 bundles", "64 calibration replicates"
MACHINES, CORES, BUNDLES = 100, 8, 10_000  # a cluster on paper
USUAL = 20.0  # s of processor time of a planar diagnosis of an hour at 1 Hz, with its report


def scaling_sections(rows: list[dict[str, Any]]) -> list[Section]:
    """None where nothing was measured."""
    if not rows:
        return []
    order = {name: k for k, name in enumerate((REPLICATES, PACK, EMPTY))}
    ways = {way: k for k, way in enumerate(WAYS)}
    rows = sorted(rows, key=lambda r: (order.get(r["work"], 9), ways.get(r["way"], 9)))
    return [Section("From one process to a cluster", [_table(rows), Text(_words(rows)), Text(_paper(rows))])]


def _table(rows: list[dict[str, Any]]) -> Table:
    columns = ["work", "way", "tasks", "exit codes", "CPU [s]", "of tasks [s]", "beyond, per task [s]",
               "scheduler, per task [ms]", "workers busy", "other results"]  # fmt: skip
    cells = []
    for r in rows:
        each = 1e3 * r["scheduler_cpu"] / r["tasks"] if r["work"] == EMPTY and r["scheduler_cpu"] else None
        beyond, codes = (r["cpu"] - r["task_cpu"]) / r["tasks"], ", ".join(map(str, r["codes"]))
        cells.append([r["work"], r["way"], r["tasks"], codes, r["cpu"], r["task_cpu"] or None, beyond, each,
                      r["busy"], len(r["apart"])])  # fmt: skip
    return Table(columns, cells, "CPU is of command, scheduler and workers, with their start.", digits=3)


def _words(rows: list[dict[str, Any]]) -> str:
    apart = sum(len(r["apart"]) for r in rows)
    killed = [r for r in rows if r["way"] == KILLED]
    told = [
        "Results are compared byte for byte with those of one process, but for times: "
        + ("none differs." if not apart else f"{apart} differ.")
    ]
    if killed:
        told.append(
            "In the rows with kills a worker is killed after a quarter of the tasks, which the command "
            "survives, and the scheduler after half of them: the command ends with exit code 1 "
            f"({killed[0]['words']!r}); the same line, on a new cluster, goes on from there."
        )
    works = {r["work"] for r in rows if r["task_cpu"]}
    found = [[r["task_cpu"] for r in rows if r["work"] == work] for work in sorted(works)]
    moved = max((max(used) / min(used) - 1.0 for used in found), default=0.0)
    told.append(
        f"The same tasks took up to {100 * moved:.0f} % more processor time in one way than in another, by "
        "what else was running. The machine has two cores with other work on them, so that two workers did "
        "not halve the time: counts are of processor time, in which the start of processes and libraries is "
        "the most of what is beyond the tasks; scheduler and workers at rest take 1 to 2 % of a core, by "
        "the clock. A worker is busy while it holds a task, the time of its start included."
    )
    return " ".join(told)


def _paper(rows: list[dict[str, Any]]) -> str:
    found = {(r["work"], r["way"]): r for r in rows}
    empty, here, pack = found.get((EMPTY, DASK)), found.get((PACK, HERE)), found.get((PACK, DASK))
    if empty is None or here is None or pack is None:
        return ""
    each = empty["scheduler_cpu"] / empty["tasks"]
    client = (empty["client_cpu"] or 0.0) / empty["tasks"]
    workers = MACHINES * CORES
    serial = pack["command_cpu"] / pack["tasks"]
    lasts = BUNDLES * USUAL / workers
    return (
        f"On paper: {MACHINES} machines of {CORES} cores and {BUNDLES} bundles of {USUAL:g} s. A task costs "
        f"the scheduler {1e3 * each:.1f} ms and the command {1e3 * client:.1f} ms of processor time, so that "
        f"one scheduler hands out {1 / each:.0f} a second; {workers} workers ask for {workers / USUAL:.0f}. "
        f"Tasks may be as short as {workers * max(each, client):.1f} s before the scheduler or the command "
        f"is the limit. The work takes {lasts / 60:.0f} minutes; what the command does alone (digests, the "
        f"check of the pack, the commitment; at most {1e3 * serial:.0f} ms a bundle, its own start included) "
        f"{BUNDLES * serial / 60:.0f} minutes more at most. Not measured: {workers} connections, and a "
        "shared folder that so many processes write to."
    )
