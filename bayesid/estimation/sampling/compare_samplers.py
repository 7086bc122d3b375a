"""Do two samplers find the same posterior? Differences of means and spreads against their Monte Carlo errors.

Takes two `Posterior` of one density. Gives numbers; does not judge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.sampling.posterior import Posterior

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Agreement:
    """Differences of two posteriors, per unknown.

    Attributes
    ----------
    mean : (k,) difference of the means in their Monte Carlo standard errors
    shift : (k,) the same in posterior standard deviations
    spread : (k,) ratio of the standard deviations
    spread_error : (k,) Monte Carlo standard error of its logarithm
    """

    names: tuple[str, ...]
    mean: Array
    shift: Array
    spread: Array
    spread_error: Array


def agreement(one: Posterior, two: Posterior) -> Agreement:
    """Compare two posteriors of the same unknowns.

    Standard errors of means from bulk effective sizes, of standard deviations from tail ones as if normal.

    Raises
    ------
    SampleError
        they are not of the same density
    """
    if one.names != two.names or one.digest != two.digest:
        raise SampleError("the two posteriors are not of the same density; nothing to compare")
    difference = one.mean - two.mean
    error = np.sqrt(one.sd**2 / one.convergence.ess_bulk + two.sd**2 / two.convergence.ess_bulk)
    spread_error = np.sqrt(0.5 / one.convergence.ess_tail + 0.5 / two.convergence.ess_tail)
    return Agreement(one.names, difference / error, difference / one.sd, one.sd / two.sd, spread_error)
