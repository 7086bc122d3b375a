"""Every bundle of a folder diagnosed once; each verdict is kept, so that a stopped study goes on.

Takes bundles and a folder to keep verdicts in. Gives what is kept, plain. A verdict of another bundle or of
other code is not taken over. Does not read labels.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.commitment import digest_of_folder, read_json
from bayesid.code import code_digest
from bayesid.diagnosis.failed_checks import diverging, far_off, predicts_worse, runs_disagree
from bayesid.diagnosis.of_log import diagnose_log
from bayesid.diagnosis.result import Result
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.executor import Executor
from bayesid.files import write_json
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.trials import load_trial
from bayesid.trials.measured_wind import in_measured_wind

KEYS = ("verdict", "set95", "probabilities")


def verdicts(
    bundles: Sequence[Path], folder: Path, seed: int, executor: Executor, progress: Progress
) -> dict[str, dict[str, Any]]:
    """Verdicts by name of the bundle, as `summary` has them, with `cpu_seconds` and `failure` ("" if none).

    Each is written to FOLDER/<bundle>.json as soon as it is there, the whole diagnosis to FOLDER/whole.
    """
    (folder / "whole").mkdir(parents=True, exist_ok=True)
    code = code_digest()
    todo = [b for b in bundles if not _current(folder / f"{b.name}.json", b, code, seed)]
    if len(todo) < len(bundles):
        progress.note(f"{len(bundles) - len(todo)} bundles are diagnosed already and kept")
    begun = time.monotonic()
    with progress.stage("diagnoses", len(todo)) as stage:
        work = partial(_keep, folder, code, seed)
        for done, (name, word) in enumerate(executor.in_order(work, todo), start=1):
            minutes = (time.monotonic() - begun) / done * (len(todo) - done) / 60.0
            stage.step(info=f"{name} {word}, about {minutes:.0f} min left")
    return {b.name: read_json(folder / f"{b.name}.json", "a kept verdict") for b in bundles}


def summary(record: Mapping[str, Any]) -> dict[str, Any]:
    """What scoring needs of the data of a diagnosis.json: word, effects with their parameters, 95 % set,
    mistakes of the simulator."""
    effects = [
        {"name": e["name"], "probability": e["probability"], "parameters": {
            name: {"value": p["value"], "sd": p["sd"]} for name, p in e["parameters"].items()}}
        for e in record["effects"]
    ]  # fmt: skip
    mistakes = [m["name"] for m in record["simulator"]]
    return {key: record[key] for key in KEYS} | {"effects": effects, "simulator": mistakes}


def checks(result: Result) -> dict[str, bool]:
    """Check of a diagnosis -> whether it failed."""
    return {
        "coefficients far from those stated": bool(far_off(result)),
        "held-out runs predicted worse than as given": bool(predicts_worse(result)),
        "a simulation diverges": bool(diverging(result)),
        "the runs disagree about the size": runs_disagree(result),
    }


def _current(file: Path, bundle: Path, code: str, seed: int) -> bool:
    if not file.exists():
        return False
    kept = read_json(file, "a kept verdict")
    return (kept["bundle"], kept["code"], kept["seed"]) == (digest_of_folder(bundle), code, seed)


def _keep(folder: Path, code: str, seed: int, bundle: Path) -> tuple[str, str]:
    kept: dict[str, Any] = {"bundle": digest_of_folder(bundle), "code": code, "seed": seed, "failure": ""}
    begun = time.process_time()
    try:
        trial = load_trial(bundle)
        model = build_model(in_measured_wind(load_vehicle(trial.vehicle_ref), trial), trial.dof)
        found, checked = diagnose_log(trial, model, seed=seed, plan_next=False)
        record = found.result.record()
        write_json(folder / "whole" / f"{bundle.name}.json", record)
        kept |= summary(record) | {"checks": checks(found.result)}
        kept["input"] = [f.name for f in checked.findings]
    except BayesidError as error:
        kept["failure"] = str(error)
    except Exception as error:  # one bundle must not cost the others theirs
        kept["failure"] = f"{type(error).__name__}: {error}"
    kept["cpu_seconds"] = time.process_time() - begun
    write_json(folder / f"{bundle.name}.json", kept)
    return bundle.name, kept.get("verdict", "failed")
