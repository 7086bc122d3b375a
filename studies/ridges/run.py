"""Which of vv, vr and rr do a steady turn, a spiral and three manoeuvres know, asked in four ways?

Usage: bayesid study ridges [--out FOLDER] [--truths N] [--seed S] [--quick] [--workers N]. Truths are
drawn from the prior, which is centred on the vehicle file, not on them. Cases are kept in FOLDER/cases and
not run again.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.ridges.case import PRIORS, SETS, asked
from studies.ridges.report import counted, ridges_report

TRUTHS = 12


def work(name: str, prior: float, first: int, seed: int) -> dict[str, Any]:
    """One truth; the first is sampled too."""
    return asked(name, prior, seed, seed == first)


def main(out: Path, truths: int, seed: int, quick: bool, executor: Executor = HERE) -> dict[str, Any]:
    """Ask in every set of runs under every prior, report."""
    progress, cases = Progress(), []
    sets, priors = (SETS[:1], PRIORS[1:2]) if quick else (SETS, PRIORS)
    progress.expect(len(sets) * len(priors))
    for name in sets:
        for prior in priors:
            seeds = range(seed, seed + (2 if quick else truths))
            key = f"{name.replace(' ', '-')}-{prior:g}"
            with progress.stage(f"{name}, prior {100 * prior:g} %", len(seeds)) as stage:
                cases += run_seeds(
                    partial(work, name, prior, seed), seeds, out / "cases", key, executor, stage.step
                )
    numbers = counted(cases)
    kept = [{k: v for k, v in c.items() if k not in ("draws", "names")} for c in cases]
    results = {
        "inputs": {"truths": truths, "quick": quick},
        "seeds": [seed],
        "counts": numbers,
        "cases": kept,
    }
    writer.write(ridges_report(cases, numbers, quick), out, results)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study ridges", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/ridges"))
    parser.add_argument("--truths", type=int, default=TRUTHS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="one set, one prior, two truths")
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/ridges/run.py")
    main(given.out, given.truths, given.seed, given.quick, executor_from(given))
