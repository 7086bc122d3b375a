"""Identify a vehicle from a trial: fit its runs, predict the held-out ones, give the vehicle that results.

Takes a trial and a vehicle. Gives a `TrialFit` and, in a folder, iterates.jsonl, fit.json and vehicle.toml.
Does not draw or choose words: `bayesid.report.fit` does.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from bayesid.equations.model import Model, build_model
from bayesid.errors import FitError, ModelError
from bayesid.estimation.effect_gain import effect_gains
from bayesid.estimation.likelihood import CoefficientPosterior, NoiseParts
from bayesid.estimation.likelihood.filter_estimate import filter_estimate
from bayesid.estimation.likelihood.predictive_check import kind_of
from bayesid.estimation.likelihood.smoothed_start import smoothed_start
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.onsets import begun_in_time
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.read_run import output_error_run
from bayesid.estimation.output_error.residual_correlation import memory
from bayesid.estimation.output_error.search import FitOptions
from bayesid.estimation.output_error.trial_setup import measured_base, trial_problem
from bayesid.estimation.parameters import coefficient_set, with_effects
from bayesid.measures.angle_errors import counted_on
from bayesid.model.effects import Effect
from bayesid.model.params import ParameterSet
from bayesid.model.terms import TERMS
from bayesid.model.vehicles import Vehicle, identified, load_vehicle, write_vehicle
from bayesid.trials import Run, Trial

Array = np.ndarray
# The initial state of a held-out run is read from this stretch [L/U] and at least so many samples.
HEAD_LENGTHS, HEAD_SAMPLES = 3.0, 20
# Simulations of it at most, and residuals of one that diverges.
HEAD_TRIALS, DIVERGED = 50, 1e8


@dataclass(frozen=True, eq=False)
class RunOutcome:
    """One run beside its simulations.

    Attributes
    ----------
    readings, nominal, fitted : (n, c) SI; nominal and fitted are simulated with the vehicle as given and as
        found
    sigma : (c,) noise used as weight
    rms_nominal, rms_fitted : (c,) root mean square differences
    memory : (c,) integrated correlation time of the fitted residuals [samples]; 1 is white
    """

    name: str
    manoeuvre: str
    role: str
    t: Array
    channels: tuple[str, ...]
    readings: Array
    nominal: Array
    fitted: Array
    sigma: Array
    rms_nominal: Array
    rms_fitted: Array
    memory: Array


@dataclass(frozen=True, eq=False)
class TrialFit:
    """A fit with what it was made from and what it predicts; `gains` of effects as in `effect_gains`."""

    trial: Trial
    vehicle: Vehicle
    identified: Vehicle
    model: Model
    problem: FitProblem
    fit: Fit
    runs: tuple[RunOutcome, ...]
    posterior: CoefficientPosterior | None = None
    gains: Mapping[str, float] = field(default_factory=dict)


def fit_trial(
    trial: Trial,
    vehicle: Vehicle | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    free: Iterable[str] | None = None,
    fixed: Iterable[str] = (),
    ties: Mapping[str, tuple[str, float, float]] | None = None,
    params: ParameterSet | None = None,
    channels: Sequence[str] | None = None,
    use_prior: bool = True,
    relative_bounds: float | None = None,
    options: FitOptions | None = None,
    resume: bool = True,
    threads: int = 2,
    watch: Callable[[int, float, float], None] | None = None,
    parts: NoiseParts | None = None,
    effects: Iterable[str] = (),
    declared: Iterable[Effect] = (),
    say: Callable[[str], None] | None = None,
) -> TrialFit:
    """Maximum-posterior fit of a trial's runs with role "identify".

    Parameters
    ----------
    vehicle : by default the one the trial names
    out : folder for iterates.jsonl, fit.json, vehicle.toml; none are written without
    free, fixed : coefficients or effect parameters to free (default: every coefficient of the file), or to
        keep
    ties : name -> (free name, factor, offset)
    params : the unknowns themselves instead of free, fixed, ties, use_prior and relative_bounds
    channels : readings to compare, by default all
    effects : effects, or parameters of theirs, to free beside the coefficients, with their declared priors
    declared : effects beyond the catalogue
    parts : what the noise is made of; by default what the data ask for, `NoiseParts()` is white noise
    options : with `profile` None, a channel the trial states no noise for makes all of them be estimated
    say : told in a sentence whether the fit goes on from what `out` holds of an earlier run

    Raises
    ------
    FitError, ModelError, VehicleError
        set-up that cannot be used, `out` a trial's own folder among it; a fit that does not converge is a
        result
    """
    if out is not None and (Path(out) / "trial.toml").exists():
        raise FitError(
            f"{out}: holds a trial, whose vehicle.toml the fit would write over; choose another folder, "
            f"{Path(out) / 'fit'} say"
        )
    if vehicle is None:
        if not trial.vehicle_ref:
            raise FitError(f"trial {trial.name!r} names no vehicle; pass one or name it in trial.toml")
        vehicle = load_vehicle(trial.vehicle_ref)
    model = build_model(vehicle, 3 if vehicle.planar_only else trial.dof, declared)
    if params is None:
        kept = set(fixed)
        names = tuple(n for n in (free if free is not None else model.coefficients) if n not in kept)
        params = coefficient_set(
            model, names, relative_bounds=relative_bounds, use_prior=use_prior, ties=ties
        )
    params = with_effects(model, params, effects)
    problem = begun_in_time(trial_problem(model, trial, params, channels=channels, threads=threads))
    options = options or FitOptions()
    weighed_by_residuals = options.profile is True  # as asked for; those of a filter are of its sensors
    if options.profile is None:
        stated = all(c in trial.noise for run in problem.runs for c in run.channels)
        options = replace(options, profile=not stated)
    kinds = {run.name: kind_of(run.manoeuvre) for run in trial.identify}
    posed = problem
    problem, result, posterior = weighted_fit(
        problem, options, out, resume, watch, parts, kinds, say,
        smoothed=lambda: smoothed_start(posed, trial.identify),
        filtered=lambda even, tick: (
            None if weighed_by_residuals else filter_estimate(even, trial.identify, tick)
        ),
    )  # fmt: skip
    found = _identified(model, trial, result)
    if out is not None:
        write_vehicle(found, Path(out) / "vehicle.toml")
    gains = effect_gains(problem, result.z, 1.0 if posterior is None else posterior.parts.weight)
    return TrialFit(
        trial, vehicle, found, model, problem, result, outcomes(problem, trial, result), posterior, gains
    )


def _identified(model: Model, trial: Trial, result: Fit) -> Vehicle:
    rows = {t.name for t in TERMS}
    values = {n: v for n, v in result.values.items() if n in rows}
    where = [result.names.index(n) for n in values]
    covariance = within_widths(
        result.covariance[np.ix_(where, where)], (result.high - result.low)[where] / math.sqrt(12.0)
    )
    names = tuple(values)
    on = {
        n: (float(result.z[i]), float(result.sd[i]))
        for i, n in enumerate(result.names[: result.n_params])
        if model.index[n] in model.effect_off
    }
    return identified(
        model.vehicle,
        values,
        source=f"bayesid fit of {trial.name} ({trial.digest[:12]}): {result.status}",
        name=f"{model.vehicle.name}, identified",
        names=names,
        covariance=covariance,
        effects=on,
    )


def within_widths(covariance: Array, width: Array) -> Array:
    """(C^-1 + diag(1/width^2))^-1: what nothing else holds has the spread of its bounds.

    In units of the widths the eigenvalues s of C become s / (1 + s), which stays positive where C is nearly
    singular; a width that is infinite is a thousand standard deviations.
    """
    if not np.isfinite(width).any():
        return covariance
    sd = np.sqrt(np.diag(covariance))
    unit = np.where(np.isfinite(width), width, np.where(sd > 0.0, 1e3 * sd, 1.0))
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    values = np.maximum(values, 0.0)
    return ((vectors * (values / (1.0 + values))) @ vectors.T) * np.outer(unit, unit)


def outcomes(problem: FitProblem, trial: Trial, result: Fit) -> tuple[RunOutcome, ...]:
    """Every run of the trial beside the vehicle as given and as found.

    Fitted runs keep their fitted initial states; for all others it is estimated from the run's own first
    stretch, for each vehicle by itself.
    """
    model, k = problem.model, result.n_params
    found = []
    nominal = measured_base(model, trial)
    par, starts = problem.split(result.z)
    fitted = {run.name: x0 for run, x0 in zip(problem.runs, starts, strict=True)}
    channels = tuple(dict.fromkeys(c for run in problem.runs for c in run.channels))
    for run in trial.runs:
        data = output_error_run(model, run, result.sigma, channels, True, trial.measured_point)
        pair = []
        for values, x0 in ((nominal, None), (par, fitted.get(run.name))):
            alone = FitProblem(model, ParameterSet(()), (data,), values)
            z = _head_state(alone, model, run) if x0 is None else x0
            try:
                pair.append(alone.readings(z)[0])
            except ModelError:  # the vehicle as given may be unstable in this run; that is a finding
                pair.append(np.full(data.readings.shape, np.nan))
        found.append(_outcome(run, data, *pair))
    assert k <= result.z.size
    return tuple(found)


def _head_state(alone: FitProblem, model: Model, run: Run) -> Array:
    """Initial state that fits the first stretch of a run, coefficients held.

    In a trust region (scipy's): a hull that is unstable grows within the stretch, and five Gauss-Newton steps
    began the held-out turn of a REMUS 100 4 degrees a second off.
    """
    (data,) = alone.runs
    speed = max(abs(float(data.x0[model.states.index("u")])), 0.1 * model.scales["U"])
    until = max(
        HEAD_LENGTHS * model.vehicle.L / speed, float(run.t[min(HEAD_SAMPLES, run.t.size) - 1] - run.t[0])
    )
    readings = np.where((run.t - run.t[0] <= until)[:, None], data.readings, np.nan)
    head = replace(alone, runs=(replace(data, readings=readings),))
    start = np.array(head.start)
    try:
        far = np.full(head.residuals(start).shape, DIVERGED)
    except ModelError:
        return start

    def residuals(z: Array) -> Array:
        try:
            return head.residuals(z)
        except ModelError:
            return far

    try:
        found = least_squares(
            residuals, start, jac=lambda z: head.jacobian(z)[1], x_scale=head.scale, max_nfev=HEAD_TRIALS
        )
    except (ModelError, np.linalg.LinAlgError):
        return start
    return np.asarray(found.x)


def _outcome(run: Run, data: Any, nominal: Array, fitted: Array) -> RunOutcome:
    def rms(simulated: Array) -> Array:
        error = counted_on(np.where(data.valid, simulated - data.readings, np.nan), data.channels)
        count = np.maximum(data.valid.sum(axis=0), 1)
        return np.sqrt(np.sum(np.where(data.valid, error, 0.0) ** 2, axis=0) / count)

    resid = data.residuals(fitted.copy())
    finite = np.isfinite(data.readings)
    persistence = np.array([memory(resid[finite[:, j], j]) for j in range(resid.shape[1])])
    return RunOutcome(
        run.name, run.manoeuvre, run.role, run.t, data.channels, data.readings, nominal, fitted,
        np.asarray(data.sigma), rms(nominal), rms(fitted), persistence,
    )  # fmt: skip
