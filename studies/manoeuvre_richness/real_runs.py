"""Real logs: does a richer run predict the others better, and how well could that be seen at all?

Takes the logs of a ship. Gives a record: information of each run by white and by composite noise, errors it
makes of the others, and the rank correlation that would come out if the posteriors were exactly right.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.design.compare import rank_correlation
from bayesid.analysis.design.criteria import gain, posterior
from bayesid.analysis.design.executed_runs import campaign_noise
from bayesid.analysis.design.goals import prediction_rows
from bayesid.analysis.design.information import runs_information
from bayesid.analysis.design.logged_runs import LogCrossing, cross_logs, level
from bayesid.analysis.design.planning_case import known_of
from bayesid.analysis.design.virtual_refit import refit
from bayesid.equations.model import build_model
from bayesid.estimation.output_error import FitProblem, measured_base, output_error_run
from bayesid.estimation.segments import in_pieces
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.trials import load_trial, thin
from studies.real_logs.run import HERE, INERTIA, SETTINGS, begun

Array = np.ndarray
REPLICATES = 2000  # of posteriors drawn, of halves and of bootstrap samples
LEAST_PAIR = 1e-12


def real(name: str, data: Path, progress: Progress, seed: int = 0) -> dict[str, Any]:
    """Richness and cross prediction of the logs of a ship; runs of reversed propeller are left out."""
    setting = SETTINGS[name]
    logged = load_trial(HERE / name, data)
    runs = [r for r in logged.runs if not r.manoeuvre.startswith("random")]
    trial = replace(logged, runs=tuple(thin(begun(r, setting.way), setting.dt) for r in runs))
    model = build_model(load_vehicle(HERE / name / "vehicle.toml"), 3)
    known = known_of(model, fixed=[n for n in INERTIA if n in model.coefficients])
    pieces: dict[str, Any] = {}
    for k, run in enumerate(trial.runs):
        cut = in_pieces(replace(trial, runs=(replace(run, role="identify"),)), setting.piece)
        pieces[f"{run.manoeuvre} ({k + 1})"] = [
            output_error_run(model, r, trial.noise, measured_point=trial.measured_point) for r in cut.runs
        ]
    base = measured_base(model, trial)
    with progress.stage(f"{name}: fit of all runs"):
        weights = level(model, known, base, pieces)
        every = tuple(r.with_sigma(weights.rms) for row in pieces.values() for r in row)
        problem = FitProblem(model, known.parameters(), every, base)
        found = refit(problem, known, start=weights.fit.unknowns)
        step = float(np.median(np.concatenate([np.diff(run.plan.t) for run in every])))
        together, noise = campaign_noise(problem, found.unknowns, known, step)
    with progress.stage(f"{name}: fit of each run alone", len(pieces)) as stage:
        table = cross_logs(model, known, base, pieces, weights, lambda _: stage.step())
    joint = np.array(base)
    joint[known.where] = weights.fit.values
    begun_at = {
        n: [replace(r, x0=x) for r, x in zip(pieces[n], weights.starts[n], strict=True)] for n in pieces
    }
    matrices: dict[str, list[Array]] = {"white noise": [], "composite": []}
    rows = []
    for n in table.names:
        flat = [r.with_sigma(weights.sigma) for r in begun_at[n]]
        plain = [r.with_sigma(weights.rms) for r in begun_at[n]]
        matrices["white noise"].append(runs_information(model, known, joint, flat, None))
        matrices["composite"].append(runs_information(model, known, joint, plain, noise))
        rows.append(np.concatenate([prediction_rows(model, known, joint, r) for r in plain]))
    rng = np.random.default_rng([seed, 7])
    made = table.others(table.excess)
    return {
        "title": trial.name, "attribution": trial.attribution, "rms": weights.rms, "table": table,
        "excess": table.excess, "others": made, "converged": weights.fit.converged,
        "predicted_others": table.others(table.predicted),
        "noise": together.parts.describe(), "share": together.parts.share,
        "likelihoods": {k: judged(table, m, rows, made, rng) for k, m in matrices.items()},
        "halves": halves(table, rng),
    }  # fmt: skip


def judged(
    table: LogCrossing,
    matrices: Sequence[Array],
    rows: Sequence[Array],
    made: Array,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Ranks by gain and by expected error beside the errors made, and what they would be in theory."""
    gains = np.array([float(gain(m)) for m in matrices])
    left = [posterior(m) for m in matrices]
    seen = [r.T @ r / len(r) * _channels(r, rows) for r in rows]
    expected = np.array([
        [np.sqrt(1.0 + float(np.sum(part * cov))) for part in seen] for cov in left
    ])  # fmt: skip
    foreseen = table.others(expected)
    theory = {"gain": [], "expected error": []}  # type: dict[str, list[float]]
    roots = [np.linalg.cholesky(0.5 * (c + c.T)) for c in left]
    for _ in range(REPLICATES):
        errors = np.array([_errors(root @ rng.standard_normal(len(root)), seen) for root in roots])
        drawn = table.others(errors)
        theory["gain"].append(rank_correlation(gains, -drawn))
        theory["expected error"].append(rank_correlation(foreseen, drawn))
    return {
        "gains": gains, "expected": foreseen,
        "ranks": {
            "gain": {"made": rank_correlation(gains, -made), "interval": _bootstrap(gains, -made, rng)},
            "expected error": {
                "made": rank_correlation(foreseen, made), "interval": _bootstrap(foreseen, made, rng)
            },
        },
        "theory": {k: np.quantile(v, [0.05, 0.5, 0.95]) for k, v in theory.items()},
        "expected_over_made": float(np.exp(np.median(np.log(foreseen / made)))),
    }  # fmt: skip


def _channels(row: Array, rows: Sequence[Array]) -> float:
    """Rows of all runs hold the same channels; none needs another weight."""
    return 1.0 if row.shape[1] == rows[0].shape[1] else np.nan


def _errors(xi: Array, seen: Sequence[Array]) -> Array:
    """(m,) error over the joint fit's in every run of a vehicle `xi` off it."""
    return np.array([np.sqrt(1.0 + float(xi @ part @ xi)) for part in seen])


def _bootstrap(a: Array, b: Array, rng: np.random.Generator) -> Array:
    """90 % interval of a rank correlation, runs drawn again."""
    picked = rng.integers(0, len(a), (REPLICATES, len(a)))
    found = np.array([rank_correlation(a[p], b[p]) for p in picked])
    return np.nanquantile(found, [0.05, 0.95])


def halves(table: LogCrossing, rng: np.random.Generator) -> dict[str, Any]:
    """Rank correlation of the errors a run makes of one half of the runs and of the other half.

    The measured ranking of runs is no better known than that: what ranks by it cannot do better than the
    square root of the whole list's reliability (Spearman and Brown).
    """
    logs = np.log(np.clip(table.excess, LEAST_PAIR, None))
    np.fill_diagonal(logs, np.nan)
    found = []
    for _ in range(REPLICATES):
        order = rng.permutation(len(logs))
        parts = [np.nanmean(logs[:, p], axis=1) for p in np.array_split(order, 2)]
        found.append(rank_correlation(*parts))
    half = float(np.median(found))
    whole = 2 * half / (1 + half)
    return {
        "halves": np.quantile(found, [0.05, 0.5, 0.95]),
        "ceiling": float(np.sqrt(max(whole, 0.0))),
    }


def kinds(table: Mapping[str, Any]) -> list[str]:
    """Kinds of run there are."""
    return sorted({n.split(" ")[0] for n in table["names"]})
