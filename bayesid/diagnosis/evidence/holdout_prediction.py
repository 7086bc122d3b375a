"""One prediction of a held-out run: a state fitted to a lead-in, an open-loop replay, its errors by channel.

Takes fitted models and pieces of runs. Gives `Segment`s. A piece begins where the orders have been held; what
the explanation expects of its own prediction comes from draws of its parameters and of the start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.replay import EXPLAINED
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, linearise
from bayesid.estimation.filter_error.noise_model import NoiseModel, smoothed
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.likelihood.composite import root
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData
from bayesid.estimation.segments import REACH, held_since
from bayesid.measures import turning_circle, zigzag
from bayesid.measures.angle_errors import counted_on
from bayesid.simulation import observe, simulate
from bayesid.trials import Run, window

MOST_SEGMENTS = 8
FULL_HORIZON = "full replay"

Measures = dict[str, tuple[float, str]]  # name -> value [m, rad] and unit


@dataclass(frozen=True)
class MeasureComparison:
    """One standard measure of a held-out run: as logged and as each model replays it [m, rad]."""

    run: str
    name: str
    unit: str
    logged: float
    models: dict[str, float]


@dataclass(frozen=True, eq=False)
class PiecePrediction:
    """What one model makes of one piece: mean squared error in noise units per channel of the log, the mean
    over channels for posterior draws, and standard measures of the replay, None where it has none."""

    square: Array
    drawn: Array | None
    measures: Measures | None


# Run, start [s], horizon and model of a prediction made before -> it, None where the run cannot be followed.
Made = dict[tuple[str, float, str, str], PiecePrediction | None]


@dataclass(frozen=True, eq=False)
class Segment:
    """One prediction: mean squared error in noise units per channel, after the lead-in.

    Channels are those of the problem, nan where the piece does not read one. `drawn` holds the mean over
    channels for posterior draws of a model, `measures` those of a full replay. `chance` (d,) is the error
    that draws of the explanation's parameters, and of the start it was given, expect of its prediction; inf
    where one diverges.
    """

    run: str
    start: float
    horizon: str
    errors: dict[str, Array]
    rms: dict[str, dict[str, float]]
    floor: Array
    drawn: dict[str, Array]
    chance: Array
    measures: tuple[MeasureComparison, ...] = ()


def pieces_of(run: Run, lead: float, length: float) -> list[tuple[Run, float]]:
    """Pieces of a run, begun where the orders have been held: a fin that lags is then where it is ordered."""
    if not np.isfinite(length):
        return [(run, float(run.t[0]))]
    starts = np.arange(run.t[0], run.t[-1] - lead - length, lead + length)
    if starts.size > MOST_SEGMENTS:
        starts = starts[np.linspace(0, starts.size - 1, MOST_SEGMENTS).astype(int)]
    held, last = held_since(run), run.t[-1] - lead - length
    moved = []
    for s in starts:
        near = np.flatnonzero((run.t >= s) & (run.t <= min(s + REACH * (lead + length), last)))
        best = s if s <= run.t[0] or not near.size else run.t[near[np.argmax(held[near])]]
        moved.append(float(best))
    return [(window(run, s, s + lead + length), s) for s in moved]


def predicted(
    problem: DiagnosisProblem,
    run: Run,
    noise: dict[str, float],
    models: Mapping[str, Array],
    noise_model: NoiseModel,
    lead: float,
    start: float,
    horizon: str,
    draws: Mapping[str, Array],
    rng: np.random.Generator,
    made: Made,
) -> Segment | None:
    """One piece predicted by all models; None where one of them cannot follow it.

    Parameters
    ----------
    made : predictions of models other than the explanation, which are not made twice; new ones are added
    """
    model = problem.model
    try:
        log = filter_error_run(model, run, noise, problem.channels)
    except BayesidError:
        return None
    t = log.plan.t - log.plan.t[0]
    early = t <= lead
    if early.sum() < 4 or (~early).sum() < 4:
        return None
    known = log.without(np.repeat(~early[:, None], len(log.channels), axis=1))
    told = _measuring(run, log) if horizon == FULL_HORIZON else None
    floor, chance = np.ones(len(log.channels)), np.zeros(0)
    found: dict[str, PiecePrediction] = {}
    followed_by: list[tuple[Array, Trajectory, Array]] = []
    for name, par in models.items():
        key = (run.name, start, horizon, name)
        one = made.get(key)
        if key not in made:
            try:
                same = [(p, o) for other, p, o in followed_by if np.array_equal(other, par)]
                point, obs = same[0] if same else _followed(model, known, log, par, noise_model)
                followed_by.append((par, point, obs))
                if name == EXPLAINED:
                    path = linearise(model, known, point, NO_PARAMETERS.where)
                    floor = _floor(model, path, noise_model, ~early)
                    if name in draws:
                        begins = _starts(model, path, noise_model, len(draws[name]), rng)
                        chance = _chance(model, draws[name], log, begins, obs, ~early)
                x0 = point.states[0, : len(model.states)]
                drawn = _drawn(model, draws[name], log, x0, ~early) if name in draws else None
                measured = told(obs) if told is not None else None
                one = PiecePrediction(_squares(log, obs, ~early), drawn, measured)
            except BayesidError:
                one = None
            if name != EXPLAINED:
                made[key] = one
        if one is None:
            return None
        found[name] = one
    at = [problem.channels.index(c) for c in log.channels]

    def every(values: Array) -> Array:
        out = np.full(len(problem.channels), np.nan)
        out[at] = values
        return out

    errors = {name: every(one.square) for name, one in found.items()}
    if not np.isfinite(errors[EXPLAINED]).any():
        return None
    sigma = every(log.sigma)
    rms = {
        name: dict(zip(problem.channels, np.sqrt(square) * sigma, strict=True))
        for name, square in errors.items()
    }
    drawn_by = {name: one.drawn for name, one in found.items() if one.drawn is not None}
    measures = _measures(run, told(log.readings.copy()), found) if told is not None else ()
    return Segment(run.name, start, horizon, errors, rms, every(floor), drawn_by, chance, measures)


def _followed(
    model: Model, known: RunData, log: RunData, par: Array, noise_model: NoiseModel
) -> tuple[Trajectory, Array]:
    """Path of a model along a lead-in, and its readings of the whole piece from there."""
    point = followed(model, known, par, noise_model, iterations=15).points[0]
    return point, _replayed(model, par, log, point.states[0, : len(model.states)])


def _starts(
    model: Model, path: Linearisation, noise_model: NoiseModel, count: int, rng: np.random.Generator
) -> Array:
    """(count, nx) first states drawn from what the lead-in tells of them."""
    x0 = path.point.states[0, : len(model.states)]
    spread = root(start_covariance(model, path, noise_model))
    return x0 + (rng.standard_normal((count, len(spread))) @ spread.T)[:, : x0.size]


def _replayed(model: Model, par: Array, log: RunData, x0: Array) -> Array:
    """(n, q) readings of a run begun at a state."""
    track = simulate(model, par, log.plan, x0, full=True)
    return observe(model, par, log.plan, track.states, full=True)[:, log.positions(model)]


def _chance(model: Model, pars: Array, log: RunData, begins: Array, obs: Array, late: Array) -> Array:
    """(d,) mean squared error, in noise units, of the prediction `obs` if a draw were the vehicle."""
    out = np.full(len(pars), np.inf)
    for i, (par, begin) in enumerate(zip(pars, begins, strict=True)):
        try:
            apart = counted_on(_replayed(model, par, log, begin) - obs, log.channels)[late]
        except BayesidError:
            continue
        out[i] = 1.0 + average(np.mean((apart / log.sigma) ** 2, axis=0))
    return out


def start_covariance(model: Model, path: Linearisation, noise_model: NoiseModel) -> Array:
    """(nx, nx) covariance of the first state given all readings, smoothed under the environment.

    By the response to the prior: a prior mean moved by d moves the smoothed mean by P Q^-1 d, with P the
    covariance wanted and Q the prior's.
    """
    sd = path.log.initial_sd
    still = smoothed(model, path, np.zeros(0), noise_model, variances=False).mean[0, : sd.size]
    out = np.empty((sd.size, sd.size))
    for i in range(sd.size):
        x0 = path.log.x0.copy()
        x0[i] += sd[i]
        moved = replace(path, log=replace(path.log, x0=x0))
        mean = smoothed(model, moved, np.zeros(0), noise_model, variances=False).mean[0, : sd.size]
        out[:, i] = (mean - still) * sd[i]
    return 0.5 * (out + out.T)


def _squares(log: RunData, obs: Array, late: Array) -> Array:
    """(q,) mean squared error in noise units after the lead-in, gross readings left out; nan without any."""
    resid = counted_on(np.where(log.valid, log.readings - obs, np.nan), log.channels)[late]
    out = np.full(resid.shape[1], np.nan)
    for j, sigma in enumerate(log.sigma):
        miss = np.abs(resid[np.isfinite(resid[:, j]), j])
        if miss.size:
            out[j] = float(np.mean((miss[miss <= 50 * np.median(miss) + 20 * sigma] / sigma) ** 2))
    return out


def _drawn(model: Model, pars: Array, log: RunData, x0: Array, late: Array) -> Array:
    """(d,) mean squared error of posterior draws over all channels; nan where a draw diverges."""
    out = np.full(len(pars), np.nan)
    for i, par in enumerate(pars):
        try:
            obs = _replayed(model, par, log, x0)
        except BayesidError:
            continue
        out[i] = average(_squares(log, obs, late))
    return out


def _measuring(run: Run, log: RunData) -> Callable[[Array], Measures | None] | None:
    """What gives tactical diameter and advance, or overshoots, of readings (n, q) by the logged orders; None
    for a run that has neither. It gives None where readings have none."""
    rudder, names, text = run.input("delta_r"), list(log.channels), run.manoeuvre.lower()
    rudder = run.commands.get("delta_r_cmd", rudder)
    if rudder is None or not {"x", "y", "psi"} <= set(names) or not ("turn" in text or "zig" in text):
        return None
    x, y, psi = (names.index(c) for c in ("x", "y", "psi"))

    def told(values: Array) -> Measures | None:
        try:
            if "turn" in text:
                turn = turning_circle(run.t, values[:, x], values[:, y], values[:, psi], rudder)
                return {"tactical diameter": (turn.tactical_diameter, "m"), "advance": (turn.advance, "m")}
            zig = zigzag(run.t, values[:, psi], rudder, values[:, x], values[:, y])
        except (BayesidError, ValueError):
            return None
        return {f"overshoot {i + 1}": (v, "rad") for i, v in enumerate(zig.overshoots[:2])}

    return told


def _measures(
    run: Run, logged: Measures | None, found: Mapping[str, PiecePrediction]
) -> tuple[MeasureComparison, ...]:
    """Measures of a run as logged and by each model; none where one of them has none."""
    by = {name: one.measures for name, one in found.items() if one.measures is not None}
    if logged is None or len(by) < len(found):
        return ()
    return tuple(
        MeasureComparison(run.name, what, unit, value, {n: m[what][0] for n, m in by.items() if what in m})
        for what, (value, unit) in logged.items()
        if np.isfinite(value)
    )


def _floor(model: Model, path: Linearisation, noise_model: NoiseModel, late: Array) -> Array:
    """Expected squared error in noise units of the best prediction: sensor noise, environment and initial
    state.
    """
    known = path.log
    sm = smoothed(model, path, np.zeros(0), noise_model)
    nx = path.slope.shape[2]
    spread = np.einsum("iqx,ix->iq", path.slope**2, sm.variance[:, :nx])
    names = known.channels
    drift = np.array([noise_model.slow(n) ** 2 for n in names])
    return 1.0 + np.mean((spread + drift)[late] / known.sigma**2, axis=0)


def average(values: Array) -> float:
    """Mean of what is there; nan where nothing is (a channel no held-out piece reads)."""
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else float("nan")
