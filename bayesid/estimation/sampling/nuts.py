"""Sample a density with its gradient: nutpie's No-U-Turn sampler in Laplace-whitened coordinates.

Takes a `Density` that also gives its slope, and its `Laplace` approximation. Gives a `Posterior` under the
same convergence check as the ensembles, so that either sampler can check the other. Needs the optional
package nutpie;
keeps its chain in memory; a stored posterior can be lengthened.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.sampling.convergence import ConvergenceCheck, ConvergenceLimits, check_convergence
from bayesid.estimation.sampling.density import Density, Laplace
from bayesid.estimation.sampling.moves import Reference
from bayesid.estimation.sampling.posterior import Posterior

Array = np.ndarray
MOST_DIVERGENT = 0.01  # share of draws after which a chain is not called converged


class GradientDensity(Density, Protocol):
    """A density that knows its gradient, in sampling coordinates."""

    def log_prob_slope(self, q: Array) -> tuple[float, Array]:
        """Log density of one point (k,) and its gradient (k,); -inf where it is zero or unknown."""
        ...

    def coordinates(self, v: Array) -> Array:
        """Sampling coordinates (..., k) of points in natural units: the inverse of `natural`."""
        ...


@dataclass(frozen=True)
class NutsOptions:
    """How to sample.

    chains : independent ones, each an ensemble of one walker in the result
    tune, draws : per chain, warm-up and kept
    accept : acceptance the step size is tuned to; high, since scaled equations bend the posterior
    depth : at most 2^depth gradients per draw
    spread : how much wider than the Laplace approximation chains start
    """

    chains: int = 4
    tune: int = 300
    draws: int = 1000
    accept: float = 0.95
    depth: int = 8
    spread: float = 2.0
    seed: int = 0
    # autocorrelation times near one draw fluctuate by more than a share; effective sizes judge the length
    limits: ConvergenceLimits = field(default_factory=lambda: ConvergenceLimits(tau_change=np.inf))


class _Impossible(ValueError):
    """Tells nutpie that a point has no density: the trajectory ends there."""

    is_recoverable = True


def sample_nuts(
    density: GradientDensity,
    laplace: Laplace,
    options: NutsOptions | None = None,
    *,
    threads: int = 2,
) -> Posterior:
    """Sample with gradients.

    Whitening makes the posterior close to a standard normal, so that few leapfrog steps suffice and the
    diagonal metric nutpie tunes has little to do.

    Raises
    ------
    SampleError
        nutpie is not installed, or no chain finds a start of finite density
    """
    options = options or NutsOptions()
    k = len(density.unknowns.names)

    def begin(seed: int) -> Array:
        rng = np.random.default_rng([options.seed, seed])
        for shrink in 0.8 ** np.arange(40):
            x = options.spread * shrink * rng.standard_normal(k)
            if np.isfinite(density.log_prob_slope(laplace.points(x))[0]):
                return x
        return np.zeros(k)

    q, counts, seconds = _chains(density, laplace, options, begin, options.chains, options.seed, threads)
    made_with = {"name": "nutpie NUTS"} | {n: v for n, v in asdict(options).items() if n != "seed"}
    return _posterior(
        density, options, q, counts, seconds, mode=density.natural(laplace.mode),
        mode_sd=_natural_sd(density, laplace), acceptance=np.full(options.chains, options.accept),
        discarded=options.tune, seed=options.seed, settings={"sampler": made_with},
    )  # fmt: skip


def sample_nuts_until(
    density: GradientDensity,
    laplace: Laplace,
    most: int,
    options: NutsOptions | None = None,
    *,
    threads: int = 2,
    watch: Callable[[int, str], None] | None = None,
) -> Posterior:
    """Lengthen the chains by half, again and again, until the check passes or each has `most` draws.

    Parameters
    ----------
    watch : called with draws per chain since the last call, and a note

    Raises
    ------
    SampleError
        as `sample_nuts`
    """
    options = options or NutsOptions()
    options = replace(options, draws=min(options.draws, most))
    if watch is not None:
        watch(0, f"warm-up of {options.tune} and {options.draws} draws in each of {options.chains} chains")
    found = sample_nuts(density, laplace, options, threads=threads)
    while True:
        done = found.draws.shape[1]
        if watch is not None:
            said = "converged" if found.converged else f"not yet: {found.convergence.reasons[0]}"
            watch(0, f"{done} draws a chain, R-hat {found.convergence.rhat.max():.4f}, {said}")
        if found.converged or done >= most:
            return found
        more = replace(options, draws=min(max(done // 2, 1), most - done))
        found = continue_nuts(density, laplace, found, more)


def continue_nuts(
    density: GradientDensity,
    laplace: Laplace,
    before: Posterior,
    options: NutsOptions | None = None,
    *,
    watch: Callable[[int], None] | None = None,
) -> Posterior:
    """Lengthen every chain of a posterior of `sample_nuts` by `options.draws`, and judge the whole.

    Each chain goes on from its last draw, after `options.tune` steps that are not kept: nutpie cannot take
    over a step size. It moves in coordinates whitened with the draws so far, which costs fewer gradients
    where the posterior is not as wide as its Laplace approximation.

    Parameters
    ----------
    laplace : the approximation `before` was whitened with
    watch : called with the number of draws when a chain is done

    Raises
    ------
    SampleError
        nutpie is not installed, or the chain is of another density or another sampler
    """
    options = options or NutsOptions()
    if before.digest != density.digest or before.draws.shape[2] != 1:
        raise SampleError(
            "these draws are not of this density and the gradient sampler; sample it from the start"
        )
    done = density.coordinates(before.draws[:, :, 0])
    chains, n, k = done.shape
    seen = Reference.of(laplace.whitened(done).reshape(-1, k), float(before.convergence.ess_bulk.min()))
    root = laplace.root @ seen.root
    wide = Laplace(laplace.points(seen.mean), root @ root.T)
    parts, seconds = [], before.seconds
    counts = dict(before.counts)
    for i in range(chains):
        start = wide.whitened(done[i, -1])
        seed = int(np.random.SeedSequence([options.seed, n, i]).generate_state(1)[0])
        q, more, spent = _chains(density, wide, options, partial(_same, start), 1, seed, 1)
        parts.append(q[0])
        seconds += spent
        counts = {name: counts.get(name, 0) + value for name, value in more.items()}
        if watch is not None:
            watch(q.shape[1])
    return _posterior(
        density, options, np.concatenate([done, np.stack(parts)], axis=1), counts, seconds,
        mode=before.mode, mode_sd=before.mode_sd, acceptance=before.acceptance,
        discarded=before.discarded + options.tune, seed=before.seed,
        settings={**before.settings, "continued": (*before.settings.get("continued", ()), options.draws)},
    )  # fmt: skip


def _chains(
    density: GradientDensity, laplace: Laplace, options: NutsOptions, begin: Callable[[int], Array],
    chains: int, seed: int, threads: int,
) -> tuple[Array, dict[str, int], float]:  # fmt: skip
    """Points (chains, draws, k) in sampling coordinates, what was counted, and processor seconds."""
    nutpie, from_pyfunc = _nutpie()
    k = len(density.unknowns.names)
    counts = {"all": 0, "out of bounds": 0, "diverged": 0}

    def slope(x: Array) -> tuple[float, Array]:
        counts["all"] += 1
        value, by_q = density.log_prob_slope(laplace.points(np.asarray(x)))
        if not (np.isfinite(value) and np.isfinite(by_q).all()):
            counts["diverged"] += 1
            raise _Impossible("no density here")
        return float(value), by_q @ laplace.root

    model = from_pyfunc(
        k, lambda: slope, _expand, [np.dtype(np.float64)], [(k,)], ["x"], make_initial_point_fn=begin
    )
    clock = time.process_time()
    try:
        trace = nutpie.sample(
            model, draws=options.draws, tune=options.tune, chains=chains, cores=threads,
            seed=seed, save_warmup=False, progress_bar=False, target_accept=options.accept,
            maxdepth=options.depth,
        )  # fmt: skip
    except (RuntimeError, ValueError) as error:
        raise SampleError(f"nutpie stopped: {str(error).splitlines()[0]}") from None
    seconds = time.process_time() - clock
    counts["divergent draws"] = int(np.asarray(trace["sample_stats"]["diverging"].values).sum())
    return laplace.points(np.asarray(trace["posterior"]["x"].values)), counts, seconds


def _posterior(
    density: GradientDensity, options: NutsOptions, q: Array, counts: dict[str, int], seconds: float,
    **rest: Any,
) -> Posterior:  # fmt: skip
    """Points (chains, draws, k) judged."""
    draws = np.asarray(density.natural(q))[:, :, None, :]
    convergence = _with_divergences(
        check_convergence(draws, density.unknowns.names, 1, options.limits),
        counts["divergent draws"] / q[..., 0].size,
    )
    log_prob = np.stack([density.log_prob(chain) for chain in q])[:, :, None]
    return Posterior(
        unknowns=density.unknowns, draws=draws, log_prob=log_prob, log_prior=_log_prior(density, draws),
        convergence=convergence, thin=1, counts=counts, seconds=seconds, digest=density.digest, **rest,
    )  # fmt: skip


def _log_prior(density: Density, draws: Array) -> Array:
    """(chains, draws, 1) where the density tells it, else nan."""
    told = getattr(density, "log_prior", None)
    if told is None:
        return np.full(draws.shape[:3], np.nan)
    return np.asarray(told(draws.reshape(-1, draws.shape[3]))).reshape(draws.shape[:3])


def _nutpie() -> tuple[Any, Callable[..., Any]]:
    try:
        import nutpie
        from nutpie.compiled_pyfunc import from_pyfunc
    except ImportError:
        raise SampleError("the gradient sampler needs nutpie: pip install 'bayesid[nuts]'") from None
    return nutpie, from_pyfunc


def _same(start: Array, _: int) -> Array:
    return start


def _expand(*seeds: int) -> Callable[[Array], dict[str, Array]]:
    return lambda x: {"x": np.array(x, dtype=np.float64)}


def _with_divergences(convergence: ConvergenceCheck, share: float) -> ConvergenceCheck:
    if share <= MOST_DIVERGENT:
        return convergence
    reason = (
        f"{100 * share:.1f} % of the draws met a region that the steps cannot follow (a bound, or a vehicle "
        "that diverges); the tails there are not explored"
    )
    return replace(convergence, converged=False, reasons=(*convergence.reasons, reason))


def _natural_sd(density: Density, laplace: Laplace) -> Array:
    """(k,) Laplace sd in natural units, by central differences of half an sd."""
    sd = np.sqrt(np.diag(laplace.covariance))
    step = 0.5 * np.diag(sd)
    ends = density.natural(laplace.mode + step) - density.natural(laplace.mode - step)
    return np.abs(np.diag(ends))
