"""How far the gap shrinks on held-out runs: nominal, recalibrated without the effect, with the effect, floor.

Takes fitted models and the held-out runs, which nothing before this has read. Gives a frozen `Shrink`.
Never changes a verdict.

A prediction starts from a state fitted to a short lead-in and runs open loop over the horizon; it is scored
in units of
the sensors' noise after the lead-in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.coloured.colours import Colours, smoothed
from bayesid.coloured.fit import NOTHING, fit
from bayesid.coloured.log import Array, Log, read_run
from bayesid.coloured.path import Point, linearise, wrap
from bayesid.diagnose.problem import Problem
from bayesid.errors import BayesidError
from bayesid.model import Model
from bayesid.simulate import observe, simulate
from bayesid.trials import Run, Trial, window

LEAD, SHORT, LONG = 6.0, 6.0, 23.0
MOST_SEGMENTS = 8
DRAWS = 400


@dataclass(frozen=True, eq=False)
class Segment:
    """One prediction: mean squared error in noise units per channel, after the lead-in."""

    run: str
    start: float
    horizon: str
    errors: dict[str, Array]
    rms: dict[str, dict[str, float]]
    floor: Array


@dataclass(frozen=True, eq=False)
class Rung:
    """Excess error of each model over one horizon.

    Attributes
    ----------
    horizon, seconds : name and length [s] (nan for full replay)
    excess : model -> mean squared error in noise units above the floor
    shrink, interval : 1 - after/before and its 90 % interval; nan where nothing is left to shrink
    worth : whether the gap before is above zero at 95 %
    floor : expected error of the best prediction, noise variances
    rms : model -> channel -> root mean square error [SI]
    channels : model -> channel -> excess
    """

    horizon: str
    seconds: float
    excess: dict[str, float]
    shrink: float
    interval: tuple[float, float]
    worth: bool
    floor: float
    rms: dict[str, dict[str, float]]
    channels: dict[str, dict[str, float]]


@dataclass(frozen=True, eq=False)
class Shrink:
    """Ladder over all horizons; empty without held-out runs."""

    rungs: tuple[Rung, ...]
    runs: tuple[str, ...]


def ladder(
    problem: Problem, trial: Trial, models: Mapping[str, Array], colours: Colours, seed: int
) -> Shrink:
    """Score models on the held-out runs.

    Parameters
    ----------
    models : "nominal", "recalibrated" (one or more keys starting so, the best counts) and "with effect"
        -> parameters
    colours : environment, for the floor
    """
    rng = np.random.default_rng(seed)
    noise = {
        problem.model.kernel.channels[c]: s
        for c, s in zip(problem.logs[0].channels, problem.logs[0].sigma, strict=True)
    }
    time = problem.model.scales["L"] / problem.model.scales["U"]
    rungs = []
    for name, length in (("6 L/U", SHORT * time), ("23 L/U", LONG * time), ("full replay", np.nan)):
        segments = []
        for run in trial.holdout:
            for piece, start in _pieces(run, LEAD * time, length):
                found = _predict(problem, piece, noise, models, colours, LEAD * time, start, name)
                if found is not None:
                    segments.append(found)
        if segments:
            rungs.append(_rung(problem, name, length, segments, rng))
    return Shrink(tuple(rungs), tuple(run.name for run in trial.holdout))


def _pieces(run: Run, lead: float, length: float) -> list[tuple[Run, float]]:
    if not np.isfinite(length):
        return [(run, float(run.t[0]))]
    starts = np.arange(run.t[0], run.t[-1] - lead - length, lead + length)
    if starts.size > MOST_SEGMENTS:
        starts = starts[np.linspace(0, starts.size - 1, MOST_SEGMENTS).astype(int)]
    return [(window(run, float(s), float(s + lead + length)), float(s)) for s in starts]


def _predict(
    problem: Problem,
    run: Run,
    noise: dict[str, float],
    models: Mapping[str, Array],
    colours: Colours,
    lead: float,
    start: float,
    horizon: str,
) -> Segment | None:
    model = problem.model
    try:
        log = read_run(model, run, noise, problem.channels)
    except BayesidError:
        return None
    t = log.plan.t - log.plan.t[0]
    early = t <= lead
    if early.sum() < 4 or (~early).sum() < 4:
        return None
    known = log.without(np.repeat(~early[:, None], len(log.channels), axis=1))
    errors, rms = {}, {}
    floor = np.ones(len(log.channels))
    for name, par in models.items():
        try:
            point = Point(par, log.path, np.zeros((log.n - 1, len(colours.force))))
            begun = fit(model, [known], NOTHING, colours, start=[point], loud=0.0, passes=15)
            x0 = begun.points[0].states[0, : len(model.states)]
            if name == "with effect":
                floor = _floor(model, known, begun.points[0], colours, ~early)
            track = simulate(model, par, log.plan, x0, full=True)
            obs = observe(model, par, log.plan, track.states, full=True)[:, list(log.channels)]
        except BayesidError:
            return None
        resid = np.where(log.valid, wrap(model, log, log.data - obs), np.nan)[~early]
        resid = np.where(
            np.abs(resid) > 50 * np.nanmedian(np.abs(resid), axis=0) + 20 * log.sigma, np.nan, resid
        )
        errors[name] = np.nanmean((resid / log.sigma) ** 2, axis=0)
        rms[name] = {c: float(np.sqrt(np.nanmean(resid[:, j] ** 2))) for j, c in enumerate(problem.channels)}
    return Segment(run.name, start, horizon, errors, rms, floor)


def _floor(model: Model, known: Log, point: Point, colours: Colours, late: Array) -> Array:
    """Expected squared error in noise units of the best prediction: sensor noise, environment and initial
    state.
    """
    path = linearise(model, known, point, NOTHING.where)
    sm = smoothed(model, path, np.zeros(0), colours)
    nx = point.states.shape[1]
    spread = np.einsum("iqx,ix->iq", path.slope**2, sm.variance[:, :nx])
    names = [model.kernel.channels[c] for c in known.channels]
    drift = np.array([colours.drift**2 if n in ("x", "y", "z") else 0.0 for n in names])
    return 1.0 + np.mean((spread + drift)[late] / known.sigma**2, axis=0)


def _rung(
    problem: Problem, name: str, length: float, segments: Sequence[Segment], rng: np.random.Generator
) -> Rung:
    keys = list(segments[0].errors)
    excess = {k: np.array([np.nanmean(s.errors[k] - s.floor) for s in segments]) for k in keys}
    before_keys = [k for k in keys if k.startswith("recalibrated")]
    before_key = min(before_keys, key=lambda k: float(excess[k].mean()))
    before, after = excess[before_key], excess["with effect"]
    n = len(segments)
    ratio, base = [], []
    for _ in range(DRAWS):
        pick = rng.integers(0, n, n)
        b, a = float(before[pick].mean()), float(after[pick].mean())
        base.append(b)
        ratio.append(1.0 - max(a, 0.0) / b if b > 0 else np.nan)
    floor = float(np.mean([s.floor for s in segments]))
    # Three segments give an interval; with fewer the gap must stand out of what the best model would leave.
    sure = np.quantile(base, 0.05) > 0 if n >= 3 else before.mean() > 0.5 * floor
    worth = bool(before.mean() > 0.05 and sure)
    shrink = 1.0 - max(float(after.mean()), 0.0) / float(before.mean()) if worth else float("nan")
    interval = (
        tuple(float(q) for q in np.nanquantile(ratio, (0.05, 0.95)))
        if worth and n >= 3
        else (float("nan"),) * 2
    )
    shown = {"nominal": "nominal", "recalibrated": before_key, "with effect": "with effect"}
    channels = {
        label: {
            c: float(np.mean([s.errors[k][j] - s.floor[j] for s in segments]))
            for j, c in enumerate(problem.channels)
        }
        for label, k in shown.items()
    }
    rms = {
        label: {c: float(np.sqrt(np.mean([s.rms[k][c] ** 2 for s in segments]))) for c in problem.channels}
        for label, k in shown.items()
    }
    return Rung(
        name,
        float(length),
        {label: float(excess[k].mean()) for label, k in shown.items()},
        shrink,
        (interval[0], interval[1]),
        worth,
        floor,
        rms,
        channels,
    )
