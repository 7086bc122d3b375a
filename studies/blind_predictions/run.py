"""What will real runs do whose outcome nobody here has seen? Esso Osaka in its pond, KVLCC2 in another basin.

Usage: bayesid study blind_predictions --data FOLDER [--out FOLDER] [--expect] [--quick] [--seed N].
FOLDER holds `blind_predictions`, `kvlcc2_hsva` and `esso_osaka`. With --expect half of the known runs is held
out and predicted as the blind ones will be, and the errors to expect are written; without it every known run
is fitted and the blind ones are predicted. Fits that were interrupted go on. `--equations mmg` makes a second
set, `<set>_mmg`, with ships by the MMG method and bands as wide as runs left out of the fit ask for; the
first one, with rows of products of velocities, stays as it was sealed.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.estimation.trial_fit import TrialFit
from bayesid.files import write_atomic, write_json
from bayesid.lock import lock_or_exit
from bayesid.prediction.fitted_model import predictive_model
from bayesid.prediction.intervals import beside_readings, standard_errors
from bayesid.prediction.prediction import Prediction
from bayesid.prediction.run_prediction import predict_run
from bayesid.progress import Progress
from bayesid.trials import Run, Trial, load_trial, thin
from studies.blind_predictions.expectation import expectation_text, left_out_text
from studies.blind_predictions.left_out import drawing_model, left_out
from studies.blind_predictions.sets import HERE, REGIMES, SETS, BlindSet, fitted, kind, known_runs, prepared
from studies.blind_predictions.widening import widened

Array = np.ndarray
DRAWS, CALIBRATION_DRAWS = 200, 40


def main(
    data: Path,
    out: Path,
    expect: bool,
    quick: bool,
    seed: int,
    equations: str = "rows",
    only: str | None = None,
) -> None:
    """Expectation or predictions of every set that is there."""
    progress = Progress()
    for name, of_rows in SETS.items():
        blind = replace(of_rows, equations=equations)
        if only not in (None, name):
            continue
        if not (data / blind.logs).is_dir() or not (data / "blind_predictions" / name).is_dir():
            progress.note(f"{name}: no such folder in {data.name}; left out")
            continue
        folder = out / (name if equations == "rows" else f"{name}_{equations}")
        make = (expectation if equations == "rows" else left_out_errors) if expect else predictions
        make(name, blind, data, folder, quick, seed, progress)


def left_out_errors(
    name: str, blind: BlindSet, data: Path, out: Path, quick: bool, seed: int, progress: Progress
) -> None:
    """Errors of runs left out of the fit and the bands they ask for, which `predictions` takes from there."""
    trial = known_runs(blind, data)
    found = left_out(blind, trial, data, quick, seed, out / "left_out", progress)
    inputs = {"trial": trial.digest, "quick": quick, "lead": blind.lead, **_which(blind)}
    record = {"inputs": inputs, "seeds": [seed], **found, "attribution": trial.attribution}
    write_json(out / "expected.json", record)
    write_atomic(out / "EXPECTATION.md", left_out_text(name, record))
    progress.note(f"expectation: {out / 'EXPECTATION.md'}")


def models(
    blind: BlindSet,
    trial: Trial,
    data: Path,
    quick: bool,
    seed: int,
    out: Path,
    progress: Progress,
    chosen: Mapping[str, Any] | None = None,
) -> tuple[dict[str, Any], dict[str, str]]:
    """A predicting model per kind of motion: coefficients of the fit, disturbance of the known runs of
    that kind; and why there is none of the other kinds. With what left-out runs chose per kind, its fit
    without a disturbance of the kind.
    """
    ready: dict[str, Any] = {}
    missing: dict[str, str] = {}
    fits: dict[str, TrialFit | None] = {}
    unfitted: dict[str, str] = {}
    wanted = REGIMES if chosen is None else dict.fromkeys(row["regime"] for row in chosen.values())
    for regime in wanted:
        try:
            fits[regime] = fitted(blind, trial, regime, data, quick, seed, out / f"fit_{regime}", progress)
        except BayesidError as error:
            fits[regime], unfitted[regime] = None, f"the fit failed: {error}"
            progress.note(f"{trial.name}, {regime}: {unfitted[regime]}")
    for name, row in (chosen or {}).items():
        found = fits[row["regime"]]
        if found is None or found.posterior is None:
            missing[name] = unfitted.get(row["regime"], "the fit has no posterior")
        else:
            ready[name] = (drawing_model(found), None, found)
    for name in dict.fromkeys(kind(r.name) for r in trial.runs if chosen is None):
        regime = next(regime for regime, kinds in REGIMES.items() if name in kinds)
        found = fits[regime]
        runs = [prepared(blind, r) for r in trial.runs if kind(r.name) == name and r.role == "identify"]
        if not runs or found is None:
            missing[name] = unfitted.get(regime, f"no known {name} run to fit")
            continue
        draws = 15 if quick else CALIBRATION_DRAWS
        with progress.stage(f"{trial.name}: disturbance of {name} runs"):
            try:
                model = predictive_model(
                    found, draws, seed, runs=runs[:2] if quick else runs, lead=blind.lead
                )
                ready[name] = (*model, found)
            except BayesidError as error:
                missing[name] = str(error)
                progress.note(f"{name}: {error}")
    return ready, missing


def no_model(name: str, missing: Mapping[str, str]) -> str:
    """Why a run of this kind of motion cannot be predicted."""
    told = missing.get(name) or "; ".join(f"{n}: {why}" for n, why in missing.items())
    return f"no model could be made ({told or 'there are no known runs'})"


def expectation(
    name: str, blind: BlindSet, data: Path, out: Path, quick: bool, seed: int, progress: Progress
) -> None:
    """Errors of held-out known runs, predicted as the blind ones will be."""
    trial = known_runs(blind, data)
    per_kind, missing = models(blind, trial, data, quick, seed, out / "expected", progress)
    rows = []
    held = [r for r in trial.runs if r.role == "holdout"]
    for run in progress.track(held[:2] if quick else held, f"{name}: held-out runs"):
        model = per_kind.get(kind(run.name)) or next(iter(per_kind.values()), None)
        if model is None:
            why = no_model(kind(run.name), missing)
            rows.append({"run": run.name, "kind": kind(run.name), "failed": why})
            continue
        rows.append(errors_of(model[0], prepared(blind, run), blind.lead, 20 if quick else DRAWS, seed))
    record = {
        "inputs": {"trial": trial.digest, "quick": quick, "lead": blind.lead, **_which(blind)},
        "seeds": [seed],
        "fit": {k: v[2].fit.uncertainty for k, v in per_kind.items()},
        "calibration": {k: v[1] for k, v in per_kind.items()},
        "runs": rows,
        "attribution": trial.attribution,
    }
    write_json(out / "expected.json", record)
    write_atomic(out / "EXPECTATION.md", expectation_text(name, record))
    progress.note(f"expectation: {out / 'EXPECTATION.md'}")


def errors_of(model: Any, run: Run, lead: float, draws: int, seed: int) -> dict[str, Any]:
    """Rms error, share inside the 95 % band and errors over their sd of one run."""
    try:
        p = predict_run(model, run, draws, seed, lead)
    except BayesidError as error:
        return {"run": run.name, "kind": kind(run.name), "failed": str(error)}
    z = standard_errors(p, run)
    return {
        "run": run.name, "kind": kind(run.name), "seconds": float(run.duration),
        "rms": {c: v["rms"] for c, v in beside_readings(p, run, seed).items()},
        "inside": {c: float(np.mean(np.abs(v) < 1.96)) for c, v in z.items()},
        "rms_z": {c: float(np.sqrt(np.mean(v**2))) for c, v in z.items()},
        "lost": p.lost,
    }  # fmt: skip


def predictions(
    name: str, blind: BlindSet, data: Path, out: Path, quick: bool, seed: int, progress: Progress
) -> None:
    """Fit every known run, predict the blind ones, a CSV each."""
    trial = known_runs(blind, data)
    inputs = {"trial": trial.digest, "quick": quick, "lead": blind.lead, **_which(blind)}
    chosen = None if blind.equations == "rows" else expected_kinds(out / "expected.json", inputs)
    trial = replace(trial, runs=tuple(replace(run, role="identify") for run in trial.runs))
    per_kind, missing = models(blind, trial, data, quick, seed, out / "fitted", progress, chosen)
    told: dict[str, Any] = {}
    unseen = load_trial(HERE / name, data / "blind_predictions" / name)
    for run in progress.track(unseen.runs, f"{name}: predictions"):
        wanted = kind(run.name) if kind(run.name) in per_kind else known_as(kind(run.name))
        known = next((n for n in (wanted, "zigzag", *per_kind) if n in per_kind), None)
        target = out / f"{run.name}.csv"
        if known is None:
            told[run.name] = {"disturbance": None, "failed": no_model(wanted, missing)}
            target.unlink(missing_ok=True)
            continue
        model = per_kind[known][0]
        thinned = thin(run, blind.step)
        try:
            p = predict_run(model, thinned, 20 if quick else DRAWS, seed, blind.lead)
        except BayesidError as error:
            told[run.name] = {"disturbance": known, "failed": str(error)}
            continue
        low, high = p.band() if chosen is None else widened(p, chosen[known]["factors"])
        write_atomic(target, csv_text(p, low, high))
        told[run.name] = {
            "disturbance": known, "lost": p.lost, "seconds": float(run.duration),
            "widest": {c: float((high - low)[:, j].max()) for j, c in enumerate(p.channels)},
        }  # fmt: skip
    record = {
        "inputs": {
            "fitted": {k: [r.name for r in v[2].trial.runs] for k, v in per_kind.items()},
            "trial": trial.digest, "blind": unseen.digest,
            "draws": 20 if quick else DRAWS, "lead": blind.lead, "quick": quick,
            **_which(blind),
        },
        "seeds": [seed],
        "fit": {k: v[2].fit.uncertainty for k, v in per_kind.items()},
        "coefficients": {k: v[2].fit.values for k, v in per_kind.items()},
        "calibration": {k: v[1] for k, v in per_kind.items() if v[1] is not None},
        "predictions": told,
        "attribution": trial.attribution,
    }  # fmt: skip
    write_json(out / "predictions.json", record)
    progress.note(f"predictions: {out}")


def known_as(name: str) -> str:
    """Kind of known runs a kind without any is predicted as."""
    return {"circle": "turn"}.get(name, name)


def expected_kinds(file: Path, inputs: Mapping[str, Any]) -> Mapping[str, Any]:
    """Kind -> fit and factors, as left-out runs of the same logs chose them.

    Raises
    ------
    SystemExit
        if nobody said what to expect, or of other logs or with another --quick
    """
    if not file.is_file():
        raise SystemExit(f"{file}: not there; run with --expect first, it says how wide the bands are")
    record = json.loads(file.read_text(encoding="utf-8"))
    if other := [key for key, value in inputs.items() if record["inputs"].get(key) != value]:
        raise SystemExit(f"{file}: made with another {' and '.join(other)}; run with --expect anew")
    return dict(record["kinds"])


def _which(blind: BlindSet) -> dict[str, str]:
    """What a record says of the equations; the first set says nothing, as when it was sealed."""
    return {} if blind.equations == "rows" else {"equations": blind.equations}


SHOWN: Mapping[str, str] = {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}


def csv_text(p: Prediction, low: Array, high: Array) -> str:
    """`t[s]`, and mean, 2.5 % and 97.5 % of every channel."""
    names, columns = ["t[s]"], [p.t]
    for j, c in enumerate(p.channels):
        for ending, values in (("", p.mean), ("_lo", low), ("_hi", high)):
            names.append(f"{c}{ending}[{SHOWN[c]}]")
            columns.append(values[:, j])
    rows = [",".join(f"{v:.6g}" for v in row) for row in np.column_stack(columns)]
    return "\n".join([",".join(names), *rows]) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study blind_predictions",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with blind_predictions and the logs")
    parser.add_argument("--out", type=Path, default=Path("out/blind_predictions"))
    parser.add_argument("--expect", action="store_true", help="errors to expect instead of predictions")
    parser.add_argument("--quick", action="store_true", help="few draws and runs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--equations", choices=("rows", "mmg"), default="rows")
    parser.add_argument("--only", choices=tuple(SETS), default=None)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/blind_predictions/run.py")
    main(given.data, given.out, given.expect, given.quick, given.seed, given.equations, given.only)
