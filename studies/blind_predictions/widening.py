"""How much wider bands must be so that runs the model has not read lie inside them.

Takes predictions of left-out runs and their readings. Gives, by channel and time since the first readings,
the usual error and a factor: either limit is the factor times its distance in the draws and the usual error
together. Does not predict.

Conformal prediction with a normalised score (Lei and others 2018; without the usual error, draws that agree
for no good reason make all bands wide), runs as the exchangeable units: readings of one run share their
error, so every run counts the same, and the level is raised until runs left out of the factors are covered.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.measures.angle_errors import counted_on
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
    """One left-out run: channel -> (m,) time since its first readings [s], size of the error, and distance of
    the limit on its side."""

    run: str
    kind: str
    since: Mapping[str, Array]
    error: Mapping[str, Array]
    limit: Mapping[str, Array]


def misses(p: Prediction, run: Run, kind: str) -> Misses:
    """Errors of a prediction beside its own band, sensor noise included."""
    times, sizes, limits = {}, {}, {}
    late = p.t - p.t[0] > p.lead
    low, high = sides(p)
    for j, name in enumerate(p.channels):
        error = counted_on((run.data[name] - p.mean[:, j])[:, None], (name,))[:, 0]
        seen = late & np.isfinite(error)
        if seen.sum() < SHORTEST:
            continue
        times[name] = (p.t - p.t[0] - p.lead)[seen]
        sizes[name] = np.abs(error[seen])
        limits[name] = np.where(error > 0, high[:, j], low[:, j])[seen]
    return Misses(run.name, kind, times, sizes, limits)


def either_way(one: Misses) -> Misses:
    """A stand-in for a run that turns through all headings: errors in x count for y too, and vice versa."""
    both = {
        name: {"x": np.concatenate([part["x"], part["y"]]), "y": np.concatenate([part["x"], part["y"]])}
        for name, part in (("since", one.since), ("error", one.error), ("limit", one.limit))
    }
    return Misses(
        one.run, one.kind, {**one.since, **both["since"]}, {**one.error, **both["error"]},
        {**one.limit, **both["limit"]},
    )  # fmt: skip


def sides(p: Prediction) -> tuple[Array, Array]:
    """(n, q) distances of the 95 % limits below and above the mean, white noise of the sensors added."""
    low, high = p.band(INTERVAL_LEVEL)
    noise = 1.96 * np.nan_to_num(p.noise)
    return np.hypot(np.maximum(p.mean - low, 0.0), noise), np.hypot(np.maximum(high - p.mean, 0.0), noise)


def factors(found: Sequence[Misses], level: float) -> dict[str, list[list[float]]]:
    """Channel -> usual error and factor per horizon: the median and the quantile of all readings, every run
    with the same weight. A horizon no run reaches has those of the one before.
    """
    out: dict[str, list[list[float]]] = {}
    for name in dict.fromkeys(c for one in found for c in one.error):
        last, row = [0.0, 1.0], []
        for h in range(len(HORIZONS)):
            parts = [_within(one, name, h) for one in found if name in one.error]
            parts = [(error, limit) for error, limit in parts if error.size >= SHORTEST]
            if parts:
                usual = _weighted_quantile([error for error, _ in parts], 0.5)
                most = _weighted_quantile(
                    [error / (limit + usual) for error, limit in parts], min(level, 1.0)
                )
                last = [usual, max(most * max(level, 1.0), 0.1)]
            row.append(last)
        out[name] = row
    return out


def _within(one: Misses, name: str, h: int) -> tuple[Array, Array]:
    end = HORIZONS[h + 1] if h + 1 < len(HORIZONS) else np.inf
    inside = (one.since[name] >= HORIZONS[h]) & (one.since[name] < end)
    return one.error[name][inside], one.limit[name][inside]


def _weighted_quantile(parts: Sequence[Array], level: float) -> float:
    values = np.concatenate(parts)
    weights = np.concatenate([np.full(part.size, 1.0 / part.size) for part in parts])
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / weights.sum()
    return float(values[order[min(int(np.searchsorted(share, level - 1e-9)), values.size - 1)]])


def widened_side(row: Sequence[Sequence[float]], since: Array, limit: Array) -> Array:
    """Distance of a limit from the mean at times since the first readings [s]; usual error and factor change
    evenly from the middle of one horizon to that of the next."""
    middles = [*(0.5 * (np.array(HORIZONS[:-1]) + np.array(HORIZONS[1:]))), HORIZONS[-1]]
    usual, factor = (np.interp(since, middles, [pair[k] for pair in row]) for k in (0, 1))
    return np.asarray(factor * (limit + usual))


def covered(one: Misses, scale: Mapping[str, Sequence[Sequence[float]]]) -> dict[str, float]:
    """Channel -> share of the readings of a run inside the widened band."""
    return {
        name: float(np.mean(error <= widened_side(scale[name], one.since[name], one.limit[name])))
        for name, error in one.error.items()
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


def widened(p: Prediction, scale: Mapping[str, Sequence[Sequence[float]]]) -> tuple[Array, Array]:
    """(n, q) limits of a prediction, as left-out runs ask for."""
    since = np.maximum(p.t - p.t[0] - p.lead, 0.0)
    low, high = sides(p)
    for j, name in enumerate(p.channels):
        if name in scale:
            low[:, j], high[:, j] = (widened_side(scale[name], since, side[:, j]) for side in (low, high))
    return p.mean - low, p.mean + high
