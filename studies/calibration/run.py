"""Do 90 % intervals hold the truth nine times in ten, and where not?

Usage: bayesid study calibration [--out FOLDER] [--quick] [--seed N] [--workers N]. Truths are drawn
from the prior of three vehicles, short runs are simulated and sampled, and the truth's rank among the draws
noted. Replicates are kept in FOLDER/seeds and not run again.
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
from studies.calibration.judging import judged
from studies.calibration.replicate import NOISE, NOISE_WEIGHT, START, UNKNOWN, Condition, replicate
from studies.calibration.report import calibration_report

VEHICLES = ("generic_sub", "remus100", "nps_auv2")
THREE = ("steps", "turn", "doublets")
SAMPLED, INFLATED = ({"memory": m} for m in ("ar1", "inflate"))
STUDENT = {"memory": "ignore", "student": 4.0, "initial": "fixed"}
# condition -> what it is and how many replicates, a third of them per vehicle
CONDITIONS: dict[str, tuple[Condition, int]] = {
    "one run": (Condition(), 48),
    "three runs": (Condition(runs=THREE), 48),
    "four pieces": (Condition(pieces=4), 48),
    "Student-t noise": (
        Condition(noise="student", start_known=True, settings=STUDENT), 48,
    ),
    "coloured noise, memory sampled": (Condition(noise="coloured", settings=SAMPLED), 24),
    "coloured noise, memory counted": (Condition(noise="coloured", settings=INFLATED), 48),
    "control: coloured noise read as white": (Condition(noise="coloured", control=True), 48),
    "control: Student-t noise read as Gaussian": (
        Condition(noise="student", start_known=True, control=True), 48,
    ),
    "control: a current not modelled": (Condition(current=0.01, control=True), 24),
    "control: that current, memory counted": (
        Condition(current=0.01, settings=INFLATED, control=True), 24,
    ),
}  # fmt: skip


def work(condition: Condition, seed: int) -> dict[str, Any]:
    """One replicate; seeds take turns among the vehicles."""
    return replicate(VEHICLES[seed % len(VEHICLES)], condition, seed)


def main(out: Path, quick: bool, first_seed: int, executor: Executor = HERE) -> dict[str, Any]:
    """Run everything and write the report; returns the conditions' numbers."""
    progress, records = Progress(), {}
    progress.expect(len(CONDITIONS))
    for name, (condition, count) in CONDITIONS.items():
        seeds = range(first_seed, first_seed + (3 if quick else count))
        key = name.translate(str.maketrans("", "", ",:")).replace(" ", "-")
        with progress.stage(name, len(seeds)) as stage:
            records[name] = run_seeds(
                partial(work, condition), seeds, out / "seeds", key, executor, stage.step
            )
    findings = judged(records, {name: c for name, (c, _) in CONDITIONS.items()})
    inputs = {
        "vehicles": VEHICLES, "unknown": UNKNOWN, "quick": quick, "noise": NOISE,
        "noise_weight": NOISE_WEIGHT, "start_sd": START, "first_seed": first_seed,
        "prior_sd": Condition().prior_sd,
    }  # fmt: skip
    results = {"inputs": inputs, **findings}
    writer.write(calibration_report(records, findings, inputs), out, results)
    return findings


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study calibration", description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/calibration"))
    parser.add_argument("--quick", action="store_true", help="three replicates of each")
    parser.add_argument("--seed", type=int, default=0)
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/calibration/run.py")
    main(given.out, given.quick, given.seed, executor=executor_from(given))
