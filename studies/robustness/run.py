"""What is lost when a command is killed, the disk is full, an input is damaged, or a log is long?

Usage: python -m studies.robustness.run --data FOLDER [--out FOLDER] [--kills N] [--fuzz SECONDS]
[--seed S] [--quick]. FOLDER holds the practice bundles (a016 is used). Every part is kept in OUT/parts as it
ends; kills and inputs of several seeds add up there.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bayesid.code import code_digest
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.robustness.commands import commands
from studies.robustness.faults import fault_rows
from studies.robustness.kills import kill_and_resume, rows_of
from studies.robustness.report import robustness_report
from studies.robustness.sizes import size_rows

BUNDLE = "a016"
KILLS, FUZZ_SECONDS = 12, 420.0
SIZES = [(1.0, 1.0), (3.0, 1.0), (10.0, 1.0), (10.0, 10.0)]  # h, Hz
# Keys by which rows of several files (seeds, machines, days) are one, and what of them is added up.
SUMS = {
    "kills": (("command", "fault"), ("sent", "finished", "same", "wrong")),
    "fuzz": (("kind",), ("tried", "refused", "hung", "escaped")),
}


def main(out: Path, data: Path, kills: int, seconds: float, seed: int, quick: bool) -> dict[str, Any]:
    """Kill, spoil, fuzz, measure, report."""
    progress, places = Progress(), (data, data / "practice", data.parent / "practice")
    place = next((p for p in places if (p / BUNDLE).exists()), None)
    if place is None:
        raise SystemExit(f"{data}: no bundle {BUNDLE} there, nor in a folder practice in it or beside it")
    bundle = str(place / BUNDLE)
    parts: dict[str, Callable[[Path], Any]] = {
        "kills": lambda work: _kills(work, out / "parts" / "kills", kills, seed, progress),
        "faults": lambda work: fault_rows(Path(bundle), work),
        "fuzz": lambda work: _fuzz(seconds, seed),
        "sizes": lambda work: size_rows(SIZES[:1] if quick else SIZES),
    }  # fmt: skip
    for name, work in parts.items():
        kept = out / "parts" / name
        if name == "kills" or not list(kept.glob("*.json")):
            progress.note(name)
            with tempfile.TemporaryDirectory() as folder:
                rows = work(Path(folder))
            if name != "kills":
                write_json(kept / f"seed{seed}.json", {"code": code_digest(), "rows": rows})
    found = {name: _read(out / "parts" / name, SUMS.get(name)) for name in parts}
    inputs = {"bundle": BUNDLE, "kills": kills, "fuzz_seconds": seconds, "quick": quick}
    results = {"inputs": inputs, "seeds": [seed], **found}
    progress.note(f"report: {writer.write(robustness_report(found), out, results)}")
    return results


def _kills(work: Path, kept: Path, count: int, seed: int, progress: Progress) -> None:
    """Every command killed `count` times by each fault; those of a command are kept as they come."""
    for k, command in enumerate(commands(work / "bundles")):
        path = kept / f"seed{seed}-{command.name.replace(' ', '-').replace(',', '')}.json"
        if not path.exists():
            progress.note(f"kills of {command.name}")
            found = kill_and_resume(command, work, min(command.times, count), seed + k)
            write_json(path, {"code": code_digest(), "rows": rows_of(found)})


def _read(folder: Path, sums: tuple[tuple[str, ...], tuple[str, ...]] | None) -> dict[str, Any]:
    """Rows of all files of a part, those of the same keys added up, and the codes they were made with."""
    files = [json.loads(path.read_text("utf-8")) for path in sorted(folder.glob("*.json"))]
    rows: list[dict[str, Any]] = []
    for row in [row for file in files for row in file["rows"]]:
        same = None if sums is None else next((r for r in rows if all(r[k] == row[k] for k in sums[0])), None)
        if sums is None or same is None:
            rows.append(dict(row))
        else:
            same.update({k: same[k] + row[k] for k in sums[1]})
    return {"code": ", ".join(sorted({file["code"] for file in files})), "rows": rows}


def _fuzz(seconds: float, seed: int) -> list[dict[str, Any]]:
    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "fuzz"))
    from fuzz_inputs import fuzz  # type: ignore[import-not-found]

    return [{"kind": kind, **vars(c), "escaped": c.escaped[:20]} for kind, c in fuzz(seconds, seed).items()]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/robustness"))
    parser.add_argument("--data", type=Path, required=True, help="folder of the practice bundles")
    parser.add_argument("--kills", type=int, default=KILLS, help="of each command by each fault at most")
    parser.add_argument("--fuzz", type=float, default=FUZZ_SECONDS, help="seconds of mutated inputs")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="one kill each, 20 s of inputs, one size")
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/robustness/run.py")
    kills, seconds = (1, 20.0) if given.quick else (given.kills, given.fuzz)
    main(given.out, given.data, kills, seconds, given.seed, given.quick)
