"""What chance alone reaches on this design: thresholds of the verdict from a parametric bootstrap.

Takes a `SensitivityBank` (its normal equations are the whole design: manoeuvres, sensors, environment).
Draws trials without any effect from the linearised model, coefficients from their prior, and screens each.
No simulation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.diagnosis.hypotheses.sensitivity_bank import SensitivityBank
from bayesid.diagnosis.hypotheses.size_scales import gains_of_draws
from bayesid.diagnosis.threshold_table import FALSE_ALARM, LEAST_NAMING_EVIDENCE, NOISE_MODEL_SLACK
from bayesid.estimation.run_data import Array


@dataclass(frozen=True)
class Thresholds:
    """Levels that trials without an effect pass with probability `FALSE_ALARM`.

    Attributes
    ----------
    named : gain in log evidence of the best effect of the catalogue
    remainder : gain of the best free signal
    conflict : largest move of a coefficient, in prior standard deviations
    draws : trials drawn
    """

    named: float
    remainder: float
    conflict: float
    draws: int


def chance(bank: SensitivityBank, seed: int, draws: int = 2000) -> tuple[Array, Array]:
    """Best gain of any effect and largest coefficient move, (draws,) each, in trials without an effect."""
    a, c = bank.total(0).ss, bank.n_coef
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(a)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    se = rng.standard_normal((draws, c)) @ a[:c] + rng.standard_normal((draws, a.shape[0])) @ root.T
    inner = np.linalg.inv(np.eye(c) + a[:c, :c])
    moved = se[:, :c] @ inner
    best = np.full(draws, -np.inf)
    for column in bank.effects.values():
        for v, k in enumerate(column.variants):
            rest = se[:, k] - moved @ a[:c, k]
            own = a[np.ix_(k, k)] - a[np.ix_(k, np.arange(c))] @ inner @ a[:c, k]
            best = np.maximum(best, gains_of_draws(own, rest, column.sizes_of(v)))
    return best, np.abs(moved).max(axis=1, initial=0.0)


def thresholds(bank: SensitivityBank, tried: int, seed: int, draws: int = 2000) -> Thresholds:
    """Thresholds of one design.

    Parameters
    ----------
    tried : free signals tried (`localisation.tried`: places times amplitudes times correlation times, and one
        that keeps time). A Bayes factor exceeds exp(w) by chance with probability exp(-w) at most, so the
        best of them exceeds log(tried / FALSE_ALARM) with probability `FALSE_ALARM` at most.
    """
    gain, moved = chance(bank, seed, draws)
    return Thresholds(
        named=max(LEAST_NAMING_EVIDENCE, float(np.quantile(gain, 1.0 - FALSE_ALARM))),
        remainder=float(np.log(tried / FALSE_ALARM)) + NOISE_MODEL_SLACK,
        conflict=float(np.quantile(moved, 1.0 - FALSE_ALARM)),
        draws=draws,
    )
