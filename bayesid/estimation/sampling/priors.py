"""Priors of parameters and noise as densities of many points at once, and draws from them.

Takes a `ParameterSet`, or a noise level as stated. Normalised but for the cut at the bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.special import gammaln

from bayesid.errors import SampleError
from bayesid.model.params import ParameterSet, Prior

Array = np.ndarray
LOG_2PI = float(np.log(2 * np.pi))
DRAW_TRIES = 10_000


@dataclass(frozen=True, eq=False)
class ParameterPrior:
    """Prior density of a parameter set, laid out for many points."""

    params: ParameterSet

    def __post_init__(self) -> None:
        p, free = self.params, self.params.free
        joint = set() if p.joint is None else set(p.joint.names)
        kinds = [
            "joint" if e.name in joint
            else "uniform" if e.prior is None or not np.isfinite(e.prior.spread) else e.prior.kind
            for e in free
        ]  # fmt: skip
        found: dict[str, Any] = {"low": p.vector("low"), "high": p.vector("high"), "const": 0.0}
        for kind in ("normal", "lognormal"):
            at = np.array([i for i, k in enumerate(kinds) if k == kind], dtype=np.int64)
            chosen = [q for i in at if (q := free[i].prior) is not None]
            found[kind] = at
            found[f"{kind}_centre"] = np.array([q.centre for q in chosen], dtype=float)
            found[f"{kind}_spread"] = np.array([q.spread for q in chosen], dtype=float)
            found["const"] -= float(np.sum(np.log(found[f"{kind}_spread"]) + 0.5 * LOG_2PI))
        room = (found["high"] - found["low"])[[k == "uniform" for k in kinds]]
        found["const"] -= float(np.sum(np.log(room[np.isfinite(room)])))
        if p.joint is not None:
            found["joint"] = np.array([p.names.index(n) for n in p.joint.names], dtype=np.int64)
            white = p.joint.whitener
            found["const"] += 0.5 * float(np.linalg.slogdet(white @ white.T)[1]) - 0.5 * LOG_2PI * len(white)
        object.__setattr__(self, "_laid", found)

    def log(self, x: Array) -> Array:
        """(b,) log density of (b, k) points; -inf outside the bounds."""
        f: dict[str, Any] = self._laid  # type: ignore[attr-defined]
        z = (x[:, f["normal"]] - f["normal_centre"]) / f["normal_spread"]
        out = f["const"] - 0.5 * np.einsum("bi,bi->b", z, z)
        if f["lognormal"].size:
            values = x[:, f["lognormal"]]
            ratio = np.maximum(values / f["lognormal_centre"], 1e-300)
            z = np.log(ratio) / f["lognormal_spread"]
            out -= np.sum(0.5 * z * z + np.log(np.maximum(np.abs(values), 1e-300)), axis=1)
            out[np.any(values / f["lognormal_centre"] <= 0, axis=1)] = -np.inf
        if self.params.joint is not None:
            white = (x[:, f["joint"]] - self.params.joint.mean) @ self.params.joint.whitener.T
            out -= 0.5 * np.sum(white**2, axis=1)
        out[np.any((x < f["low"]) | (x > f["high"]), axis=1)] = -np.inf
        return np.asarray(out)


def with_prior(params: ParameterSet, relative_sd: float) -> ParameterSet:
    """The set with a normal prior of this share of its scale for every free parameter that has none."""
    joint = set() if params.joint is None else set(params.joint.names)
    bare = [p for p in params.free if p.prior is None and p.name not in joint]
    for p in bare:
        params = params.changed([p.name], prior=Prior("normal", p.start, relative_sd * p.scale))
    return params


def prior_moments(params: ParameterSet) -> tuple[Array, Array]:
    """(k,) means and standard deviations; of a uniform prior without bounds start and inf."""
    mean, sd = params.start.copy(), np.full(len(params.names), np.inf)
    for i, p in enumerate(params.free):
        if p.prior is not None and p.prior.kind != "uniform" and np.isfinite(p.prior.spread):
            s = p.prior.spread
            mean[i], sd[i] = p.prior.centre, s
            if p.prior.kind == "lognormal":
                mean[i] = p.prior.centre * np.exp(0.5 * s * s)
                sd[i] = abs(mean[i]) * np.sqrt(np.expm1(s * s))
        elif np.isfinite(p.high - p.low):
            mean[i], sd[i] = 0.5 * (p.low + p.high), (p.high - p.low) / np.sqrt(12.0)
    if params.joint is not None:
        where = [params.names.index(n) for n in params.joint.names]
        mean[where], sd[where] = params.joint.mean, np.sqrt(np.diag(params.joint.covariance))
    return mean, sd


def draw_params(params: ParameterSet, count: int, rng: np.random.Generator) -> Array:
    """(count, k) draws from the prior.

    Raises
    ------
    SampleError
        a parameter without prior and bounds, or bounds that hold almost none of the prior
    """
    low, high = params.vector("low"), params.vector("high")
    loose = [p.name for p in params.free if p.prior is None and not np.isfinite(p.high - p.low)]
    joint = set() if params.joint is None else set(params.joint.names)
    if set(loose) - joint:
        raise SampleError(f"no draws from the prior: {', '.join(loose)} have neither a prior nor bounds")
    found: list[Array] = []
    for _ in range(DRAW_TRIES):
        x = np.empty((count, len(params.free)))
        for i, p in enumerate(params.free):
            if p.prior is None or p.prior.kind == "uniform" or not np.isfinite(p.prior.spread):
                x[:, i] = rng.uniform(low[i], high[i], count) if p.name not in joint else p.start
            elif p.prior.kind == "normal":
                x[:, i] = p.prior.centre + p.prior.spread * rng.standard_normal(count)
            else:
                x[:, i] = p.prior.centre * np.exp(p.prior.spread * rng.standard_normal(count))
        if params.joint is not None:
            where = [params.names.index(n) for n in params.joint.names]
            root = np.linalg.cholesky(params.joint.covariance + 0.0)
            x[:, where] = params.joint.mean + rng.standard_normal((count, len(where))) @ root.T
        found.extend(x[np.all((x >= low) & (x <= high), axis=1)])
        if len(found) >= count:
            return np.array(found[:count])
    raise SampleError("no draws from the prior: the bounds hold almost none of it")


@dataclass(frozen=True, eq=False)
class NoisePrior:
    """Prior of the noise of every channel.

    kind : "inverse_gamma" of the variance, worth `weight` readings of rms `scale`: heavy tails, so that a
        channel the model misses is not forced to its stated noise; or "half_normal" of the sd
    scale : (c,) stated or estimated noise [SI]
    reach : half-normal scale in units of `scale`
    """

    kind: Literal["inverse_gamma", "half_normal"]
    scale: Array
    weight: float = 4.0
    reach: float = 3.0

    def log(self, sigma: Array) -> Array:
        """(b,) log density of (b, c) noise levels, by the levels."""
        if self.kind == "half_normal":
            s = self.reach * self.scale
            each = -0.5 * (sigma / s) ** 2 - np.log(s) + 0.5 * np.log(2 / np.pi)
        else:
            a, b = 0.5 * self.weight, 0.5 * self.weight * self.scale**2
            each = a * np.log(b) - gammaln(a) - (2 * a + 1) * np.log(sigma) - b / sigma**2 + np.log(2.0)
        return np.asarray(each.sum(axis=1))

    def moments(self) -> tuple[Array, Array]:
        """(c,) mean and sd of the level; sd inf where it has none."""
        if self.kind == "half_normal":
            s = self.reach * self.scale
            return s * np.sqrt(2 / np.pi), s * np.sqrt(1 - 2 / np.pi)
        a, b = 0.5 * self.weight, 0.5 * self.weight * self.scale**2
        mean = np.sqrt(b) * np.exp(gammaln(a - 0.5) - gammaln(a)) if a > 0.5 else np.full(b.shape, np.inf)
        return mean, np.sqrt(b / (a - 1) - mean**2) if a > 1 else np.full(b.shape, np.inf)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """(count, c)"""
        if self.kind == "half_normal":
            return np.asarray(self.reach * self.scale * np.abs(rng.standard_normal((count, self.scale.size))))
        a, b = 0.5 * self.weight, 0.5 * self.weight * self.scale**2
        return np.asarray(np.sqrt(b / rng.gamma(a, size=(count, self.scale.size))))

    def mode_of(self, squares: Array, count: Array) -> Array:
        """(c,) level that maximises the density by its logarithm, given sums of squares of residuals."""
        if self.kind == "inverse_gamma":
            return np.asarray(np.sqrt((squares + self.weight * self.scale**2) / (count + self.weight)))
        s2 = (self.reach * self.scale) ** 2
        n = count - 1.0
        return np.asarray(np.sqrt(0.5 * (np.sqrt((n * s2) ** 2 + 4 * s2 * squares) - n * s2)))
