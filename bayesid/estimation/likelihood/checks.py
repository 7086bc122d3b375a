"""Checks of a posterior that its intervals must pass: halves of the runs, the prior, its weight.

Takes a `Composite` and parts. Gives numbers with a verdict. Does not change the posterior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.estimation.likelihood.composite import Composite, Law, inverse
from bayesid.estimation.likelihood.parts import NoiseParts

Array = np.ndarray
# Posterior sd over prior sd below which data, not prior, determine a coefficient.
DETERMINED = 0.5
HALVES_P, DRAWS = 0.02, 4000
# Sd that chance gives an estimate, over its prior sd, below which the runs said nothing of it.
SAID_NOTHING = 1e-4


@dataclass(frozen=True, eq=False)
class HalvesCheck:
    """Odd runs against even ones.

    Attributes
    ----------
    z : (k,) difference of the two posterior means over its standard deviation
    combined : (k,) the same over the root of the sum of both posterior variances
    counted : (k,) coefficients that the data determine
    rms, combined_rms : over those; nan where there is none
    p : probability of so large an rms where the runs agree
    """

    z: Array
    combined: Array
    counted: Array
    rms: float
    combined_rms: float
    p: float

    @property
    def agrees(self) -> bool:
        """Whether chance alone can make the halves differ so."""
        return not self.p < HALVES_P


def halves(composite: Composite, parts: NoiseParts, prior_sd: Array, seed: int = 0) -> HalvesCheck | None:
    """Posteriors of odd and of even runs compared; None with a single run.

    What both took from the prior does not differ: the estimates follow the true value by their responses.
    """
    if len(composite.runs) < 2:
        return None
    odd, even = composite.runs[0::2], composite.runs[1::2]
    one, two = composite.law(parts, odd), composite.law(parts, even)
    lean = one.response - two.response
    covariance = lean @ pseudo_inverse(composite.prior_precision) @ lean.T + one.noise + two.noise
    difference = one.mean - two.mean
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    counted = np.sqrt(np.diag(composite.law(parts).covariance)) < DETERMINED * prior_sd
    z = difference / sd
    combined = difference / np.sqrt(np.diag(one.covariance) + np.diag(two.covariance))
    if not counted.any():
        return HalvesCheck(z, combined, counted, float("nan"), float("nan"), 1.0)
    correlation = (covariance / np.outer(sd, sd))[np.ix_(counted, counted)]
    values, vectors = np.linalg.eigh(correlation)
    draws = np.random.default_rng(seed).standard_normal((DRAWS, values.size)) * np.sqrt(np.maximum(values, 0))
    chance = np.sqrt(np.mean((draws @ vectors.T) ** 2, axis=1))
    rms = float(np.sqrt(np.mean(z[counted] ** 2)))
    return HalvesCheck(
        z,
        combined,
        counted,
        rms,
        float(np.sqrt(np.mean(combined[counted] ** 2))),
        (1 + int(np.sum(chance >= rms))) / (1 + DRAWS),
    )


def pseudo_inverse(precision: Array) -> Array:
    """Inverse of a prior precision; directions without prior get none, as they carry no common pull."""
    held = np.diag(precision) > 0
    out = np.zeros_like(precision)
    if held.any():
        out[np.ix_(held, held)] = inverse(precision[np.ix_(held, held)])
    return out


def prior_conflict(composite: Composite, found: Law) -> Array:
    """(k,) distance of each estimate from its prior mean over the sd chance gives it; nan without prior.

    Under prior and likelihood the estimate is where its response to the true value and noise put it (Evans
    and Moshonov 2006).
    """
    prior = pseudo_inverse(composite.prior_precision)
    shift = found.mean - prior @ composite.prior_score
    expected = np.diag(found.response @ prior @ found.response.T + found.noise)
    held = np.diag(composite.prior_precision) > 0
    # an estimate that neither noise nor truth moves has only rounding to differ by
    moves = expected > SAID_NOTHING**2 * np.diag(prior)
    return np.where(held, np.where(moves, shift / np.sqrt(np.maximum(expected, 1e-300)), 0.0), np.nan)


def prior_sensitivity(composite: Composite, parts: NoiseParts, found: Law) -> Array:
    """(k,) change of each estimate, in its sd, per doubling of the prior's weight.

    Power scaling of the prior (Kallioinen et al. 2024), to first order.
    """
    if parts.efficient:
        a = composite.data(parts)[0]
    else:
        a = parts.weight * sum(
            (r.information for r in composite.runs), np.zeros_like(composite.prior_precision)
        )
    pull = composite.prior_score - composite.prior_precision @ found.mean
    change = inverse(a + composite.prior_precision) @ pull
    return np.log(2.0) * change / np.sqrt(np.diag(found.covariance))
