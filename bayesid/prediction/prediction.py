"""Predict runs with a diagnosed model: mean and 95 % band over causes, parameters, start and disturbance.

Takes a `DiagnosedModel` and a logged run or a manoeuvre. Gives a frozen `Prediction`. Reads of a logged run
its orders and its lead-in only; the rest of its readings is what the prediction may be compared with.

What is told of coefficients that were fitted is the mean of the draws. Where they are as given the draws come
from what is stated of them, often a third of their value, and the mean of such tracks is the track of no
vehicle: there it is the model that the diagnosis shows, and the draws give the band alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import Model
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.run_data import Array, RunData
from bayesid.manoeuvres import Manoeuvre, OpenLoop
from bayesid.prediction.initial_state import InitialState, balanced_speed, coloured_noise, initial_states
from bayesid.simulation import (
    TimePlan,
    carried_by_water,
    inertia_ratio,
    observe,
    plan_run,
    plan_trial_run,
    run_manoeuvre,
    simulate,
)
from bayesid.simulation.shaft_speed import ordered_with_shaft_speed
from bayesid.trials import Run, window

LEAD_LENGTHS = 6.0  # L/U
INTERVAL_LEVEL = 0.95
# Share of draws that may diverge before the prediction is refused.
MOST_DIVERGED = 0.2


@dataclass(frozen=True, eq=False)
class Centre:
    """One explanation as it is, undisturbed: its weight, readings (n, q), in a closed loop (n,) orders."""

    weight: float
    readings: Array
    orders: Mapping[str, Array] | None = None


@dataclass(frozen=True, eq=False)
class Prediction:
    """A predicted run.

    Attributes
    ----------
    name, manoeuvre : as given
    t : (n,) [s]
    channels : (q,) names
    draws : (k, n, q) readings without white noise [SI]
    commands : name -> (n,) orders; in a closed loop those of the first draw
    orders : name -> (k, n) orders of every draw in a closed loop, None otherwise
    lead : length of the lead-in whose readings were used [s], 0 for a manoeuvre
    lost : draws that diverged
    noise : (q,) white noise of the sensors, nan where none is known
    given : (n, q) the vehicle as given, without disturbance; None where it diverges or ends at another time
    given_orders : name -> (n,) its orders in a closed loop, None otherwise
    vehicles : (k,) which of the drawn vehicles each draw is; all of them, in order, by default
    occasion : number of the run among those the vehicles are followed through
    centres : explanations with coefficients as given, or the estimate of a fit of whose draws some diverge:
        they add up to what is told; empty elsewhere, or where one diverges
    estimate : the estimate of a fit as it is, undisturbed; None of a diagnosis, or where it diverges
    """

    name: str
    manoeuvre: str
    t: Array
    channels: tuple[str, ...]
    draws: Array
    commands: Mapping[str, Array]
    orders: Mapping[str, Array] | None
    lead: float
    lost: int
    noise: Array
    given: Array | None = None
    given_orders: Mapping[str, Array] | None = None
    vehicles: Array = None  # type: ignore[assignment]
    occasion: int = 0
    centres: tuple[Centre, ...] = ()
    estimate: Centre | None = None

    def __post_init__(self) -> None:
        if self.vehicles is None:
            object.__setattr__(self, "vehicles", np.arange(len(self.draws)))

    def _about_estimate(self) -> Prediction:
        """The same, told by the estimate where draws about it diverge.

        Those that are left are of a law that reaches beyond what the estimate stands for. Of seven held-out
        runs of a ship in which 7 to 49 of 300 diverged their mean missed the position by 12 m (geometric
        mean), their median by 12 m, the estimate by 7 m; the heading by 14, 24 and 16 degrees.
        """
        return replace(self, centres=(self.estimate,)) if self.lost and self.estimate else self

    def sensor_noise(self, seed: int) -> np.random.Generator:
        """Generator of the white noise of the sensors in this run."""
        return _generator(seed, self.occasion, 1) if self.occasion else np.random.default_rng(seed)

    @property
    def mean(self) -> Array:
        """(n, q) mean of the draws."""
        return self.draws.mean(axis=0)

    @property
    def told(self) -> Array:
        """(n, q) what is predicted: the centres, else the mean of the draws."""
        if not self.centres:
            return self.mean
        whole = sum(c.weight for c in self.centres)
        return np.asarray(sum(c.weight / whole * c.readings for c in self.centres))

    def band(
        self, level: float = INTERVAL_LEVEL, rng: np.random.Generator | None = None
    ) -> tuple[Array, Array]:
        """(n, q) limits between which a reading lies with this probability, sample by sample.

        Parameters
        ----------
        rng : adds the white noise of the sensors; without it the band is for what they would read on average
        """
        draws = self.draws
        if rng is not None:
            draws = draws + np.nan_to_num(self.noise) * rng.standard_normal(draws.shape)
        low, high = np.quantile(draws, (0.5 - 0.5 * level, 0.5 + 0.5 * level), axis=0)
        return low, high


def _generator(seed: int, *use: int) -> np.random.Generator:
    """Random numbers of one use, independent of those of the seed itself and of other uses."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=use))


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
    _enough(read.run.name, len(kept), draws)
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
    _enough(run.name, len(kept), draws, most_diverged)
    noise = np.array([found.noise.get(c, np.nan) for c in channels])
    commands = {**run.commands, **run.measured_inputs}
    lost = draws - len(kept)

    def undisturbed(par: Array, noise_model: NoiseModel) -> tuple[Array, None] | None:
        obs = _undisturbed(model, par, noise_model, read)
        return None if obs is None else (obs, None)

    given = undisturbed(model.nominal, found.hypotheses[0].noise_model)
    return Prediction(
        run.name, run.manoeuvre, run.t, channels, np.array(kept), commands, None, read.lead, lost, noise,
        None if given is None else given[0], vehicles=whole, occasion=occasion,
        centres=_centres(found, undisturbed), estimate=_estimate(found, undisturbed),
    )._about_estimate()  # fmt: skip


def _tracks(
    found: DiagnosedModel, read: ReadRun, draws: int, seed: int, occasion: int = 0
) -> list[Array | None]:
    """Readings (n, q) of every draw, None for one that diverges."""
    model, rng = found.model, np.random.default_rng(seed)
    tracks: list[Array | None] = [None] * draws
    there = found.in_a_run(rng, draws)
    if occasion:
        vehicles = found.vehicles(there, _generator(seed, 0))
        rng = _generator(seed, occasion, 0)
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
            slow = _slow(h.noise_model, read.channels)
            force, drift = _onwards(h.noise_model, slow, begin, read.run.t, rng)
            tracks[k] = _track(model, par, read, begin.x0, force, drift)
    return tracks


Undisturbed = Callable[[Array, NoiseModel], tuple[Array, Mapping[str, Array] | None] | None]


def _centres(found: DiagnosedModel, undisturbed: Undisturbed) -> tuple[Centre, ...]:
    """Every explanation, where all have the coefficients as given; none where one of them diverges."""
    out: list[Centre] = []
    for h in found.hypotheses if found.coefficients_as_given else ():
        if (centre := _centre(found, h, undisturbed)) is None:
            return ()
        out.append(centre)
    return tuple(out)


def _estimate(found: DiagnosedModel, undisturbed: Undisturbed) -> Centre | None:
    """The estimate of a fit, whose hypotheses differ in the noise model alone."""
    if found.verdict != "fit":
        return None
    return _centre(found, max(found.hypotheses, key=lambda h: h.weight), undisturbed)


def _centre(found: DiagnosedModel, h: WeightedHypothesis, undisturbed: Undisturbed) -> Centre | None:
    """The mean of a hypothesis as one vehicle; None where it diverges."""
    par = found.model.nominal.copy()
    par[found.model.positions(h.names)] = h.mean
    made = undisturbed(par, h.noise_model)
    return None if made is None else Centre(h.weight, *made)


def _undisturbed(model: Model, par: Array, noise_model: NoiseModel, read: ReadRun) -> Array | None:
    """Readings (n, q) of one vehicle without disturbance, begun where the lead-in most probably has it."""
    try:
        begin = followed(model, read.log, par, noise_model, iterations=8).points[0].states[0]
    except BayesidError:
        return None
    n = read.run.n_samples
    still = np.zeros((n - 1, len(noise_model.force)))
    drift = np.zeros((n, _slow(noise_model, read.channels).size))
    return _track(model, par, read, begin[: len(model.states)], still, drift)


def _slow(noise_model: NoiseModel, channels: Sequence[str]) -> Array:
    """(nd,) standard deviations of the slow errors of the measured positions [m]."""
    return np.array([noise_model.slow(c) for c in channels if c in ("x", "y", "z")])


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


def _disturbed(model: Model, par: Array, plan: TimePlan, force: Array) -> TimePlan:
    """Plan with the disturbance, which is stated for the nominal inertia."""
    ratio, _ = inertia_ratio(model, par, np.zeros(0, dtype=np.int64))
    return with_forces(model, plan, force @ ratio.T)


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
        plan = _disturbed(model, par, read.plan, force)
        track = simulate(model, par, plan, x0, full=True)
        obs = observe(model, par, plan, track.states, full=True)[:, read.picked]
    except BayesidError:
        return None
    position = [j for j, c in enumerate(read.channels) if c in ("x", "y", "z")]
    obs[:, position] += drift
    return obs if np.isfinite(obs).all() else None


def predict_manoeuvre(
    found: DiagnosedModel,
    name: str,
    manoeuvre: Manoeuvre,
    draws: int = 200,
    seed: int = 0,
    speed: float | None = None,
) -> Prediction:
    """Predict a manoeuvre begun from a straight run at its first shaft speed, heading north, at the origin.

    Parameters
    ----------
    speed : approach speed [m/s]; by default each draw's own, at which its thrust and drag balance

    Raises
    ------
    ModelError
        if thrust and drag do not balance, or too many draws diverge
    """
    model, rng = found.model, np.random.default_rng(seed)
    channels = tuple(c for c in model.kernel.channels if not c.endswith("_water"))
    picked = [model.kernel.channels.index(c) for c in channels]
    rpm = _first_rpm(model, manoeuvre)
    manoeuvre = ordered_with_shaft_speed(manoeuvre, rpm)
    kept: list[Array] = []
    ordered: list[Mapping[str, Array]] = []
    whole: list[int] = []
    number = -1
    t = np.asarray(manoeuvre.t)
    for h, pars in found.draw(rng, draws):
        speeds = np.full(len(pars), speed) if speed is not None else balanced_speed(model, pars, rpm)
        for par, u in zip(pars, speeds, strict=True):
            number += 1
            executed = _simulated(model, par, manoeuvre, float(u), h, picked, rng)
            if executed is None:
                continue
            t, obs, commands = executed
            obs[:, [j for j, c in enumerate(channels) if c in ("x", "y", "z")]] += _fresh_drift(
                h.noise_model, t, _slow(h.noise_model, channels), rng
            )
            kept.append(obs)
            whole.append(number)
            ordered.append(commands)
    _enough(name, len(kept), draws)
    closed = not isinstance(manoeuvre, OpenLoop)
    orders = {name: np.array([one[name] for one in ordered]) for name in ordered[0]} if closed else None

    def undisturbed(par: Array, noise_model: NoiseModel) -> tuple[Array, Mapping[str, Array] | None] | None:
        made = _undisturbed_manoeuvre(model, par, manoeuvre, speed, rpm, picked, t.size)
        return None if made is None else (made[0], made[1] if closed else None)

    given, given_orders = undisturbed(model.nominal, found.hypotheses[0].noise_model) or (None, None)
    noise = np.array([found.noise.get(c, np.nan) for c in channels])
    return Prediction(
        name, manoeuvre.name, t, channels, np.array(kept), ordered[0], orders, 0.0,
        draws - len(kept), noise, given, given_orders, np.array(whole, dtype=np.int64),
        centres=_centres(found, undisturbed), estimate=_estimate(found, undisturbed),
    )._about_estimate()  # fmt: skip


def _undisturbed_manoeuvre(
    model: Model,
    par: Array,
    manoeuvre: Manoeuvre,
    speed: float | None,
    rpm: float,
    picked: list[int],
    n: int,
) -> tuple[Array, Mapping[str, Array]] | None:
    """Readings (n, q) of one vehicle without disturbance, and its orders, (n,) each."""
    try:
        begin = speed if speed is not None else float(balanced_speed(model, par[None], rpm)[0])
        x0 = np.zeros(len(model.states))
        x0[model.states.index("u")] = begin
        track, commands = run_manoeuvre(model, par, manoeuvre, carried_by_water(model, par, x0))
        obs = observe(model, par, plan_run(model, track.t, commands), track.states)[:, picked]
    except BayesidError:
        return None
    if len(obs) != n or not np.isfinite(obs).all():
        return None
    return obs, commands


def _simulated(
    model: Model,
    par: Array,
    manoeuvre: Manoeuvre,
    speed: float,
    h: WeightedHypothesis,
    picked: list[int],
    rng: np.random.Generator,
) -> tuple[Array, Array, Mapping[str, Array]] | None:
    x0 = np.zeros(len(model.states))
    x0[model.states.index("u")] = speed
    sd = np.array(h.noise_model.force)

    def disturb(plan: TimePlan) -> TimePlan:
        decay = np.exp(-np.diff(plan.t) / h.noise_model.force_tau)[:, None] * np.ones(sd.size)
        return _disturbed(model, par, plan, coloured_noise(decay, sd, rng)[:-1])

    try:
        start = carried_by_water(model, par, x0)
        track, commands = run_manoeuvre(model, par, manoeuvre, start, disturb=disturb)
        plan = plan_run(model, track.t, commands)
        obs = observe(model, par, plan, track.states)[:, picked]
    except BayesidError:
        return None
    return (track.t, obs, commands) if np.isfinite(obs).all() else None


def _fresh_drift(noise_model: NoiseModel, t: Array, slow: Array, rng: np.random.Generator) -> Array:
    """Slow position errors (n, nd) counted from the first sample, whose position is the origin."""
    decay = np.exp(-np.diff(t) / noise_model.drift_tau)[:, None] * np.ones(slow.size)
    drift = coloured_noise(decay, slow, rng)
    return drift - drift[0]


def _first_rpm(model: Model, manoeuvre: Any) -> float:
    usual = model.vehicle.rpm_ref or 0.0
    if isinstance(manoeuvre, OpenLoop):
        return float(manoeuvre.commands["n_cmd"][0]) if "n_cmd" in manoeuvre.commands else usual
    return float(manoeuvre.start.get("n_cmd", usual))


class DivergingDraws(ModelError):
    """More of the draws diverge than a prediction may lose."""


def _enough(name: str, kept: int, draws: int, most_diverged: float = MOST_DIVERGED) -> None:
    if kept < max((1.0 - most_diverged) * draws, 1):
        raise DivergingDraws(
            f"{name}: {draws - kept} of {draws} draws diverge; the coefficients are too uncertain to predict "
            "this run"
        )
