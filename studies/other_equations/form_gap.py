"""What a tuned nominal simulator misses on clean runs of a vehicle with other equations.

Takes: a campaign and its runs. Gives the sum of squares over noise in pieces of ten lengths, every start
fitted, on the commands of the campaign without its causes, sea and noise; and rms by channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bayesid.benchmark.other_equations import Campaign, Executed, replayed
from bayesid.benchmark.other_equations.bundles import write_bundle
from bayesid.benchmark.other_equations.evidence import fitted_start, piece_seconds
from bayesid.equations.model import Model, build_model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem, measured_base, output_error_run
from bayesid.estimation.segments import in_pieces
from bayesid.model.params import ParameterSet
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial, load_trial

Array = np.ndarray


def form_gap(campaign: Campaign, runs: Sequence[Executed], vehicle: str) -> dict[str, float]:
    """Form gap of a nominal simulator on the runs to identify from.

    Parameters
    ----------
    vehicle : text of its vehicle file

    Returns
    -------
    chi2 : sum of squares over noise; count : readings; rms_<channel> : SI
    """
    shown = []
    for run in runs:
        if run.plan.role == "identify":
            clean = replayed(campaign, run, causes=False)
            shown.append(replace(clean, logged=np.where(np.isfinite(run.logged), clean.clean, np.nan)))
    with TemporaryDirectory() as place:
        bundle = Path(place) / "clean"
        only = replace(campaign, runs=tuple(run.plan for run in shown))
        write_bundle(only, shown, vehicle, bundle)
        trial = in_pieces(load_trial(bundle), piece_seconds(campaign.vehicle))
        model = build_model(load_vehicle(bundle / "vehicle.toml"), 3)
    sigma = campaign.sigma
    misfits = [_misfit(model, trial, run, sigma) for run in trial.runs]
    squares = np.concatenate(misfits)
    out: dict[str, Any] = {"chi2": float(np.sum(squares)), "count": int(squares.size)}
    for k, (name, sd) in enumerate(sigma.items()):
        out[f"rms_{name}"] = float(sd * np.sqrt(np.mean(squares[:, k])))
    return out


def _misfit(model: Model, trial: Trial, run: Run, sigma: dict[str, float]) -> Array:
    """(n, c) squares over noise of one piece with its start fitted."""
    data = output_error_run(model, run, sigma, tuple(sigma), True, trial.measured_point)
    alone = FitProblem(model, ParameterSet(()), (data,), measured_base(model, trial))
    sd, start, last = np.asarray(data.sigma), np.array(alone.start), [np.empty(0)]

    def simulated(change: Array) -> Array:
        try:
            last[0] = data.residuals(alone.readings(start + change)[0])
        except ModelError:  # a step too far: the search halves it
            return np.full(data.readings.shape, np.inf)
        return np.asarray(last[0])

    at = fitted_start(simulated, np.zeros(data.readings.shape), np.array(alone.scale))
    assert sd.shape == (len(sigma),)
    return simulated(at) ** 2
