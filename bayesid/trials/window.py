"""Parts of a run and runs on another time base, with a note of where they came from.

Takes a `Run`, returns a new `Run`.
Does not: smooth; samples are cut, or interpolated between neighbours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.errors import TrialError
from bayesid.trials.trial import Floats, Run

MAX_SAMPLES = 50_000_000
BESIDE = 0.05  # of dt: a reading so near a sample is that of the sample, moved by a line to its neighbour


def window(run: Run, t0: float, t1: float) -> Run:
    """Samples with t0 <= t <= t1, seconds of the log: a part of the run, which began when the run did.

    A command given before t0 is held into the window by its first sample, as everywhere.

    Raises
    ------
    TrialError                 fewer than two samples in the window
    """
    keep = (run.t >= t0) & (run.t <= t1)
    if keep.sum() < 2:
        raise TrialError(
            f"{run.name}: window {t0:g} to {t1:g} s holds {int(keep.sum())} samples; "
            f"the log runs from {run.t[0]:g} to {run.t[-1]:g} s"
        )
    groups: dict[str, Any] = {g: {name: v[keep] for name, v in getattr(run, g).items()} for g in Run.GROUPS}
    note = f"window {t0:g} to {t1:g} s of {run.digest[:12]}"
    began = float(run.t[0]) if run.began is None else run.began
    return replace(run, t=run.t[keep], provenance=run.provenance + (note,), began=began, **groups)


def resample(run: Run, dt: float, max_gap: float | None = None) -> Run:
    """The run at regular times t[0], t[0] + dt, ... up to the last sample.

    Commands are held (zero-order); everything else is interpolated linearly between its own finite samples.
    Data farther than `max_gap` apart stay NaN in between (default: five times the median time between the
    readings of that channel, or 1.5 dt: a position at 1 Hz beside rates at 20 Hz has no gap).

    Raises
    ------
    TrialError                 dt is not positive, or longer than the run
    """
    if not 0.0 < dt <= run.duration:
        raise TrialError(f"{run.name}: dt = {dt:g} s; it must be positive and at most {run.duration:g} s")
    if run.duration / dt > MAX_SAMPLES:
        raise TrialError(f"{run.name}: dt = {dt:g} s would give {run.duration / dt:.3g} samples")
    t = run.t[0] + dt * np.arange(int(np.floor(run.duration / dt * (1 + 1e-12))) + 1)
    return _at(run, t, dt, max_gap, f"resampled to {dt:g} s from {run.digest[:12]}")


def thin(run: Run, dt: float) -> Run:
    """As `resample`, for fits: readings every dt, but commands still switch when they did.

    The samples at switches in between hold no readings. A channel that is not read more often than every dt
    keeps its readings, at their own times where these are not those of a sample: what is interpolated between
    two readings is nothing that was read. Held from one coarse sample to the next, a rudder order comes up to
    dt late: a 20/20 zig-zag at 4 instead of 2 s then gave N_v 5.7 times too large at 5.9 times the noise,
    thinned 2 % too large at 0.99.

    Raises
    ------
    TrialError                 as `resample`
    """
    coarse = resample(run, dt)
    switches = np.zeros(run.n_samples, dtype=bool)
    for values in run.commands.values():
        switches[1:] |= (np.diff(values) != 0) & np.isfinite(values[1:])
    seldom = {name: read for name, v in run.data.items() if (read := _seldom(run.t, v, dt)) is not None}
    switched = run.t[switches & (run.t < coarse.t[-1])]
    own = np.unique(np.concatenate([switched, *(t[_off(coarse.t, t, dt)] for t in seldom.values())]))
    t = np.sort(np.concatenate([coarse.t, own[_off(coarse.t, own, dt, 1e-6)]]))
    out = _at(run, t, dt, np.inf, coarse.provenance[-1])
    data = {name: np.full(t.shape, np.nan) for name in out.data}
    for name, values in data.items():
        if name in seldom:
            at = np.unique(_nearest(t, seldom[name]))
            values[at] = out.data[name][at]
        else:
            read = np.unique(_nearest(coarse.t, run.t[np.isfinite(run.data[name])]))
            values[np.searchsorted(t, coarse.t[read])] = coarse.data[name][read]
    return replace(out, data=data)


def _seldom(t: Floats, values: Floats, dt: float) -> Floats | None:
    """Times at which a channel was read, where these are usually no less than dt apart; else None."""
    read = t[np.isfinite(values)]
    often = read.size > 1 and float(np.median(np.diff(read))) < (1.0 - BESIDE) * dt
    return None if often else read


def _off(samples: Floats, t: Floats, dt: float, beside: float = BESIDE) -> np.ndarray:
    """Which of some times are farther than a share of dt from every sample."""
    return np.abs(samples[_nearest(samples, t)] - t) > beside * dt


def _nearest(samples: Floats, t: Floats) -> np.ndarray:
    """Samples nearest to some times."""
    return np.searchsorted(0.5 * (samples[1:] + samples[:-1]), t)


def _at(run: Run, t: Floats, dt: float, max_gap: float | None, note: str) -> Run:
    """Commands held and everything else interpolated at the times t."""
    held = np.searchsorted(run.t, t + 1e-9 * dt, side="right") - 1
    groups: dict[str, Any] = {}
    for group in Run.GROUPS:
        series = getattr(run, group)
        if group == "commands":
            groups[group] = {name: values[held] for name, values in series.items()}
        else:
            gap = max_gap if group in ("data", "propulsion", "extra") else np.inf
            groups[group] = {name: _linear(run.t, values, t, dt, gap) for name, values in series.items()}
    return replace(run, t=t, provenance=run.provenance + (note,), **groups)


def _linear(t: Floats, values: Floats, at: Floats, dt: float, max_gap: float | None) -> Floats:
    good = np.isfinite(values)
    if not good.any():
        return np.full(at.shape, np.nan)
    knots, edge = t[good], 1e-9 * (t[-1] - t[0])
    if max_gap is None:
        max_gap = max(5.0 * float(np.median(np.diff(knots))) if knots.size > 1 else 0.0, 1.5 * dt)
    out = np.interp(at, knots, values[good])
    right = np.clip(np.searchsorted(knots, at), 0, knots.size - 1)
    left = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, knots.size - 1)
    out[(knots[right] - knots[left] > max_gap) | (at < knots[0] - edge) | (at > knots[-1] + edge)] = np.nan
    return out
