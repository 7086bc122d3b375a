"""From a vehicle and its logs to an output-error problem.

Takes a `Model`, a trial and choices. Gives a `FitProblem`. Does not fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.read_run import output_error_run
from bayesid.estimation.parameters import coefficient_set
from bayesid.estimation.run_data import RunData
from bayesid.model.params import ParameterSet
from bayesid.simulation import TimePlan

Array = np.ndarray


def trial_problem(
    model: Model,
    trial: Any,
    params: ParameterSet | None = None,
    *,
    runs: Iterable[Any] | None = None,
    channels: Sequence[str] | None = None,
    sigma: Mapping[str, float] | None = None,
    initial: bool = True,
    threads: int = 2,
) -> FitProblem:
    """The runs of a trial a fit may read, weighted by their noise.

    Parameters
    ----------
    params : by default every coefficient with the prior of the vehicle file
    runs : by default `trial.identify`
    sigma : channel -> noise [SI]; by default the trial's, else what each series shows

    Raises
    ------
    FitError
        no run to fit
    """
    chosen = tuple(trial.identify if runs is None else runs)
    if not chosen:
        raise FitError(f'trial {trial.name!r} has no run with role "identify"; mark one in trial.toml')
    noise = {**trial.noise, **(sigma or {})}
    data = tuple(
        output_error_run(model, run, noise, channels, initial, trial.measured_point) for run in chosen
    )
    return FitProblem(model, params or coefficient_set(model), data, measured_base(model, trial), threads)


def measured_base(model: Model, trial: Any) -> Array:
    """Nominal parameters with the trial's measured point."""
    point = dict(zip(("point_x", "point_y", "point_z"), trial.measured_point, strict=True))
    return model.with_values({n: float(v) for n, v in point.items() if n in model.index})


def unweighted(
    model: Model,
    params: ParameterSet,
    runs: Iterable[tuple[str, TimePlan, Array]],
    x0: Array,
    channels: Sequence[str] | None = None,
    threads: int = 1,
) -> FitProblem:
    """The paper's objective: unit noise on positions and angles, known initial state, no prior.

    Twice the cost is V(p) of Furlong et al. (2003) [m^2, rad^2].

    Parameters
    ----------
    runs : name, plan and the target's (n, nx) states
    channels : by default the pose
    """
    pose = tuple(channels or (s for s in model.states if s in ("x", "y", "z", "phi", "theta", "psi")))
    where = [model.states.index(c) for c in pose]
    data = tuple(
        RunData(name, plan, pose, np.array(states[:, where]), np.ones(len(pose)), np.asarray(x0, dtype=float))
        for name, plan, states in runs
    )
    return FitProblem(model, params, data, np.array(model.nominal), threads)
