"""Every run of a trial replayed from its orders: as given, re-tuned, explained; how far each misses the log.

Takes a `DiagnosisProblem`, its trial and fitted models. Gives frozen `Replay`s. Never changes a verdict.

Each replay starts from a state fitted to the first seconds and runs open loop from there; errors are counted
after those seconds. The deviation around the explained model is that of the sensors, of the environment, of
the start and of the explained model's parameters.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.linalg import LinAlgError

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.residual_force import residual_force
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.noise_model import NoiseModel, smoothed
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData
from bayesid.estimation.truncated_normal import within_bounds
from bayesid.measures.angle_errors import counted_on
from bayesid.simulation import observe, plan_trial_run, simulate
from bayesid.trials import Run, Trial

GIVEN, RETUNED, EXPLAINED = "nominal", "recalibrated", "with effect"
# First part read to begin on the track: six ship lengths of travel, at most this share of a run.
LEAD_LENGTHS, MOST_LEAD = 6.0, 0.25
BAND_DRAWS = 16
MOST_FORCES = 5  # runs that get a residual force: the one to show, and held-out ones
GROSS = 50.0  # times the median miss, from which a reading is not an error of a model


@dataclass(frozen=True, eq=False)
class Replay:
    """One run beside its simulations.

    Attributes
    ----------
    run, manoeuvre, role : as in the trial
    t : (n,) [s]
    lead : seconds read to begin on the track
    channels : (q,) names
    readings : (n, q) SI, nan where there is none
    models : "nominal", "recalibrated", "with effect" -> (n, q) SI, nan where the simulation diverges
    rms : model -> channel -> root mean square error after the lead-in [SI], nan without readings
    sd : (n, q) deviation of a reading from the explained model that is to be expected; None where not asked
    commands : name -> (n,) orders [SI]
    force : as given and explained -> (n, 3) force X, Y [N] and moment N [N m] that would lead the model along
        the log; empty where not asked or where the model cannot be led along it
    expected : channel -> rms error after the lead-in that the explained model expects of itself: sensor
        noise, environment, start, coefficients; inf where half of the simulations within these diverge, empty
        where the model itself diverges or where nothing could be computed
    """

    run: str
    manoeuvre: str
    role: str
    t: Array
    lead: float
    channels: tuple[str, ...]
    readings: Array
    models: Mapping[str, Array]
    rms: Mapping[str, Mapping[str, float]]
    sd: Array | None
    commands: Mapping[str, Array]
    force: Mapping[str, Array] = field(default_factory=dict)
    expected: Mapping[str, float] = field(default_factory=dict)

    def position_error(self, model: str) -> float:
        """Root mean square distance in the horizontal plane [m]; nan where no position was logged."""
        return float(np.hypot(self.rms[model].get("x", np.nan), self.rms[model].get("y", np.nan)))

    def misfit(self, model: str, sigma: Mapping[str, float]) -> float:
        """Mean squared error in noise variances of the channels that were read; inf where the simulation
        diverges.
        """
        ratios = [e / sigma[c] for c, e in self.rms[model].items() if c in sigma and not np.isnan(e)]
        found = float(np.mean(np.square(ratios))) if ratios else np.inf
        return found if np.isfinite(found) else np.inf


def replay_trial(
    problem: DiagnosisProblem,
    trial: Trial,
    models: Mapping[str, FilterErrorFit | None],
    seed: int,
    shown: Collection[str] = (),
) -> tuple[Replay, ...]:
    """All runs that can be replayed; the first is the one to show.

    That is the held-out run which the model as given misses most, in noise units, else the identify run. It
    alone keeps the deviation of its readings, of which the others keep the rms (`expected`); it and the
    held-out runs have the force that each model lacks. Readings of brief events are in it.

    Parameters
    ----------
    models : name -> its fit; None is the model as given
    shown : names of runs of which one is to be shown first
    """
    brief = {e.run for e in problem.events if e.brief}
    noise = {c: float(s) for log in problem.logs for c, s in zip(log.channels, log.sigma, strict=True)}
    read = {log.name: log for log in problem.logs}
    found: list[_Replayed] = []
    for run in trial.runs:
        try:
            log = read.get(run.name)
            if log is None or run.name in brief:
                log = filter_error_run(problem.model, run, noise, problem.channels)
            else:
                log = replace(log, plan=plan_trial_run(problem.model, run))
        except BayesidError:
            continue
        replayed = _replay(problem, run, log, models)
        if replayed is not None:
            found.append(replayed)
    if not found:
        return ()
    held = any(f.replay.role == "holdout" for f in found)

    def rank(f: _Replayed) -> tuple[bool, bool, float]:
        later = held and f.replay.role != "holdout"
        return f.replay.run not in shown, later, -f.replay.misfit(GIVEN, noise)

    found.sort(key=rank)
    explained = models.get(EXPLAINED)
    deviations = [
        _deviation(problem, f.known, f.replay, explained, f.starts.get(EXPLAINED), f.point, seed)
        for f in found
    ]
    first = found[0]
    asked = [first, *(f for f in found[1:] if f.replay.role == "holdout")][:MOST_FORCES]
    forces = {f.replay.run: _forces(problem, f.log, models) for f in asked}
    replays = [
        replace(
            f.replay,
            force=forces.get(f.replay.run, {}),
            expected=_expected(f.replay, *deviation) if EXPLAINED in f.starts else {},
        )
        for f, deviation in zip(found, deviations, strict=True)
    ]
    return replace(replays[0], sd=deviations[0].sd), *replays[1:]


class _Deviation(NamedTuple):
    """(n, q) deviation of readings from the explained model, None where it could not be computed; whether
    simulations within what is known of start and coefficients diverge, so that it has no bound.
    """

    sd: Array | None
    diverges: bool


def _expected(shown: Replay, sd: Array | None, diverges: bool) -> dict[str, float]:
    """Channel -> rms error after the lead-in that the explained model expects of itself; empty where that
    could not be computed.
    """
    if diverges:
        return dict.fromkeys(shown.channels, np.inf)
    if sd is None:
        return {}
    late = shown.t - shown.t[0] > shown.lead
    square = np.where(np.isfinite(shown.readings), sd**2, np.nan)[late]
    return {
        c: float(np.sqrt(np.nanmean(square[:, j])))
        for j, c in enumerate(shown.channels)
        if np.isfinite(square[:, j]).any()
    }


class _Replayed(NamedTuple):
    """A replay with what it was made of: the run, its lead-in, starts of the models, path of the lead-in."""

    replay: Replay
    log: RunData
    known: RunData
    starts: dict[str, Array]
    point: Trajectory


def _forces(
    problem: DiagnosisProblem, log: RunData, models: Mapping[str, FilterErrorFit | None]
) -> dict[str, Array]:
    """What the first and the last model lack along a run; one that cannot be led along it is left out."""
    out = {}
    for name in (m for m in (GIVEN, EXPLAINED) if m in models):
        fitted = models[name]
        try:
            out[name] = residual_force(problem, log, problem.model.nominal if fitted is None else fitted.par)
        except (BayesidError, LinAlgError):
            continue
    return out


def misses(problem: DiagnosisProblem, log: RunData, par: Array) -> dict[str, float]:
    """Channel -> rms error of one run replayed from its first readings [SI]; inf where the simulation
    diverges, empty where the run is too short to be replayed.
    """
    late, known, _ = _after_lead(problem, log)
    if not known.valid.any() or not log.valid[late].any():
        return {}
    try:
        x0 = _begun(problem, known, par, problem.environment.noise_model).states[0]
        obs = _simulated(problem, log, par, x0[: len(problem.model.states)])
    except BayesidError:
        return dict.fromkeys(log.channels, np.inf)
    return _rms(log, obs, late)


def _after_lead(problem: DiagnosisProblem, log: RunData) -> tuple[Array, RunData, float]:
    """Which samples come after the first readings, the log without them, and how long those last [s]."""
    t, s = log.plan.t - log.plan.t[0], problem.model.scales
    lead = min(LEAD_LENGTHS * s["L"] / s["U"], MOST_LEAD * float(t[-1]))
    late = t > lead
    return late, log.without(np.repeat(late[:, None], len(log.channels), axis=1)), lead


def _replay(
    problem: DiagnosisProblem, run: Run, log: RunData, models: Mapping[str, FilterErrorFit | None]
) -> _Replayed | None:
    model, (late, known, lead) = problem.model, _after_lead(problem, log)
    if not known.valid.any() or not log.valid[late].any():
        return None
    noise_model = problem.environment.noise_model
    simulated: dict[str, Array] = {}
    starts: dict[str, Array] = {}
    point: Trajectory | None = None
    begun: dict[str, tuple[Array, Trajectory | None]] = {}
    for name, fitted in models.items():
        par = model.nominal if fitted is None else fitted.par
        same = next((n for n, (other, _) in begun.items() if np.array_equal(other, par)), None)
        if same is not None:  # one model under two names is simulated once
            simulated[name], point = simulated[same], begun[same][1] or point
            starts |= {name: starts[same]} if same in starts else {}
            continue
        simulated[name] = np.full(log.readings.shape, np.nan)
        begun[name] = par, None
        try:
            point = _begun(problem, known, par, noise_model)
            begun[name] = par, point
            x0 = point.states[0, : len(model.states)]
            simulated[name] = _simulated(problem, log, par, x0)
            starts[name] = x0
        except BayesidError:  # it diverges in this run, which is a finding
            continue
    if point is None:
        return None
    rms = {name: _rms(log, obs, late) for name, obs in simulated.items()}
    commands = {**run.commands, **run.measured_inputs}
    replayed = Replay(
        run.name, run.manoeuvre, run.role, log.plan.t, float(lead), log.channels,
        np.where(log.valid, log.readings, np.nan), simulated, rms, None, commands,
    )  # fmt: skip
    return _Replayed(replayed, log, known, starts, point)


def _begun(problem: DiagnosisProblem, known: RunData, par: Array, noise_model: NoiseModel) -> Trajectory:
    """Path of a model over a run of which only the lead-in has readings."""
    return followed(problem.model, known, par, noise_model, iterations=15).points[0]


def _simulated(problem: DiagnosisProblem, log: RunData, par: Array, x0: Array) -> Array:
    model = problem.model
    track = simulate(model, par, log.plan, x0, full=True)
    return observe(model, par, log.plan, track.states, full=True)[:, log.positions(model)]


def _rms(log: RunData, obs: Array, late: Array) -> dict[str, float]:
    """Channel -> error after the lead-in, gross readings left out."""
    resid = counted_on(np.where(log.valid, log.readings - obs, np.nan), log.channels)[late]
    out = {}
    for j, channel in enumerate(log.channels):
        miss = np.abs(resid[np.isfinite(resid[:, j]), j])
        if miss.size:
            miss = miss[miss <= GROSS * np.median(miss) + 20 * log.sigma[j]]
        out[channel] = float(np.sqrt(np.mean(miss**2))) if miss.size else float("nan")
    return out


def _deviation(
    problem: DiagnosisProblem,
    known: RunData,
    shown: Replay,
    fitted: FilterErrorFit | None,
    x0: Array | None,
    point: Trajectory,
    seed: int,
) -> _Deviation:
    """What noise, environment, start and parameters let a reading depart from the explained model."""
    model, noise_model = problem.model, problem.environment.noise_model
    if fitted is None or x0 is None:
        return _Deviation(None, False)
    try:
        path = linearise(model, known, point, NO_PARAMETERS.where)
        sm = smoothed(model, path, np.zeros(0), noise_model)
    except (BayesidError, LinAlgError) as error:  # the replay stands without a band
        return _Deviation(None, isinstance(error, BayesidError))
    spread = np.einsum("iqx,ix->iq", path.slope**2, sm.variance[:, : point.states.shape[1]])
    drift = np.array([noise_model.slow(c) for c in known.channels])
    tracks = []
    for par in _draws(fitted, np.random.default_rng(seed)):
        try:
            tracks.append(_simulated(problem, known, par, x0))
        except BayesidError:
            continue
    about = np.zeros_like(spread)
    diverges = len(tracks) <= BAND_DRAWS // 2
    if not diverges:
        about = np.mean((np.array(tracks) - shown.models[EXPLAINED]) ** 2, axis=0)
    return _Deviation(np.sqrt(known.sigma**2 + spread + drift**2 + about), diverges)


def _draws(fitted: FilterErrorFit, rng: np.random.Generator) -> Array:
    """(draws, n_par) parameter vectors of a fit's Gaussian posterior within its bounds."""
    free = fitted.free
    if not free.names:
        return np.repeat(fitted.par[None], BAND_DRAWS, axis=0)
    covariance = fitted.posterior.covariance * np.outer(free.sd, free.sd)
    deviations = rng.multivariate_normal(
        np.zeros(len(free.names)), fitted.posterior.covariance, size=BAND_DRAWS, method="eigh"
    )
    values = within_bounds(
        fitted.values + free.sd * deviations, fitted.values, covariance, free.low, free.high, rng
    )
    out = np.repeat(fitted.par[None], BAND_DRAWS, axis=0)
    out[:, free.where] = values
    return out
