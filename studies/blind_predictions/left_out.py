"""Bands that runs left out of the fit ask for: the second set of predictions, ships by MMG.

Takes a set and its known logs. Gives, per kind of motion, the fit that predicts left-out runs best and the
factors on its band; and models that predict. Writes nothing.

Draws are those that keep the prior, about the estimate: where residuals have memory, the error of the
estimate that was made is up to 160 times the prior, and ships drawn from it diverge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.errors import BayesidError
from bayesid.estimation.trial_fit import TrialFit
from bayesid.measures.angle_errors import counted_on
from bayesid.prediction.fitted_model import with_disturbance
from bayesid.prediction.run_prediction import predict_run
from bayesid.progress import Progress
from bayesid.trials import Run, Trial
from studies.blind_predictions.sets import REGIMES, BlindSet, fitted, kind, prepared
from studies.blind_predictions.widening import (
    Misses,
    chosen_level,
    either_way,
    factors,
    left_out_coverage,
    misses,
)

# Share of the covariance that is drawn, disturbance over 1/2 rho L^2 U^2 and its time [L/U]: they shape the
# band over time and from channel to channel, its size is that of left-out runs.
SHARE, LEVEL, TAU = 0.1, 1e-5, 12.0
FOLDS, DRAWS = 2, 60
#: kinds nobody here has a log of: runs that go beyond all others, predicted without them
BEYOND = {"kvlcc2_hsva": ("circle", ("Z_25_05", "Z_30_05", "Z_35_05"))}


def drawing_model(found: TrialFit) -> DiagnosedModel:
    """Draws about the estimate that keep the prior.

    Raises
    ------
    BayesidError
        if the fit has no posterior
    """
    posterior = found.posterior
    if posterior is None:
        raise BayesidError("the fit has no posterior: the vehicle diverges at its estimate")
    kept = replace(
        posterior,
        mean=posterior.estimate,
        covariance=SHARE * posterior.kept_prior,
        run_sd=np.zeros_like(posterior.run_sd),
    )
    s, axes = found.model.scales, [n for n in found.model.kernel.exogenous if n.startswith("force_")]
    return with_disturbance(found, kept, np.full(len(axes), LEVEL), TAU * s["L"] / s["U"])


def folds(blind: BlindSet, trial: Trial) -> dict[str, tuple[str, ...]]:
    """Fold -> names of the runs it leaves out: of each kind every `FOLDS`-th, and those beyond the others."""
    out: dict[str, tuple[str, ...]] = {}
    kinds = dict.fromkeys(kind(r.name) for r in trial.runs)
    for n in range(FOLDS):
        lists = [[r.name for r in trial.runs if kind(r.name) == k][n::FOLDS] for k in kinds]
        out[f"fold_{n + 1}"] = tuple(name for some in lists for name in some)
    if blind.logs in BEYOND:
        out["beyond"] = BEYOND[blind.logs][1]
    return out


def left_out(
    blind: BlindSet, trial: Trial, data: Path, quick: bool, seed: int, out: Path, progress: Progress
) -> dict[str, Any]:
    """Record: kind -> chosen regime, factors, level and coverage; and errors of every left-out run.

    Every fit that can predict a run does, whatever its regime.
    """
    seen: dict[str, list[tuple[Misses, dict[str, Any]]]] = {}
    for fold, names in folds(blind, trial).items():
        below = out / fold
        roles = tuple(replace(r, role="holdout" if r.name in names else "identify") for r in trial.runs)
        for regime in REGIMES:
            try:
                found = fitted(
                    blind,
                    replace(trial, runs=roles),
                    regime,
                    data,
                    quick,
                    seed,
                    below / regime,
                    progress,
                )
            except BayesidError as error:
                progress.note(f"{fold}, {regime}: {error}")
                continue
            if found is None:
                continue
            model = drawing_model(found)
            held = [r for r in roles if r.role == "holdout"]
            for run in progress.track(held, f"{fold}, {regime}: left-out runs"):
                what = BEYOND[blind.logs][0] if fold == "beyond" else kind(run.name)
                if regime == "ahead" and what in REGIMES["slow"]:
                    continue
                row = predicted(model, prepared(blind, run), what, blind.lead, seed)
                if row is not None and fold == "beyond":
                    row = either_way(row[0]), row[1]
                if row is not None:
                    seen.setdefault(f"{what} {regime}", []).append(row)
    return {"kinds": summary(seen), "runs": {key: [row for _, row in rows] for key, rows in seen.items()}}


def predicted(
    model: DiagnosedModel, run: Run, what: str, lead: float, seed: int
) -> tuple[Misses, dict[str, Any]] | None:
    """Misses and rms errors of one left-out run, None where it cannot be predicted."""
    try:
        p = predict_run(model, run, DRAWS, seed, lead)
    except BayesidError:
        return None
    one = misses(p, run, what)
    late = p.t - p.t[0] > p.lead
    rms = {}
    for j, name in enumerate(p.channels):
        error = counted_on((run.data[name] - p.mean[:, j])[:, None], (name,))[late, 0]
        if name in one.error:
            rms[name] = float(np.sqrt(np.nanmean(error**2)))
    return one, {"run": run.name, "kind": what, "seconds": float(run.duration), "rms": rms}


def summary(seen: Mapping[str, Sequence[tuple[Misses, dict[str, Any]]]]) -> dict[str, Any]:
    """Kind -> regime with the least position error of left-out runs, its factors, and their coverage."""
    out: dict[str, Any] = {}
    for key, rows in seen.items():
        what, regime = key.split()
        size = float(np.median([np.hypot(row["rms"]["x"], row["rms"]["y"]) for _, row in rows]))
        tried = out.get(what, {}).get("tried", {}) | {regime: size}
        if size > min(tried.values()):
            out[what]["tried"] = tried
            continue
        found = [one for one, _ in rows]
        level = chosen_level(found)
        inside = left_out_coverage(found, level) if len(found) > 1 else {}
        for _, row in rows:
            row["inside"] = inside.get(row["run"], {})
        out[what] = {
            "regime": regime, "tried": tried, "runs": len(found), "level": level,
            "factors": factors(found, level),
            "inside": {c: float(np.mean([r[c] for r in inside.values() if c in r])) for c in found[0].error}
            if inside else {},
        }  # fmt: skip
    return out
