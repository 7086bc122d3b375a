"""From a vehicle and its logs to a problem: which coefficients are free, how far they may go, what was known.

Takes a `Model`, a trial and choices. Gives a `ParameterSet` or a `FitProblem`. Does not fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.run_data import RunData, run_data
from bayesid.model.params import JointPrior, Parameter, ParameterSet, Prior
from bayesid.model.terms import TERMS, term
from bayesid.simulation import TimePlan

Array = np.ndarray
WIDE = 5.0  # half width of the default bounds in prior standard deviations, or in sizes of the coefficient


def coefficient_set(
    model: Model,
    free: Iterable[str] | None = None,
    *,
    relative_bounds: float | None = None,
    use_prior: bool = True,
    ties: Mapping[str, tuple[str, float, float]] | None = None,
) -> ParameterSet:
    """Coefficients as unknowns, starting at the vehicle's values.

    Parameters
    ----------
    free : names; by default every coefficient of the file this model reads
    relative_bounds : half width of the bounds over |value|; by default 5 prior sd or 5 |value|, whichever is
        more
    use_prior : normal prior from the vehicle file where it states one
    ties : name -> (free name, factor, offset)

    Raises
    ------
    FitError
        a name the model does not have
    """
    names = tuple(free) if free is not None else model.coefficients
    unknown = [n for n in names if n not in model.index]
    if unknown:
        raise FitError(
            f"model of {model.vehicle.name!r} ({model.dof}-DOF) has no parameter {', '.join(unknown)}; "
            "see `bayesid vehicle show` for its coefficients"
        )
    entries = []
    for name in names:
        value = float(model.nominal[model.index[name]])
        sd = model.prior_sd(name)
        scale = abs(value) or _unit_size(model, name)
        half = (
            relative_bounds * scale if relative_bounds else WIDE * max(scale, 0.0 if math.isnan(sd) else sd)
        )
        prior = Prior("normal", value, sd) if use_prior and sd > 0 and math.isfinite(sd) else None
        entries.append(
            Parameter(
                name,
                value,
                "free",
                value - half,
                value + half,
                scale,
                prior,
                file_scale=model.file_scale(name),
            )
        )
    for name, tie in (ties or {}).items():
        start = tie[2] + tie[1] * float(model.nominal[model.positions([tie[0]])[0]])
        entries.append(Parameter(name, start, "tied", tie=tie, file_scale=model.file_scale(name)))
    joint = _joint(model, names) if use_prior else None
    if joint is not None:
        entries = [Parameter(**{**vars(p), "prior": None}) if p.name in joint.names else p for p in entries]
    return ParameterSet(tuple(entries), joint)


def _unit_size(model: Model, name: str) -> float:
    """Scale of a parameter that is zero: its prior sd, else 1e-3 of the prime unit at the reference speed."""
    sd = model.prior_sd(name)
    if sd > 0:
        return float(sd)
    if name in {t.name for t in TERMS}:
        row = term(name)
        s = model.scales
        return 1e-3 * 0.5 * s["rho"] * s["L"] ** row.length_power * s["U"] ** (2 - row.velocity_power)
    return 1.0


def _joint(model: Model, names: Sequence[str]) -> JointPrior | None:
    prior = model.vehicle.prior
    if prior is None or prior.covariance is None:
        return None
    kept = [i for i, n in enumerate(prior.names) if n in names]
    if not kept:
        return None
    picked = tuple(prior.names[i] for i in kept)
    scale = np.array([model.file_scale(n) for n in picked])
    covariance = prior.covariance[np.ix_(kept, kept)] * np.outer(scale, scale)
    return JointPrior(picked, model.nominal[model.positions(picked)], covariance)


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
    data = tuple(run_data(model, run, noise, channels, initial, trial.measured_point) for run in chosen)
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
