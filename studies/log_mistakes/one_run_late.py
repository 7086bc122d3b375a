"""Is one run named whose orders were joined to its motion at a wrong time, and none where no run was?

Usage: python -m studies.log_mistakes.one_run_late FOLDER... [--out FILE] [--seed N].
Every FOLDER holds bundles, with any cause. Each is judged as it is, and with the orders of one run, drawn
among those that steer, logged half, one and two lengths travelled too late and too early. One line per log is
written as it is judged; the totals are printed at the end.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.input import check_trial
from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial, load_trial

LENGTHS = (0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0)
STEERS = 4  # angles a rudder stands at, at least: a run of one turn tells nothing of its orders' time
SIZE = 0.3  # lengths travelled, or a row, by which a time may be off


def logged_late(run: Run, late: float) -> tuple[Run, float]:
    """The run with its orders some time [s] late, and by how much they are at its rows."""
    at = np.searchsorted(run.t, run.t - late, side="right") - 1
    orders = {name: values[np.clip(at, 0, run.n_samples - 1)] for name, values in run.commands.items()}
    row = float(np.median(np.diff(run.t)))
    return replace(run, commands=orders), math.ceil(late / row - 1e-9) * row


def judged(trial: Trial, model: Model, run: Run | None, lengths: float) -> dict[str, Any]:
    """What is said of a trial with one run late, or with none."""
    travel, row, true = model.scales["L"] / model.scales["U"], 0.0, 0.0
    if run is not None:
        late, true = logged_late(run, lengths * travel)
        row = float(np.median(np.diff(run.t)))
        trial = replace(trial, runs=tuple(late if one.name == run.name else one for one in trial.runs))
    findings = [f for f in check_trial(trial, model).findings if f.name.startswith("orders of ")]
    word = "nothing"
    if findings:
        first = findings[0]
        named = {name.split()[2] for name in (first.name, *first.also) if name.startswith("orders of ")}
        told = first.correction.late if first.correction is not None else {}
        near = all(abs(s - true) <= max(SIZE * travel, row) for s in told.values())
        if run is None or run.name not in named:
            word = "false alarm" if run is None else "another run"
        else:
            word = "in a set" if len(named) > 1 else "named" if near else "named, another time"
    return {"run": run.name if run is not None else None, "lengths": lengths, "word": word}


def rows(folder: Path, seed: int) -> Iterator[dict[str, Any]]:
    """Every judgement of the bundles of a folder."""
    for bundle in sorted(path.parent for path in folder.glob("*/trial.toml")):
        try:
            trial = load_trial(bundle)
            model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
        except BayesidError as error:
            print(f"{bundle}: left out, {error}", flush=True)
            continue
        rng = np.random.default_rng([seed, *bundle.name.encode()])
        orders = [(run, run.commands.get("delta_r_cmd")) for run in trial.identify]
        steer = [run for run, order in orders if order is not None and np.unique(order).size >= STEERS]
        for lengths in LENGTHS:
            run = steer[int(rng.integers(len(steer)))] if lengths and steer else None
            if run is not None or not lengths:
                yield {"bundle": f"{folder.name}/{bundle.name}"} | judged(trial, model, run, lengths)


def study(folders: list[Path], out: Path, seed: int) -> None:
    """Judge all, then print the totals."""
    done = []
    with out.open("w", encoding="utf-8") as file:
        for folder in folders:
            for row in rows(folder, seed):
                done.append(row)
                file.write(json.dumps(row) + "\n")
                file.flush()
            print(f"{folder.name}: {len(done)} logs judged", flush=True)
    for size in dict.fromkeys(abs(lengths) for lengths in LENGTHS):
        counted = Counter(row["word"] for row in done if abs(row["lengths"]) == size)
        print(f"{size:g} lengths: {', '.join(f'{n} {word}' for word, n in counted.most_common())}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("out/one_run_late.jsonl"))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    study(given.folders, given.out, given.seed)
