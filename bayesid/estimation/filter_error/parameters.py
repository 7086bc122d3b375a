"""Free parameters of a filter-error fit: coefficients of the vehicle, rows it lacks, effect parameters.

Takes a `Model` and names. Gives `FreeParameters` with the priors of the vehicle file and of the effect
declarations.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bayesid.equations.model import Model, eval_scale
from bayesid.estimation.filter_error.normal_equations import FreeParameters
from bayesid.model.effects import Effect

DEFAULT_RELATIVE_SD = 0.1


def coefficient_prior(
    model: Model, names: Iterable[str] | None = None, widen: dict[str, float] | None = None
) -> FreeParameters:
    """Coefficients free within the vehicle file's prior (10 % where it states none).

    Parameters
    ----------
    names : default all coefficients of the file that the model reads
    widen : coefficient -> factor on its prior standard deviation
    """
    chosen = tuple(names if names is not None else model.coefficients)
    where = model.positions(chosen)
    mean = model.nominal[where]
    sd = np.array([model.prior_sd(n) for n in chosen])
    sd = np.where(np.isfinite(sd) & (sd > 0), sd, DEFAULT_RELATIVE_SD * np.abs(mean))
    keep = sd > 0
    sd = sd * np.array([(widen or {}).get(n, 1.0) for n in chosen])
    chosen = tuple(n for n, k in zip(chosen, keep, strict=True) if k)
    return FreeParameters(chosen, where[keep], mean[keep], sd[keep], np.full(int(keep.sum()), -np.inf))


def effect_prior(model: Model, effect: Effect) -> FreeParameters:
    """Parameters of one effect free within its declared prior."""
    names = tuple(effect.key(p.name) for p in effect.parameters)
    return FreeParameters(
        names,
        model.positions(names),
        np.array([p.mean for p in effect.parameters]),
        np.array([p.sd * eval_scale(p.scale, model.scales) for p in effect.parameters]),
        np.array([p.off if p.one_sided else -np.inf for p in effect.parameters]),
    )
