"""Coefficients that a fit holds as given, as unknowns within what was known of them.

Takes a `FitProblem`. Gives the problem with them free. Does not search.

What they are off by looks like a force the equations lack, or goes into the coefficients that are free
(Furlong et al. 2003: 1 % in those that were held sent five estimates to their bounds).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.parameters import DEFAULT_RELATIVE_SD, joint_prior, unit_size
from bayesid.model.params import Parameter, ParameterSet, Prior

SURE = 2.0  # sd from which a coefficient has moved
OFF = 1e-9  # prior sd of one that stays as given, over its own: held, in the same unknowns


@dataclass(frozen=True)
class HeldCheck:
    """Whether coefficients that a fit holds explain errors of its runs.

    Attributes
    ----------
    evidence : log evidence that they gain, free within what was known of them
    moves : coefficient -> how far the runs move it from the value held, and the sd of that [SI]; those beyond
        `SURE` sd, the surest first
    """

    evidence: float
    moves: Mapping[str, tuple[float, float]]


def held_coefficients(problem: FitProblem) -> dict[str, float]:
    """Coefficients of the vehicle that a problem neither frees nor ties, and the sd of their prior [SI]: that
    of the vehicle file, else `DEFAULT_RELATIVE_SD` of the value, of one that is zero the unit of its row. One
    told to be exact stays."""
    model, given = problem.model, {p.name for p in problem.params if p.role != "fixed"}
    found = {}
    for name in model.coefficients:
        if name in given:
            continue
        sd = model.prior_sd(name)
        value = abs(_value(problem, name))
        if math.isnan(sd) or (sd == 0 and value == 0):  # a share of nothing says nothing
            sd = DEFAULT_RELATIVE_SD * value or unit_size(model, name)
        if 0 < sd < math.inf:
            found[name] = float(sd)
    return found


def with_held(problem: FitProblem, on: bool = True) -> FitProblem:
    """The problem with the coefficients it holds as unknowns behind its own; `on` free within their prior,
    else as given. One that it has as fixed becomes free."""
    held = held_coefficients(problem)
    if not held:
        return problem
    added = [
        Parameter(
            name, _value(problem, name), scale=sd, file_scale=problem.model.file_scale(name),
            prior=Prior("normal", _value(problem, name), sd if on else OFF * sd),
        )
        for name, sd in held.items()
    ]  # fmt: skip
    kept = tuple(p for p in problem.params if p.name not in held)
    joint = problem.params.joint
    known = (*(joint.names if joint is not None else ()), *held)
    if on and (together := joint_prior(problem.model, known)) is not None:
        joint = together
        added = [Parameter(**{**vars(p), "prior": None}) if p.name in joint.names else p for p in added]
    return problem.with_params(ParameterSet((*kept, *added), joint))


def _value(problem: FitProblem, name: str) -> float:
    own = {p.name: p.start for p in problem.params}
    return own.get(name, float(problem.base[problem.model.index[name]]))


def surely_moved(
    problem: FitProblem, held: Iterable[str], mean: np.ndarray, covariance: np.ndarray
) -> dict[str, tuple[float, float]]:
    """Of the coefficients held those that move beyond `SURE` sd: change and its sd [SI], the surest first.

    Parameters
    ----------
    mean, covariance : (k,), (k, k) of all free parameters about where they were linearised, in units of their
        scale
    """
    scale = problem.scale
    sd = np.sqrt(np.diag(covariance))
    found = {
        name: (float(scale[i] * mean[i]), float(scale[i] * sd[i]))
        for i, name in enumerate(problem.params.names)
        if name in held and abs(mean[i]) > SURE * sd[i]
    }
    return dict(sorted(found.items(), key=lambda one: -abs(one[1][0] / one[1][1])))
