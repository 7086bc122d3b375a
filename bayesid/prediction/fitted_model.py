"""From a fit to a model that predicts: honest coefficients, and the disturbance that gives the errors seen.

Takes a `TrialFit`. Gives a `DiagnosedModel` without effects. Does not fit coefficients.

A new run has coefficients of its own, so the run-to-run spread is added to the posterior. What is left is
taken for a force with memory whose size per axis makes the multi-step errors of the fitted runs, each
predicted from the others and begun on its first readings, as large as predicted: 95 % of them within 1.96
predicted standard deviations. Of the memories and sizes tried, and of the two covariances of the coefficients
(the error of the estimate; that of readings weighed by what their noise leaves them, never wider than the
prior), the one that gives those runs the largest predictive density is taken (logarithmic score; Gneiting and
Raftery 2007). On two tankers this order is that of held-out runs: the error of the estimate is 15 prior
standard deviations for one, whose bands then hold everything; without it those of the other hold too little.

The size that one-step evidence prefers is another one: it makes a wrong model follow the data, and bands of
a long prediction three to ten times too wide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit
from bayesid.estimation.likelihood.posterior import CoefficientPosterior
from bayesid.estimation.trial_fit import TrialFit
from bayesid.prediction.intervals import log_density, standard_errors
from bayesid.prediction.prediction import predict_run
from bayesid.trials import Run
from bayesid.trials.noise import raised, rough_noise

Array = np.ndarray
# Correlation times of the disturbance that are tried [L/U]; its first, least and most size over
# 1/2 rho L^2 U^2.
TAUS, FIRST_LEVEL, LEAST_LEVEL, MOST_LEVEL = (1.0, 3.0, 12.0), 3e-5, 1e-7, 3e-3
# Rounds of prediction and change of size, change that counts as none, and most change of one round.
ROUNDS, SAME, MOST_CHANGE = 4, 0.1, 4.0
HORIZONS = ("early", "middle", "late")  # thirds of a run after its lead-in
# Channels that tell the size of each axis.
TELLING = {
    "X": ("u",),
    "Y": ("v",),
    "Z": ("w", "z"),
    "K": ("p", "phi"),
    "M": ("q", "theta"),
    "N": ("r", "psi"),
}
MOST_RUNS = 12

Say = Callable[[str], None]
Errors = Mapping[str, Mapping[str, Sequence[Array]]]
# Ratio of standard deviations up to which two covariances give the same predictions.
ALIKE = 1.1
# Sd of the logarithm of the size of errors of single runs that chance gives.
CHANCE_SPREAD = 0.25


@dataclass(frozen=True, eq=False)
class Calibration:
    """How well the errors of the fitted runs, each predicted from the others, are predicted.

    Attributes
    ----------
    level : axis -> force over 1/2 rho L^2 U^2 (moments: L^3)
    tau : its correlation time [s]
    ratio : channel -> horizon (third of a run after its lead-in) -> error that 95 % of the readings stay
        below, over 1.96 predicted sd
    inside : channel -> share of readings inside the 95 % band
    run_spread : sd of the logarithm of the disturbance's size from run to run
    keeps_prior : whether coefficients are drawn no wider than their prior
    apart : whether each run was predicted from the others; not where one run alone was fitted
    """

    level: dict[str, float]
    tau: float
    ratio: dict[str, dict[str, float]]
    inside: dict[str, float]
    run_spread: float = 0.0
    keeps_prior: bool = False
    apart: bool = True


@dataclass(frozen=True, eq=False)
class _Tried:
    """A disturbance and how runs were predicted with it: `density` is the mean log density of their readings
    in the units of each channel, of runs x channels x horizons; `lost` are runs that were not predicted."""

    lost: int
    density: float
    posterior: CoefficientPosterior
    level: Array
    told: Calibration

    @property
    def rank(self) -> tuple[int, float]:
        return -self.lost, self.density


def predictive_model(
    found: TrialFit,
    draws: int = 60,
    seed: int = 0,
    say: Say = lambda text: None,
    runs: Sequence[Run] | None = None,
    lead: float | None = None,
) -> tuple[DiagnosedModel, Calibration]:
    """The model of a fit, its disturbance calibrated on the fitted runs, each predicted from the others.

    Parameters
    ----------
    runs : to calibrate on instead of the fitted ones
    lead : first seconds of each that are read; by default as in `predict_run`

    Raises
    ------
    ModelError
        if the fit has no posterior, or no fitted run can be predicted
    """
    if found.posterior is None:
        raise ModelError("the fit has no posterior: the vehicle diverges at its estimate")
    chosen = spaced(found.trial.identify if runs is None else runs, MOST_RUNS)
    wide, kept = found.posterior, found.posterior.no_wider_than_prior()
    time = found.model.scales["L"] / found.model.scales["U"]
    tried = [t for tau in TAUS for t in _calibrated(found, wide, tau * time, chosen, draws, seed, say, lead)]
    if np.abs(np.log(kept.sd / wide.sd)).max() > np.log(ALIKE):
        tau = max(tried, key=lambda t: t.rank).told.tau if tried else TAUS[0] * time
        tried += _calibrated(found, kept, tau, chosen, draws, seed, say, lead)
    if not tried:
        raise ModelError("no fitted run can be predicted from its first readings: every draw diverges")
    best = max(tried, key=lambda t: t.rank)
    told = replace(best.told, keeps_prior=best.posterior is kept)
    return with_disturbance(found, best.posterior, best.level, told.tau, told.run_spread), told


def _calibrated(
    found: TrialFit,
    posterior: CoefficientPosterior,
    tau: float,
    runs: Sequence[Run],
    draws: int,
    seed: int,
    say: Say,
    lead: float | None,
) -> list[_Tried]:
    """What was tried with one correlation time [s]."""
    axes = [n[-1] for n in found.model.kernel.exogenous if n.startswith("force_")]
    level = np.full(len(axes), FIRST_LEVEL)
    tried: list[_Tried] = []
    for number in range(ROUNDS):
        models = {run.name: with_disturbance(found, posterior.without(run.name), level, tau) for run in runs}
        errors, density = prediction_errors(models, runs, draws, seed, lead)
        if not errors:
            level = level * 0.2
            continue
        ratio = {c: {h: ratio_of(np.concatenate(z)) for h, z in parts.items()} for c, parts in errors.items()}
        inside = {c: float(np.mean(np.abs(pooled(parts)) < 1.96)) for c, parts in errors.items()}
        sizes = dict(zip(axes, map(float, level), strict=True))
        apart = all(run.name in posterior.left_out for run in runs)
        now = Calibration(sizes, tau, ratio, inside, size_spread(errors), apart=apart)
        tried.append(_Tried(len(runs) - len(density), float(np.mean(density)), posterior, level, now))
        worst = max(r for parts in ratio.values() for r in parts.values())
        say(
            f"disturbance of {tau:.3g} s, round {number + 1}: 95 % of the errors are within "
            f"{worst:.2g} times their band"
        )
        new = np.clip(level * [_change(axis, errors) for axis in axes], LEAST_LEVEL, MOST_LEVEL)
        if np.all(np.abs(np.log(new / level)) < SAME):
            break
        level = new
    return tried


def ratio_of(z: Array) -> float:
    """Error that 95 % of the readings stay below, over 1.96 predicted standard deviations."""
    return max(float(np.quantile(np.abs(z), 0.95)) / 1.96, 1e-3)


def _change(axis: str, errors: Errors) -> float:
    seen = [c for c in TELLING[axis] if c in errors] or list(errors)
    value = float(np.exp(np.mean([np.log(ratio_of(pooled(errors[c]))) for c in seen])))
    return float(np.clip(value**1.2, 1.0 / MOST_CHANGE, MOST_CHANGE))


def pooled(parts: Mapping[str, Sequence[Array]]) -> Array:
    """All errors of one channel."""
    return np.concatenate([z for runs in parts.values() for z in runs])


def size_spread(errors: Errors) -> float:
    """Sd of the logarithm of the errors' size from run to run, beyond what few correlation times give."""
    count = max(len(runs) for parts in errors.values() for runs in parts.values())
    sizes = []
    for k in range(count):
        squares = [
            np.mean(runs[k] ** 2) for parts in errors.values() for runs in parts.values() if runs[k].size
        ]
        if squares:
            sizes.append(0.5 * np.log(np.median(squares)))
    return float(np.sqrt(max(np.var(sizes, ddof=1) - CHANCE_SPREAD**2, 0.0))) if len(sizes) > 2 else 0.0


def with_disturbance(
    found: TrialFit, posterior: CoefficientPosterior, level: Array, tau: float, run_spread: float = 0.0
) -> DiagnosedModel:
    """The model of a fit under a disturbance: size per axis over 1/2 rho L^2 U^2, correlation time [s]."""
    model, s = found.model, found.model.scales
    covariance = posterior.covariance + np.diag(posterior.run_sd**2)
    time = s["L"] / s["U"]
    noise = NoiseModel(tuple(float(f) for f in level * force_unit(model)), tau, 0.0, 20.0 * time)
    # three-point Gauss-Hermite rule of the logarithm of its size
    sizes = [(np.exp(np.sqrt(3.0) * run_spread * k), w) for k, w in ((-1, 1 / 6), (0, 2 / 3), (1, 1 / 6))]
    hypotheses = tuple(
        WeightedHypothesis(
            (),
            w,
            posterior.names,
            posterior.mean,
            covariance,
            posterior.low,
            posterior.high,
            noise.scaled(float(f)),
        )
        for f, w in (sizes if run_spread > 0 else [(1.0, 1.0)])
    )
    return DiagnosedModel(model, hypotheses, sensor_noise(found), "fit", found.trial.digest)


def sensor_noise(found: TrialFit) -> dict[str, float]:
    """White noise per channel [SI]: as stated, else of the readings' own fast changes; never nothing."""
    out: dict[str, float] = {}
    for run in found.trial.identify:
        for c, values in run.data.items():
            value = found.trial.noise.get(c) or rough_noise(run.t, values)
            if value:
                out[c] = max(out.get(c, 0.0), float(value))
    s = found.model.scales
    return out | (raised(out, s["L"], s["U"]) or {})


def spaced(runs: Sequence[Run], most: int) -> list[Run]:
    """At most so many runs, evenly picked."""
    if len(runs) <= most:
        return list(runs)
    return [runs[i] for i in np.unique(np.linspace(0, len(runs) - 1, most).round().astype(int))]


def prediction_errors(
    models: Mapping[str, DiagnosedModel],
    runs: Sequence[Run],
    draws: int,
    seed: int,
    lead: float | None = None,
) -> tuple[Errors, list[float]]:
    """Errors of the mean over the predicted sd, after the lead-ins, and log density per predicted run.

    Parameters
    ----------
    models : run -> model that predicts it

    Returns
    -------
    channel -> horizon -> per run: errors. Every list has all runs; what a run has not read is empty
    mean over channels and horizons of the log density of a reading [its unit], for every run predicted
    """
    out: dict[str, dict[str, list[Array]]] = {}
    found: list[dict[str, Array]] = []
    density = []
    for run in runs:
        try:
            p = predict_run(models[run.name], run, draws, seed, lead)
        except BayesidError:
            continue
        if not (errors := standard_errors(p, run)):
            continue
        found.append(errors)
        density.append(log_density(p, run))
    for name in dict.fromkeys(c for errors in found for c in errors):
        split = [np.array_split(errors.get(name, np.zeros(0)), len(HORIZONS)) for errors in found]
        for horizon, parts in zip(HORIZONS, zip(*split, strict=True), strict=True):
            if any(part.size for part in parts):
                out.setdefault(name, {})[horizon] = list(parts)
    return out, density
