"""Readings that all others contradict: single wrong samples, found before anything is fitted.

Takes logs. Gives them without the outliers, which are listed with run, time and channel. Longer faults are
the business of `events`, gaps that of the diagnosis.

A reading is judged by its misfit given all others (de Jong and Penzer 1998) along a path that may bend. How
much it may bend decides what can be seen: under the force that certainly follows any gap, one yaw rate off by
12 sigma is a possible motion. So the path is then led with as little force as the readings need, and they
are judged again until nothing more is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from bayesid.coloured.colours import Colours, force_unit, smoothed
from bayesid.coloured.fit import NOTHING, fit
from bayesid.coloured.levels import DRIFT_MEDIAN, silent
from bayesid.coloured.log import Array, Log
from bayesid.coloured.path import Point, linearise
from bayesid.model import Model

# Misfit of an outlier over its deviation; force over 1/2 rho L^2 U^2 with which the path may bend at first.
OUTLIER, BENDING = 6.0, 0.003
# Share of a channel's readings in a run above which outliers are no accident.
MOST_OUTLIERS = 0.1
# Neighbours on either side in the same channel that must not show the same misfit.
BESIDE = 4
# So many outliers among as many neighbours on either side are a fault that lasts, not chance: at 3 % of
# outliers one in 700 of them.
LASTING, NEAR = 4, 4
ROUNDS = 3

Found = tuple[tuple[str, float, str], ...]


def set_aside(model: Model, logs: Sequence[Log]) -> tuple[list[Log], Found]:
    """Logs without the readings that all others contradict, and (run, time [s], channel) of those.

    Many in one channel of a run are no accident but a gap; they stay.
    """
    unit, quiet = force_unit(model), silent(model)
    calm = replace(quiet, drift=DRIFT_MEDIAN * model.scales["L"])
    kept, start, level = list(logs), None, BENDING
    for turn in range(1 + ROUNDS):
        if turn == 0:
            fitted = fit(model, kept, NOTHING, _forced(calm, level * unit), passes=3, loud=0.0)
            start = fitted.points
        else:
            fitted = fit(model, kept, NOTHING, calm, start=start, loud=level, passes=10 if turn == 1 else 5)
            start, level = fitted.follow, fitted.follow_level
        before = kept
        colours = _forced(calm, level * unit)
        kept = [_stripped(model, log, point, colours) for log, point in zip(kept, start, strict=True)]
        if turn > 0 and all(new is old for new, old in zip(kept, before, strict=True)):
            break
    return listed(model, logs, kept)


def stripped(
    model: Model, logs: Sequence[Log], points: Sequence[Point], colours: Colours
) -> tuple[list[Log], Found]:
    """`set_aside` along paths that are known, under an environment that is."""
    return listed(model, logs, [_stripped(model, g, p, colours) for g, p in zip(logs, points, strict=True)])


def listed(model: Model, logs: Sequence[Log], kept: Sequence[Log]) -> tuple[list[Log], Found]:
    """Logs without the readings missing in `kept`, where these are few and apart, and which they are."""
    out, found = [], []
    for log, new in zip(logs, kept, strict=True):
        bad = log.valid & ~new.valid
        bad &= bad.sum(axis=0) <= np.maximum(MOST_OUTLIERS * log.valid.sum(axis=0), 2)
        bad &= ~_lasting(bad, log.valid)
        for i, j in np.argwhere(bad):
            found.append((log.name, float(log.plan.t[i]), model.kernel.channels[log.channels[j]]))
        out.append(log.without(bad))
    return out, tuple(found)


def _forced(colours: Colours, force: Array) -> Colours:
    return replace(colours, force=tuple(float(f) for f in force))


def _stripped(model: Model, log: Log, point: Point, colours: Colours) -> Log:
    """One log without its outliers, along a fixed path; the same object where there is none.

    The worst reading of its neighbourhood goes first: an outlier spoils the misfit of those next to it. A
    misfit the channel's next readings share is a gap and stays.
    """
    path = linearise(model, log, point, NOTHING.where)
    for _ in range(12):
        valid = path.log.valid
        alone = smoothed(model, path, NOTHING.mean, colours).alone
        spread = max(1.0, float(np.median(np.abs(alone[valid]))) / 0.6745)
        size = np.minimum(np.abs(alone), np.abs(alone - _beside(alone, valid))) * valid
        near = maximum_filter1d(size.max(axis=1), 7, mode="constant")
        bad = (size > OUTLIER * spread) & (size == near[:, None])
        if not bad.any():
            break
        path = replace(path, log=path.log.without(bad))
    return path.log


def _lasting(bad: Array, valid: Array) -> Array:
    """Bad readings that come one after the other in their channel: a fault that lasts is no outlier."""
    out = np.zeros_like(bad)
    for j in range(bad.shape[1]):
        where = np.flatnonzero(valid[:, j])
        row = bad[where, j]
        if not row.any():
            continue
        # "full" and cut: "same" is as long as the longer of the two, and a run may have few readings
        crowd = np.convolve(row, np.ones(2 * NEAR + 1))[NEAR : NEAR + row.size] >= LASTING
        out[where, j] = row & crowd
    return out


def _beside(values: Array, valid: Array) -> Array:
    """Median of the nearest valid values of the same channel, the value itself left out; 0 with too few."""
    n = values.shape[0]
    padded = np.full((n + 2 * BESIDE, values.shape[1]), np.nan)
    padded[BESIDE : BESIDE + n] = np.where(valid, values, np.nan)
    shifts = [padded[BESIDE + k : BESIDE + k + n] for k in range(-BESIDE, BESIDE + 1) if k]
    stacked = np.sort(np.stack(shifts), axis=0)  # NaN last
    count = np.isfinite(stacked).sum(axis=0)
    middle = np.maximum(count - 1, 0) // 2
    low = np.take_along_axis(stacked, middle[None], axis=0)[0]
    high = np.take_along_axis(stacked, np.minimum(count // 2, 2 * BESIDE - 1)[None], axis=0)[0]
    return np.where(count >= 3, 0.5 * (low + high), 0.0)
