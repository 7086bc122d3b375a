"""What is lost when a command is killed, the disk is full, an input is damaged, or a log is long?

Usage: bayesid study robustness [--out FOLDER] [--parts NAMES] [--kills N] [--fuzz INPUTS] [--seed S]
[--codes CODES] [--quick]. Every part is kept in OUT/parts as it goes, with the code it was made with: the
same line goes on where it was stopped, another seed adds to what is there, and the report counts rows of one
state of the deciding code, but for what --codes adds.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.code import loaded_code
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.robustness.commands import commands
from studies.robustness.faults import fault_rows
from studies.robustness.kept import Kept, added
from studies.robustness.kills import UNBROKEN, Killed, kill_and_resume, rows_of
from studies.robustness.report import robustness_report
from studies.robustness.scaling import KILLED, WAYS, WORKS, can_scale, scaling_row
from studies.robustness.sizes import SIZES, size_row
from studies.robustness.small import small_bundle

KILLS, INPUTS = 100, 100_000
CHUNK = 120.0  # s of mutated inputs that are kept at a time
PARTS = ("kills", "faults", "fuzz", "scaling", "sizes")
# Keys by which rows of several files (seeds, machines, days) are one, and what of them is added up.
SUMS = {
    "kills": (("command", "fault"), ("sent", "finished", "same", "wrong")),
    "fuzz": (("kind",), ("tried", "refused", "hung", "escaped")),
}


def main(
    out: Path, parts: tuple[str, ...], kills: int, inputs: int, seed: int, quick: bool, codes: tuple[str, ...]
) -> dict[str, Any]:
    """Kill, spoil, fuzz, measure what is asked for; report what there is of `codes`."""
    progress = Progress()
    works: dict[str, Callable[[Path, Kept], None]] = {
        "kills": lambda work, kept: _kills(work, kept, kills, seed, progress),
        "faults": lambda work, kept: _faults(work, kept),
        "fuzz": lambda work, kept: _fuzz(kept, inputs, seed, 20.0 if quick else CHUNK),
        "scaling": lambda work, kept: _scaling(out / "scaling" / loaded_code(), kept, progress),
        "sizes": lambda work, kept: _sizes(work, kept, quick, progress),
    }  # fmt: skip
    kept = {name: Kept(out / "parts" / name, codes) for name in works}
    for name in parts:
        progress.note(name)
        with tempfile.TemporaryDirectory() as folder:
            works[name](Path(folder), kept[name])
    found = {name: _found(k, SUMS.get(name)) for name, k in kept.items()}
    inputs_of = {"kills": kills, "inputs": inputs, "quick": quick, "codes": codes}
    results = {"inputs": inputs_of, "seeds": [seed], **found}
    writer.write(robustness_report(found), out, results)
    return results


def _found(kept: Kept, sums: tuple[tuple[str, ...], tuple[str, ...]] | None) -> dict[str, Any]:
    """Rows of the code that is reported, its commits, and the rows of earlier ones by commit."""

    def one(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return rows if sums is None else added(rows, *sums)

    earlier = {commit: one(rows) for commit, rows in kept.earlier().items()} if sums else {}
    return {"commits": kept.commits(), "rows": one(kept.rows()), "earlier": earlier}


def _kills(work: Path, kept: Kept, count: int, seed: int, progress: Progress) -> None:
    """Every command killed by each fault as often as it says, `count` times at most."""
    for k, command in enumerate(commands(work / "bundles")):
        name = f"seed{seed}-{command.name}"
        before = kept.read(name) or {"rows": [], "done": 0}
        most = min(command.times, count)
        if before["done"] < most:
            progress.note(f"kills of {command.name}: {before['done']} of {most} done")
            rows = [Killed(**row) for row in before["rows"]]
            found = kill_and_resume(
                command, work, most, seed + k, partial(_keep, kept, name), rows, before["done"]
            )
            if found[0].fault == UNBROKEN:
                raise SystemExit(f"{command.name} fails without a kill: {found[0].wrong[0]}")


def _keep(kept: Kept, name: str, done: int, rows: list[Killed]) -> None:
    kept.write(name, rows_of(rows), done=done)


def _faults(work: Path, kept: Kept) -> None:
    if kept.read("faults") is None:
        kept.write("faults", fault_rows(small_bundle(work / "bundle"), work / "faults"))


def _fuzz(kept: Kept, inputs: int, seed: int, chunk: float) -> None:
    """Mutated inputs, a chunk of each seed, until there are as many."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "fuzz"))
    from fuzz_inputs import fuzz  # type: ignore[import-not-found]

    while sum(row["tried"] for row in kept.rows()) < inputs:
        while kept.read(f"seed{seed}") is not None:
            seed += 1
        found = fuzz(chunk, seed).items()
        kept.write(f"seed{seed}", [{"kind": k, **vars(c), "escaped": c.escaped[:20]} for k, c in found])


def _scaling(folder: Path, kept: Kept, progress: Progress) -> None:
    """Every work in every way there is; results of one process stay, for the others to be compared with."""
    for name in WORKS:
        for way in filter(can_scale, WAYS):
            if kept.read(f"{name} {way}") is None and (way != KILLED or WORKS[name].notes):
                progress.note(f"{name}, {way}")
                kept.write(f"{name} {way}", [scaling_row(name, way, folder)])


def _sizes(work: Path, kept: Kept, quick: bool, progress: Progress) -> None:
    for name, size in list(SIZES.items())[: 1 if quick else None]:
        if kept.read(name) is None:
            progress.note(name)
            kept.write(name, [size_row(name, size, work)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study robustness", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/robustness"))
    parser.add_argument("--parts", default=",".join(PARTS), help="some of them, or none: only the report")
    parser.add_argument("--kills", type=int, default=KILLS, help="of each command by each fault at most")
    parser.add_argument("--fuzz", type=int, default=INPUTS, help="mutated inputs in all")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--codes", default="", help="fingerprints of code that count beside the present one")
    parser.add_argument("--quick", action="store_true", help="one kill each, 20 s of inputs, one size")
    given = parser.parse_args()
    chosen = tuple(name for name in PARTS if name in given.parts.split(","))
    lock_or_exit(given.out, "studies/robustness/run.py")
    codes = (loaded_code(), *filter(None, given.codes.split(",")))
    kills, inputs = (1, 1) if given.quick else (given.kills, given.fuzz)
    main(given.out, chosen, kills, inputs, given.seed, given.quick, codes)
