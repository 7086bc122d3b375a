"""Is the cause of a planted gap found, and does the gap close on held-out runs? Plant apart, faults known.

Usage: python studies/sim_to_real_gap.py [--out FOLDER] [--quick] [--seed N]. Finished campaigns are kept in
FOLDER/campaigns and not run again; delete that folder to start afresh.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

from bayesid import report
from bayesid.diagnose.diagnosis import as_json, diagnose
from bayesid.files import write_json
from bayesid.model import build_model
from bayesid.plant import draw_campaign, write_bundle
from bayesid.progress import Progress
from bayesid.sections.gap_study import gap_report
from bayesid.trials import load_trial
from bayesid.vehicles import load_vehicle

# vehicle, planted effects, kind, sea
CASES: tuple[tuple[str, tuple[str, ...], str, str], ...] = (
    ("generic_sub", ("ocean_current",), "effect", "calm"),
    ("remus100", ("rudder_offset",), "effect", "mid"),
    ("generic_sub", ("actuator_lag",), "effect", "mid"),
    ("remus100", ("position_lever_arm",), "effect", "calm"),
    ("generic_sub", ("velocity_misalignment",), "effect", "rough"),
    ("remus100", ("thrust_decay",), "effect", "calm"),
    ("generic_sub", ("ocean_current", "rudder_offset"), "two", "calm"),
    ("remus100", (), "none", "mid"),
    ("generic_sub", (), "none", "rough"),
    ("remus100", ("bank_suction",), "outside", "calm"),
)
QUICK = (0, 7)
SIZES = (0.3, 1.0)  # of the reference magnitude


def main(out: Path, quick: bool, first_seed: int) -> dict[str, Any]:
    """Run all cases and write the report."""
    progress = Progress()
    chosen = QUICK if quick else range(len(CASES))
    rows = []
    for i in progress.track(chosen, "campaigns"):
        rows.append(run(i, first_seed + i, out / "campaigns", progress))
    results = {
        "inputs": {"cases": [CASES[i] for i in chosen], "sizes": SIZES, "quick": quick},
        "seeds": [first_seed + i for i in chosen],
        "campaigns": rows,
    }
    path = report.write(gap_report(rows), out, results)
    progress.note(f"report: {path}")
    return results


def run(i: int, seed: int, store: Path, progress: Progress) -> dict[str, Any]:
    """One campaign: planted, diagnosed without its answer, then laid beside it."""
    kept = store / f"{i:02d}-{seed}.json"
    if kept.exists():
        return json.loads(kept.read_text(encoding="utf-8"))
    vehicle, effects, kind, sea = CASES[i]
    made = draw_campaign(
        seed,
        kind=kind,
        effects=effects or None,
        vehicle=vehicle,
        dof=3,
        sensors="full",
        sea=sea,
        sizes=SIZES,
        rich=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / f"campaign-{i:02d}"
        truth = write_bundle(made, bundle)
        trial = load_trial(bundle)
        model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
        found = as_json(diagnose(trial, model, seed=seed, say=progress.note, plan_next=False))
    row = {
        "vehicle": vehicle,
        "planted": list(effects),
        "kind": kind,
        "sea": sea,
        "truth": truth,
        "found": found,
    }
    store.mkdir(parents=True, exist_ok=True)
    write_json(kept, row)
    return row


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("reports/sim_to_real_gap"))
    parser.add_argument("--quick", action="store_true", help="two campaigns instead of ten")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    main(given.out, given.quick, given.seed)
