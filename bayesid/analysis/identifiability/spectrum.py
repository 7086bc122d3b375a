"""What a manoeuvre can tell about coefficients, before anything is fitted.

Takes a `Model`, parameters, a plan and names. Gives sensitivities per relative change, singular values and
named flat directions. Does not fit, and knows neither priors nor noise beyond one sigma per channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.output_error import Direction, flat_directions, rank, singular_values
from bayesid.simulation import TimePlan, sensitivities

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Sensitivity of a run to relative changes of coefficients.

    Attributes
    ----------
    names : (k,)
    norms : (k,) root sum of squares of each column, in units of sigma
    values : (k,) singular values, falling
    flat : named directions below the level asked for
    rank : number of singular values above rounding
    """

    names: tuple[str, ...]
    norms: Array
    values: Array
    flat: tuple[Direction, ...]
    rank: int


def sensitivity_columns(
    model: Model, par: Array, plan: TimePlan, x0: Array, names: Sequence[str], channels: Sequence[str]
) -> Array:
    """(n, c, k) change of each state listed for a relative change of one of each coefficient."""
    where = model.positions(names)
    result = sensitivities(model, par, plan, x0, where, initial=False)
    picked = [model.states.index(c) for c in channels]
    return result.jacobian[:, picked] * np.asarray(par)[where]


def spectrum(
    model: Model,
    par: Array,
    runs: Sequence[tuple[TimePlan, Array]],
    names: Sequence[str],
    channels: Sequence[str] = ("x", "y", "psi"),
    sigma: Sequence[float] | None = None,
    level: float = 0.5,
) -> Spectrum:
    """Singular values of the stacked sensitivities of several runs.

    Parameters
    ----------
    runs : plan and initial state of each
    sigma : noise per channel [SI], 1 by default
    level : relative sd beyond which a direction counts as flat
    """
    weight = np.ones(len(channels)) if sigma is None else np.asarray(sigma, dtype=float)
    blocks = [
        (sensitivity_columns(model, par, plan, x0, names, channels) / weight[:, None]).reshape(-1, len(names))
        for plan, x0 in runs
    ]
    jac = np.vstack(blocks)
    values, _ = singular_values(jac)
    flat = flat_directions(names, jac, level)
    return Spectrum(tuple(names), np.linalg.norm(jac, axis=0), values, flat, rank(values))
