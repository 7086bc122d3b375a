"""Does PySINDy name the terms that act, and none that do not?

Usage: bayesid study excited_terms [--out FOLDER] [--draws N] [--seed S] [--quick] [--workers N]. Five
vehicles, twelve manoeuvres and three of them together, five kinds of truth. Beside it bayesid's own stepwise
selection, Fisher information of balance and tracks, and controls that must fail: PySINDy's plain ensemble
over single rows, labels permuted, a force of white noise. Cases are kept in FOLDER/cases and not run again.
"""

from __future__ import annotations

import argparse
import random
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.excited_terms.case import TRUTHS, executed_case
from studies.excited_terms.counting import counted
from studies.excited_terms.report import excited_terms_report

VEHICLES = ("generic_sub", "remus100", "nps_auv2", "delphin2", "lauv")
MANOEUVRES = (
    "straight", "turn_starboard", "spiral", "pullout_port", "zigzag_10_port", "zigzag_modified", "meander",
    "speedsteps", "chirp", "multisine", "prbs", "random",
)  # fmt: skip
ORDER = 1  # seed of the order in which cases are judged
TOGETHER = ("multisine", "zigzag_10_port", "prbs")
SETS = (*((m,) for m in MANOEUVRES), TOGETHER)
TASKS = tuple((v, names, truth) for v in VEHICLES for names in SETS for truth in TRUTHS)
QUICK = tuple((v, names, truth) for v in VEHICLES[:1] for names in (("spiral",), ("zigzag_10_port",))
              for truth in TRUTHS)  # fmt: skip


def work(tasks: Any, draws: int, seed: int, number: int) -> dict[str, Any]:
    """One case by its number."""
    vehicle, names, truth = tasks[number]
    return executed_case(vehicle, names, truth, seed + number, draws)


def main(
    out: Path, draws: int, seed: int, quick: bool, executor: Executor = HERE, most: int | None = None
) -> dict[str, Any]:
    """Judge every case, or `most` of them in random order, count, report."""
    progress = Progress()
    tasks = QUICK if quick else TASKS
    order = list(range(len(tasks)))
    random.Random(ORDER).shuffle(order)
    chosen = order[:most]
    with progress.stage("cases", len(chosen)) as stage:
        name = f"{'quick' if quick else 'full'}-{draws}-{seed}"
        cases = run_seeds(
            partial(work, tasks, draws, seed), chosen, out / "cases", name, executor, stage.step
        )
    numbers = {**counted(cases, seed), "designed": len(tasks)}
    results = {
        "inputs": {"draws": draws, "quick": quick, "most": most},
        "seeds": [seed],
        "counts": numbers,
        "cases": [shortened(c) for c in cases],
    }
    writer.write(excited_terms_report(cases, numbers, quick), out, results)
    return results


def shortened(case: dict[str, Any]) -> dict[str, Any]:
    """A case as kept: per verdict the terms that act; of the absent ones those found singly."""
    verdicts: dict[str, list[str]] = {}
    for row in case["terms"]:
        if row["acts"]:
            verdicts.setdefault(row["pysindy"], []).append(row["name"])
        elif row["pysindy"] == "found" and len(row["group"]) == 1:
            verdicts.setdefault("found, absent", []).append(row["name"])
    kept = {k: case[k] for k in ("vehicle", "runs", "truth", "seed", "vehicles_drawn")}
    return {**kept, "acting": verdicts}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study excited_terms", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/excited_terms"))
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--most", type=int, help="so many cases only, at random")
    parser.add_argument("--quick", action="store_true", help="one vehicle, two manoeuvres")
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/excited_terms/run.py")
    main(given.out, given.draws, given.seed, given.quick, executor_from(given), given.most)
