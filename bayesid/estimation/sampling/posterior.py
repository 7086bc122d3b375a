"""A sampled posterior: draws of independent ensembles with everything needed to trust or distrust them.

Frozen data, stored as posterior.nc for ArviZ and read back. Does not sample, draw or choose words.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.sampling.convergence import ConvergenceCheck
from bayesid.estimation.sampling.density import Unknowns
from bayesid.files import json_text

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Posterior:
    """Draws and their verdict.

    Attributes
    ----------
    unknowns : names, bounds, priors
    draws : (ensembles, steps, walkers, k) natural units (SI), warm-up left out
    log_prob : (ensembles, steps, walkers) log density by the sampling coordinates, up to a constant
    log_prior : the same of the prior alone (by natural units); nan where the density does not tell
    convergence : converged or why not
    mode, mode_sd : (k,) natural units: where the Laplace approximation stands, and its sd
    acceptance : (ensembles,) share of accepted proposals
    thin : sampler steps per stored one
    discarded : sampler steps left out as warm-up, per ensemble
    counts : evaluations "all", "out of bounds", "diverged" (not finite: counted as impossible)
    seconds : processor time of the ensembles, warm-up included
    seed, digest, settings : what the chain was made with
    """

    unknowns: Unknowns
    draws: Array
    log_prob: Array
    log_prior: Array
    convergence: ConvergenceCheck
    mode: Array
    mode_sd: Array
    acceptance: Array
    thin: int
    discarded: int
    counts: Mapping[str, int]
    seconds: float
    seed: int
    digest: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    # ---- access ----
    @property
    def names(self) -> tuple[str, ...]:
        return self.unknowns.names

    @property
    def n_params(self) -> int:
        """Parameters of the model; they come first."""
        return self.unknowns.n_params

    @property
    def prior_mean(self) -> Array:
        return self.unknowns.prior_mean

    @property
    def prior_sd(self) -> Array:
        return self.unknowns.prior_sd

    @property
    def converged(self) -> bool:
        """Whether the convergence check was passed; below it no interval is final."""
        return self.convergence.converged

    @property
    def steps(self) -> int:
        """Kept sampler steps per ensemble."""
        return self.draws.shape[1] * self.thin

    @cached_property
    def flat(self) -> Array:
        """(n, k) all kept draws, step by step."""
        return np.moveaxis(self.draws, 0, 2).reshape(-1, self.draws.shape[3])

    @property
    def params(self) -> Array:
        """(n, n_params) draws of the model's parameters, SI; order as `names`."""
        return self.flat[:, : self.n_params]

    def column(self, name: str) -> Array:
        """(n,) draws of one unknown.

        Raises
        ------
        SampleError
            for a name that was not sampled
        """
        return self.flat[:, self._index(name)]

    def _index(self, name: str) -> int:
        try:
            return self.names.index(name)
        except ValueError:
            raise SampleError(f"{name} was not sampled; there are {', '.join(self.names)}") from None

    @cached_property
    def mean(self) -> Array:
        return np.asarray(self.flat.mean(axis=0))

    @cached_property
    def covariance(self) -> Array:
        """(k, k)"""
        return np.atleast_2d(np.cov(self.flat, rowvar=False))

    @property
    def sd(self) -> Array:
        return np.sqrt(np.diag(self.covariance))

    def interval(self, level: float = 0.9) -> Array:
        """(k, 2) central credible intervals."""
        edge = 0.5 * (1 - level)
        return np.quantile(self.flat, [edge, 1 - edge], axis=0).T

    def subset(self, count: int, rng: np.random.Generator) -> Array:
        """(count, k) draws at random, without replacement as long as there are enough."""
        return self.flat[rng.choice(self.flat.shape[0], count, replace=count > self.flat.shape[0])]

    @property
    def ess_per_second(self) -> float:
        """Smallest bulk effective size over all processor seconds."""
        return float(self.convergence.ess_bulk.min()) / max(self.seconds, 1e-9)

    def summary(self) -> dict[str, Any]:
        """Numbers for results.json: convergence, and mean, sd, 90 % interval of every unknown."""
        g, interval = self.convergence, self.interval(0.9)
        return {
            "converged": g.converged, "reasons": g.reasons, "rhat_max": float(np.nanmax(g.rhat)),
            "ess_bulk_min": float(g.ess_bulk.min()), "ess_tail_min": float(g.ess_tail.min()),
            "tau_max": float(g.tau.max()), "steps_in_tau": g.n_tau, "tau_change": g.tau_change,
            "ensembles": self.draws.shape[0], "walkers": self.draws.shape[2], "steps": self.steps,
            "discarded": self.discarded, "thin": self.thin, "acceptance": self.acceptance,
            "evaluations": dict(self.counts), "cpu_seconds": self.seconds,
            "ess_per_cpu_second": self.ess_per_second, "seed": self.seed, "digest": self.digest,
            "settings": dict(self.settings),
            "unknowns": {
                n: {
                    "mean": float(self.mean[i]), "sd": float(self.sd[i]), "low90": float(interval[i, 0]),
                    "high90": float(interval[i, 1]), "prior_sd": float(self.prior_sd[i]),
                    "rhat": float(g.rhat[i]), "ess_bulk": float(g.ess_bulk[i]),
                    "ess_tail": float(g.ess_tail[i]), "tau": float(g.tau[i]),
                }
                for i, n in enumerate(self.names)
            },
        }  # fmt: skip

    # ---- storing ----
    def to_netcdf(
        self, path: str | os.PathLike[str], groups: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> Path:  # fmt: skip
        """Write for ArviZ: groups `posterior` and `sample_stats`, and `groups` (xarray datasets) beside them.

        A chain is an ensemble. Its draws are the walkers of the first half of the steps, one after the other,
        then those of the second half: so `arviz.rhat` compares what the convergence check compares, and
        `arviz.ess` meets the memory of each walker. Coordinates `step` and `walker` say which is which.
        All else is in the attributes. The file is written whole or not at all. `units`: name -> unit of every
        unknown, as attribute `units` of its variable.
        """
        import h5py  # noqa: F401  (the engine; named here so that a missing one is told before work is lost)
        import xarray

        e, n, w, _ = self.draws.shape
        step, walker = _order(n, w)
        coords = {
            "chain": np.arange(e), "draw": np.arange(n * w), "step": ("draw", step),
            "walker": ("draw", walker),
        }  # fmt: skip

        def laid(values: Array) -> Any:
            return ("chain", "draw"), np.ascontiguousarray(values[:, step, walker])

        rest = {
            "unknowns": asdict(self.unknowns), "convergence": asdict(self.convergence), "mode": self.mode,
            "mode_sd": self.mode_sd, "acceptance": self.acceptance, "thin": self.thin,
            "discarded": self.discarded, "counts": dict(self.counts), "seconds": self.seconds,
            "seed": self.seed, "digest": self.digest, "settings": dict(self.settings),
        }  # fmt: skip
        attributes = {"created_by": "bayesid", "bayesid": json_text(rest)}
        draws = {
            stored_name(name): (*laid(self.draws[..., i]), {"units": units[name]} if units else {})
            for i, name in enumerate(self.names)
        }
        pure = {"units": "1"}
        stats = {"lp": (*laid(self.log_prob), pure), "log_prior": (*laid(self.log_prior), pure)}
        written = {
            "posterior": xarray.Dataset(draws, coords, attributes),
            "sample_stats": xarray.Dataset(stats, coords, attributes),
            **(groups or {}),
        }
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = target.with_name(f".{target.name}.part")
        try:
            mode: Literal["w", "a"] = "w"
            for group, data in written.items():
                zipped = {name: {"zlib": True, "complevel": 1} for name in data.data_vars}
                data.to_netcdf(temporary, mode=mode, group=group, engine="h5netcdf", encoding=zipped)
                mode = "a"
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)
        return target


def _order(steps: int, walkers: int) -> tuple[Array, Array]:
    """Step and walker of every draw of a chain as it is stored."""
    halves = (np.arange(steps // 2), np.arange(steps // 2, steps))
    step = np.concatenate([np.tile(half, walkers) for half in halves])
    walker = np.concatenate([np.repeat(np.arange(walkers), half.size) for half in halves])
    return step, walker


def load_posterior(path: str | os.PathLike[str]) -> Posterior:
    """Read what `Posterior.to_netcdf` wrote.

    Raises
    ------
    SampleError
        if the file is missing or was not written by bayesid
    """
    import xarray

    target = Path(path)
    try:
        with xarray.open_dataset(target, group="posterior", engine="h5netcdf") as data:
            rest = json.loads(data.attrs["bayesid"])
            order = data["step"].values, data["walker"].values
            names = rest["unknowns"]["names"]
            draws = np.stack([_folded(data[stored_name(n)].values, *order) for n in names], axis=-1)
        with xarray.open_dataset(target, group="sample_stats", engine="h5netcdf") as data:
            lp, prior = (_folded(data[n].values, *order) for n in ("lp", "log_prior"))
    except (OSError, KeyError, ValueError) as error:
        raise SampleError(f"{target.name}: not a posterior of bayesid ({type(error).__name__})") from None
    about, convergence = rest.pop("unknowns"), rest.pop("convergence")
    unknowns = Unknowns(
        tuple(about["names"]), about["n_params"],
        *(_array(about[n]) for n in ("low", "high", "prior_mean", "prior_sd", "file_scale")),
    )  # fmt: skip
    for name in ("rhat", "ess_bulk", "ess_tail", "tau"):
        convergence[name] = _array(convergence[name])
    convergence["reasons"], convergence["stuck"] = (
        tuple(convergence["reasons"]),
        tuple((i, j) for i, j in convergence["stuck"]),
    )
    for name in ("mode", "mode_sd", "acceptance"):
        rest[name] = _array(rest[name])
    return Posterior(unknowns, draws, lp, prior, ConvergenceCheck(**convergence), **rest)


def _folded(values: Array, step: Array, walker: Array) -> Array:
    """(ensembles, steps, walkers) of (ensembles, draws) as stored."""
    out = np.empty((len(values), int(step.max()) + 1, int(walker.max()) + 1))
    out[:, step, walker] = values
    return out


def stored_name(name: str) -> str:
    """Name of a variable in the file, where a slash would open a group."""
    return name.replace("/", "∕")


def _array(values: Sequence[Any]) -> Array:
    return np.array([np.nan if v is None else float(v) for v in values], dtype=float)
