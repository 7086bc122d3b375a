"""From a fit to a model that predicts: honest coefficients, and the disturbance that gives the errors seen.

Takes a `TrialFit`. Gives a `DiagnosedModel` without effects. Does not fit coefficients.

A new run has coefficients of its own, so the run-to-run spread is added to the posterior. What is left is
taken for a force with memory, and for errors of single channels where the runs ask for them. Sizes, memory
and one of two covariances of the coefficients (the error of the estimate; that of readings weighed by what
their noise leaves them, never wider than the prior) are those that give the fitted runs, each predicted from
the others and begun on its first readings, the largest predictive density (`disturbance_size`). On two
tankers this order is that of held-out runs: the error of the estimate is 15 prior standard deviations for
one, whose bands then hold everything; without it those of the other hold too little.

The size that one-step evidence prefers is another one: it makes a wrong model follow the data, and bands of
a long prediction three to ten times too wide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit
from bayesid.estimation.likelihood.posterior import CoefficientPosterior
from bayesid.estimation.trial_fit import TrialFit
from bayesid.prediction.disturbance_size import PredictedRun, best_sizes
from bayesid.prediction.draws import DivergingDraws
from bayesid.prediction.intervals import log_density, reading_errors, standard_errors
from bayesid.prediction.run_prediction import predict_run, read_run, variance_of_draws
from bayesid.threads import each
from bayesid.trials import Run
from bayesid.trials.noise import raised, rough_noise

Array = np.ndarray
# Correlation times of the disturbance that are tried [L/U]; its size over 1/2 rho L^2 U^2 where the runs are
# predicted for their errors, and where its effect is read.
TAUS, CALM_LEVEL, UNIT_LEVEL = (1.0, 3.0, 12.0), 1e-5, 3e-5
FEW_DRAWS = 20  # of a disturbance alone
MOST_INSTANTS = 80  # of a run, evenly picked, whose errors size the disturbance
# Rounds of prediction and sizes, change of log density that counts as none, least share of a variance that
# is not of the disturbance.
ROUNDS, SAME, LEAST_SHARE = 4, 0.005, 0.01
HORIZONS = ("early", "middle", "late")  # thirds of a run after its lead-in
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
    channel : channel -> sd of errors of its own that no force explains, beyond its noise [SI]
    diverge : held-out run, else fitted one -> share of the vehicles drawn from the covariance of the fit that
        diverge in it; runs where none does are left out
    """

    level: dict[str, float]
    tau: float
    ratio: dict[str, dict[str, float]]
    inside: dict[str, float]
    run_spread: float = 0.0
    keeps_prior: bool = False
    apart: bool = True
    channel: Mapping[str, float] = field(default_factory=dict)
    diverge: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Setting:
    """What runs are predicted with: covariance of the coefficients, memory of the disturbance, its sizes."""

    found: TrialFit
    posterior: CoefficientPosterior
    tau: float
    level: Array
    channel: Mapping[str, float]
    sensors: Mapping[str, float]

    def model(self, run: str, known: bool = False) -> DiagnosedModel:
        """The model that predicts one run from the others; `known` without spread of its coefficients."""
        p = self.posterior.without(run)
        if known:
            p = replace(p, covariance=0.0 * p.covariance, run_sd=0.0 * p.run_sd)
        return with_disturbance(
            self.found, p, self.level, self.tau, channel=self.channel, sensors=self.sensors
        )


@dataclass(frozen=True, eq=False)
class _Errors:
    """One run predicted from the others; `rows` are the instants that count, `density` of its readings."""

    channels: tuple[str, ...]
    rows: Array
    error: Array
    variance: Array
    density: float

    def beside(self, setting: _Setting, added: Array) -> PredictedRun:
        """The same beside the variance that a disturbance adds at all instants, its own part taken out."""
        per_axis = added[:, self.rows]
        own = np.einsum("a,anq->nq", setting.level**2, per_axis)
        fixed = np.maximum(self.variance - own, LEAST_SHARE * self.variance)
        return PredictedRun(self.channels, self.error, fixed, per_axis)


def predictive_model(
    found: TrialFit,
    draws: int = 60,
    seed: int = 0,
    say: Say = lambda text: None,
    runs: Sequence[Run] | None = None,
    lead: float | None = None,
) -> tuple[DiagnosedModel, Calibration]:
    """The model of a fit, its disturbance sized on the fitted runs, each predicted from the others.

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
    # what no run tells moves none of these runs; in a new manoeuvre it would make most draws diverge
    wide, kept = found.posterior.as_given_where_open(), found.posterior.no_wider_than_prior()
    seen = (wide.sd > 0) & (kept.sd > 0)
    alike = np.abs(np.log(kept.sd[seen] / wide.sd[seen])).max(initial=0.0) <= np.log(ALIKE)
    time = found.model.scales["L"] / found.model.scales["U"]
    calm = np.full(len(_axes(found)), CALM_LEVEL)
    sensors = sensor_noise(found)
    settings = [
        _Setting(found, p, TAUS[1] * time, calm, {}, sensors) for p in ((wide,) if alike else (wide, kept))
    ]
    errors = [_errors(s, chosen, draws, seed, lead) for s in settings]
    tried: list[tuple[int, float, _Setting]] = []
    for tau in (k * time for k in TAUS):
        able = [run for run in chosen if any(run.name in e for e in errors)]
        added = _added_variances(replace(settings[0], tau=tau), able, draws, seed, lead)
        for setting, predicted in zip(settings, errors, strict=True):
            parts = [predicted[n].beside(setting, more) for n, more in added.items() if n in predicted]
            if parts:
                sizes = best_sizes(parts)
                new = replace(setting, tau=tau, level=sizes.level, channel=sizes.channel)
                tried.append((len(parts), sizes.density, new))
    if not tried:
        raise ModelError("no fitted run can be predicted from its first readings: every draw diverges")
    best = _settled(max(tried, key=lambda t: t[:2])[2], chosen, draws, seed, say, lead)
    told = _told(best, chosen, draws, seed, lead)
    told = replace(told, keeps_prior=best.posterior is kept)
    model = with_disturbance(
        found, best.posterior, best.level, told.tau, told.run_spread, best.channel, sensors
    )
    return model, told


def diverging_draws(
    model: DiagnosedModel, runs: Sequence[Run], draws: int = 60, seed: int = 0
) -> dict[str, float]:
    """Run -> share of the vehicles drawn that diverge in it, where any does."""

    def lost(run: Run) -> int:
        try:
            return predict_run(model, run, draws, seed, most_diverged=1.0).lost
        except DivergingDraws:
            return draws
        except BayesidError:  # it cannot be predicted for another reason, as one of a few samples
            return 0

    chosen = spaced(runs, MOST_RUNS)
    return {run.name: n / draws for run, n in zip(chosen, each(lost, chosen), strict=True) if n}


def _settled(
    setting: _Setting, runs: Sequence[Run], draws: int, seed: int, say: Say, lead: float | None
) -> _Setting:
    """Sizes once more about those found: how sure a lead-in leaves the start depends on them."""
    seen: list[tuple[int, float, _Setting]] = []
    for number in range(ROUNDS):
        errors = _errors(setting, runs, draws, seed, lead)
        if not errors:
            break
        density = float(np.mean([e.density for e in errors.values()]))
        seen.append((len(errors), density, setting))
        say(f"disturbance of {setting.tau:.3g} s, round {number + 1}: log density {density:.4g} per reading")
        if number + 1 == ROUNDS or (number and abs(density - seen[-2][1]) < SAME):
            break
        able = [run for run in runs if run.name in errors]
        added = _added_variances(setting, able, draws, seed, lead)
        parts = [errors[n].beside(setting, more) for n, more in added.items()]
        if not parts:
            break
        sizes = best_sizes(parts)
        setting = replace(setting, level=sizes.level, channel=sizes.channel)
    return max(seen, key=lambda t: t[:2])[2] if seen else setting


def _errors(
    setting: _Setting, runs: Sequence[Run], draws: int, seed: int, lead: float | None
) -> dict[str, _Errors]:
    """Runs predicted from the others, those that can be."""

    def errors(run: Run) -> _Errors | None:
        try:
            p = predict_run(setting.model(run.name), run, draws, seed, lead)
        except BayesidError:
            return None
        read = {channel: error for _, channel, error, _ in reading_errors(p, run)}
        if not read:
            return None
        late = np.flatnonzero(p.t - p.t[0] > p.lead)
        rows = late[np.unique(np.linspace(0, late.size - 1, min(MOST_INSTANTS, late.size)).astype(int))]
        error = np.stack([read.get(c, np.full(p.t.size, np.nan)) for c in p.channels], axis=1)
        own = np.array([setting.channel.get(c, 0.0) for c in p.channels])
        variance = p.draws.var(axis=0, ddof=1) + np.nan_to_num(p.noise) ** 2 - own**2
        return _Errors(p.channels, rows, error[rows], variance[rows], log_density(p, run))

    found = zip(runs, each(errors, runs), strict=True)
    return {run.name: one for run, one in found if one is not None}


def _added_variances(
    setting: _Setting, runs: Sequence[Run], draws: int, seed: int, lead: float | None
) -> dict[str, Array]:
    """Run -> (a, n, q) variance that a disturbance of size 1 on each axis adds, coefficients known."""
    few = max(draws // 2, FEW_DRAWS)

    def added(run: Run) -> Array | None:
        def variance(level: Array) -> Array:
            model = replace(setting, level=level).model(run.name, known=True)
            return variance_of_draws(model, read, few, seed)

        found = []
        try:
            read = read_run(setting.model(run.name, known=True), run, lead)
            here = variance(setting.level)
            for axis, size in enumerate(setting.level):
                level = setting.level.copy()
                level[axis] = max(2.0 * size, UNIT_LEVEL)
                found.append(np.maximum(variance(level) - here, 0.0) / (level[axis] ** 2 - size**2))
        except BayesidError:
            return None
        return np.array(found)

    each_added = zip(runs, each(added, runs), strict=True)
    return {run.name: more for run, more in each_added if more is not None}


def _told(setting: _Setting, runs: Sequence[Run], draws: int, seed: int, lead: float | None) -> Calibration:
    """How well the runs are predicted with the disturbance found."""
    models = {run.name: setting.model(run.name) for run in runs}
    errors, _ = prediction_errors(models, runs, draws, seed, lead)
    ratio = {c: {h: ratio_of(np.concatenate(z)) for h, z in parts.items()} for c, parts in errors.items()}
    inside = {c: float(np.mean(np.abs(pooled(parts)) < 1.96)) for c, parts in errors.items()}
    return Calibration(
        dict(zip(_axes(setting.found), map(float, setting.level), strict=True)), setting.tau, ratio, inside,
        size_spread(errors) if errors else 0.0,
        apart=all(run.name in setting.posterior.left_out for run in runs),
        channel=setting.channel,
    )  # fmt: skip


def _axes(found: TrialFit) -> list[str]:
    """Axes a disturbance acts on."""
    return [n[-1] for n in found.model.kernel.exogenous if n.startswith("force_")]


def ratio_of(z: Array) -> float:
    """Error that 95 % of the readings stay below, over 1.96 predicted standard deviations."""
    return max(float(np.quantile(np.abs(z), 0.95)) / 1.96, 1e-3)


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
    found: TrialFit,
    posterior: CoefficientPosterior,
    level: Array,
    tau: float,
    run_spread: float = 0.0,
    channel: Mapping[str, float] | None = None,
    sensors: Mapping[str, float] | None = None,
) -> DiagnosedModel:
    """The model of a fit under a disturbance: size per axis over 1/2 rho L^2 U^2, correlation time [s].

    Parameters
    ----------
    run_spread : sd of the logarithm of its size from run to run, whose mean square `level` is
    channel : channel -> sd of errors of its own, which count as noise of that sensor [SI]
    sensors : `sensor_noise` of the fit, where it is known already
    """
    model, s = found.model, found.model.scales
    time = s["L"] / s["U"]
    noise = NoiseModel(tuple(float(f) for f in level * force_unit(model)), tau, 0.0, 20.0 * time)
    # three-point Gauss-Hermite rule of the logarithm of its size
    rms = np.exp(run_spread**2)
    sizes = [
        (np.exp(np.sqrt(3.0) * run_spread * k) / rms, w) for k, w in ((-1, 1 / 6), (0, 2 / 3), (1, 1 / 6))
    ]
    hypotheses = tuple(
        WeightedHypothesis(
            (),
            w,
            posterior.names,
            posterior.mean,
            posterior.covariance,
            posterior.low,
            posterior.high,
            noise.scaled(float(f)),
            posterior.run_sd,
        )
        for f, w in (sizes if run_spread > 0 else [(1.0, 1.0)])
    )
    seen = dict(sensor_noise(found) if sensors is None else sensors)
    seen |= {c: float(np.hypot(seen.get(c, 0.0), s)) for c, s in (channel or {}).items()}
    return DiagnosedModel(model, hypotheses, seen, "fit", found.trial.digest)


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

    def predicted(run: Run) -> tuple[dict[str, Array], float] | None:
        try:
            p = predict_run(models[run.name], run, draws, seed, lead)
        except BayesidError:
            return None
        errors = standard_errors(p, run)
        return (errors, log_density(p, run)) if errors else None

    able = [one for one in each(predicted, runs) if one is not None]
    found, density = [errors for errors, _ in able], [value for _, value in able]
    out: dict[str, dict[str, list[Array]]] = {}
    for name in dict.fromkeys(c for errors in found for c in errors):
        split = [np.array_split(errors.get(name, np.zeros(0)), len(HORIZONS)) for errors in found]
        for horizon, parts in zip(HORIZONS, zip(*split, strict=True), strict=True):
            if any(part.size for part in parts):
                out.setdefault(name, {})[horizon] = list(parts)
    return out, density
