"""Are causes found that free coefficients hide, and does the proposed manoeuvre tell look-alikes apart?

Usage: bayesid study frames [--out FOLDER] [--work FOLDER] [--count N] [--replicates N] [--seed S]
[--workers J] [--executor NAME] [--quick]. Campaigns of the independent plant, judged by what was planted.
One file per campaign is kept in the work folder and not computed again, so the same line goes on after
a stop. Seeds count from 7000 on, those of the look-alikes from 8000 on.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from bayesid.executor import Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.frames import as_built, extra_run
from studies.frames.diagnose_campaign import kept
from studies.frames.report import frames_report

COUNT, REPLICATES, SEED = 30, 3, 7000
APART = 1000  # between the seeds of the two parts


def main(
    out: Path,
    work: Path,
    count: int,
    replicates: int,
    seed: int,
    executor: Executor,
    quick: bool,
) -> dict[str, Any]:
    """Ask, score, report."""
    progress = Progress()
    hidden = as_built.as_built_tasks(2 if quick else count, seed)
    built = kept(as_built.as_built_case, hidden, work / "as_built", executor, progress, "as built")
    effects = extra_run.EFFECTS[:1] if quick else extra_run.EFFECTS
    tasks = extra_run.extra_run_tasks(1 if quick else replicates, seed + APART, effects)
    extra = kept(extra_run.extra_run_case, tasks, work / "extra_run", executor, progress, "one more run")
    rows = {"as built": as_built.as_built_scores(built), "one more run": extra_run.extra_run_scores(extra)}
    codes = sorted({r["code"] for r in (*built, *extra)})
    document = frames_report(built, extra, rows["as built"], rows["one more run"], codes)
    results = {
        "inputs": {
            "count": count, "replicates": replicates, "quick": quick, "hidden": as_built.EFFECTS,
            "known": as_built.AS_BUILT_SD, "stated": as_built.STATED_SD,
            "aim": as_built.NONCENTRALITY_RANGE, "look-alikes": effects,
            "sea": extra_run.SEA, "prior": extra_run.PRIOR, "margin": extra_run.EXPECTED_MARGIN,
            "alike": extra_run.ALIKE_MARGIN,
        },
        "seeds": [seed, seed + APART],
        "code": codes,
        "quantities": rows,
        "as_built": built,
        "extra_run": extra,
    }  # fmt: skip
    writer.write(document, out, results)
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study frames", description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/frames"))
    parser.add_argument("--work", type=Path, help="default: out/frames, or beside a quick report")
    parser.add_argument("--count", type=int, default=COUNT, help="campaigns with a hidden cause")
    parser.add_argument("--replicates", type=int, default=REPLICATES, help="campaigns per look-alike")
    parser.add_argument("--seed", type=int, default=SEED)
    add_executor(parser)
    parser.add_argument("--quick", action="store_true", help="two hidden causes and one look-alike")
    given = parser.parse_args()
    place = given.work or (given.out / "work" if given.quick else Path("out/frames"))
    lock_or_exit(given.out, "studies/frames/run.py")
    lock_or_exit(place, "studies/frames/run.py")
    main(given.out, place, given.count, given.replicates, given.seed, executor_from(given), given.quick)
