"""Campaigns of an independent plant with a known fault each: planted, diagnosed unseen, then compared."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bayesid.benchmark.plant import draw_campaign, write_bundle
from bayesid.diagnosis.input import as_read
from bayesid.diagnosis.run import diagnose
from bayesid.equations.model import build_model
from bayesid.executor import Executor
from bayesid.files import write_json
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.trials import load_trial

# vehicle, planted effects, kind, sea
CASES: tuple[tuple[str, tuple[str, ...], str, str], ...] = (
    ("remus100", ("rudder_offset",), "effect", "mid"),
    ("remus100", (), "none", "mid"),
    ("generic_sub", ("ocean_current",), "effect", "calm"),
    ("generic_sub", ("actuator_lag",), "effect", "mid"),
    ("remus100", ("position_lever_arm",), "effect", "calm"),
    ("generic_sub", ("velocity_misalignment",), "effect", "rough"),
    ("remus100", ("thrust_decay",), "effect", "calm"),
    ("generic_sub", ("ocean_current", "rudder_offset"), "two", "calm"),
    ("generic_sub", (), "none", "rough"),
    ("remus100", ("bank_suction",), "outside", "calm"),
)
SIZES = (0.3, 1.0)  # of the reference magnitude
WORKERS = 2


def planted(chosen: Iterable[int], store: Path, seed: int, progress: Progress) -> list[dict[str, Any]]:
    """Rows of the chosen cases, in order; finished ones are read back."""
    chosen = list(chosen)
    found: dict[int, dict[str, Any]] = {i: kept for i in chosen if (kept := _kept(store, i, seed + i))}
    left = [(i, seed + i) for i in chosen if i not in found]
    results = Executor("processes", WORKERS).as_they_come(run, left)
    for k, result in progress.track(results, "campaigns", total=len(left)):
        i, own = left[k]
        found[i] = result
        write_json(_file(store, i, own), result)
    return [found[i] for i in chosen]


def run(task: tuple[int, int]) -> dict[str, Any]:
    """One campaign; the diagnosis sees the bundle only."""
    i, seed = task
    vehicle, effects, kind, sea = CASES[i]
    made = draw_campaign(
        seed, kind=kind, effects=effects or None, vehicle=vehicle, dof=3, sensors="full", sea=sea,
        sizes=SIZES, rich=True,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / f"campaign-{i:02d}"
        answer = write_bundle(made, bundle)
        trial = load_trial(bundle)
        model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
        found = diagnose(as_read(trial, model), model, seed=seed, plan_next=False).result.record()
    return {
        "vehicle": vehicle,
        "planted": list(effects),
        "kind": kind,
        "sea": sea,
        "truth": answer,
        "found": found,
    }


def _file(store: Path, i: int, seed: int) -> Path:
    return store / f"{i:02d}-{seed}.json"


def _kept(store: Path, i: int, seed: int) -> dict[str, Any] | None:
    path = _file(store, i, seed)
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
