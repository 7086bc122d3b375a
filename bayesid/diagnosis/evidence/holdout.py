"""How far the gap shrinks on held-out runs: nominal, recalibrated without the effect, with the effect, floor.

Takes fitted models and the held-out runs, which nothing before this has read. Gives a frozen
`HoldoutValidation`. Never changes a verdict.

A prediction starts from a state fitted to a short lead-in and runs open loop over the horizon; it is scored
in units of the sensors' noise after the lead-in. Intervals come from a bootstrap over these pieces (block by
block) and, in the same stroke, over posterior draws of the models' parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Trajectory, linearise, wrap
from bayesid.estimation.filter_error.noise_model import NoiseModel, smoothed
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData
from bayesid.estimation.segments import REACH, held_since
from bayesid.measures import turning_circle, zigzag
from bayesid.simulation import observe, simulate
from bayesid.trials import Run, Trial, window

LEAD_LENGTHS, SHORT_HORIZON, LONG_HORIZON = 6.0, 6.0, 23.0
MOST_SEGMENTS = 8
BOOTSTRAP_DRAWS = 400
FULL_HORIZON = "full replay"


@dataclass(frozen=True)
class MeasureComparison:
    """One standard measure of a held-out run: as logged and as each model replays it [m, rad]."""

    run: str
    name: str
    unit: str
    logged: float
    models: dict[str, float]


@dataclass(frozen=True, eq=False)
class Segment:
    """One prediction: mean squared error in noise units per channel, after the lead-in.

    Channels are those of the problem, nan where the piece does not read one. `drawn` holds the mean over
    channels for posterior draws of a model, `measures` those of a full replay. `chance` (d,) is the error the
    explanation itself expects of its prediction: how far draws of its parameters and of the start it was
    given lie from it.
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


@dataclass(frozen=True, eq=False)
class HorizonError:
    """Excess error of each model over one horizon.

    Attributes
    ----------
    horizon, seconds : name and length [s] (nan for full replay)
    excess : model -> mean squared error in noise units above the floor
    shrink, interval : 1 - after/before and its 90 % interval; nan where nothing is left to shrink
    significant : whether the gap before is above zero at 95 %
    floor : expected error of the best prediction, noise variances
    rms : model -> channel -> root mean square error [SI]
    channels : model -> channel -> excess
    pieces, draws : predictions scored, posterior draws of each model; what the interval rests on
    expected : error with the effect that 95 % of its own draws stay below, as `excess`; nan without draws
    """

    horizon: str
    seconds: float
    excess: dict[str, float]
    shrink: float
    interval: tuple[float, float]
    significant: bool
    floor: float
    rms: dict[str, dict[str, float]]
    channels: dict[str, dict[str, float]]
    pieces: int = 0
    draws: int = 0
    expected: float = float("nan")

    @property
    def refutes(self) -> bool:
        """Whether the explanation predicts worse (90 % interval of the shrinkage below 0), and by more than
        it expects of itself: a vehicle unstable on course turns a start known to a hundredth of a degree a
        second into degrees, and then a prediction by the truth may be the worse one."""
        unexpected = not self.excess["with effect"] <= self.expected
        return self.significant and self.interval[1] < 0 and unexpected


@dataclass(frozen=True, eq=False)
class HoldoutValidation:
    """Ladder over all horizons; empty without held-out runs. `measures` of their full replays."""

    horizons: tuple[HorizonError, ...]
    runs: tuple[str, ...]
    measures: tuple[MeasureComparison, ...] = ()

    @property
    def worse(self) -> tuple[str, ...]:
        """Horizons over which the explanation predicts worse, and worse than it can itself expect."""
        return tuple(h.horizon for h in self.horizons if h.refutes)


def validate_holdout(
    problem: DiagnosisProblem,
    trial: Trial,
    models: Mapping[str, Array],
    noise_model: NoiseModel,
    seed: int,
    draws: Mapping[str, Array] | None = None,
) -> HoldoutValidation:
    """Score models on the held-out runs.

    Parameters
    ----------
    models : "nominal", "recalibrated" (one or more keys starting so, the best counts) and "with effect"
        -> parameters
    noise_model : environment, for the floor
    draws : model -> (d, n_par) parameter vectors of its posterior, for the intervals
    """
    rng = np.random.default_rng(seed)
    noise = {c: s for log in problem.logs for c, s in zip(log.channels, log.sigma, strict=True)}
    time = problem.model.scales["L"] / problem.model.scales["U"]
    horizons: list[HorizonError] = []
    measures: tuple[MeasureComparison, ...] = ()
    for name, length in (
        ("6 L/U", SHORT_HORIZON * time),
        ("23 L/U", LONG_HORIZON * time),
        (FULL_HORIZON, np.nan),
    ):
        segments: list[Segment] = []
        for run in trial.holdout:
            for piece, start in _pieces(run, LEAD_LENGTHS * time, length):
                found = _predict(
                    problem, piece, noise, models, noise_model, LEAD_LENGTHS * time, start, name, draws or {},
                    np.random.default_rng([seed, len(segments), 1]),
                )  # fmt: skip
                if found is not None:
                    segments.append(found)
        if segments:
            horizons.append(_rung(problem, name, length, segments, rng))
            measures = tuple(m for s in segments for m in s.measures)
    return HoldoutValidation(tuple(horizons), tuple(run.name for run in trial.holdout), measures)


def _pieces(run: Run, lead: float, length: float) -> list[tuple[Run, float]]:
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


def _predict(
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
) -> Segment | None:
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
    errors, rms, drawn, replays = {}, {}, {}, {}
    floor, chance = np.ones(len(log.channels)), np.zeros(0)
    for name, par in models.items():
        try:
            point = Trajectory(par, log.path, np.zeros((log.n - 1, len(noise_model.force))))
            begun = fit(
                model,
                [known],
                NO_PARAMETERS,
                noise_model,
                start=[point],
                initial_noise_scale=0.0,
                iterations=15,
            )
            x0 = begun.points[0].states[0, : len(model.states)]
            obs = _replayed(model, par, log, x0)
            if name == "with effect":
                floor, begin_sd = _floor(model, known, begun.points[0], noise_model, ~early)
                if name in draws:
                    chance = _chance(model, draws[name], log, x0, begin_sd, obs, ~early, rng)
        except BayesidError:
            return None
        replays[name] = obs
        if name in draws:
            drawn[name] = _drawn(model, draws[name], log, x0, ~early)
        square = _squares(model, log, obs, ~early)
        at = [problem.channels.index(c) for c in log.channels]
        errors[name] = np.full(len(problem.channels), np.nan)
        errors[name][at] = square
        sigma = np.full(len(problem.channels), np.nan)
        sigma[at] = log.sigma
        rms[name] = dict(zip(problem.channels, np.sqrt(errors[name]) * sigma, strict=True))
    if not np.isfinite(errors["with effect"]).any():
        return None
    whole = np.full(len(problem.channels), np.nan)
    whole[at] = floor
    measures = _measures(problem, run, log, replays) if horizon == FULL_HORIZON else ()
    return Segment(run.name, start, horizon, errors, rms, whole, drawn, chance, measures)


def _replayed(model: Model, par: Array, log: RunData, x0: Array) -> Array:
    """(n, q) readings of a run begun at a state."""
    track = simulate(model, par, log.plan, x0, full=True)
    return observe(model, par, log.plan, track.states, full=True)[:, log.positions(model)]


def _chance(
    model: Model, pars: Array, log: RunData, x0: Array, begin_sd: Array, obs: Array, late: Array,
    rng: np.random.Generator,
) -> Array:  # fmt: skip
    """(d,) mean squared distance, in noise units, of draws of parameters and start from the prediction."""
    out = []
    for par in pars:
        begin = x0 + begin_sd * rng.standard_normal(x0.size)
        try:
            apart = wrap(model, log, _replayed(model, par, log, begin) - obs)[late]
        except BayesidError:
            continue
        out.append(_average(np.mean((apart / log.sigma) ** 2, axis=0)))
    return np.array(out)


def _squares(model: Model, log: RunData, obs: Array, late: Array) -> Array:
    """(q,) mean squared error in noise units after the lead-in, gross readings left out; nan without any."""
    resid = np.where(log.valid, wrap(model, log, log.readings - obs), np.nan)[late]
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
        out[i] = _average(_squares(model, log, obs, late))
    return out


def _measures(
    problem: DiagnosisProblem, run: Run, log: RunData, replays: Mapping[str, Array]
) -> tuple[MeasureComparison, ...]:
    """Tactical diameter, advance or overshoots of a run, by its logged orders; none where it has neither."""
    rudder, names = run.input("delta_r"), list(problem.channels)
    rudder = run.commands.get("delta_r_cmd", rudder)
    if rudder is None or not {"x", "y", "psi"} <= set(names):
        return ()
    x, y, psi = (names.index(c) for c in ("x", "y", "psi"))
    text = run.manoeuvre.lower()

    def told(values: Array) -> dict[str, tuple[float, str]]:
        if "turn" in text:
            turn = turning_circle(run.t, values[:, x], values[:, y], values[:, psi], rudder)
            return {"tactical diameter": (turn.tactical_diameter, "m"), "advance": (turn.advance, "m")}
        zig = zigzag(run.t, values[:, psi], rudder, values[:, x], values[:, y])
        return {f"overshoot {i + 1}": (v, "rad") for i, v in enumerate(zig.overshoots[:2])}

    if "turn" not in text and "zig" not in text:
        return ()
    try:
        logged = told(log.readings.copy())
        replayed = {name: told(obs) for name, obs in replays.items()}
    except (BayesidError, ValueError):
        return ()
    return tuple(
        MeasureComparison(
            run.name, what, unit, value, {n: r[what][0] for n, r in replayed.items() if what in r}
        )
        for what, (value, unit) in logged.items()
        if np.isfinite(value)
    )


def _floor(
    model: Model, known: RunData, point: Trajectory, noise_model: NoiseModel, late: Array
) -> tuple[Array, Array]:
    """Expected squared error in noise units of the best prediction: sensor noise, environment and initial
    state; and the sd of that state.
    """
    path = linearise(model, known, point, NO_PARAMETERS.where)
    sm = smoothed(model, path, np.zeros(0), noise_model)
    nx = point.states.shape[1]
    spread = np.einsum("iqx,ix->iq", path.slope**2, sm.variance[:, :nx])
    names = known.channels
    drift = np.array([noise_model.slow(n) ** 2 for n in names])
    begin = np.sqrt(np.maximum(sm.variance[0, : len(model.states)], 0.0))
    return 1.0 + np.mean((spread + drift)[late] / known.sigma**2, axis=0), begin


def _rung(
    problem: DiagnosisProblem, name: str, length: float, segments: Sequence[Segment], rng: np.random.Generator
) -> HorizonError:
    keys = list(segments[0].errors)
    excess = {k: np.array([_average(s.errors[k] - s.floor) for s in segments]) for k in keys}
    before_keys = [k for k in keys if k.startswith("recalibrated")]
    before_key = min(before_keys, key=lambda k: float(excess[k].mean()))
    before, after = excess[before_key], excess["with effect"]
    n = len(segments)
    sampled = {}
    for k in (before_key, "with effect"):
        if all(k in s.drawn for s in segments):
            raw = np.array([s.drawn[k] for s in segments])
            raw = raw[:, np.isfinite(raw).all(axis=0)]  # a draw that diverges on one piece is none
            if raw.shape[1]:
                # a draw misses by the estimate's error and its own: its spread counts, not that second share
                sampled[k] = raw - raw.mean(axis=1, keepdims=True) + excess[k][:, None]
    ratio, base = [], []
    for _ in range(BOOTSTRAP_DRAWS):
        # with two pieces there is nothing to resample: the draws alone speak
        pick = rng.integers(0, n, n) if n >= 3 else np.arange(n)
        b = _one(before, sampled.get(before_key), pick, rng)
        a = _one(after, sampled.get("with effect"), pick, rng)
        base.append(b)
        ratio.append(1.0 - max(a, 0.0) / b if b > 0 else np.nan)
    floor = _average(np.array([s.floor for s in segments]))
    # Three segments give an interval; with fewer the gap must stand out of what the best model would leave.
    sure = np.quantile(base, 0.05) > 0 and (_stands_out(before) if n >= 3 else before.mean() > 0.5 * floor)
    significant = bool(before.mean() > 0.05 and sure)
    shrink = 1.0 - max(float(after.mean()), 0.0) / float(before.mean()) if significant else float("nan")
    interval = (
        tuple(float(q) for q in np.nanquantile(ratio, (0.05, 0.95)))
        if significant and (n >= 3 or len(sampled) == 2)
        else (float("nan"),) * 2
    )
    shown = {"nominal": "nominal", "recalibrated": before_key, "with effect": "with effect"}
    channels = {
        label: {
            c: _average(np.array([s.errors[k][j] - s.floor[j] for s in segments]))
            for j, c in enumerate(problem.channels)
        }
        for label, k in shown.items()
    }
    rms = {
        label: {c: _average(np.array([s.rms[k][c] ** 2 for s in segments])) ** 0.5 for c in problem.channels}
        for label, k in shown.items()
    }
    return HorizonError(
        name,
        float(length),
        {label: float(excess[k].mean()) for label, k in shown.items()},
        shrink,
        (interval[0], interval[1]),
        significant,
        floor,
        rms,
        channels,
        n,
        max((v.shape[1] for v in sampled.values()), default=0),
        _expected(segments),
    )


def _expected(segments: Sequence[Segment]) -> float:
    """Mean over the pieces of what 95 % of the draws stay below; nan without draws."""
    bounds = [float(np.quantile(s.chance, 0.95)) for s in segments if s.chance.size]
    return float(np.mean(bounds)) if bounds else float("nan")


def _average(values: Array) -> float:
    """Mean of what is there; nan where nothing is (a channel no held-out piece reads)."""
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else float("nan")


def _stands_out(values: Array) -> bool:
    """Whether a mean is above zero at 95 % by Student's t: a bootstrap of three pieces is too sure."""
    error = float(values.std(ddof=1)) / np.sqrt(values.size)
    return float(values.mean()) > float(student.ppf(0.95, values.size - 1)) * error


def _one(values: Array, sampled: Array | None, pick: Array, rng: np.random.Generator) -> float:
    """Mean excess of the picked pieces, of one posterior draw where there are any."""
    if sampled is None:
        return float(values[pick].mean())
    return float(sampled[pick, rng.integers(0, sampled.shape[1])].mean())
