"""Predict a logged run with a diagnosed model, begun on its first readings.

Takes a `DiagnosedModel` and a logged run. Gives a frozen `Prediction`. Reads of the run its orders and its
lead-in only; the rest of its readings is what the prediction may be compared with.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.equations.model import Model
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.run_data import Array, RunData
from bayesid.model.vehicles.orders import gathered
from bayesid.prediction.draws import (
    MOST_DIVERGED,
    centres_of,
    disturbed,
    estimate_of,
    require_enough,
    slow_errors,
)
from bayesid.prediction.initial_state import InitialState, coloured_noise, initial_states
from bayesid.prediction.prediction import Prediction, generator_of
from bayesid.simulation import TimePlan, observe, plan_trial_run, simulate
from bayesid.trials import Run, window

LEAD_LENGTHS = 6.0  # L/U


@dataclass(frozen=True, eq=False)
class ReadRun:
    """A logged run ready to be predicted.

    Attributes
    ----------
    lead : length of the lead-in [s]
    channels : (q,) readings that are predicted, at `picked` among those of the model
    log : the lead-in as the filter reads it
    plan : orders of the whole run
    """

    run: Run
    lead: float
    channels: tuple[str, ...]
    log: RunData
    plan: TimePlan
    picked: list[int]


def read_run(found: DiagnosedModel, run: Run, lead: float | None = None) -> ReadRun:
    """Orders and first readings of a logged run; `lead` as in `predict_run`.

    Raises
    ------
    ModelError
        if too few readings lie in the lead-in
    """
    model, s = found.model, found.model.scales
    if lead is None:
        lead = min(LEAD_LENGTHS * s["L"] / s["U"], 0.25 * run.duration)
    channels = tuple(c for c in model.kernel.channels if c in run.data and c in found.noise)
    early = window(run, float(run.t[0]), float(run.t[0]) + lead)
    log = filter_error_run(model, early, found.noise, channels)
    if log.n < 4 or not log.valid.any():
        raise ModelError(f"{run.name}: fewer than four samples in the first {lead:.3g} s; give a longer lead")
    picked = [model.kernel.channels.index(c) for c in channels]
    return ReadRun(run, lead, channels, log, plan_trial_run(model, run), picked)


def variance_of_draws(found: DiagnosedModel, read: ReadRun, draws: int, seed: int) -> Array:
    """(n, q) variance of the readings of a run over draws, without sensor noise.

    Raises
    ------
    ModelError
        if the lead-in cannot be followed, or too many draws diverge
    """
    kept = [x for x in _tracks(found, read, draws, seed) if x is not None]
    require_enough(read.run.name, len(kept), draws)
    return np.asarray(np.var(kept, axis=0, ddof=1))


def predict_run(
    found: DiagnosedModel,
    run: Run,
    draws: int = 300,
    seed: int = 0,
    lead: float | None = None,
    occasion: int = 0,
    most_diverged: float = MOST_DIVERGED,
) -> Prediction:
    """Predict a logged run from its orders, begun on its first readings.

    Parameters
    ----------
    seed : of the vehicles, and with the occasion of what is new in the run
    lead : length of the lead-in [s]; default 6 L/U, at most a quarter of the run
    occasion : number of the run among several through which the vehicles are followed. In each of them
        vehicle k has the same cause and coefficients; deviation of its coefficients in the run, size of the
        disturbance, disturbance and start are independent. 0 is the first, or the only one
    most_diverged : share of the draws that may

    Raises
    ------
    ModelError
        if too few readings lie in the lead-in, or too many draws diverge
    """
    read = read_run(found, run, lead)
    tracks = _tracks(found, read, draws, seed, occasion)
    model, channels = found.model, read.channels
    kept = [x for x in tracks if x is not None]
    whole = np.array([k for k, x in enumerate(tracks) if x is not None])
    require_enough(run.name, len(kept), draws, most_diverged)
    noise = np.array([found.noise.get(c, np.nan) for c in channels])
    measured = gathered(model.vehicle, run.measured_inputs, "")
    commands = {**gathered(model.vehicle, run.commands), **measured}
    lost = draws - len(kept)

    def undisturbed(par: Array, noise_model: NoiseModel) -> tuple[Array, None] | None:
        obs = _undisturbed(model, par, noise_model, read)
        return None if obs is None else (obs, None)

    given = undisturbed(model.nominal, found.hypotheses[0].noise_model)
    return Prediction(
        run.name, run.manoeuvre, run.t, channels, np.array(kept), commands, None, read.lead, lost, noise,
        None if given is None else given[0], vehicles=whole, occasion=occasion,
        centres=centres_of(found, undisturbed), estimate=estimate_of(found, undisturbed),
    ).about_estimate()  # fmt: skip


def _tracks(
    found: DiagnosedModel, read: ReadRun, draws: int, seed: int, occasion: int = 0
) -> list[Array | None]:
    """Readings (n, q) of every draw, None for one that diverges."""
    model, rng = found.model, np.random.default_rng(seed)
    tracks: list[Array | None] = [None] * draws
    there = found.in_a_run(rng, draws)
    if occasion:
        vehicles = found.vehicles(there, generator_of(seed, 0))
        rng = generator_of(seed, occasion, 0)
        there = found.in_another_run(vehicles, rng)
    for i, h in enumerate(found.hypotheses):
        mine = np.flatnonzero(there.which == i)
        if not mine.size:
            continue
        free, pars = model.positions(h.names), there.pars[mine]
        mean = model.nominal.copy()
        mean[free] = h.mean
        begun = initial_states(model, read.log, free, mean, pars, h.noise_model, rng)
        for k, par, begin in zip(mine, pars, begun, strict=True):
            slow = slow_errors(h.noise_model, read.channels)
            force, drift = _onwards(h.noise_model, slow, begin, read.run.t, rng)
            tracks[k] = _track(model, par, read, begin.x0, force, drift)
    return tracks


def _undisturbed(model: Model, par: Array, noise_model: NoiseModel, read: ReadRun) -> Array | None:
    """Readings (n, q) of one vehicle without disturbance, begun where the lead-in most probably has it."""
    try:
        begin = followed(model, read.log, par, noise_model, iterations=8).points[0].states[0]
    except BayesidError:
        return None
    n = read.run.n_samples
    still = np.zeros((n - 1, len(noise_model.force)))
    drift = np.zeros((n, slow_errors(noise_model, read.channels).size))
    return _track(model, par, read, begin[: len(model.states)], still, drift)


def _onwards(
    noise_model: NoiseModel, slow: Array, begin: InitialState, t: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Disturbance (n-1, nf) and slow position errors (n, nd) of the whole run: the lead-in's, then free."""
    k, gaps = begin.force.shape[0], np.diff(t)
    decay = np.exp(-gaps[k - 1 : -1] / noise_model.force_tau)[:, None] * np.ones(begin.force.shape[1])
    later = coloured_noise(decay, np.array(noise_model.force), rng, begin.force[-1])
    force = np.vstack([begin.force, later[1:]])
    count = begin.drift.shape[1]
    decay = np.exp(-gaps[k:] / noise_model.drift_tau)[:, None] * np.ones(count)
    later = coloured_noise(decay, slow, rng, begin.drift[-1])
    return force, np.vstack([begin.drift, later[1:]])


def _track(
    model: Model,
    par: Array,
    read: ReadRun,
    x0: Array,
    force: Array,
    drift: Array,
) -> Array | None:
    """Readings (n, q) of one draw, None if it diverges."""
    try:
        plan = disturbed(model, par, read.plan, force)
        track = simulate(model, par, plan, x0, full=True)
        obs = observe(model, par, plan, track.states, full=True)[:, read.picked]
    except BayesidError:
        return None
    position = [j for j, c in enumerate(read.channels) if c in ("x", "y", "z")]
    obs[:, position] += drift
    return obs if np.isfinite(obs).all() else None
