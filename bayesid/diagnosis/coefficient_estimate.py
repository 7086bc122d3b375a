"""What one explanation of a trial says of the coefficients: their Gaussian, and the prior it was found under.

Takes a filter-error fit. Gives a frozen `CoefficientEstimate`, which goes into `model.json` and comes back.
Always of the re-tuned coefficients, also where the diagnosed model predicts with those of the vehicle file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.estimation.filter_error.fit import FilterErrorFit

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class CoefficientEstimate:
    """Coefficients of the vehicle under one explanation, all else integrated out.

    Attributes
    ----------
    effects : names, empty for none
    weight : probability of the explanation among those of the model
    names, mean, covariance : (k,) coefficients [SI] and their Gaussian
    prior_mean, prior_sd : (k,) of the independent normal prior it was found under [SI]
    converged : whether the fit arrived
    """

    effects: tuple[str, ...]
    weight: float
    names: tuple[str, ...]
    mean: Array
    covariance: Array
    prior_mean: Array
    prior_sd: Array
    converged: bool

    def record(self) -> dict[str, Any]:
        """Plain data."""
        arrays = {n: getattr(self, n).tolist() for n in ("mean", "covariance", "prior_mean", "prior_sd")}
        rest = {"effects": list(self.effects), "weight": self.weight, "names": list(self.names)}
        return {**rest, **arrays, "converged": self.converged}


def estimate_of(
    effects: tuple[str, ...], weight: float, fitted: FilterErrorFit, names: Sequence[str]
) -> CoefficientEstimate:
    """The coefficients of a fit that its prior leaves free.

    Parameters
    ----------
    names : coefficients of the vehicle file
    """
    free = fitted.free
    where = [i for n in names if n in free.names and free.sd[i := free.names.index(n)] > 0.0]
    sd = free.sd[where]
    return CoefficientEstimate(
        effects,
        weight,
        tuple(free.names[i] for i in where),
        fitted.values[where],
        fitted.posterior.covariance[np.ix_(where, where)] * np.outer(sd, sd),
        free.mean[where],
        sd,
        bool(fitted.converged),
    )


def read_estimate(record: Mapping[str, Any]) -> CoefficientEstimate:
    """What `CoefficientEstimate.record` gave.

    Raises
    ------
    ValueError, KeyError, TypeError
        it holds no such thing
    """
    names = tuple(str(n) for n in record["names"])
    mean, covariance, prior_mean, prior_sd = (
        np.array(record[key], dtype=float) for key in ("mean", "covariance", "prior_mean", "prior_sd")
    )
    k = len(names)
    if any(a.shape != (k,) for a in (mean, prior_mean, prior_sd)) or covariance.shape != (k, k):
        raise ValueError("an estimate of the coefficients does not fit its names")
    if not all(np.isfinite(a).all() for a in (mean, covariance, prior_mean, prior_sd)):
        raise ValueError("an estimate of the coefficients holds numbers that are not finite")
    weight = float(record["weight"])
    if not (np.all(prior_sd > 0) and np.all(np.diag(covariance) > 0) and 0.0 <= weight <= 1.0):
        raise ValueError("an estimate of the coefficients has a size that is not positive")
    return CoefficientEstimate(
        tuple(record["effects"]),
        weight,
        names,
        mean,
        covariance,
        prior_mean,
        prior_sd,
        bool(record["converged"]),
    )
