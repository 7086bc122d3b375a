"""What do a spiral's 22 coefficients look like as a posterior, and what do further runs and real logs add?

Usage: bayesid study posterior [--data FOLDER] [--out FOLDER] [--quick] [--seed N]. FOLDER holds
`kvlcc2_hsva` and `esso_osaka` (see studies/real_logs/run.py; the logs are not part of this project). Chains
are kept in OUT/chains, an interrupted one goes on; delete that folder to start afresh.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.identifiability import (
    Information,
    derived,
    full_vectors,
    identify,
    predict,
    with_assumed_priors,
)
from bayesid.equations.model import Model, build_model
from bayesid.errors import SampleError
from bayesid.estimation.output_error import FitOptions, FitProblem, fit
from bayesid.estimation.sampling import Posterior, SamplerOptions, load_posterior, sample
from bayesid.estimation.sampling.nuts import NutsOptions, continue_nuts, sample_nuts
from bayesid.estimation.sampling.priors import draw_params
from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity
from bayesid.estimation.sampling.trial_posterior import TrialDensity
from bayesid.estimation.sampling.trial_setup import trial_density
from bayesid.estimation.segments import fit_in_pieces
from bayesid.lock import lock_or_exit
from bayesid.manoeuvres import Manoeuvre
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.simulation import plan_run, run_manoeuvre, simulate, steady_start
from bayesid.trials import load_trial, thin
from studies.posterior.problem import KNOWN, NOISE, PRIOR, RPM, VEHICLE, manoeuvres, posed, prior_of
from studies.posterior.report import posterior_report
from studies.posterior.results import posterior_results
from studies.posterior.sampled_case import Sampled, Tracks
from studies.posterior.truths import every
from studies.real_logs import run as real_logs

ACCELERATION = ("X_udot", "Y_vdot", "Y_rdot", "N_vdot", "N_rdot")
DRAWS, ZIGZAGS = 400, 60
MORE, MOST_DRAWS = 200, 1500  # per chain of NUTS; a convergence check still shut then is reported so
TRUTHS, SAMPLED_TRUTHS = 50, 8  # drawn from the prior; the first of them sampled
LOGS = {"hsva": "kvlcc2_hsva", "esso": "esso_osaka"}
FAR = 50.0  # bounds of real ships, in sizes of a coefficient: their estimates go far, and a bound is a wall


def main(
    out: Path,
    data: Path | None,
    quick: bool,
    seed: int,
    by_laplace: tuple[str, ...] = (),
    most: int = MOST_DRAWS,
    truths: int = TRUTHS,
    sampled_truths: int = SAMPLED_TRUTHS,
) -> dict[str, Any]:
    """Sample every case, look at it through all lenses, write the report."""
    progress = Progress()
    model = build_model(load_vehicle(VEHICLE), 3)
    executed = manoeuvres(quick)
    all22, known14 = model.coefficients, tuple(n for n in model.coefficients if n not in KNOWN)
    both = ("emcee", "NUTS")
    plans: list[tuple[str, str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = [
        ("spiral14", "spiral, 14 unknown", ("spiral",), known14, both),
        ("spiral22", "spiral, 22 unknown", ("spiral",), all22, both),
        ("joint22", "three runs, 22 unknown", tuple(executed), all22, ("NUTS",)),
    ]
    if quick:
        plans = [("spiral14", "short spiral, 14 unknown", ("spiral",), known14, ("NUTS",))]
    if importlib.util.find_spec("nutpie") is None:
        progress.note("nutpie is missing (pip install 'bayesid[nuts]'): the ensembles alone")
        plans = [(*plan[:-1], ("emcee",)) for plan in plans]
    cases = {}
    whole = prior_of(model, all22)
    truth = draw_params(whole, 1, np.random.default_rng([1812, seed]))[0]
    for key, words, runs, names, samplers in plans:
        params = prior_of(model, names)
        values = truth[[all22.index(n) for n in names]]
        chosen = {n: executed[n] for n in runs}
        case = posed(model, chosen, params, np.random.default_rng(seed), truth=values)
        cases[key] = sampled(
            key, words, case.problem, None, samplers, out, quick, seed, progress, most, case.truth
        )
    logs = {} if data is None or quick else real(data, plans[-1][-1], by_laplace, out, seed, progress, most)
    with progress.stage("runs not flown"):
        tracks = {n: tracks_of(model, n, m, cases, seed) for n, m in executed.items()}
        facts: dict[str, Any] = {"accelerations": accelerations(cases), "tracks": tracks}
    few = (2, 1) if quick else (truths, sampled_truths)
    facts["truths"] = every(out, *few, seed, progress, quick=quick)
    facts["collapse"] = {} if quick else collapse(model, executed, {22: all22, 14: known14}, seed)
    facts |= {
        "by_laplace": [k for k in logs if k in by_laplace],
        "noise": NOISE,
        "prior": PRIOR,
        "quick": quick,
        "vehicle": VEHICLE,
    }
    results = posterior_results(cases, logs, facts, seed)
    writer.write(posterior_report(cases, logs, facts), out, results)
    return results


def sampled(
    key: str, words: str, problem: FitProblem, z: np.ndarray | None, samplers: tuple[str, ...], out: Path,
    quick: bool, seed: int, progress: Progress, most: int = MOST_DRAWS, truth: np.ndarray | None = None,
) -> Sampled:  # fmt: skip
    """Fit (unless done), sample with every sampler, and look through the three lenses with the draws."""
    if z is None:
        with progress.stage(f"{key}: fit"):
            z = fit(problem, FitOptions(seed=seed)).z
    density = trial_density(problem, z)
    folder = out / "chains" / key
    found: dict[str, Posterior] = {}
    for name in samplers:
        with progress.stage(f"{key}: {name}") as stage:
            stored = folder / f"{name}.nc"
            kept = load_posterior(stored) if stored.exists() else None
            if kept is not None and kept.digest != density.digest:
                kept = None
            if name == "NUTS":
                kept = by_slopes(density, kept, stored, key in LOGS, quick, seed, most, stage)
            elif kept is None:
                kept = sample(
                    density, density.laplace, SamplerOptions(seed=seed), folder,
                    resume=(folder / "chain").exists(),
                    watch=stage.step,
                )  # fmt: skip
                kept.to_netcdf(stored)
            found[name] = kept
    first = next(iter(found.values()), None)
    k, rng = len(problem.params.names), np.random.default_rng(seed)
    seen = identify(
        weighed(density, first), z,
        draws=None if first is None else first.params,
        profile=() if key in LOGS else True, log=folder / "profile.jsonl",
    )  # fmt: skip
    draws = seen.information.draws(10 * DRAWS, rng) if first is None else first.params
    some = rng.choice(len(draws), DRAWS, replace=False)
    pair = tuple(
        derived(problem.model, full_vectors(problem, d), zigzags=0 if quick else ZIGZAGS)
        for d in (density.prior_draws(DRAWS, rng)[:, :k], draws[some])
    )
    return Sampled(key, words, problem, z, found, draws, seen, (pair[0], pair[1]), truth)


def by_slopes(
    density: TrialDensity, kept: Posterior | None, stored: Path, logged: bool, quick: bool, seed: int,
    most: int, stage: Any,
) -> Posterior:  # fmt: skip
    """A chain by NUTS, stored, and lengthened a few times while its convergence check stays shut."""
    target = GradientTrialDensity(density)
    # equations scaled as a whole bend the posterior of 22 unknowns: short steps there. Real logs bend it
    # away from its Laplace approximation: a short chain first, whose draws whiten the rest at half the cost
    few = NutsOptions(tune=200, draws=200 if quick else 500, accept=0.9, seed=seed)
    if logged:
        few = NutsOptions(tune=150, draws=100, accept=0.8, seed=seed)
    if kept is None:
        kept = sample_nuts(target, density.laplace, few)
        kept.to_netcdf(stored)
    while not (quick or kept.converged) and kept.draws.shape[1] < most:
        stage.step(0, f"{kept.convergence.reasons[0]}: going on")
        kept = continue_nuts(target, density.laplace, kept, replace(few, tune=100, draws=MORE))
        kept.to_netcdf(stored)
    return kept


def weighed(density: TrialDensity, posterior: Posterior | None) -> FitProblem:
    """The problem with noise as the density weighs it: its level times the root of the correlation time."""
    names = density.unknowns.names
    middle = density.natural(density.laplace.mode) if posterior is None else np.median(posterior.flat, axis=0)
    level = {n.removeprefix("sigma:"): middle[i] for i, n in enumerate(names) if n.startswith("sigma:")}
    runs = [
        run.with_sigma({c: level[c] * math.sqrt(one.tau) for c, one in zip(run.channels, row, strict=True)})
        for run, row in zip(density.problem.runs, density.data, strict=True)
    ]
    return replace(density.problem, runs=tuple(runs))


def tracks_of(model: Model, name: str, manoeuvre: Manoeuvre, cases: dict[str, Sampled], seed: int) -> Tracks:
    """Bands of one run, orders as the true vehicle's, by the prior and by every posterior."""
    x0 = steady_start(model, RPM)
    widest = cases.get("spiral22", next(iter(cases.values())))
    true = widest.vehicle
    track, orders = run_manoeuvre(model, true, manoeuvre, x0)
    plan = plan_run(model, track.t, orders)
    truth = simulate(model, true, plan, x0).states
    rng = np.random.default_rng(seed)
    density = trial_density(widest.problem, widest.z)
    k = len(widest.problem.params.names)
    bands = {
        "prior": predict(
            model, full_vectors(widest.problem, density.prior_draws(DRAWS, rng)[:, :k]), plan, x0
        )
    }
    for case in cases.values():
        if not np.allclose(case.vehicle, true):  # another truth: what is known there is exact
            continue
        draws = case.draws[rng.choice(len(case.draws), DRAWS, replace=False)]
        bands[case.words] = predict(model, full_vectors(case.problem, draws), plan, x0)
    return Tracks(name, truth, bands)


def accelerations(cases: dict[str, Sampled]) -> dict[str, Any]:
    """Structural directions with the acceleration derivatives known to 10 and 0.1 %: relative sd along."""
    case = cases.get("spiral22")
    if case is None:
        return {}
    found = {}
    for words, sd in (("10 %", PRIOR), ("0.1 %", 1e-3)):
        params = case.problem.params
        for name in ACCELERATION:
            prior = params[name].prior
            assert prior is not None
            params = params.changed([name], prior=replace(prior, spread=sd * params[name].scale))
        info = identify(case.problem.with_params(params), case.z, profile=False).information
        along = {}
        for d in case.seen.structural:
            way = d.relative * info.scale / info.unit
            along[d.words] = float(
                1.0 / np.hypot(np.linalg.norm(info.data @ way), np.linalg.norm(info.prior @ way))
            )
        found[words] = along
    return found


def collapse(
    model: Model, executed: dict[str, Manoeuvre], sets: dict[int, tuple[str, ...]], seed: int
) -> dict[str, Any]:
    """What one and three runs leave along the spiral's open directions, at the true vehicle, by noise."""
    found = {}
    for count, names in sets.items():
        at = np.array(model.nominal[model.positions(names)])
        for share in (1.0, 0.3, 0.1):
            one, three = (
                identify(
                    posed(
                        model, runs, prior_of(model, names), np.random.default_rng(seed), share, at
                    ).problem,
                    profile=False,
                )
                for runs in ({"spiral": executed["spiral"]}, executed)
            )
            rows = []
            for d in one.directions:
                infos = (one.information, three.information)
                left = [relative_sd(info, d.vector) for info in infos]
                sd = [float(np.sqrt(d.vector @ info.covariance @ d.vector)) for info in infos]
                rows.append({"name": d.name, "words": d.words, "data_sd": left, "sd_over_prior": sd})
            found[f"{count} unknown, {share * NOISE['x']:g} m"] = {
                "open": [len(one.directions), len(three.directions)],
                "structural": [len(one.structural), len(three.structural)],
                "rows": rows,
            }
    return found


def relative_sd(info: Information, way: np.ndarray) -> float:
    """Relative sd the data alone leave along a direction (k,) in prior units; inf below rounding."""
    change = float(np.linalg.norm(info.data @ way))
    if change < 1e-11 * float(np.linalg.norm(info.reach * way)):
        return math.inf
    return float(np.linalg.norm(way * info.unit / info.scale)) / change


def real(
    data: Path,
    samplers: tuple[str, ...],
    by_laplace: tuple[str, ...],
    out: Path,
    seed: int,
    progress: Progress,
    most: int = MOST_DRAWS,
) -> dict[str, Sampled]:
    """The logs of studies/real_logs/run.py with its rows and pieces, wind left out."""
    found = {}
    for key, name in LOGS.items():
        if not (data / name).is_dir():
            progress.note(f"{name}: no such folder in {data.name}; left out")
            continue
        setting = real_logs.SETTINGS[name]
        logged = load_trial(real_logs.HERE / name, data / name)
        runs = tuple(thin(real_logs.begun(run, setting.way), 2 * setting.dt) for run in logged.runs)
        inside = replace(logged, runs=tuple(r for r in runs if not r.manoeuvre.startswith("random")))
        ship = load_vehicle(real_logs.HERE / name / "vehicle.toml")
        free = (*(n for n in ship.coef if n not in real_logs.INERTIA), *real_logs.SINGLE_SCREW)
        with progress.stage(f"{key}: fit") as stage:
            fitted = fit_in_pieces(
                inside, setting.piece, ship, out / "chains" / key, free=free,
                relative_bounds=FAR, options=FitOptions(seed=seed, profile=True, rounds=12),
                watch=lambda done, cost, step, s=stage: s.step(info=f"cost {cost:.5g}"),
            )  # fmt: skip
        problem = with_assumed_priors(fitted.problem)
        try:
            found[key] = sampled(
                key, f"{logged.name}, {len(problem.runs)} pieces", problem, fitted.fit.z,
                () if key in by_laplace else samplers, out,
                False, seed, progress, most,
            )  # fmt: skip
        except SampleError as error:
            progress.note(f"{key}: {error}")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study posterior",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, help="folder with kvlcc2_hsva and esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/posterior"))
    parser.add_argument("--quick", action="store_true", help="one short spiral, one sampler")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--truths", type=int, default=TRUTHS, help="drawn from each prior")
    parser.add_argument("--sampled", type=int, default=SAMPLED_TRUTHS, help="of them sampled on a spiral")
    parser.add_argument("--laplace", nargs="*", choices=LOGS, default=(), help="real logs without a chain")
    parser.add_argument(
        "--draws", type=int, default=MOST_DRAWS, help="lengthen chains that fall short up to so many draws"
    )
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/posterior/run.py")
    main(
        given.out, given.data, given.quick, given.seed, tuple(given.laplace), given.draws, given.truths,
        given.sampled,
    )  # fmt: skip
