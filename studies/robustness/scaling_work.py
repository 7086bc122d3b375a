"""Replicates of the calibration study, or tasks without work, on any executor, each with what it took.

Usage: python -m studies.robustness.scaling_work calibration|empty --out FOLDER --count N [--workers N]
[--executor X]
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.cli.terminal import guarded
from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.executor import Executor, add_executor, executor_from
from bayesid.files import write_json
from studies.calibration.run import CONDITIONS, work

CONDITION = "one run"


def timed(seed: int) -> dict[str, Any]:
    """One replicate, and its processor and clock time [s]."""
    cpu, wall = time.process_time(), time.monotonic()
    record = work(CONDITIONS[CONDITION][0], seed)
    return {**record, "cpu_seconds": time.process_time() - cpu, "wall_seconds": time.monotonic() - wall}


def nothing(seed: int) -> dict[str, Any]:
    """A task without work: what is left is what the executor takes."""
    return {"seed": seed}


def run(what: str, out: Path, count: int, executor: Executor) -> None:
    """All tasks, and how long the executor took from the first to the last."""
    list(executor.as_they_come(partial(round, ndigits=0), [1.5] * 4))  # workers start and load libraries
    began, cpu = time.monotonic(), time.process_time()
    if what == "empty":
        list(executor.as_they_come(nothing, list(range(count))))
    else:
        run_seeds(timed, range(count), out / "seeds", "one-run", executor)
    write_json(out / "took.json", {"wall": time.monotonic() - began, "cpu": time.process_time() - cpu})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("calibration", "empty"))
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, required=True)
    add_executor(parser)
    given = parser.parse_args()

    class _Command:
        """What `guarded` runs: errors become a sentence and an exit code, as in every command."""

        def main(self, **_: Any) -> int:
            run(given.what, given.out, given.count, executor_from(given))
            return 0

    raise SystemExit(guarded(_Command, []))
