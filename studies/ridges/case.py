"""One case: a truth from the prior, runs of it, and what four ways of asking say of X_vv, X_vr and X_rr.

Takes a set of runs, a prior and a seed. Gives plain numbers. Does not judge.
"""

from __future__ import annotations

import importlib.util
import math
import time
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.analysis.identifiability import information
from bayesid.analysis.identifiability.posterior_ridges import ridges
from bayesid.analysis.identifiability.profile import profiles
from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError
from bayesid.estimation.output_error import FitOptions, FitProblem, coefficient_set, fit, trial_problem
from bayesid.estimation.sampling import SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.priors import draw_params
from bayesid.manoeuvres import Manoeuvre, chirp, spiral, turn, zigzag
from bayesid.model.params import ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.report.sample_first_screen import group_words
from bayesid.simulation.virtual_trial import virtual_trial

Array = np.ndarray
VEHICLE, RPM, DT, DEG = "generic_sub", 90.0, 2.0, math.pi / 180
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.5 * DEG, "u": 0.02}
TRIPLE = ("X_vv", "X_vr", "X_rr")
OTHERS = ("Y_v", "Y_r", "Y_dr", "N_v", "N_r", "N_dr")
OTHERS_SD = 0.1  # relative prior sd of what is not asked for
SETS = ("steady turn", "spiral", "three manoeuvres")
PRIORS = (0.1, 0.5, 1.0)
MOST_DRAWN = 50  # truths drawn until the vehicle does not diverge
GRID = (-2.0, -1.0, 1.0, 2.0)


def manoeuvres(name: str) -> dict[str, Manoeuvre]:
    """Runs of a set."""
    circle: dict[str, Manoeuvre] = {"turn": turn(20 * DEG, RPM, approach=10.0, duration=400.0, dt=DT)}
    if name == "steady turn":
        return circle
    if name == "spiral":
        return {"spiral": spiral(RPM, end=400.0, dt=DT)}
    weave = zigzag(20 * DEG, 20 * DEG, RPM, approach=10.0, duration=300.0, dt=DT)
    rich = chirp(25 * DEG, 1 / 150, 1 / 20, RPM, 300.0, DT, (1.0, 0.7, 1.1, 0.8))
    return {**circle, "zig-zag": weave, "swept rudder, stepped shaft": rich}


def prior_of(model: Model, prior_sd: float) -> ParameterSet:
    """Normal about the vehicle file's values: `prior_sd` for the three, `OTHERS_SD` for the others."""
    wide = 8 * max(prior_sd, OTHERS_SD)
    entries = coefficient_set(model, (*TRIPLE, *OTHERS), relative_bounds=wide, use_prior=False)
    spread = dict.fromkeys(TRIPLE, prior_sd) | dict.fromkeys(OTHERS, OTHERS_SD)
    return ParameterSet(
        tuple(replace(p, prior=Prior("normal", p.start, spread[p.name] * p.scale)) for p in entries)
    )


def posed(name: str, prior_sd: float, seed: int) -> tuple[FitProblem, Array, int]:
    """The problem of one truth drawn from the prior, that truth, and how many had to be drawn."""
    model = build_model(load_vehicle(VEHICLE), 3)
    # truths of their own for every set and prior: what runs leave open would else go wrong together
    rng = np.random.default_rng([1810, seed, SETS.index(name), PRIORS.index(prior_sd)])
    params = prior_of(model, prior_sd)
    for drawn in range(1, MOST_DRAWN + 1):
        truth = draw_params(params, 1, rng)[0]
        par = params.place(np.array(model.nominal), model.index, truth)
        try:
            trial = virtual_trial(
                model, par, manoeuvres(name), title=name, vehicle_ref=VEHICLE, noise=NOISE, rng=rng
            )
            return trial_problem(model, trial, params, channels=tuple(NOISE), threads=1), truth, drawn
        except BayesidError:
            if drawn == MOST_DRAWN:
                raise
    raise AssertionError


def asked(name: str, prior_sd: float, seed: int, sampled: bool) -> dict[str, Any]:
    """What the ways of asking say: Laplace and profile always, both samplers where `sampled`."""
    begin = time.process_time()
    problem, truth, drawn = posed(name, prior_sd, seed)
    found = fit(problem, FitOptions(seed=seed))
    info = information(problem, found.z)
    names = list(problem.params.names)
    at = [names.index(n) for n in TRIPLE]
    prior = np.diag(np.array([p.prior.spread for p in problem.params if p.prior is not None]) ** 2)
    unit = np.sqrt(np.diag(prior))
    laplace = info.covariance * np.outer(info.unit, info.unit)
    spread = np.sqrt(np.diag(laplace))
    curves = profiles(problem, info, found.z, TRIPLE, GRID)
    widths = [float(np.diff(c.interval())[0]) / (2 * 1.6449) for c in curves]
    k = len(names)
    said: dict[str, Any] = {
        "Laplace": _said(names, found.z[:k], laplace, prior, at),
        "profile": {
            "left": [w * spread[i] / unit[i] for w, i in zip(widths, at, strict=True)],
            "data_share": [c.data_share for c in curves],
        },
    }
    record: dict[str, Any] = {
        "set": name, "prior": prior_sd, "seed": seed, "vehicles_drawn": drawn,
        "fit_converged": found.converged,
        "names": names, "said": said,
    }  # fmt: skip
    if sampled:
        density = trial_density(problem, found.z, SamplingSettings(memory="ignore"), NOISE)
        options = SamplerOptions(first=50, max_steps=6000, seed=seed, weights={"gaussian": 0.9, "de": 0.1})
        by_ensemble = sample(density, density.laplace, options)
        chains = {"emcee": by_ensemble}
        if importlib.util.find_spec("nutpie") is not None:
            from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts
            from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity

            few = NutsOptions(tune=200, draws=400, accept=0.9, seed=seed)
            chains["NUTS"] = sample_nuts(GradientTrialDensity(density), density.laplace, few)
        for sampler, chain in chains.items():
            draws = chain.params
            some = np.cov(draws, rowvar=False)
            said[sampler] = _said(names, draws.mean(axis=0), some, prior, at, draws, laplace)
            said[sampler] |= {
                "converged": chain.converged, "rhat": float(np.nanmax(chain.convergence.rhat)),
                "ess": float(chain.convergence.ess_bulk.min()), "ess_per_second": chain.ess_per_second,
            }  # fmt: skip
        picked = by_ensemble.params[:: max(1, len(by_ensemble.params) // 1500)][:1500]
        record["draws"] = ((picked[:, at] - problem.start[at]) / unit[at]).round(4)
    first = said["emcee" if sampled else "Laplace"]
    record["combinations"] = first["combinations"]
    vectors = np.array([c["vector"] for c in first["combinations"]])
    for who in said.values():
        if "covariance" in who:
            own = np.array(who["covariance"])
            who["along"] = [float(np.sqrt(v @ own @ v)) for v in vectors]
    mean = np.array(first["mean"])
    record["z"] = [
        float(v @ ((truth[at] - mean) / unit[at]) / w) for v, w in zip(vectors, first["along"], strict=True)
    ]
    record["truth"] = ((truth[at] - problem.start[at]) / unit[at]).tolist()
    record["cpu_seconds"] = time.process_time() - begin
    return record


def _said(
    names: list[str], mean: Array, covariance: Array, prior: Array, at: list[int],
    draws: Array | None = None, laplace: Array | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Share left of each of the three and of their combinations, and the sentence of `bayesid sample`."""
    if draws is None:
        draws = np.random.default_rng(0).multivariate_normal(mean, covariance, 4000)
    found = ridges(names, draws, prior, laplace)
    group = next(g for g in found.groups if set(g.names) == set(TRIPLE))
    unit = np.sqrt(np.diag(prior))[at]
    part = covariance[np.ix_(at, at)] / np.outer(unit, unit)
    order = [group.names.index(n) for n in TRIPLE]
    return {
        "sentence": group_words(group),
        "left": np.sqrt(np.diag(part)).tolist(),
        "combinations": [
            {"name": c.name, "vector": c.vector[order].tolist(), "left": c.left, "status": c.status}
            for c in group.combinations
        ],
        "covariance": part.tolist(),
        "mean": mean[at].tolist(),
    }
