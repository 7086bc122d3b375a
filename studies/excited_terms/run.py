"""Does PySINDy name the terms that act, and none that do not?

Usage: python -m studies.excited_terms.run [--out FOLDER] [--draws N] [--seed S] [--quick]. Three vehicles,
five sets of manoeuvres, three kinds of truth. Beside it bayesid's own stepwise selection, Fisher information
of the tracks, and as a control that must fail PySINDy's plain ensemble over single rows and single terms.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.excited_terms.case import executed_case
from studies.excited_terms.report import counted, excited_terms_report

VEHICLES = ("generic_sub", "remus100", "nps_auv2")
SETS = (("spiral",), ("zigzag_10_port",), ("prbs",), ("multisine",), ("multisine", "zigzag_10_port", "prbs"))
TRUTHS = ("as_built", "fewer", "cubic")


def main(out: Path, draws: int, seed: int, quick: bool) -> dict[str, Any]:
    """Judge every case, count, report."""
    progress = Progress()
    vehicles, sets = (VEHICLES[:1], SETS[:2]) if quick else (VEHICLES, SETS)
    cases = []
    tasks = [(v, names, truth) for v in vehicles for names in sets for truth in TRUTHS]
    with progress.stage("cases", len(tasks)) as stage:
        for number, (vehicle, names, truth) in enumerate(tasks):
            cases.append(executed_case(vehicle, names, truth, seed + number, draws))
            stage.step(info=f"{vehicle} {names[0]} {truth}")
    numbers = counted(cases)
    results = {
        "inputs": {"draws": draws, "quick": quick},
        "seeds": [seed],
        "counts": numbers,
        "cases": shortened(cases),
    }
    progress.note(f"report: {writer.write(excited_terms_report(cases, numbers), out, results)}")
    return results


def shortened(cases: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cases as kept: terms that act, and those PySINDy finds or cannot tell; the others are counted only."""

    def kept(row: dict[str, Any]) -> bool:
        return bool(row["acts"] or row["pysindy"] in ("found", "cannot tell"))

    return [{**c, "terms": [r for r in c["terms"] if kept(r)]} for c in cases]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/excited_terms"))
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--quick", action="store_true", help="one vehicle, two sets of manoeuvres")
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/excited_terms/run.py")
    main(given.out, given.draws, given.seed, given.quick)
