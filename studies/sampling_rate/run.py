"""Does one log say the same at 10, 5, 2 and 1 Hz?

Usage: bayesid study sampling_rate [--out FOLDER] [--work FOLDER] [--count N] [--seed S]
[--workers J] [--executor NAME] [--quick].

Campaigns of the independent plant are executed at 10 Hz, and the same noisy readings are diagnosed
thinned. One file per campaign is kept in the work folder and not computed again, so the same line goes on
after a stop.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.frames.diagnose_campaign import kept
from studies.sampling_rate.report import sampling_rate_report
from studies.sampling_rate.thinned import INTERVALS, disjoint, thinned_case, thinned_tasks, wrong

COUNT, SEED = 10, 9000
QUICK = (0.5, 1.0)


def main(
    out: Path,
    work: Path,
    count: int = COUNT,
    seed: int = SEED,
    executor: Executor = HERE,
    quick: bool = False,
) -> dict[str, Any]:
    """Execute, thin, diagnose, report."""
    progress = Progress()
    tasks = thinned_tasks(2 if quick else count, seed)
    case = partial(thinned_case, intervals=QUICK if quick else INTERVALS)
    records = kept(case, tasks, work, executor, progress, "sampling rates")
    results = {
        "inputs": {"count": len(tasks), "quick": quick},
        "seeds": [seed],
        "code": sorted({r["code"] for r in records}),
        "disjoint": [r["name"] for r in records if disjoint(r["rates"])],
        "wrong": {r["name"]: wrong(r) for r in records if wrong(r)},
        "campaigns": records,
    }
    writer.write(sampling_rate_report(records), out, results)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study sampling_rate", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/sampling_rate"))
    parser.add_argument("--work", type=Path, help="default: out/sampling_rate/work, or OUT/work where quick")
    parser.add_argument("--count", type=int, default=COUNT, help="campaigns")
    parser.add_argument("--seed", type=int, default=SEED)
    add_executor(parser)
    parser.add_argument("--quick", action="store_true", help="two campaigns at 2 and 1 Hz")
    given = parser.parse_args()
    place = given.work or (given.out if given.quick else Path("out/sampling_rate")) / "work"
    lock_or_exit(given.out, "studies/sampling_rate/run.py")
    main(given.out, place, given.count, given.seed, executor_from(given), given.quick)
