"""Orders that hold until the next one, over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.trials.trial import Floats, Run

SAME = 1e-6  # of the shortest row: times so near to each other are one


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
    near = SAME * float(np.diff(run.t).min())
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
    return replace(run, t=t, **groups)


def _switches(values: Floats) -> np.ndarray:
    """Rows at which an order differs from that of the row before; what is unknown stays so."""
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    return 1 + np.flatnonzero(~same)
