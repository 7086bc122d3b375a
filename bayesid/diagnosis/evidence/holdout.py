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
from bayesid.diagnosis.evidence.holdout_prediction import (
    FULL_HORIZON,
    Made,
    MeasureComparison,
    Segment,
    average,
    pieces_of,
    predicted,
)
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.run_data import Array
from bayesid.trials import Trial

LEAD_LENGTHS, SHORT_HORIZON, LONG_HORIZON = 6.0, 6.0, 23.0
BOOTSTRAP_DRAWS = 400
MIN_PIECES = 3  # from which on pieces tell of each other


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
    expected : mean squared error in noise units, floor included, that the explanation expects of itself: the
        floor, or what 95 % of its draws stay below; nan without draws
    worsens : whether the explanation misses by more than chance lets it (see `_worsens`)
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
    worsens: bool = True

    @property
    def refutes(self) -> bool:
        """Whether the explanation predicts worse (90 % interval of the shrinkage below 0), by more than
        chance lets it, and by more than it expects of itself: a vehicle unstable on course turns a start
        known to a hundredth of a degree a second into degrees, and then a prediction by the truth may be the
        worse one."""
        unexpected = not self.excess["with effect"] + self.floor <= self.expected
        return self.significant and self.interval[1] < 0 and unexpected and self.worsens


@dataclass(frozen=True, eq=False)
class HoldoutValidation:
    """Errors over all horizons; empty without held-out runs. `measures` of their full replays."""

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
    made: Made | None = None,
) -> HoldoutValidation:
    """Score models on the held-out runs.

    Parameters
    ----------
    models : "nominal", "recalibrated" (one or more keys starting so, the best counts) and "with effect"
        -> parameters
    noise_model : environment, for the floor
    draws : model -> (d, n_par) parameter vectors of its posterior, for the intervals
    made : predictions of the same models and draws, "with effect" apart, from an earlier call; new ones are
        added
    """
    made = {} if made is None else made
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
            for piece, start in pieces_of(run, LEAD_LENGTHS * time, length):
                found = predicted(
                    problem, piece, noise, models, noise_model, LEAD_LENGTHS * time, start, name, draws or {},
                    np.random.default_rng([seed, len(segments), 1]), made,
                )  # fmt: skip
                if found is not None:
                    segments.append(found)
        if segments:
            horizons.append(_rung(problem, name, length, segments, rng))
            measures = tuple(m for s in segments for m in s.measures)
    return HoldoutValidation(tuple(horizons), tuple(run.name for run in trial.holdout), measures)


def _rung(
    problem: DiagnosisProblem, name: str, length: float, segments: Sequence[Segment], rng: np.random.Generator
) -> HorizonError:
    keys = list(segments[0].errors)
    excess = {k: np.array([average(s.errors[k] - s.floor) for s in segments]) for k in keys}
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
    floor = average(np.array([s.floor for s in segments]))
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
            c: average(np.array([s.errors[k][j] - s.floor[j] for s in segments]))
            for j, c in enumerate(problem.channels)
        }
        for label, k in shown.items()
    }
    rms = {
        label: {c: average(np.array([s.rms[k][c] ** 2 for s in segments])) ** 0.5 for c in problem.channels}
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
        _expected(segments, floor),
        _worsens(before, after, floor),
    )


def _worsens(before: Array, after: Array, floor: float) -> bool:
    """Whether predictions get worse by more than a common error lets them by chance.

    What sea and start add to either prediction makes the true one the worse one on half the pieces: a change
    d beside an error e adds d^2 + 2 e d, and e may have either sign. So the pieces must agree (Student's t
    of the differences, 95 %), and fewer than three must miss by twice as much, for then d exceeds e. What is
    less than the floor, which no prediction can avoid, is no loss.
    """
    change = after - before
    if not change.mean() > floor:
        return False
    if change.size < MIN_PIECES:
        return bool(after.mean() + floor > 4.0 * (before.mean() + floor))
    return _stands_out(change)


def _expected(segments: Sequence[Segment], floor: float) -> float:
    """Floor, or what 95 % of the draws stay below on average over the pieces; nan without draws."""
    if not all(s.chance.size for s in segments):
        return float("nan")
    mean = np.sort(np.mean([s.chance for s in segments], axis=0))
    if not np.isfinite(mean[int(np.ceil(0.95 * (mean.size - 1)))]):
        return float("inf")  # more draws diverge than are left out
    return max(floor, float(np.quantile(mean, 0.95)))


def _stands_out(values: Array) -> bool:
    """Whether a mean is above zero at 95 % by Student's t: a bootstrap of three pieces is too sure."""
    error = float(values.std(ddof=1)) / np.sqrt(values.size)
    return float(values.mean()) > float(student.ppf(0.95, values.size - 1)) * error


def _one(values: Array, sampled: Array | None, pick: Array, rng: np.random.Generator) -> float:
    """Mean excess of the picked pieces, of one posterior draw where there are any."""
    if sampled is None:
        return float(values[pick].mean())
    return float(sampled[pick, rng.integers(0, sampled.shape[1])].mean())
