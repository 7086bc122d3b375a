"""Readings denser than the motion needs, averaged before a long log is fitted or diagnosed.

Takes a `Trial` and the size of its vehicle. Gives a `Trial` with fewer readings of less noise, or the same.
Does not: touch commands, which switch when they did, nor logs that are short enough as they are.

The readings of a block are replaced by the line through them at its middle: exact for motion without bend,
whatever the stamps. A bend adds a 24th of the second difference of neighbouring averages; it is taken off,
the difference being that of averages two blocks away, which hardly adds noise (0.03 of that of an average).
Blocks are halved until what is taken off is small beside the noise, so that what is left does not count.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.trials.kinematics.derived_velocity import velocity_from_track
from bayesid.trials.trial import Floats, Run, Trial

LONGEST_BLOCK = 0.05  # L/U
MOST_BEND = 0.3  # what a bend adds to an average, rms, over its noise, before it is taken off
AWAY = 2  # blocks
WORTH = 0.75  # most samples left, of those there were: every change of an order keeps one
FULL = 0.75  # share of the usual readings a block must hold
SAME_RATE = 0.2  # relative difference of the readings per block between runs that share a noise


def averaged(trial: Trial, time_scale: float, most: int) -> Trial:
    """The trial with readings averaged where its runs to identify hold more than `most` samples.

    Parameters
    ----------
    time_scale : L/U [s]
    most : samples of all runs to identify that are taken as they are

    Returns
    -------
    Trial; the same one where it is short enough, where readings are too far apart to average, where orders
    change so often that no fewer samples are left, where runs are logged at different rates (one noise holds
    for all), or where noise is not stated (averages would be weighed by what fast changes of theirs show)
    """
    runs = trial.identify
    samples = sum(run.n_samples for run in runs)
    if samples <= most or not trial.noise:
        return trial
    spacing = float(np.median(np.concatenate([np.diff(run.t) for run in runs])))
    count = int(LONGEST_BLOCK * time_scale / spacing)
    while count >= 2:
        done = _averaged(trial, count * spacing, count)
        if done is None:
            return trial
        out, bend = done
        if sum(run.n_samples for run in out.identify) > WORTH * samples:
            return trial
        if bend <= MOST_BEND:
            words = (
                f"{samples} readings {spacing:.3g} s apart are averaged over {count * spacing:.3g} s "
                f"({count * spacing / time_scale:.2g} L/U), commands as logged; what the motion bends "
                f"within an average, {bend:.1g} of its noise, is taken off (--resample takes single readings)"
            )
            derived = velocity_from_track(runs)
            known = trial.velocity_from_track if trial.velocity_from_track is not None else derived
            return replace(out, velocity_from_track=known, warnings=(*trial.warnings, words))
        count //= 2
    return trial


def _averaged(trial: Trial, width: float, count: int) -> tuple[Trial, float] | None:
    """Runs averaged over blocks of `width` [s], and the largest bend over noise; None: at different rates."""
    runs, factors = [], []
    for run in trial.runs:
        out, held = _run(run, width, count)
        runs.append(out)
        factors.append(held)
    noise = dict(trial.noise)
    for name in noise:
        seen = [f[name] for f in factors if name in f]
        if seen and max(seen) > (1.0 + SAME_RATE) * min(seen):
            return None
        if seen:
            noise[name] /= np.sqrt(float(np.median(seen)))
    bends = [
        _bend(run, noise, f, width) for run, f in zip(runs, factors, strict=True) if run.role == "identify"
    ]
    return replace(trial, runs=tuple(runs), noise=noise), max(bends, default=0.0)


def _run(run: Run, width: float, count: int) -> tuple[Run, dict[str, float]]:
    """One run averaged, and channel -> readings per block; 1 for a channel that keeps its own readings."""
    spacing = width / count
    t = run.t - run.t[0]
    # whole blocks, the first reading at the beginning of the first
    block = np.floor((t + 0.5 * spacing) / width + 1e-9).astype(np.int64)
    blocks = int(block[-1]) + 1
    middle = np.asarray((np.arange(blocks) + 0.5) * width - 0.5 * spacing, dtype=np.float64)
    means, own, held = {}, np.zeros(t.size, dtype=bool), {}
    for name, values in run.data.items():
        mean, usual = _lines(t, values, block, middle, blocks)
        held[name] = 1.0 if usual < 2 else usual
        if usual < 2:
            own |= np.isfinite(values)
        else:
            means[name] = _unbent(mean)
    switches = np.zeros(t.size, dtype=bool)
    for values in run.commands.values():
        switches[1:] |= (np.diff(values) != 0) & np.isfinite(values[1:])
    kept = middle[middle <= t[-1]]
    extra = t[(switches | own) & (t > kept[0]) & (t < kept[-1])]
    near = np.clip(np.rint((extra - kept[0]) / width).astype(int), 0, kept.size - 1)
    extra = extra[np.abs(extra - kept[near]) > 1e-6 * width]
    grid = np.sort(np.concatenate([kept, extra]))
    at = np.searchsorted(grid, kept)
    data = {}
    for name, values in run.data.items():
        data[name] = np.full(grid.size, np.nan)
        if name in means:
            data[name][at] = means[name][: kept.size]
        else:
            here = np.clip(np.searchsorted(t, grid - 1e-6 * width), 0, t.size - 1)
            same = np.abs(t[here] - grid) <= 1e-6 * width
            data[name][same] = values[here[same]]
    row = np.clip(np.searchsorted(t, grid + 1e-6 * spacing, side="right") - 1, 0, t.size - 1)
    groups: dict[str, Any] = {"data": data, "commands": {n: v[row] for n, v in run.commands.items()}}
    for group in ("measured_inputs", "exogenous", "propulsion", "extra"):
        groups[group] = {
            name: _filled(_lines(t, v, block, middle, blocks)[0][: kept.size], kept, grid, t, v)
            for name, v in getattr(run, group).items()
        }
    note = f"averaged over {width:g} s from {run.digest[:12]}"
    began = float(run.t[0]) if run.began is None else run.began  # half a block before its first average
    return replace(run, t=run.t[0] + grid, began=began, provenance=(*run.provenance, note), **groups), held


def _lines(t: Floats, values: Floats, block: np.ndarray, middle: Floats, n: int) -> tuple[Floats, float]:
    """(n,) the line through the readings of each block at its middle, NaN where few; how many are usual."""
    good = np.isfinite(values)
    where = block[good]
    size = np.bincount(where, minlength=n).astype(float)
    usual = float(np.median(size[size > 0])) if good.any() else 0.0
    # about the block's own middle and first reading: positions far from the origin keep their digits
    origin = np.zeros(n)
    origin[where[::-1]] = values[good][::-1]
    off, x = t[good] - middle[where], values[good] - origin[where]
    sums = [np.bincount(where, weights=w, minlength=n) for w in (off, x, off * off, off * x)]
    enough = size >= max(2.0, FULL * usual)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_t, mean_x, tt, tx = (s / size for s in sums)
        slope = (tx - mean_t * mean_x) / (tt - mean_t**2)
        out = origin + mean_x - slope * mean_t
    return np.where(enough, out, np.nan), usual


def _unbent(means: Floats) -> Floats:
    """Averages without what the bend of the motion adds to them; the first and last as they are."""
    out = means.copy()
    second = (means[2 * AWAY :] - 2.0 * means[AWAY:-AWAY] + means[: -2 * AWAY]) / AWAY**2
    out[AWAY:-AWAY] -= np.where(np.isfinite(second), second, 0.0) / 24.0
    return out


def _filled(means: Floats, kept: Floats, grid: Floats, t: Floats, values: Floats) -> Floats:
    """An input at the times of `grid`: averages, linear in between; its own readings where it has few."""
    good = np.isfinite(means)
    if not good.any():
        fine = np.isfinite(values)
        return np.interp(grid, t[fine], values[fine]) if fine.any() else np.full(grid.size, np.nan)
    return np.interp(grid, kept[good], means[good])


def _bend(run: Run, noise: Mapping[str, float], held: Mapping[str, float], width: float) -> float:
    """The most a bend adds to the averages of a channel, rms, over their noise."""
    out = 0.0
    for name, values in run.data.items():
        good = np.isfinite(values)
        if name not in noise or held.get(name, 1.0) < 2 or good.sum() < 3:
            continue
        x, t = values[good], run.t[good]
        near = np.abs(t[2:] - t[:-2] - 2.0 * width) < 0.1 * width
        second = (x[2:] - 2.0 * x[1:-1] + x[:-2])[near]
        if second.size:
            excess = float(np.mean(second**2)) - 6.0 * noise[name] ** 2
            out = max(out, np.sqrt(max(excess, 0.0)) / (24.0 * noise[name]))
    return float(out)
