"""Are causes named and is nothing invented on vehicles whose equations are not bayesid's?

Usage: bayesid study other_equations --data FOLDER [--labels FILE] [--out FOLDER]
[--workers N] [--executor NAME] [--quick].

FOLDER holds bundles and labels.json, or a folder `practice_foreign` that does. Every verdict is
kept in OUT/verdicts as it comes; the same line goes on after a stop and diagnoses again what other code
decided.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.commitment import digest_of_file, digest_of_folder, read_json
from bayesid.code import code_digest
from bayesid.errors import BayesidError
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.other_equations.report import other_equations_report
from studies.other_equations.scoring import quantities, regime_of, scored
from studies.other_equations.verdicts import verdicts

BASELINE = Path(__file__).with_name("baseline_3125193.json")


def main(
    out: Path,
    data: Path,
    labels: Path | None = None,
    executor: Executor = HERE,
    seed: int = 0,
    quick: bool = False,
) -> dict[str, Any]:
    """Diagnose, score, report.

    Parameters
    ----------
    labels : default labels.json beside the bundles
    quick : only the first bundle of each kind of label
    """
    progress, folder = Progress(), bundles_in(data)
    listed = sorted(
        read_json(labels or folder / "labels.json", "the list of labels"), key=lambda x: x["name"]
    )
    if quick:
        listed = [next(x for x in listed if regime_of(x) == r) for r in dict.fromkeys(map(regime_of, listed))]
    missing = [x["name"] for x in listed if not (folder / x["name"] / "trial.toml").exists()]
    if missing:
        raise BayesidError(f"{folder}: no bundle for the labels {', '.join(missing)}")
    given = verdicts([folder / x["name"] for x in listed], out / "verdicts", seed, executor, progress)
    cases = [scored(x, None if given[x["name"]]["failure"] else given[x["name"]]) for x in listed]
    baseline = read_json(BASELINE, "the baseline")
    old = {n: v for n, v in baseline["verdicts"].items() if _same(folder / n, v["bundle"])}
    before = [scored(x, old[x["name"]]) for x in listed if x["name"] in old]
    document = other_equations_report(cases, given, before, old, baseline["commit"], quick)
    results = {
        "inputs": {
            "bundles": {n: v["bundle"] for n, v in given.items()}, "quick": quick,
            "labels": digest_of_file(labels or folder / "labels.json"),
        },
        "seeds": [seed],
        "code": code_digest(),
        "quantities": [asdict(q) for q in quantities(cases)],
        "quantities_before": [asdict(q) for q in quantities(before)],
        "cases": [asdict(c) for c in cases],
        "before": [asdict(c) for c in before],
        "verdicts": given,
    }  # fmt: skip
    writer.write(document, out, results)
    return results


def bundles_in(data: Path) -> Path:
    """The folder itself, `practice_foreign` in it, or beside it: the first that holds labels.

    Raises
    ------
    BayesidError               none of them does
    """
    places = (data, data / "practice_foreign", data.resolve().parent / "practice_foreign")
    for place in places:
        if (place / "labels.json").exists():
            return place
    raise BayesidError(f"{data}: holds neither labels.json nor practice_foreign/labels.json")


def _same(bundle: Path, digest: str) -> bool:
    return (bundle / "trial.toml").exists() and digest_of_folder(bundle) == digest


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study other_equations", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/other_equations"))
    parser.add_argument("--data", type=Path, required=True, help="folder of bundles, or of practice_foreign")
    parser.add_argument("--labels", type=Path, help="default: labels.json beside the bundles")
    add_executor(parser)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="one bundle of each kind")
    asked = parser.parse_args()
    lock_or_exit(asked.out, "studies/other_equations/run.py")
    main(asked.out, asked.data, asked.labels, executor_from(asked), asked.seed, asked.quick)
