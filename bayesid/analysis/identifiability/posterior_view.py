"""What a sampled posterior shows, gathered once: priors, ridges, influence of the prior, predicted runs.

Takes a `Posterior`, its `TrialDensity` and the fit it started from. Gives a frozen `PosteriorView`. Does not
sample, draw figures or choose sentences.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.analysis.identifiability.derived import full_vectors
from bayesid.analysis.identifiability.posterior_ridges import Combination, Ridges, ridges
from bayesid.analysis.identifiability.prediction_bands import TrackBands, predict
from bayesid.analysis.identifiability.prior_influence import conflict, prior_sensitivity
from bayesid.estimation.sampling import Posterior, TrialDensity
from bayesid.simulation import simulate_batch

Array = np.ndarray
MOST_RUNS, DRAWS, TRACKS = 3, 200, 30


@dataclass(frozen=True)
class StatedPrior:
    """Prior of one unknown, or of one state at the start of all runs.

    Attributes
    ----------
    kind : "normal", "lognormal", "uniform", "joint normal", "inverse gamma" or "half normal"
    centre, sd : SI; sd is inf where the prior is flat
    source : who says so
    """

    name: str
    kind: str
    centre: float
    sd: float
    source: str


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One fitted run as draws of prior and posterior predict it, begun at the fitted start.

    Attributes
    ----------
    bands : "prior" and "posterior" -> quantiles
    tracks : the same -> (m, n, 2) x and y [m] of some draws
    readings : (n, 2) x and y [m]; nan where not read
    """

    name: str
    t: Array
    bands: dict[str, TrackBands]
    tracks: dict[str, Array]
    readings: Array


@dataclass(frozen=True, eq=False)
class PosteriorView:
    """What a posterior shows.

    Attributes
    ----------
    priors : of every sampled unknown, and of the start of runs
    ridges : combinations of the parameters
    estimate : (k,) the fit [SI]
    conflict, shift, share : (k,) see `prior_influence`
    runs : up to three, longest first
    """

    priors: tuple[StatedPrior, ...]
    ridges: Ridges
    estimate: Array
    conflict: Array
    shift: Array
    share: Array
    runs: tuple[PredictedRun, ...]

    def record(self) -> dict[str, Any]:
        """For JSON."""

        def told(c: Combination) -> dict[str, Any]:
            return {
                "name": c.name,
                "status": c.status,
                "sd_over_prior": c.left,
                "laplace": c.laplace,
                "vector": dict(zip(c.names, map(float, c.vector), strict=True)),
            }

        names = self.ridges.names
        return {
            "priors": [vars(p) for p in self.priors],
            "combinations": [told(c) for c in self.ridges.combinations],
            "groups": [
                {
                    "names": g.names, "family": g.family, "correlation": g.correlation,
                    "combinations": [told(c) for c in g.combinations],
                }
                for g in self.ridges.groups
            ],
            "prior_influence": {
                n: {"fit": f, "conflict": c, "shift_if_prior_doubled": m, "share_of_prior": s}
                for n, f, c, m, s in zip(
                    names, self.estimate, self.conflict, self.shift, self.share, strict=False
                )
            },
            "predicted": {
                r.name: {k: {"radius90": b.end_spread, "diverged": b.diverged} for k, b in r.bands.items()}
                for r in self.runs
            },
        }  # fmt: skip


def view_posterior(
    posterior: Posterior,
    density: TrialDensity,
    assumed: Collection[str] = (),
    seed: int = 0,
    stated_by: str = "vehicle file",
) -> PosteriorView:
    """Gather what a posterior shows.

    Parameters
    ----------
    assumed : parameters whose prior was assumed because nothing states one
    seed : of the draws that are simulated
    stated_by : who states the other priors
    """
    k = posterior.n_params
    problem = density.problem
    prior = np.diag(posterior.prior_sd[:k] ** 2)
    joint = problem.params.joint
    if joint is not None:
        where = [problem.params.names.index(n) for n in joint.names]
        prior[np.ix_(where, where)] = joint.covariance
    laplace = density.laplace.covariance[:k, :k]
    found = ridges(posterior.names[:k], posterior.params, prior, laplace)
    log_prior = np.moveaxis(posterior.log_prior, 0, 2).ravel()
    shift, share = prior_sensitivity(posterior.params, log_prior)
    apart = conflict(posterior.mean[:k], posterior.sd[:k], posterior.prior_mean[:k], posterior.prior_sd[:k])
    return PosteriorView(
        stated_priors(density, assumed, stated_by), found, np.array(density.z[:k]), apart, shift, share,
        _predicted(posterior, density, np.random.default_rng(seed)),
    )  # fmt: skip


def stated_priors(density: TrialDensity, assumed: Collection[str], stated_by: str) -> tuple[StatedPrior, ...]:
    """Priors of parameters, noise and starts, in the words of their kinds."""
    unknowns, params = density.unknowns, density.problem.params
    joint = set() if params.joint is None else set(params.joint.names)
    found = []
    for p, centre, sd in zip(params.free, unknowns.prior_mean, unknowns.prior_sd, strict=False):
        kind = "joint normal" if p.name in joint else "uniform" if p.prior is None else p.prior.kind
        source = "assumed, none is stated" if p.name in assumed else stated_by
        found.append(StatedPrior(p.name, kind, float(centre), float(sd), source))
    noise = density.noise_prior
    words = noise.kind.replace("_", " ")
    for i, name in enumerate(unknowns.names):
        if name.startswith("sigma:"):
            where = density.channels.index(name.removeprefix("sigma:"))
            source = f"noise stated or fitted, worth {noise.weight:g} readings"
            found.append(
                StatedPrior(name, words, float(noise.scale[where]), float(unknowns.prior_sd[i]), source)
            )
        elif name.startswith("phi:"):
            found.append(StatedPrior(name, "uniform", 0.5, float(unknowns.prior_sd[i]), "0 to 1"))
    starts: dict[str, list[float]] = {}
    for run in density.problem.runs:
        for state, sd in zip(run.initial, run.initial_sd, strict=True):
            starts.setdefault(state, []).append(float(sd))
    treated = {"marginal": "integrated out", "sampled": "sampled", "fixed": "held at the fit"}
    for state, sds in starts.items():
        source = f"about the first readings of each run; {treated[density.choice.initial]}"
        found.append(
            StatedPrior(f"{state} at the start", "normal", float("nan"), float(np.median(sds)), source)
        )
    return tuple(found)


def _predicted(
    posterior: Posterior, density: TrialDensity, rng: np.random.Generator
) -> tuple[PredictedRun, ...]:
    problem, k = density.problem, posterior.n_params
    model = problem.model
    sets = {
        "prior": density.prior_draws(DRAWS, rng)[:, :k],
        "posterior": posterior.subset(DRAWS, rng)[:, :k],
    }
    pars = {name: full_vectors(problem, draws) for name, draws in sets.items()}
    starts = problem.split(density.z)[1]
    order = sorted(range(len(starts)), key=lambda i: -float(np.ptp(problem.runs[i].plan.t)))[:MOST_RUNS]
    where = [model.states.index("x"), model.states.index("y")]
    found = []
    for i in order:
        run, x0 = problem.runs[i], starts[i]
        readings = np.full((run.plan.t.size, 2), np.nan)
        for j, channel in enumerate(("x", "y")):
            if channel in run.channels and len(run.readings) == run.plan.t.size:
                readings[:, j] = run.readings[:, run.channels.index(channel)]
        bands = {name: predict(model, p, run.plan, x0) for name, p in pars.items()}
        with np.errstate(all="ignore"):
            tracks = {
                name: simulate_batch(model, p[:TRACKS], run.plan, x0)[:, :, where] for name, p in pars.items()
            }
        found.append(PredictedRun(run.name, run.plan.t, bands, tracks, readings))
    return tuple(found)
