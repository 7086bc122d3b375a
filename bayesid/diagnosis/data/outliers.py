"""Readings that all others contradict: single wrong samples, found before anything is fitted.

Takes logs. Gives them without the outliers, which are listed with run, time and channel. Longer faults are
the business of `event_search`, gaps that of the diagnosis.

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

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.noise_identification import DRIFT_MEDIAN, no_process_noise
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, smoothed
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData

# Misfit of an outlier over its deviation; force over 1/2 rho L^2 U^2 with which the path may bend at first.
OUTLIER_DEVIATION, FIRST_FORCE_LEVEL = 6.0, 0.003
# Share of a channel's readings in a run above which outliers are no accident.
MOST_OUTLIER_SHARE = 0.1
# Neighbours on either side in the same channel that must not show the same misfit.
NEIGHBOURS = 4
# So many outliers among as many neighbours on either side are a fault that lasts, not chance: at 3 % of
# outliers one in 700 of them.
LASTING_COUNT, LASTING_NEIGHBOURS = 4, 4
MOST_ROUNDS = 3

Found = tuple[tuple[str, float, str], ...]


def set_aside(model: Model, logs: Sequence[RunData]) -> tuple[list[RunData], Found]:
    """Logs without the readings that all others contradict, and (run, time [s], channel) of those.

    Many in one channel of a run are no accident but a gap; they stay.
    """
    unit, quiet = force_unit(model), no_process_noise(model)
    calm = replace(quiet, drift=DRIFT_MEDIAN * model.scales["L"])
    kept, start, level = list(logs), None, FIRST_FORCE_LEVEL
    for turn in range(1 + MOST_ROUNDS):
        if turn == 0:
            fitted = fit(
                model, kept, NO_PARAMETERS, _forced(calm, level * unit), iterations=3, initial_noise_scale=0.0
            )
            start = fitted.points
        else:
            fitted = fit(
                model,
                kept,
                NO_PARAMETERS,
                calm,
                start=start,
                initial_noise_scale=level,
                iterations=10 if turn == 1 else 5,
            )
            start, level = fitted.path_points, fitted.path_force_level
        before = kept
        noise_model = _forced(calm, level * unit)
        try:
            kept = [_stripped(model, log, p, noise_model) for log, p in zip(before, start, strict=True)]
        except ModelError:  # the last step left the numbers; the most probable pass has not
            start = fitted.path_points
            kept = [_stripped(model, log, p, noise_model) for log, p in zip(before, start, strict=True)]
        if turn > 0 and all(new is old for new, old in zip(kept, before, strict=True)):
            break
    return listed(model, logs, kept)


def stripped(
    model: Model, logs: Sequence[RunData], points: Sequence[Trajectory], noise_model: NoiseModel
) -> tuple[list[RunData], Found]:
    """`set_aside` along paths that are known, under an environment that is."""
    return listed(
        model, logs, [_stripped(model, g, p, noise_model) for g, p in zip(logs, points, strict=True)]
    )


def listed(model: Model, logs: Sequence[RunData], kept: Sequence[RunData]) -> tuple[list[RunData], Found]:
    """Logs without the readings missing in `kept`, where these are few and apart, and which they are."""
    out, found = [], []
    for log, new in zip(logs, kept, strict=True):
        bad = log.valid & ~new.valid
        bad &= bad.sum(axis=0) <= np.maximum(MOST_OUTLIER_SHARE * log.valid.sum(axis=0), 2)
        bad &= ~_lasting(bad, log.valid)
        for i, j in np.argwhere(bad):
            found.append((log.name, float(log.plan.t[i]), log.channels[j]))
        out.append(log.without(bad))
    return out, tuple(found)


def _forced(noise_model: NoiseModel, force: Array) -> NoiseModel:
    return replace(noise_model, force=tuple(float(f) for f in force))


def _stripped(model: Model, log: RunData, point: Trajectory, noise_model: NoiseModel) -> RunData:
    """One log without its outliers, along a fixed path; the same object where there is none.

    The worst reading of its neighbourhood goes first: an outlier spoils the misfit of those next to it. A
    misfit the channel's next readings share is a gap and stays.
    """
    path = linearise(model, log, point, NO_PARAMETERS.where)
    for _ in range(12):
        valid = path.log.valid
        alone = smoothed(model, path, NO_PARAMETERS.mean, noise_model).alone
        spread = max(1.0, float(np.median(np.abs(alone[valid]))) / 0.6745)
        size = np.minimum(np.abs(alone), np.abs(alone - _beside(alone, valid))) * valid
        near = maximum_filter1d(size.max(axis=1), 7, mode="constant")
        bad = (size > OUTLIER_DEVIATION * spread) & (size == near[:, None])
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
        crowd = (
            np.convolve(row, np.ones(2 * LASTING_NEIGHBOURS + 1))[
                LASTING_NEIGHBOURS : LASTING_NEIGHBOURS + row.size
            ]
            >= LASTING_COUNT
        )
        out[where, j] = row & crowd
    return out


def _beside(values: Array, valid: Array) -> Array:
    """Median of the nearest valid values of the same channel, the value itself left out; 0 with too few."""
    n = values.shape[0]
    padded = np.full((n + 2 * NEIGHBOURS, values.shape[1]), np.nan)
    padded[NEIGHBOURS : NEIGHBOURS + n] = np.where(valid, values, np.nan)
    shifts = [padded[NEIGHBOURS + k : NEIGHBOURS + k + n] for k in range(-NEIGHBOURS, NEIGHBOURS + 1) if k]
    stacked = np.sort(np.stack(shifts), axis=0)  # NaN last
    count = np.isfinite(stacked).sum(axis=0)
    middle = np.maximum(count - 1, 0) // 2
    low = np.take_along_axis(stacked, middle[None], axis=0)[0]
    high = np.take_along_axis(stacked, np.minimum(count // 2, 2 * NEIGHBOURS - 1)[None], axis=0)[0]
    return np.where(count >= 3, 0.5 * (low + high), 0.0)
