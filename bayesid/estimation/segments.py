"""Fit long runs in short pieces, judge the result on whole ones.

Takes a trial. Gives trials whose runs to identify are cut, and a fit judged on the uncut trial.
Does not overlap pieces or tie their ends together.
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.estimation.trial_fit import TrialFit, fit_trial, outcomes
from bayesid.model.vehicles import Vehicle
from bayesid.trials import Run, Trial, window

# How far a cut may move, in pieces.
REACH = 0.2


def in_pieces(trial: Trial, seconds: float) -> Trial:
    """The trial with every run to identify cut into equal pieces of about that length.

    Every piece has an initial state of its own, so errors of the model cannot add up over a long run: an
    unstable vehicle amplifies them until they hide what the run says. Runs kept for judging stay whole.
    Where the rudder is known as ordered only, cuts move by up to `REACH` of a piece to where it has been held
    longest: a piece begins with the rudder where the order is, and one cut at an order, or while the rudder
    followed it, took N_dr of a clean campaign 0.9 sd off.
    """
    runs: list[Run] = []
    for run in trial.runs:
        count = max(1, round(run.duration / seconds)) if run.role == "identify" else 1
        edges = _settled(run, np.linspace(run.t[0], run.t[-1], count + 1))
        slack = 1e-9 * max(run.duration, 1.0)
        for k, (a, b) in enumerate(zip(edges, edges[1:], strict=False)):
            piece = replace(window(run, a - slack, b + slack), name=f"{run.name} {k + 1}/{count}")
            runs.append(run if count == 1 else piece)
    return replace(trial, runs=tuple(runs))


def _settled(run: Run, edges: np.ndarray) -> np.ndarray:
    """Cuts moved to samples at which the orders nobody measured the answer of have been held longest."""
    changed, held = _orders(run)
    reach, out = REACH * (edges[1] - edges[0]), np.array(edges)
    for i, edge in enumerate(edges[1:-1], start=1):
        near = np.flatnonzero(np.abs(run.t - edge) <= reach)
        if near.size and changed[near].any():
            best = near[held[near] >= held[near].max() - 1e-9]
            out[i] = run.t[best[np.argmin(np.abs(run.t[best] - edge))]]
    return out


def held_since(run: Run) -> np.ndarray:
    """(n,) time [s] since an order last changed whose answer nobody measured."""
    return _orders(run)[1]


def _orders(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """At which samples such an order changes, and the time since."""
    ordered = [v for c, v in run.commands.items() if c.removesuffix("_cmd") not in run.measured_inputs]
    changed = np.zeros(run.t.size, dtype=bool)
    for values in ordered:
        changed[1:] |= values[1:] != values[:-1]
    last = np.maximum.accumulate(np.where(changed, np.arange(run.t.size), 0))
    return changed, run.t - run.t[last]


def fit_in_pieces(
    trial: Trial,
    seconds: float | None,
    vehicle: Vehicle | None = None,
    out: str | os.PathLike[str] | None = None,
    **choices: Any,
) -> TrialFit:
    """`fit_trial` on pieces of that many seconds; its runs are those of the whole trial, simulated in one go.

    Parameters
    ----------
    seconds : length of a piece; None fits whole runs
    choices : as in `fit_trial`

    Raises
    ------
    FitError, ModelError, VehicleError
        as `fit_trial`
    """
    if seconds is None:
        return fit_trial(trial, vehicle, out, **choices)
    cut = in_pieces(trial, seconds)
    found = fit_trial(replace(cut, runs=cut.identify), vehicle, out, **choices)
    return replace(found, trial=trial, runs=outcomes(found.problem, trial, found.fit))
