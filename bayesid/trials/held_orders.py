"""Orders that hold until the next one, over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.trials.trial import Floats, Run

ADDED = "samples without readings where orders switch between rows"
SAME = 1e-6  # of a usual row: times so near to each other are one


def integral_of_held(t: Floats, values: Floats, at: Floats) -> Floats:
    """Integral of an order over time from the first row to `at`, the first and last order held outside.

    Parameters
    ----------
    t, values : (n,) rows, finite
    at : (m,) times
    """
    total = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(t))])
    outside = values[0] * np.minimum(at - t[0], 0.0) + values[-1] * np.maximum(at - t[-1], 0.0)
    return np.asarray(np.interp(at, t, total) + outside)


def ordered_earlier(run: Run, delays: Mapping[str, float]) -> Run:
    """The run with some orders given earlier than logged, each held until the next as before.

    Where one then switches between two rows there is a row more, which holds no readings: an order that is
    held at its mean over a row instead sets off a rudder at the begin of that row, at the same rate.

    Parameters
    ----------
    delays : order -> seconds by which it was logged late
    """
    late = {name: delay for name, delay in delays.items() if name in run.commands and delay}
    if not late or run.n_samples < 2:
        return run
    near = max(SAME * float(np.median(np.diff(run.t))), 4.0 * float(np.spacing(np.abs(run.t).max())))
    new = np.concatenate([run.t[_switches(run.commands[n])] - delay for n, delay in late.items()])
    new = np.unique(new[(new > run.t[0] + near) & (new < run.t[-1] - near)])
    beside = np.clip(np.searchsorted(run.t, new), 1, run.n_samples - 1)
    new = new[np.minimum(new - run.t[beside - 1], run.t[beside] - new) > near]
    new = new[np.diff(new, prepend=-np.inf) > near]
    t = np.sort(np.concatenate([run.t, new]))
    own = np.searchsorted(t, run.t)

    def read(values: Floats) -> Floats:
        out = np.full(t.shape, np.nan)
        out[own] = values
        return out

    def known(values: Floats) -> Floats:
        out, good = read(values), np.isfinite(values)
        if good.any():
            added = np.setdiff1d(np.arange(t.size), own)
            out[added] = np.interp(t[added], run.t[good], values[good])
        return out

    def held(name: str, values: Floats) -> Floats:
        at = np.searchsorted(run.t, t + late.get(name, 0.0) + near, side="right") - 1
        return values[np.clip(at, 0, run.n_samples - 1)]

    groups: dict[str, Any] = {
        group: {name: read(v) for name, v in getattr(run, group).items()}
        for group in ("data", "propulsion", "extra")
    }
    groups |= {
        group: {name: known(v) for name, v in getattr(run, group).items()}
        for group in ("measured_inputs", "exogenous")
    }
    groups["commands"] = {name: held(name, v) for name, v in run.commands.items()}
    provenance = (*run.provenance, ADDED) if new.size else run.provenance
    return replace(run, t=t, provenance=provenance, **groups)


def at_readings(run: Run) -> Run:
    """The run without the samples that `ordered_earlier` added, orders at their means over what is left; the
    same one where it added none."""
    if ADDED not in run.provenance or not run.data:
        return run
    at = np.flatnonzero(np.any([np.isfinite(v) for v in run.data.values()], axis=0))
    if at.size < 2:
        return run
    t = run.t[at]
    groups: dict[str, Any] = {
        group: {name: v[at] for name, v in getattr(run, group).items()} for group in Run.GROUPS
    }
    end = np.append(t[1:], run.t[-1] if run.t[-1] > t[-1] else t[-1] + 1.0)
    for name, values in run.commands.items():
        mean = (integral_of_held(run.t, values, end) - integral_of_held(run.t, values, t)) / (end - t)
        first, last = at, np.searchsorted(run.t, end, side="left")
        changes = np.append(0, np.cumsum(np.diff(values) != 0.0))
        held = changes[np.maximum(last - 1, first)] == changes[first]  # to the last bit: no switch
        groups["commands"][name] = np.where(held | ~np.isfinite(mean), values[at], mean)
    provenance = tuple(text for text in run.provenance if text != ADDED)
    return replace(run, t=t, provenance=provenance, **groups)


def _switches(values: Floats) -> np.ndarray:
    """Rows at which an order differs from that of the row before; what is unknown stays so."""
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    return 1 + np.flatnonzero(~same)
