"""Runs against each other: does what the others say about an effect predict this run, and do they agree?

Takes `RefittedHypothesis`s. Uses the normal equations of their refits, so nothing is fitted again; held-out
runs are not read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.interpolate import BSpline

from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.threshold_table import DISAGREEMENT_P_VALUE
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.run_data import Array

# Precision over the prior's from which a run tells of a size.
_LEAST_TOLD = 1.0


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Leave-one-run-out comparison of an explanation with no effect.

    Attributes
    ----------
    gains : (runs,) log density of each run given all others, over that without an effect
    disagreement : p-value of the runs having one and the same effect
    excess : its chi-square over the degrees of freedom
    """

    gains: Array
    disagreement: float
    excess: float

    @property
    def disagree(self) -> bool:
        return self.disagreement < DISAGREEMENT_P_VALUE

    @property
    def total(self) -> float:
        return float(self.gains.sum())

    @property
    def refuted(self) -> bool:
        """Whether the others predict a run worse with the effect than without, at 95 % over the runs."""
        n = self.gains.size
        if n < 3:
            return False
        error = float(self.gains.std(ddof=1)) / np.sqrt(n)
        return self.total < 0 and self.total / n + float(stats.t.ppf(0.95, n - 1)) * error < 0


def left_out(equations: tuple[NormalEquations, ...]) -> Array:
    """(runs,) log predictive density of each run given all others."""
    total = sum(equations[1:], equations[0])
    whole = posterior(total).log_evidence
    return np.array([whole - posterior(total - g).log_evidence for g in equations])


def cross_validate(
    candidate: RefittedHypothesis, none: RefittedHypothesis, coefficients: int
) -> CrossValidation:
    """Runs against each other.

    Parameters
    ----------
    coefficients : number of leading columns that are coefficients; the others are the effect's
    """
    gains = left_out(candidate.fit.equations) - left_out(none.fit.equations)
    return CrossValidation(gains, *disagreement(candidate.fit.equations, coefficients))


def agreement(candidate: RefittedHypothesis, coefficients: int) -> float | None:
    """p-value of one and the same effect for all runs; None for a single run, or where it cannot be told."""
    if len(candidate.fit.equations) < 2:
        return None
    try:
        found = disagreement(candidate.fit.equations, coefficients)[0]
    except np.linalg.LinAlgError:
        return None
    return found if np.isfinite(found) else None


def disagreement(equations: tuple[NormalEquations, ...], coefficients: int) -> tuple[float, float]:
    """p-value, and chi-square over its degrees of freedom, of one common effect against one for every run.

    Coefficients are common. Twice the gain in the maximised density is chi-square with (runs - 1) times
    (effect parameters) degrees of freedom; directions no run shows do not count.
    """
    c = coefficients
    k = equations[0].se.size - c
    runs = len(equations)
    if k == 0 or runs < 2:
        return 1.0, 1.0
    own = np.zeros((c + k * runs, c + k * runs))
    score = np.zeros(c + k * runs)
    for m, g in enumerate(equations):
        at = np.concatenate([np.arange(c), c + k * m + np.arange(k)])
        own[np.ix_(at, at)] += g.ss
        score[at] += g.se
    own[:c, :c] += np.eye(c)
    common = np.zeros((c + k * runs, c + k))
    common[:c, :c] = np.eye(c)
    for m in range(runs):
        common[c + k * m : c + k * (m + 1), c:] = np.eye(k)
    gain, rank = _explained(own, score)
    less, fewer = _explained(common.T @ own @ common, common.T @ score)
    chi2, freedom = max(gain - less, 0.0), max(rank - fewer, 1)
    return float(stats.chi2.sf(chi2, freedom)), chi2 / freedom


def of_single_runs(equations: Sequence[NormalEquations], column: int) -> tuple[Array, Array]:
    """(runs,) an unknown as each run alone asks for it, all else common to them, and (runs, runs) covariance.

    Infinite variance, and nought, of a run that does not tell.
    """
    runs, k = len(equations), equations[0].se.size
    others = np.delete(np.arange(k), column)
    joint, score = np.zeros((k - 1 + runs, k - 1 + runs)), np.zeros(k - 1 + runs)
    for m, g in enumerate(equations):
        at = np.append(np.arange(k - 1), k - 1 + m)
        of = np.append(others, column)
        joint[np.ix_(at, at)] += g.ss[np.ix_(of, of)]
        score[at] += g.se[of]
    joint[: k - 1, : k - 1] += np.eye(k - 1)
    tells = np.flatnonzero(np.diag(joint)[k - 1 :] > _LEAST_TOLD)
    kept = np.append(np.arange(k - 1), k - 1 + tells)
    found = np.linalg.inv(joint[np.ix_(kept, kept)])
    size, covariance = np.zeros(runs), np.diag(np.full(runs, np.inf))
    size[tells] = (found @ score[kept])[k - 1 :]
    covariance[np.ix_(tells, tells)] = found[k - 1 :, k - 1 :]
    return size, covariance


def between_runs(size: Array, covariance: Array) -> float:
    """Sd of a size from run to run, beyond what the readings of each leave of it.

    By moments (DerSimonian and Laird 1986); 0 where sizes of single runs scatter no more than that, or fewer
    than two tell.
    """
    variance = np.diag(covariance)
    tells = np.isfinite(variance)
    if tells.sum() < 2:
        return 0.0
    size, weight = size[tells], 1.0 / variance[tells]
    spread = float(weight @ (size - weight @ size / weight.sum()) ** 2)
    beyond = (spread - (size.size - 1)) / (weight.sum() - (weight**2).sum() / weight.sum())
    return float(np.sqrt(max(beyond, 0.0)))


def log_odds_over_runs(ahead: Array) -> float:
    """Log odds that one explanation stays ahead of another when the runs are weighed anew.

    Bayesian bootstrap (Rubin 1981), as in the stacking of models by left-out data (Yao et al. 2018). Weights
    are uniform on the simplex, so the weighted sum has the density of a B-spline whose knots are the
    differences (Curry and Schoenberg 1966), and the odds are exact. Infinite where all runs agree.

    Parameters
    ----------
    ahead : (runs,) difference of `left_out`
    """
    knots = np.sort(ahead)
    if knots[0] >= 0.0 or knots[-1] <= 0.0:
        return float(np.inf if knots.sum() > 0.0 else -np.inf if knots.sum() < 0.0 else 0.0)
    below = BSpline.basis_element(knots).antiderivative()
    above = float(np.clip(1.0 - below(0.0) * (knots.size - 1) / (knots[-1] - knots[0]), 0.0, 1.0))
    with np.errstate(divide="ignore"):
        return float(np.log(above) - np.log1p(-above))


def excess_where_apart(equations: tuple[NormalEquations, ...], coefficients: int) -> float:
    """Chi-square over its degrees of freedom of `disagreement` where the runs disagree; 1 where not."""
    p, excess = disagreement(equations, coefficients)
    return max(excess, 1.0) if p < DISAGREEMENT_P_VALUE else 1.0


def _explained(a: Array, b: Array) -> tuple[float, int]:
    """b' a^+ b and the rank of a, directions below 1e-3 of a prior's information left out."""
    value, vector = np.linalg.eigh(a)
    keep = value > 1e-3
    return float(((vector[:, keep].T @ b) ** 2 / value[keep]).sum()), int(keep.sum())
