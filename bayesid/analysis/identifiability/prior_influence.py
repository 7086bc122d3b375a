"""How much of a sampled posterior is the prior's: conflict and sensitivity to power scaling, from draws.

Takes draws with their log prior densities. Gives arrays, one entry per unknown. Does not sample again.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray
# Share of the prior variance that must be gone before a distance from the prior mean can be judged.
LEAST_LEARNT = 0.02


def conflict(mean: Array, sd: Array, prior_mean: Array, prior_sd: Array) -> Array:
    """(k,) distance of posterior means from the prior's over the sd chance gives it; nan where little is
    learnt or the prior is flat.

    Under the model the posterior mean scatters about the prior's with the variance that was lost (the law of
    total variance), so that 3 and more is a conflict.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        lost = 1.0 - (sd / prior_sd) ** 2
        z = (mean - prior_mean) / (prior_sd * np.sqrt(np.where(lost > 0, lost, np.nan)))
    return np.where(np.isfinite(prior_sd) & (lost > LEAST_LEARNT), z, np.nan)


def prior_sensitivity(draws: Array, log_prior: Array) -> tuple[Array, Array]:
    """Power scaling of the prior (Kallioinen et al. 2024) to first order, from covariances of the draws.

    Parameters
    ----------
    draws : (m, k)
    log_prior : (m,) log density of the prior at them

    Returns
    -------
    shift : (k,) change of each mean, in its sd, where the prior counts twice
    share : (k,) share of the prior in each variance, 0 (readings) to 1 (prior): minus the derivative of the
        log variance by the log of the power. Draws scatter it by a few hundredths. nan without `log_prior`
    """
    k = draws.shape[1]
    if not np.isfinite(log_prior).all():
        return np.full(k, np.nan), np.full(k, np.nan)
    apart = draws - draws.mean(axis=0)
    variance = np.mean(apart**2, axis=0)
    weight = log_prior - log_prior.mean()
    sd = np.sqrt(np.maximum(variance, 1e-300))
    shift = np.log(2.0) * (weight @ apart) / len(draws) / sd
    share = -(weight @ (apart**2)) / len(draws) / np.maximum(variance, 1e-300)
    return shift, np.clip(share, 0.0, 1.0)
