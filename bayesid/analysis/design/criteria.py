"""One number out of a matrix: D, A, E and their relatives, and what becomes of every coefficient.

Takes `RunInformation`. Gives frozen `Criteria`, averaged over the vehicles drawn. Does not fly or choose.

Atkinson, Donev and Tobias (2007), chapter 10; averages over draws after Chaloner and Verdinelli (1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.analysis.design.information import RunInformation
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.estimation.output_error.flat_directions import combination

Array = np.ndarray
ROUNDING = 1e-12  # an eigenvalue of the information below this share of the largest is zero
FLAT_VARIANCE_SHARE = (
    0.25  # share of its variance that a direction called flat keeps: its sd is not even halved
)


@dataclass(frozen=True, eq=False)
class Criteria:
    """How much a run or a set tells; all in units of what is known.

    Attributes
    ----------
    gain : D, Bayesian: half the log determinant of posterior over prior information [nats]
    remaining : A, Bayesian: mean share of variance left, 1 for nothing learnt
    log_det : D of the data alone: mean log eigenvalue of the information, -inf if one is zero to rounding
    trace_inverse : A of the data alone: mean variance the data leave, inf if a direction is unseen
    weakest : E of the data alone: smallest eigenvalue
    condition : modified E: largest over smallest eigenvalue, inf if the smallest is zero to rounding
    condition_posterior : the same with what was known added to the data
    identified : mean number of directions in which the data say more than was known (eigenvalue above 1)
    contraction : (k,) expected 1 - posterior sd / prior sd of every coefficient
    contraction_low, contraction_high : (k,) smallest and largest among the vehicles
    """

    name: str
    duration: float
    gain: float
    remaining: float
    log_det: float
    trace_inverse: float
    weakest: float
    condition: float
    condition_posterior: float
    identified: float
    contraction: Array
    contraction_low: Array
    contraction_high: Array


def posterior(matrices: Array) -> Array:
    """(..., k, k) covariance of xi after data with the given information; the identity before."""
    return np.linalg.inv(np.eye(matrices.shape[-1]) + matrices)


def gain(matrices: Array) -> Array:
    """(...) half the log determinant of posterior over prior information [nats]."""
    return 0.5 * np.asarray(np.linalg.slogdet(np.eye(matrices.shape[-1]) + matrices)[1])


def contraction(knowledge: Knowledge, matrices: Array) -> Array:
    """(..., k) 1 - posterior sd / prior sd of every coefficient."""
    return 1.0 - knowledge.spread(posterior(matrices)) / knowledge.sd


def criteria(knowledge: Knowledge, info: RunInformation) -> Criteria:
    """All criteria of a run or a set."""
    values = np.linalg.eigvalsh(info.matrices)
    values = np.where(values > ROUNDING * values[:, -1:], values, 0.0)
    with np.errstate(divide="ignore"):
        logs, inverse = np.log(values), 1.0 / values
    smallest, largest = values[:, 0], values[:, -1]
    ratio = np.divide(largest, smallest, out=np.full(len(values), np.inf), where=smallest > 0)
    left = posterior(info.matrices)
    shares = 1.0 - knowledge.spread(left) / knowledge.sd
    return Criteria(
        info.name,
        info.duration,
        float(np.mean(gain(info.matrices))),
        float(np.mean(np.trace(left, axis1=1, axis2=2))) / values.shape[1],
        float(np.mean(logs)),
        float(np.mean(inverse)),
        float(np.mean(smallest)),
        float(np.median(ratio)),
        float(np.median((1.0 + largest) / (1.0 + smallest))),
        float(np.mean(np.sum(values > 1.0, axis=1))),
        np.mean(shares, axis=0),
        np.min(shares, axis=0),
        np.max(shares, axis=0),
    )


def flat_space(info: RunInformation, keep: float = FLAT_VARIANCE_SHARE) -> Array:
    """(k, m) orthonormal directions of xi that keep more than `keep` of their variance, flattest first.

    Directions are those of the posterior averaged over the vehicles drawn.
    """
    values, vectors = np.linalg.eigh(np.mean(posterior(info.matrices), axis=0))
    order = np.argsort(-values)
    return vectors[:, order[values[order] > keep]]


def flat_names(
    knowledge: Knowledge, info: RunInformation, keep: float = FLAT_VARIANCE_SHARE
) -> list[tuple[str, float]]:
    """Flat directions as sums of coefficients, in units of their prior sd, and the sd left along them."""
    space = flat_space(info, keep)
    left = np.mean(posterior(info.matrices), axis=0)
    scaled = knowledge.root / knowledge.sd[:, None]
    found = []
    for v in space.T:
        found.append((combination(knowledge.names, scaled @ v), float(np.sqrt(v @ left @ v))))
    return found
