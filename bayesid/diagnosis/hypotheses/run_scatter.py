"""How far the runs of a fit scatter about it, and by how much that widens its standard deviations.

Takes the normal equations of the runs. Gives ratios, degrees of freedom and factors. Fits nothing.

A fit counts readings as independent once its noise is whitened, so that a size which differs from run to run
has the deviation of one that does not. The scores of the runs tell: their covariance about the estimate, runs
as clusters, is that of the error (sandwich; Huber 1967, Liang and Zeger 1986), each score divided by what its
run pulls the estimate to itself (Bell and McCaffrey 2002). It is as sure as few runs make it, unequal ones
fewer still: chi-square with the degrees of freedom of its own mean and variance (Satterthwaite 1946).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp, ndtr, ndtri

from bayesid.diagnosis.threshold_table import PRIOR_OUTSIDE
from bayesid.estimation.filter_error.evidence import NormalEquations

Array = np.ndarray
# A size that differs from run to run is a cause that is not listed, and as probable before the runs are read;
# the factor on standard deviations is log-uniform then, up to this. On vehicles with other equations runs
# scattered up to 10 times as far as their readings say.
MOST = 100.0
_FACTORS = np.geomspace(1.0, MOST, 201)
_RULE = 0.975
# Part of what a run says of a size that the other runs can check, below which it tells nothing but itself;
# part of what all say that has to be checked so; and degrees of freedom below which runs do not tell of each
# other: three that say alike have two.
_NOTHING, _CHECKED, LEAST_FREEDOM = 0.1, 0.5, 1.5
# Precision over the prior's below which nothing is said of a size.
_TOLD = 1e-6


@dataclass(frozen=True, eq=False)
class RunScatter:
    """Scatter of the runs' scores along some unknowns.

    Attributes
    ----------
    ratio : (e,) variance over that which the readings of the runs ask for; 1 in the mean where they are right
    freedom : (e,) its degrees of freedom
    share : (e,) what the readings, not the prior, have of the variance of the estimate
    """

    ratio: Array
    freedom: Array
    share: Array

    def widening(self) -> Array:
        """(e,) factors on standard deviations, so that 1.96 of them hold 95 % of the error."""
        return np.array([_widening(*of) for of in zip(self.ratio, self.freedom, self.share, strict=True)])


def scatter_of_runs(equations: Sequence[NormalEquations], columns: Array) -> RunScatter:
    """Scatter of the runs about their common estimate.

    Parameters
    ----------
    equations : of every run, unknowns in prior standard deviations
    columns : (e,) the unknowns asked for
    """
    total = sum(equations[1:], equations[0])
    posterior = np.linalg.inv(np.eye(total.se.size) + total.ss)
    found = [_along(equations, total, int(c)) for c in columns]
    rows = posterior[columns]
    said = np.einsum("ei,ij,ej->e", rows, total.ss, rows)
    ratio, freedom = np.array(found).reshape(-1, 2).T
    return RunScatter(ratio, freedom, said / posterior[columns, columns])


def _along(equations: Sequence[NormalEquations], total: NormalEquations, column: int) -> tuple[float, float]:
    """Ratio and degrees of freedom of one unknown.

    About the estimate without its own prior: that would pull every score, of a size of five prior deviations
    by as much.
    """
    prior = np.eye(total.se.size)
    prior[column, column] = 0.0
    if total.ss[column, column] < _TOLD:
        return 1.0, 0.0
    inverse = np.linalg.inv(prior + total.ss)
    mean, row = inverse @ total.se, inverse[column]
    pulls = np.array([row @ (g.se - g.ss @ mean) for g in equations])
    own = np.array([row @ g.ss for g in equations])
    said = own @ row  # variances of the runs' scores
    joint = np.diag(said) - own @ inverse @ own.T
    left = np.diag(joint)
    tells = left > _NOTHING * np.maximum(said, _NOTHING * said.sum())
    weight = np.where(tells, said / np.where(tells, left, 1.0), 0.0)
    expected = float(weight @ left)
    twice = float(weight @ joint**2 @ weight)
    freedom = expected**2 / twice if twice > 0.0 else 0.0
    if not freedom >= LEAST_FREEDOM or said[tells].sum() < _CHECKED * said.sum():
        return 1.0, 0.0
    return float(weight @ pulls**2) / expected, freedom


def _widening(ratio: float, freedom: float, share: float) -> float:
    """The deviation is that of a mixture over its unknown factor, given the scatter (Birge 1932 took the
    scatter itself); 1 where nothing is known of it."""
    if not (freedom > 0.0 and np.isfinite([ratio, freedom, share]).all()):
        return 1.0
    squares = _FACTORS**2
    log = -freedom * np.log(_FACTORS) - 0.5 * freedom * ratio / squares + np.log(PRIOR_OUTSIDE / squares.size)
    weight = np.append(log, np.log1p(-PRIOR_OUTSIDE) - 0.5 * freedom * ratio)
    weight = np.exp(weight - logsumexp(weight))
    deviations = np.sqrt(np.append(1.0 + share * (squares - 1.0), 1.0))
    usual = float(ndtri(_RULE))

    def beyond(reach: float) -> float:
        return float(weight @ ndtr(-reach / deviations)) - (1.0 - _RULE)

    return max(1.0, float(brentq(beyond, 0.5 * usual, 2.0 * usual * MOST)) / usual)
