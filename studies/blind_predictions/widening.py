"""How much wider bands must be so that runs the model has not read lie inside them.

Takes predictions of left-out runs and their readings. Gives factors on the distance of either limit from the
mean, by kind of motion, channel and time since the first readings. Does not predict.

Split conformal prediction with the predicted band as the score (Romano, Patterson and Candes 2019), runs as
the exchangeable units: readings of one run share their error, so every run counts the same, and the level is
raised until runs left out of the factors are covered.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.prediction.prediction import INTERVAL_LEVEL, Prediction
from bayesid.trials import Run

Array = np.ndarray
# Time since the first readings at which a new factor begins [s].
HORIZONS = (0.0, 20.0, 60.0, 150.0, 400.0)
# Levels tried: the least that covers left-out runs on average. Beyond 1, so many times the largest error.
LEVELS = (0.95, 0.96, 0.97, 0.98, 0.99, 0.995, 1.0, 1.25, 1.5, 2.0, 3.0)
SHORTEST = 5  # readings that tell a quantile


@dataclass(frozen=True, eq=False)
class Misses:
    """One left-out run: channel -> (m,) time since its first readings [s], and (m,) error over the distance
    of the limit on its side."""

    run: str
    kind: str
    since: Mapping[str, Array]
    ratio: Mapping[str, Array]


def misses(p: Prediction, run: Run, kind: str) -> Misses:
    """Errors of a prediction in units of its own band, sensor noise included."""
    times, ratios = {}, {}
    late = p.t - p.t[0] > p.lead
    low, high = sides(p)
    for j, name in enumerate(p.channels):
        error = run.data[name] - p.mean[:, j]
        if name == "psi":
            error = error - 2 * np.pi * np.round(error / (2 * np.pi))
        seen = late & np.isfinite(error)
        if seen.sum() < SHORTEST:
            continue
        limit = np.where(error > 0, high[:, j], low[:, j])
        times[name] = (p.t - p.t[0] - p.lead)[seen]
        ratios[name] = np.abs(error[seen]) / limit[seen]
    return Misses(run.name, kind, times, ratios)


def sides(p: Prediction) -> tuple[Array, Array]:
    """(n, q) distances of the 95 % limits below and above the mean, white noise of the sensors added."""
    low, high = p.band(INTERVAL_LEVEL)
    noise = 1.96 * np.nan_to_num(p.noise)
    return np.hypot(np.maximum(p.mean - low, 0.0), noise), np.hypot(np.maximum(high - p.mean, 0.0), noise)


def factors(found: Sequence[Misses], level: float) -> dict[str, list[float]]:
    """Channel -> factor per horizon: the quantile of all readings, every run with the same weight.

    A horizon no run reaches has the factor of the one before.
    """
    out: dict[str, list[float]] = {}
    for name in dict.fromkeys(c for one in found for c in one.ratio):
        last, row = 1.0, []
        for h in range(len(HORIZONS)):
            parts = [_within(one, name, h) for one in found if name in one.ratio]
            parts = [part for part in parts if part.size >= SHORTEST]
            if parts:
                last = max(_weighted_quantile(parts, min(level, 1.0)) * max(level, 1.0), 0.1)
            row.append(last)
        out[name] = row
    return out


def _within(one: Misses, name: str, h: int) -> Array:
    end = HORIZONS[h + 1] if h + 1 < len(HORIZONS) else np.inf
    return one.ratio[name][(one.since[name] >= HORIZONS[h]) & (one.since[name] < end)]


def _weighted_quantile(parts: Sequence[Array], level: float) -> float:
    values = np.concatenate(parts)
    weights = np.concatenate([np.full(part.size, 1.0 / part.size) for part in parts])
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(values[order[min(int(np.searchsorted(share, level - 1e-9)), values.size - 1)]])


def at(row: Sequence[float], since: Array) -> Array:
    """Factor at times since the first readings [s]: linear between the middles of the horizons."""
    middles = [*(0.5 * (np.array(HORIZONS[:-1]) + np.array(HORIZONS[1:]))), HORIZONS[-1]]
    return np.interp(since, middles, row)


def covered(one: Misses, scale: Mapping[str, Sequence[float]]) -> dict[str, float]:
    """Channel -> share of the readings of a run inside the widened band."""
    return {
        name: float(np.mean(ratio <= at(scale[name], one.since[name])))
        for name, ratio in one.ratio.items()
        if name in scale
    }


def left_out_coverage(found: Sequence[Misses], level: float) -> dict[str, dict[str, float]]:
    """Run -> channel -> share inside the band that the other runs of its kind ask for."""
    return {
        one.run: covered(one, factors([other for other in found if other is not one], level)) for one in found
    }


def chosen_level(found: Sequence[Misses]) -> float:
    """The least level whose factors, of all runs but one, cover that one in 95 % on average of channels."""
    for level in LEVELS:
        shares = [np.mean(list(row.values())) for row in left_out_coverage(found, level).values() if row]
        if shares and np.mean(shares) >= INTERVAL_LEVEL:
            return level
    return LEVELS[-1]


def widened(p: Prediction, scale: Mapping[str, Sequence[float]]) -> tuple[Array, Array]:
    """(n, q) limits of a prediction, each side times its factor."""
    since = np.maximum(p.t - p.t[0] - p.lead, 0.0)
    low, high = sides(p)
    grow = np.ones_like(p.mean)
    for j, name in enumerate(p.channels):
        if name in scale:
            grow[:, j] = at(scale[name], since)
    return p.mean - grow * low, p.mean + grow * high


def as_prediction(p: Prediction, centre: Array) -> Prediction:
    """The prediction moved so that its mean is `centre` (n, q)."""
    return replace(p, draws=p.draws + (centre - p.mean))
