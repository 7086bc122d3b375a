"""Where a search over whole runs begins when the given coefficients are far off: at a filter-error estimate.

Takes a `FitProblem` and its runs as logged. Gives its unknowns, or none. Does not search or judge.

Whole runs amplify errors of the coefficients, so that a search from the given ones meets one kink after the
other. Along a path that is smoothed from the readings nothing is amplified (multiple shooting; Bock 1983,
Ljung 1999, 8.5): a REMUS 100 with coefficients 12 % off arrives in 3 s, and 50 iterates over whole runs
from there end its fit, where 275 from the given ones did not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import Trajectory, first_trajectory
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit
from bayesid.estimation.filter_error.read_run import LONGER_STEPS, filter_error_run
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import RunData
from bayesid.trials import Run

Array = np.ndarray
# Prior sd over the size of a parameter for which none is stated: what the runs do not tell stays near its
# value.
UNSTATED_SD = 0.3
# Disturbance allowed along the path, over 1/2 rho L^2 U^2: it takes what the equations lack.
DISTURBANCE = 1e-5
# The same of the first pass, along the readings' own path.
USUAL_LEVEL = 0.03
# Least distance to a bound over the width between both.
INSIDE = 1e-6


def smoothed_start(problem: FitProblem, runs: Sequence[Run]) -> Array | None:
    """Unknowns of a problem at a filter-error estimate with a small disturbance, or with none at all where
    the runs are simulated better from there; None where no estimate arrives, or parameters are tied.

    Parameters
    ----------
    runs : those of the problem, as logged
    """
    model, params = problem.model, problem.params
    if any(p.role == "tied" for p in params) or not params.names:
        return None
    scale = UNSTATED_SD * params.vector("scale")
    sd = np.where(np.isfinite(params.prior_sd), params.prior_sd, scale)
    free = GaussianPrior(params.names, model.positions(params.names), params.start, sd, params.vector("low"))
    logs, points = along_readings(problem, runs)
    calm, noisy = no_process_noise(model), small_disturbance(model)
    found = []
    for noise_model, first_level in ((noisy, USUAL_LEVEL), (calm, DISTURBANCE)):
        try:
            made = fit(model, logs, free, noise_model, points, first_level)
        except (ModelError, np.linalg.LinAlgError):
            break
        if not made.converged:
            break
        points = list(made.points)
        found.append(_unknowns(problem, made))
    return min(found, key=problem.cost, default=None)


def along_readings(problem: FitProblem, runs: Sequence[Run]) -> tuple[list[RunData], list[Trajectory]]:
    """Runs of a problem as a filter reads them, and their own paths with the parameters at their start."""
    model, params = problem.model, problem.params
    base = params.place(problem.base, model.index, params.start)
    logs = []
    for run, data in zip(runs, problem.runs, strict=True):
        sigma = dict(zip(data.channels, (float(s) for s in data.sigma), strict=True))
        logs.append(filter_error_run(model, run, sigma, data.channels, LONGER_STEPS))
    return logs, [first_trajectory(model, log, base) for log in logs]


def small_disturbance(model: Model) -> NoiseModel:
    """Process noise of `DISTURBANCE` in every axis."""
    return replace(no_process_noise(model), force=tuple(float(f) for f in DISTURBANCE * force_unit(model)))


def first_states(problem: FitProblem, points: Sequence[Trajectory]) -> list[Array]:
    """Initial states of the problem's runs on paths."""
    states = problem.model.kernel.full.states
    return [
        point.states[0, [states.index(s) for s in data.initial]]
        for data, point in zip(problem.runs, points, strict=True)
    ]


def _unknowns(problem: FitProblem, made: FilterErrorFit) -> Array:
    """Parameters, within their bounds, and the first states of every run."""
    low, high = (problem.params.vector(end) for end in ("low", "high"))
    margin = INSIDE * np.where(np.isfinite(high - low), high - low, 0.0)
    starts = first_states(problem, made.points)
    return np.concatenate([np.clip(made.values, low + margin, high - margin), *starts])
