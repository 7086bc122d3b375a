"""Sample a density with its gradient: nutpie's No-U-Turn sampler in Laplace-whitened coordinates.

Takes a `Density` that also gives its slope, and its `Laplace` approximation. Gives a `Posterior` under the
same gate as the ensembles, so that either sampler can check the other. Needs the optional package nutpie;
keeps its chain in memory only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from bayesid.errors import SampleError
from bayesid.sample.density import Density, Laplace
from bayesid.sample.gate import Gate, Limits, judge
from bayesid.sample.posterior import Posterior

Array = np.ndarray
MOST_DIVERGENT = 0.01  # share of draws after which a chain is not called converged


class SlopedDensity(Density, Protocol):
    """A density that knows its gradient, in sampling coordinates."""

    def log_prob_slope(self, q: Array) -> tuple[float, Array]:
        """Log density of one point (k,) and its gradient (k,); -inf where it is zero or unknown."""
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
    limits: Limits = field(default_factory=lambda: Limits(tau_change=np.inf))


class _Impossible(ValueError):
    """Tells nutpie that a point has no density: the trajectory ends there."""

    is_recoverable = True


def sample_nuts(
    density: SlopedDensity,
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

    def begin(seed: int) -> Array:
        rng = np.random.default_rng([options.seed, seed])
        for shrink in 0.8 ** np.arange(40):
            x = options.spread * shrink * rng.standard_normal(k)
            if np.isfinite(density.log_prob_slope(laplace.points(x))[0]):
                return x
        return np.zeros(k)

    model = from_pyfunc(
        k, lambda: slope, _expand, [np.dtype(np.float64)], [(k,)], ["x"], make_initial_point_fn=begin
    )
    clock = time.process_time()
    try:
        trace = nutpie.sample(
            model, draws=options.draws, tune=options.tune, chains=options.chains, cores=threads,
            seed=options.seed, save_warmup=False, progress_bar=False, target_accept=options.accept,
            maxdepth=options.depth,
        )  # fmt: skip
    except (RuntimeError, ValueError) as error:
        raise SampleError(f"nutpie stopped: {str(error).splitlines()[0]}") from None
    seconds = time.process_time() - clock
    x = np.asarray(trace["posterior"]["x"].values)
    divergent = np.asarray(trace["sample_stats"]["diverging"].values)
    q = laplace.points(x)
    draws = np.asarray(density.natural(q))[:, :, None, :]
    gate = _with_divergences(judge(draws, density.unknowns.names, 1, options.limits), divergent)
    log_prob = np.stack([density.log_prob(chain) for chain in q])[:, :, None]
    made_with = {n: v for n, v in asdict(options).items() if n not in ("limits", "seed")}
    return Posterior(
        unknowns=density.unknowns, draws=draws, log_prob=log_prob, log_prior=np.full(log_prob.shape, np.nan),
        gate=gate, mode=density.natural(laplace.mode), mode_sd=_natural_sd(density, laplace),
        acceptance=np.full(options.chains, options.accept), thin=1, discarded=options.tune,
        counts={**counts, "divergent draws": int(divergent.sum())}, seconds=seconds, seed=options.seed,
        digest=density.digest, settings={"sampler": "nutpie NUTS", **made_with},
    )  # fmt: skip


def _nutpie() -> tuple[Any, Callable[..., Any]]:
    try:
        import nutpie
        from nutpie.compiled_pyfunc import from_pyfunc
    except ImportError:
        raise SampleError("the gradient sampler needs nutpie: pip install 'bayesid[nuts]'") from None
    return nutpie, from_pyfunc


def _expand(*seeds: int) -> Callable[[Array], dict[str, Array]]:
    return lambda x: {"x": np.array(x, dtype=np.float64)}


def _with_divergences(gate: Gate, divergent: Array) -> Gate:
    share = float(divergent.mean())
    if share <= MOST_DIVERGENT:
        return gate
    reason = (
        f"{100 * share:.1f} % of the draws met a region that the steps cannot follow (a bound, or a vehicle "
        "that diverges); the tails there are not explored"
    )
    return replace(gate, converged=False, reasons=(*gate.reasons, reason))


def _natural_sd(density: Density, laplace: Laplace) -> Array:
    """(k,) Laplace sd in natural units, by central differences of half an sd."""
    sd = np.sqrt(np.diag(laplace.covariance))
    step = 0.5 * np.diag(sd)
    ends = density.natural(laplace.mode + step) - density.natural(laplace.mode - step)
    return np.abs(np.diag(ends))
