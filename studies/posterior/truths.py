"""One truth drawn from the prior: what a posterior fixes of it, and whether it lies where the posterior says.

Takes a set of runs, the width of the prior, a seed. Gives plain numbers, by Laplace, by what a fit tells,
which counts that ridges bend, and, where asked, from draws of emcee and NUTS. Does not judge.
"""

from __future__ import annotations

import importlib.util
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.design.virtual_refit import Refit, refit
from bayesid.analysis.identifiability import full_vectors, predict
from bayesid.equations.model import build_model
from bayesid.errors import ModelError, SampleError
from bayesid.estimation.likelihood.nonlinear_covariance import nonlinear_covariance
from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.estimation.sampling import Posterior, SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.priors import draw_params
from bayesid.executor import HERE, Executor
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.simulation import plan_run, run_manoeuvre, simulate, steady_start
from studies.posterior.problem import NOISE, PRIORS, RPM, SETS, VEHICLE, Posed, manoeuvres, posed, prior_of

Array = np.ndarray
FIT = "fit"  # Laplace with the covariance of ridges that bend
DT = 2.0  # s: half as many samples as the single cases have
DRAWS = 200  # of predictions
# sampled of three runs, dearer; under the widest prior the search ends elsewhere now and then
THREE_RUNS = {0.1: 1, 0.5: 1, 1.0: 3}
STARTS = 2  # of the fit, besides the vehicle file
KEPT, PICTURED = 1200, 3  # draws kept for a picture, of so many truths
STEPS = 1000  # of emcee at most; whether that was enough is told, and the draws count all the same
PANELS = {"X": ("X_vv", "X_vr", "X_rr"), "N": ("N_v|v|", "N_|v|r", "N_r|r|")}


def every(
    out: Path,
    truths: int,
    sampled: int,
    seed: int,
    progress: Progress,
    executor: Executor = HERE,
    quick: bool = False,
) -> list[dict[str, Any]]:
    """Every truth under every prior; the first `sampled` by emcee (`THREE_RUNS` of them with three runs), the
    very first spiral by NUTS too. Kept in OUT/truths."""
    cases = []
    for name in list(SETS)[: 1 if quick else None]:
        for prior in PRIORS[: 1 if quick else None]:
            few = sampled if name == "spiral" else min(sampled, THREE_RUNS[prior])
            seeds = range(seed, seed + truths)
            work = partial(_work, name, prior, seed, few)
            key = f"{name.replace(' ', '-')}-{prior:g}"
            with progress.stage(f"{name}, prior {100 * prior:g} %", len(seeds)) as stage:
                cases += run_seeds(work, seeds, out / "truths", key, executor, stage.step)
    return cases


def _work(name: str, prior: float, first: int, few: int, seed: int) -> dict[str, Any]:
    samplers = (
        ("emcee", *(("NUTS",) if seed == first and name == "spiral" else ())) if seed < first + few else ()
    )
    return asked(name, prior, seed, samplers, seed < first + PICTURED)


def asked(name: str, prior: float, seed: int, samplers: tuple[str, ...], picture: bool) -> dict[str, Any]:
    """One truth of one set of runs under one prior."""
    begin = time.process_time()
    model = build_model(load_vehicle(VEHICLE), 3)
    runs = manoeuvres(dt=DT)
    params = prior_of(model, model.coefficients, prior)
    # truths of their own for every set and prior: what runs leave open would else go wrong together
    rng = np.random.default_rng([1811, seed, list(SETS).index(name), PRIORS.index(prior)])
    case = posed(model, {n: runs[n] for n in SETS[name]}, params, rng)
    found, starts = best_fit(case, rng)
    k = len(params.names)
    unit = case.known.sd
    covariance = found.covariance
    root = np.linalg.cholesky(covariance + 1e-14 * np.eye(k))
    some = (found.values - case.known.mean) / unit + rng.standard_normal((4000, k)) @ root.T
    told = nonlinear_covariance(case.problem, found.unknowns, covariance * np.outer(unit, unit), seed)
    bent = np.linalg.cholesky(told.covariance / np.outer(unit, unit) + 1e-14 * np.eye(k))
    own = np.random.default_rng([1812, seed])  # of its own: all else is as it was without
    wide = (found.values - case.known.mean) / unit + own.standard_normal((4000, k)) @ bent.T
    said: dict[str, Any] = {"Laplace": _said(case, some, name, rng), FIT: _said(case, wide, name, own)}
    drawn: dict[str, Array] = {"Laplace": some}
    refused: list[str] = []
    if samplers:
        settings = SamplingSettings(memory="ignore", noise="fixed")
        density = trial_density(case.problem, found.unknowns, settings, NOISE)
        for sampler in samplers:
            if sampler == "NUTS" and importlib.util.find_spec("nutpie") is None:
                continue
            try:
                chain = _chain(sampler, density, seed)
            except SampleError as error:
                refused.append(f"{sampler}: {error}")
                continue
            drawn[sampler] = (chain.params - case.known.mean) / unit
            said[sampler] = _said(case, drawn[sampler], name, rng) | {
                "converged": chain.converged, "rhat": float(np.nanmax(chain.convergence.rhat)),
                "seconds": chain.seconds,
            }  # fmt: skip
    record: dict[str, Any] = {
        "set": name, "prior": prior, "seed": seed, "vehicles_drawn": case.drawn,
        "converged": found.converged, "starts": starts, "above_truth": found.cost - at_truth(case),
        "names": list(params.names), "said": said, "refused": refused,
    }  # fmt: skip
    if picture:
        shown = drawn.get("emcee", some)
        step = max(1, len(shown) // KEPT)
        where = {n: [params.names.index(c) for c in names] for n, names in PANELS.items()}
        xi = (case.truth - case.known.mean) / unit
        record["picture"] = {
            n: {"draws": shown[::step][:KEPT, at].round(3), "truth": xi[at]} for n, at in where.items()
        }
    record["cpu_seconds"] = time.process_time() - begin
    return record


def best_fit(case: Posed, rng: np.random.Generator) -> tuple[Refit, list[float]]:
    """The fit of least cost, from the vehicle file and from vehicles of the prior; the costs of all.

    Under wide priors a search from one point alone ends in another valley now and then.
    """
    fits = [refit(case.problem, case.known, iterations=80)]
    for values in draw_params(case.problem.params, STARTS, rng):
        z = np.array(case.problem.start)
        z[: len(values)] = values
        with suppress(ModelError, np.linalg.LinAlgError):
            fits.append(refit(case.problem, case.known, iterations=80, start=z))
    return min(fits, key=lambda f: f.cost), [f.cost for f in fits]


def at_truth(case: Posed) -> float:
    """Least cost that a search from the truth finds."""
    z = np.array(case.problem.start)
    z[: len(case.truth)] = case.truth
    return refit(case.problem, case.known, iterations=80, start=z).cost


def _chain(sampler: str, density: Any, seed: int) -> Posterior:
    if sampler == "NUTS":
        from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts
        from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity

        few = NutsOptions(tune=200, draws=250, accept=0.9, seed=seed)
        return sample_nuts(GradientTrialDensity(density), density.laplace, few)
    options = SamplerOptions(first=50, max_steps=STEPS, seed=seed, weights={"gaussian": 0.9, "de": 0.1})
    return sample(density, density.laplace, options)


def _said(case: Posed, xi: Array, name: str, rng: np.random.Generator) -> dict[str, Any]:
    """What draws (m, k) in prior units leave, where the truth lies among them, and what they predict."""
    truth = (case.truth - case.known.mean) / case.known.sd
    covariance = np.cov(xi, rowvar=False)
    values, vectors = np.linalg.eigh(covariance)
    along = xi @ vectors
    at = truth @ vectors
    names = case.problem.params.names
    sd = np.sqrt(np.diag(covariance))
    return {
        "left": dict(zip(names, sd.tolist(), strict=True)),
        "widths": np.sqrt(np.maximum(values, 0.0)),
        # vectors and means let another truth be read beside this posterior: the control
        "rank": np.mean(along < at, axis=0),
        "coefficient_rank": np.mean(xi < truth, axis=0),
        "z": (at - along.mean(axis=0)) / np.sqrt(np.maximum(values, 1e-300)),
        "control_rank": np.mean(along < _another(case, rng) @ vectors, axis=0),
        "predicted": _predicted(case, xi[rng.choice(len(xi), DRAWS, replace=False)], name),
    }


def _another(case: Posed, rng: np.random.Generator) -> Array:
    """Another vehicle of the prior, in prior units."""
    return rng.standard_normal(len(case.truth))


def _predicted(case: Posed, xi: Array, name: str) -> dict[str, Any]:
    """A zig-zag that was not executed (10/10 where the 20/20 was), from a known start."""
    model = case.problem.model
    runs = manoeuvres(dt=DT)
    manoeuvre = runs["zig-zag"] if name == "spiral" else _other_zigzag()
    x0 = steady_start(model, RPM)
    track, orders = run_manoeuvre(model, case.vehicle, manoeuvre, x0)
    plan = plan_run(model, track.t, orders)
    true = simulate(model, case.vehicle, plan, x0).states
    bands = predict(
        model, full_vectors(case.problem, case.known.mean + xi * case.known.sd), plan, x0, threads=1
    )
    last = {}
    for state in ("x", "y", "psi"):
        j = bands.states.index(state)
        low, high = bands.quantiles[0, -1, j], bands.quantiles[-1, -1, j]
        last[state] = bool(low <= true[-1, j] <= high)
    return {"radius": bands.end_spread, "holds_at_end": last, "diverged": bands.diverged}


def _other_zigzag() -> Any:
    from bayesid.manoeuvres import zigzag

    return zigzag(np.radians(10.0), np.radians(10.0), RPM, approach=10.0, duration=300.0, dt=DT)
