"""Draws of an explanation's posterior by emcee, how they agree with Laplace, and the evidence they imply.

Takes an `EffectDensity`. Gives an `EffectPosterior`. Does not choose effects: Laplace decides, this confirms
and draws.

The evidence by bridge sampling (Meng and Wong 1996) needs no Laplace approximation: draws of the posterior
and of a Gaussian of their own covariance meet half way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.effect_density import EffectDensity, density_check, effect_density
from bayesid.diagnosis.evidence.effect_draws import ROUGH_DENSITY, EffectDraws, ParameterDraws
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.estimation.sampling import ConvergenceLimits, Laplace, Posterior, SamplerOptions, sample

Array = np.ndarray
Notify = Callable[[str], None]
# A deviation or a mean that differs by more is said to disagree with Laplace.
SD_RATIO, SHIFT = 1.25, 0.5


@dataclass(frozen=True, eq=False)
class EffectPosterior:
    """Posterior draws beside their Laplace approximation.

    Attributes
    ----------
    density, laplace, posterior : what was sampled
    sd_ratio : (k,) sd of the draws over Laplace's
    shift : (k,) mean of the draws less Laplace's, in Laplace's sd
    log_evidence, error : by bridge sampling, and its standard error [nats]
    """

    density: EffectDensity
    laplace: Laplace
    posterior: Posterior
    sd_ratio: Array
    shift: Array
    log_evidence: float
    error: float

    @property
    def agrees(self) -> bool:
        """Whether Laplace describes the effects' parameters well enough to quote."""
        e = self.density.where_effects
        ratio = np.maximum(self.sd_ratio[e], 1.0 / self.sd_ratio[e])
        close = bool((ratio < SD_RATIO).all() and (np.abs(self.shift[e]) < SHIFT).all())
        return (
            close
            and self.density.surface.roughness < ROUGH_DENSITY
            and self.density.noise_scale.error < ROUGH_DENSITY
        )


def sample_effect(
    problem: DiagnosisProblem,
    fitted: FilterErrorFit,
    seed: int = 0,
    folder: Path | str | None = None,
    notify: Notify = lambda text: None,
    coefficients: int = 6,
    sample_noise_scale: bool = True,
) -> EffectPosterior:
    """Posterior of a converged fit with effects.

    Parameters
    ----------
    folder : gets posterior.nc (and the chain)
    coefficients, sample_noise_scale : as in `effect_density`

    Raises
    ------
    SampleError
        no effect, not converged, or no finite start
    """
    density, laplace = effect_density(problem, fitted, notify, coefficients, sample_noise_scale)
    notify(f"posterior: emcee in {len(density.unknowns.names)} dimensions")
    options = SamplerOptions(ensembles=4, walkers=max(32, 4 * len(density.unknowns.names) // 2 * 2),
        seed=seed,
                      spread=1.2, first=150, max_steps=4000, limits=ConvergenceLimits(rhat=1.02))  # fmt: skip
    posterior = sample(density, laplace, options, folder)
    draws = (posterior.flat - density.offset) / density.scale
    # against the linear model's own deviations, not the narrower ones the walkers may have started with
    sd = np.sqrt(np.diag(laplace.covariance))
    at = [fitted.free.names.index(n) for n in density.unknowns.names[: density.unknowns.n_params]]
    sd[: len(at)] = np.sqrt(np.diag(fitted.posterior.covariance))[at]
    log_z, error = bridge(density.log_prob, draws, np.random.default_rng(seed))
    return EffectPosterior(
        density,
        laplace,
        posterior,
        draws.std(axis=0) / sd,
        (draws.mean(axis=0) - laplace.mode) / sd,
        log_z,
        error,
    )


def bridge(
    log_prob: Callable[[Array], Array], draws: Array, rng: np.random.Generator, most: int = 4000
) -> tuple[float, float]:
    """Log evidence from posterior draws, and its standard error.

    Half of the draws shape a Gaussian, the other half meet as many of its own draws in the optimal bridge.

    Parameters
    ----------
    log_prob : of likelihood times prior
    draws : (m, k) of it, thinned or not
    """
    picked = draws[rng.permutation(draws.shape[0])[: 2 * most]]
    half = picked.shape[0] // 2
    shape, meet = picked[:half], picked[half : 2 * half]
    proposal = multivariate_normal(shape.mean(axis=0), np.atleast_2d(np.cov(shape.T)), allow_singular=True)
    fresh = np.atleast_2d(proposal.rvs(half, random_state=rng).reshape(half, -1))
    there = _batched(log_prob, meet) - np.atleast_1d(proposal.logpdf(meet))
    here = _batched(log_prob, fresh) - np.atleast_1d(proposal.logpdf(fresh))
    log_z = float(np.median(there))
    for _ in range(200):
        upper = logsumexp(here - np.logaddexp(here, log_z)) if np.isfinite(here).any() else -np.inf
        lower = logsumexp(-np.logaddexp(there, log_z))
        new = float(upper - lower)
        if abs(new - log_z) < 1e-8:
            break
        log_z = new
    a = np.exp(here - np.logaddexp(here, log_z))
    b = np.exp(log_z - np.logaddexp(there, log_z))
    error = np.sqrt(a.var() / a.mean() ** 2 / a.size + b.var() / b.mean() ** 2 / b.size)
    return log_z, float(error)


def _batched(log_prob: Callable[[Array], Array], points: Array) -> Array:
    return np.concatenate([log_prob(points[i : i + 500]) for i in range(0, points.shape[0], 500)])


def numbers(found: EffectPosterior) -> EffectDraws:
    """Final numbers of the draws."""
    mean, sd = found.posterior.mean, found.posterior.sd
    interval = found.posterior.interval(0.95)
    return EffectDraws(
        {
            n: ParameterDraws(
                float(mean[i]),
                float(sd[i]),
                float(interval[i, 0]),
                float(interval[i, 1]),
                float(found.sd_ratio[i]),
                float(found.shift[i]),
            )
            for i, n in enumerate(found.posterior.names)
        },
        bool(found.agrees),
        bool(found.posterior.converged),
        tuple(found.posterior.convergence.reasons),
        float(found.log_evidence),
        float(found.error),
        density_check(found.density),
    )
