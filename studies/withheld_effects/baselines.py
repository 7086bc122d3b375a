"""What simpler methods would have said of the same bundles, and what the true structure would have reached.

Takes a `Diagnosis` while its fits are in memory, later the answers. Gives choices of three baselines and the
shrink of an oracle. Does not judge.

recalibrated : coefficients are refitted, no effect is ever named
bic          : readings are taken as white noise about one replay; least chi-square plus BIC among effects
correlation  : after the refit, the effect whose signature correlates most with what is left, if anything is
oracle       : the catalogue's form of the true effects, refitted like any other (needs the answer)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from bayesid.benchmark.protocol.answers import Answer
from bayesid.benchmark.protocol.cause_families import CATALOGUE_NAMES
from bayesid.benchmark.protocol.problem_file import read_problem, write_problem
from bayesid.diagnosis.data.problem import DiagnosisProblem, fit_with
from bayesid.diagnosis.evidence.holdout import validate_holdout
from bayesid.diagnosis.hypotheses.sensitivity_bank import SensitivityBank, build_bank, testable
from bayesid.diagnosis.input import checked_and_read
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.files import write_json
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import load_trial

CHOICES, PROBLEM_FILE = "baselines.json", "posed.npz"
NAMES = ("recalibrated", "bic", "correlation")
FLAT_PRIOR_PRECISION = 1e-9  # prior precision of an effect in a baseline that has no prior for it
RESIDUAL_P_VALUE = 1e-3  # p-value below which chi-square calls the residuals more than noise


def keep_baselines(found: Any, folder: Path) -> None:
    """Write the choices of the blind baselines, and what an oracle needs, beside a verdict."""
    problem, none = found.problem, found.candidates.none.fit
    effects = [e for e in problem.model.kernel.effects if testable(problem, e)]
    points = none.points if none.converged else problem.path
    bank = build_bank(problem, points, [no_process_noise(problem.model)], effects)
    write_json(folder / CHOICES, choices(bank))
    write_problem(problem, folder / PROBLEM_FILE)


def choices(bank: SensitivityBank, level: int = 0) -> dict[str, Any]:
    """Choices of the baselines from a bank whitened with sensor noise alone."""
    g, n = bank.total(level), bank.n_coef
    z = np.linalg.solve(np.eye(n) + g.ss[:n, :n], g.se[:n])
    left = float(g.ee - 2 * g.se[:n] @ z + z @ g.ss[:n, :n] @ z)
    cost = {"none": left + float(z @ z)}
    likeness: dict[str, float] = {}
    for name, column in bank.effects.items():
        size = min(v.size for v in column.variants)
        tried = [_white_fit(bank, level, v, column.effect) for v in column.variants]
        cost[name] = min(tried) + size * math.log(max(g.used, 2))
        likeness[name] = max(_likeness(g, v, z, n, left) for v in column.variants)
    stands_out = chi2.sf(left, g.used) < RESIDUAL_P_VALUE
    alike = max(likeness, key=lambda k: likeness[k]) if likeness and stands_out else "none"
    prior = {k: math.log(0.5 if k == "none" else 0.5 / max(len(cost) - 1, 1)) for k in cost}
    log_weight = {k: prior[k] - 0.5 * c for k, c in cost.items()}
    total = float(logsumexp(list(log_weight.values())))
    weight = {k: math.exp(w - total) for k, w in log_weight.items()}
    return {
        "recalibrated": {"top": "none"},
        "bic": {"top": max(weight, key=lambda k: weight[k]), "probabilities": weight},
        "correlation": {"top": alike, "share": likeness.get(alike, 0.0)},
        "reduced_chi_square": left / max(g.used, 1),
    }


def _white_fit(bank: SensitivityBank, level: int, columns: np.ndarray, effect: Any) -> float:
    """Least chi-square with an effect free; without it where a one-sided parameter would be negative."""
    g, n = bank.total(level), bank.n_coef
    both = np.concatenate([np.arange(n), columns])
    h = g.ss[np.ix_(both, both)] + np.diag(np.r_[np.ones(n), np.full(columns.size, FLAT_PRIOR_PRECISION)])
    z = np.linalg.solve(h, g.se[both])
    if any(p.one_sided and x < 0 for p, x in zip(effect.parameters, z[n:], strict=False)):
        z = np.linalg.solve(h[:n, :n], g.se[:n])
        both = both[:n]
    return float(g.ee - g.se[both] @ z)


def _likeness(g: Any, columns: np.ndarray, z: np.ndarray, n: int, left: float) -> float:
    """Share of what is left that lies along a signature."""
    b = g.se[columns] - g.ss[np.ix_(columns, np.arange(n))] @ z
    inside = g.ss[np.ix_(columns, columns)] + FLAT_PRIOR_PRECISION * np.eye(columns.size)
    return float(b @ np.linalg.solve(inside, b)) / max(left, 1e-12)


def oracle(task: tuple[Answer, Path, Path, Mapping[str, Any]]) -> tuple[str, float]:
    """Shrink of a refit with the true effects over the horizon the verdict tells, nan where there is none.

    Parameters
    ----------
    task : answer, bundle, folder of its verdict, verdict
    """
    answer, bundle, folder, verdict = task
    horizon = told_horizon(verdict)
    effects = [n for n in dict.fromkeys(c.name for c in answer.causes) if n in CATALOGUE_NAMES]
    if horizon is None or not effects or len(effects) != len(answer.causes):
        return answer.name, math.nan
    trial = load_trial(bundle)
    model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
    trial, _ = checked_and_read(trial, model)
    environment, path, level, valid = read_problem(folder / PROBLEM_FILE)
    from bayesid.estimation.parameters import coefficient_prior

    noise = dict(trial.noise)
    channels = tuple(c for c in model.kernel.channels if c in noise)
    logs = [filter_error_run(model, run, noise, channels) for run in trial.identify]
    logs = [log.without(~ok) for log, ok in zip(logs, valid, strict=True)]
    problem = DiagnosisProblem(
        model, tuple(logs), coefficient_prior(model), environment, channels, (), (), path, level
    )
    try:
        fitted = fit_with(problem, tuple(model.effects[n] for n in effects))
        models = {"nominal": model.nominal, "recalibrated": model.nominal, "with effect": fitted.par}
        horizons = validate_holdout(problem, trial, models, environment.noise_model, seed=0).horizons
    except BayesidError:
        return answer.name, math.nan
    after = next((r.excess["with effect"] for r in horizons if r.horizon == horizon["horizon"]), math.nan)
    return answer.name, 1.0 - max(after, 0.0) / horizon["excess"]["recalibrated"]


def told_horizon(verdict: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The horizon whose shrink a verdict tells, if its gap is worth it."""
    worth = [h for h in verdict["gap"]["horizons"] if h["worth_shrinking"]]
    return worth[-1] if worth else None


def needs_oracle(answer: Answer, verdict: Mapping[str, Any]) -> bool:
    """Whether the oracle is another fit than the one the verdict stands on."""
    named = {e["name"] for e in verdict["effects"]}
    return named != {c.name for c in answer.causes}
