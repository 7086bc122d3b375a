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


def in_pieces(trial: Trial, seconds: float) -> Trial:
    """The trial with every run to identify cut into equal pieces of about that length.

    Every piece has an initial state of its own, so errors of the model cannot add up over a long run: an
    unstable vehicle amplifies them until they hide what the run says. Runs kept for judging stay whole.
    """
    runs: list[Run] = []
    for run in trial.runs:
        count = max(1, round(run.duration / seconds)) if run.role == "identify" else 1
        edges = np.linspace(run.t[0], run.t[-1], count + 1)
        slack = 1e-9 * max(run.duration, 1.0)
        for k, (a, b) in enumerate(zip(edges, edges[1:], strict=False)):
            piece = replace(window(run, a - slack, b + slack), name=f"{run.name} {k + 1}/{count}")
            runs.append(run if count == 1 else piece)
    return replace(trial, runs=tuple(runs))


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
