"""Has a chain converged? R-hat across ensembles, chain length in autocorrelation times, effective sizes.

Takes draws of independent ensembles. Gives numbers and, where they fall short, reasons in words.
A wrong target passes all of this: that the moves sample what they should is for tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.estimation.sampling.arviz_import import arviz

Array = np.ndarray
MOST_RANKED = 100_000  # draws ranked for R-hat; more would change its fourth digit
TAIL = (0.05, 0.95)  # quantiles of the tail effective size (Vehtari et al. 2021); arviz 1.x has no default


@dataclass(frozen=True)
class ConvergenceLimits:
    """When a chain counts as converged.

    rhat : at most, rank-normalised and split (Vehtari et al. 2021), one chain per ensemble
    n_tau : at least so many autocorrelation times per ensemble, the largest of all unknowns
    tau_change : its estimate from the first three quarters differs by less than this share
    ess : at least so many effective draws of every unknown, bulk and tail
    """

    rhat: float = 1.01
    n_tau: float = 50.0
    tau_change: float = 0.1
    ess: float = 400.0


@dataclass(frozen=True, eq=False)
class ConvergenceCheck:
    """Verdict on a chain.

    Attributes
    ----------
    converged : all limits hold
    reasons : in words, what falls short; empty if converged
    rhat, ess_bulk, ess_tail, tau : (k,) per unknown; tau in steps of the sampler
    n_tau : kept steps per ensemble over the largest tau
    tau_change : relative change of the largest tau since three quarters of the chain
    stuck : walkers (ensemble, walker) that hardly moved
    """

    converged: bool
    reasons: tuple[str, ...]
    rhat: Array
    ess_bulk: Array
    ess_tail: Array
    tau: Array
    n_tau: float
    tau_change: float
    stuck: tuple[tuple[int, int], ...]


def check_convergence(
    draws: Array, names: tuple[str, ...], thin: int = 1, limits: ConvergenceLimits | None = None
) -> ConvergenceCheck:
    """Judge draws.

    Parameters
    ----------
    draws : (ensembles, steps, walkers, k), warm-up left out
    names : (k,)
    thin : sampler steps per stored one
    """
    limits = limits or ConvergenceLimits()
    e, n, w, k = draws.shape
    tau = thin * autocorrelation_time(draws)
    before = thin * autocorrelation_time(draws[:, : max(3 * n // 4, 2)])
    # neighbours within a third of the correlation time tell nothing new, but cost as much to rank
    sparse = draws[:, :: max(1, int(tau.max() / thin / 3))]
    rhat = np.array([_rhat(sparse[..., j]) for j in range(k)])
    bulk, tail = (
        np.array([effective_size(sparse[..., j], kind) for j in range(k)]) for kind in ("bulk", "tail")
    )
    slowest = int(np.argmax(tau))
    length, change = _length(tau, before, n * thin)
    stuck = _stuck(draws)
    reasons = []
    if e < 2:
        reasons.append("one ensemble alone cannot be compared with another")
    if not rhat.max() <= limits.rhat:
        worst = int(np.argmax(np.where(np.isnan(rhat), np.inf, rhat)))
        reasons.append(f"R-hat {rhat[worst]:.4f} of {names[worst]} (limit {limits.rhat:g})")
    if not length >= limits.n_tau:
        reasons.append(
            f"{length:.1f} autocorrelation times of {names[slowest]} (at least {limits.n_tau:g}; "
            f"one is {tau[slowest]:.0f} steps)"
        )
    if not change <= limits.tau_change:
        reasons.append(f"the autocorrelation time still changes by {100 * change:.0f} %")
    for kind, ess in (("bulk", bulk), ("tail", tail)):
        if not ess.min() >= limits.ess:
            worst = int(np.argmin(ess))
            reasons.append(
                f"{kind} effective size {ess[worst]:.0f} of {names[worst]} (at least {limits.ess:g})"
            )
    if stuck:
        reasons.append(
            f"{len(stuck)} of {e * w} walkers hardly moved: a separate mode or the edge of a region "
            "where the simulation fails; start closer to the mode (smaller spread) or narrow the bounds"
        )
    return ConvergenceCheck(not reasons, tuple(reasons), rhat, bulk, tail, tau, length, change, stuck)


def long_enough(
    draws: Array, thin: int = 1, limits: ConvergenceLimits | None = None
) -> tuple[bool, float, float]:
    """Whether the chain has the length the convergence check asks for; its length in, and, the largest
    correlation time.

    The part of the convergence check that costs little: a chain that is too short need not be ranked.
    """
    limits = limits or ConvergenceLimits()
    tau = thin * autocorrelation_time(draws)
    before = thin * autocorrelation_time(draws[:, : max(3 * draws.shape[1] // 4, 2)])
    length, change = _length(tau, before, draws.shape[1] * thin)
    return length >= limits.n_tau and change <= limits.tau_change, length, float(tau.max())


def _length(tau: Array, before: Array, steps: int) -> tuple[float, float]:
    """Steps in largest correlation times, and how much that changed since three quarters of the chain."""
    return float(steps / tau.max()), abs(float(before.max() / tau.max()) - 1.0)


def autocorrelation_time(draws: Array, window: float = 5.0) -> Array:
    """(k,) integrated autocorrelation times [stored steps] of (ensembles, steps, walkers, k) draws.

    Autocovariances are averaged over the walkers of an ensemble about the ensemble's mean, summed up to
    `window` times the result (Sokal 1997), and the times averaged over the ensembles.
    """
    n, k = draws.shape[1], draws.shape[3]
    found = np.empty((draws.shape[0], k))
    lags = np.arange(n)
    for e, one in enumerate(draws):
        for j in range(k):
            x = one[..., j] - one[..., j].mean()
            power = np.fft.rfft(x, 1 << (2 * n - 1).bit_length(), axis=0)
            covariance = np.fft.irfft(np.sum(power.real**2 + power.imag**2, axis=1))[:n] / (n - lags)
            if not covariance[0] > 0:
                found[e, j] = n
                continue
            sums = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
            enough = lags >= window * sums
            found[e, j] = sums[np.argmax(enough)] if enough.any() else n
    return np.maximum(found.mean(axis=0), 1.0)


def _rhat(one: Array) -> float:
    """Of (ensembles, steps, walkers): a chain is an ensemble, step by step, so that halves are halves."""
    e = one.shape[0]
    stride = max(1, one.size // MOST_RANKED)
    chains = one[:, ::stride].reshape(e, -1)
    if np.ptp(chains) == 0:
        return float("nan")
    return float(arviz().rhat(chains)) if e > 1 else float(arviz().rhat(chains.reshape(2, -1)))


def effective_size(one: Array, kind: str) -> float:
    """Of (ensembles, steps, walkers): a chain is a walker."""
    chains = np.swapaxes(one, 1, 2).reshape(-1, one.shape[1])
    if one.shape[1] < 4 or np.ptp(chains) == 0:
        return 0.0
    return float(arviz().ess(chains, method=kind, **({"prob": TAIL} if kind == "tail" else {})))


def _stuck(draws: Array) -> tuple[tuple[int, int], ...]:
    """Walkers that moved in fewer than a tenth as many stored steps as the median walker."""
    moved = np.any(np.diff(draws, axis=1) != 0, axis=3).mean(axis=1)
    limit = 0.1 * np.median(moved)
    return tuple((int(i), int(j)) for i, j in np.argwhere((moved < limit) | (moved == 0)))
