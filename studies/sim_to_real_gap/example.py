"""The built-in example from first overlay to closed gap. Diagnosed first; its answer is drawn afterwards."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.excitation import excite
from bayesid.benchmark.plant import truth
from bayesid.benchmark.plant.example import NAME, example_campaign
from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.diagnosed_file import write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis, diagnosed_model_of
from bayesid.diagnosis.input import as_read
from bayesid.diagnosis.run import Diagnosis, diagnose
from bayesid.equations.model import build_model
from bayesid.files import write_json
from bayesid.model.vehicles import load_vehicle
from bayesid.prediction.run_prediction import predict_run
from bayesid.progress import Progress
from bayesid.report.diagnosis.report import write_diagnosis_report
from bayesid.report.excite import finding, term_rows
from bayesid.trials import Run, load_trial

DRAWS = 200
EXCITE = 60  # bootstrap draws of the excitation


def example(out: Path, seed: int, progress: Progress, draws: int = DRAWS) -> dict[str, Any]:
    """Diagnose the example bundle, predict its held-out runs with three models, then look at the answer."""
    trial = load_trial(NAME)
    model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
    with progress.stage("example bundle"):
        d = diagnose(as_read(trial, model), model, seed=seed, notify=progress.note)
        found = diagnosed_model_of(d)
    record = d.result.record()
    write_json(out / NAME / "diagnosis.json", record)
    write_diagnosed(found, out / NAME)
    write_diagnosis_report(d.result, out / NAME)
    runs = [predicted(run, d, found, seed, draws) for run in trial.holdout]
    with progress.stage("excitation of the example"):
        excited = excite(model, trial.identify, trial.noise, draws=min(draws, EXCITE), seed=seed)
    planted, told = truth(example_campaign(), NAME), answer(d.result)
    return {
        "said": (told.headline, told.outcome),
        "found": record | {"limit": d.result.thresholds.remainder},
        "truth": planted,
        "runs": runs,
        "coefficients": coefficients(d, planted),
        "excitation": {
            "rows": term_rows(excited, vehicle=model.vehicle),
            "finding": finding(excited),
            "needed": [w.name for w in excited.terms if w.status == "found"],
            "groups": excited.groups,
            "beyond": [w.name for w in excited.candidates],
            "beyond_groups": excited.candidate_groups,
        },
    }


def predicted(run: Run, d: Diagnosis, found: DiagnosedModel, seed: int, draws: int) -> dict[str, Any]:
    """A held-out run as logged and as three models predict it from the same first readings."""
    quiet = replace(
        found.hypotheses[0].noise_model, force=(0.0,) * len(found.hypotheses[0].noise_model.force)
    )
    base = d.candidates.none.fit
    where = d.model.positions(base.free.names)

    def at(values: np.ndarray) -> DiagnosedModel:
        free = np.full(values.size, np.inf)
        known = WeightedHypothesis(
            (), 1.0, base.free.names, values, np.zeros((values.size,) * 2), -free, free, quiet
        )
        return replace(found, hypotheses=(known,))

    p = predict_run(found, run, draws, seed)
    low, high = p.band()
    out: dict[str, Any] = {"name": run.name, "manoeuvre": run.manoeuvre, "t": run.t, "lead": p.lead}
    out["log"] = {c: run.data[c] for c in p.channels}
    for key, model in (
        ("nominal", at(d.model.nominal[where])),
        ("recalibrated", at(base.values)),
        ("diagnosed", found),
    ):
        q = p if key == "diagnosed" else predict_run(model, run, 20, seed)
        out[key] = {c: q.mean[:, j] for j, c in enumerate(q.channels)}
    out["low"] = {c: low[:, j] for j, c in enumerate(p.channels)}
    out["high"] = {c: high[:, j] for j, c in enumerate(p.channels)}
    return out


def coefficients(d: Diagnosis, answer: dict[str, Any]) -> list[list[Any]]:
    """Name, nominal value, prior sd, estimate, its sd, and the true value, in file units."""
    drawn, nominal = answer["coefficient_draw_relative"], d.model.vehicle.coef
    rows = []
    for n, v in d.result.record()["coefficients"].items():
        prior = d.model.prior_sd(n) / abs(d.model.file_scale(n))
        rows.append([n, nominal[n], float(prior), v["value"], v["sd"], nominal[n] * (1 + drawn[n])])
    return rows
