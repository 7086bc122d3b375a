"""Do 90 % intervals hold the truth nine times in ten, and what if the sea does something the model omits?

Usage: python -m studies.calibration.run [--out FOLDER] [--quick] [--seed N]. Truths are drawn from the
prior, a short run is simulated and sampled, and the truth's rank among the draws noted. Replicates are kept
in FOLDER/seeds and not run again.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.equations.model import Model, build_model
from bayesid.estimation.output_error import FitProblem, coefficient_set, fit
from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.estimation.run_data import RunData
from bayesid.estimation.sampling import SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.priors import NoisePrior, draw_params
from bayesid.estimation.sampling.rank_statistics import inside, rank_of
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.model.params import ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.simulation import TimePlan, plan_run, simulate, steady_start
from studies.calibration.report import calibration_report, judged

VEHICLE, RPM, DEG = "generic_sub", 90.0, math.pi / 180
UNKNOWN = ("Y_v", "Y_r", "Y_dr", "N_v", "N_r", "N_dr", "Y_vdot", "N_rdot", "X_vr", "N_|v|r")
PRIOR_SD = 0.05  # of every coefficient, relative; wide enough that data narrow it by up to 2.6
NOISE = {
    "x": 1.25,
    "y": 1.25,
    "psi": 0.3 * DEG,
}  # m, m, rad: centre of its prior, worth NOISE_WEIGHT readings
NOISE_WEIGHT = 8.0
START = {"u": 0.2, "v": 0.06, "r": 0.06 * DEG, "psi": 1.2 * DEG}  # sd of the unknown initial state
CURRENT = {"ocean_current.V_north": 0.06, "ocean_current.V_east": 0.06}  # m/s
DURATION, DT, STEP = 300.0, 6.0, 3.0  # s; 24 L/U, 51 readings per channel
RANKS, REPLICATES, MISFITS = 99, 200, 24
# one row per question: is the current there, and what the density does about residuals that persist
CASES = {
    "well specified": (False, "ignore", REPLICATES),
    "current, not modelled": (True, "ignore", MISFITS),
    "current, memory counted": (True, "inflate", MISFITS),
}


@dataclass(frozen=True, eq=False)
class CalibrationSetting:
    """What all replicates share."""

    model: Model
    params: ParameterSet
    plan: TimePlan
    x0: np.ndarray
    noise: NoisePrior


def setting() -> CalibrationSetting:
    model = build_model(load_vehicle(VEHICLE), 3)
    entries = [
        replace(p, prior=Prior("normal", p.start, PRIOR_SD * p.scale))
        for p in coefficient_set(model, UNKNOWN, relative_bounds=6 * PRIOR_SD, use_prior=False)
    ]
    t = np.arange(0.0, DURATION + 0.5 * DT, DT)
    rudder = 15 * DEG * np.select([t < 18, t < 90, t < 200], [0.0, -1.0, 1.0], -0.4)
    plan = plan_run(model, t, {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, RPM)}, max_step=STEP)
    level = NoisePrior("inverse_gamma", np.array(list(NOISE.values())), NOISE_WEIGHT)
    return CalibrationSetting(model, ParameterSet(tuple(entries)), plan, steady_start(model, RPM), level)


def replicate(s: CalibrationSetting, current: bool, memory: str, seed: int) -> dict[str, Any]:
    """One truth, one run, one posterior: ranks, hits and how the sampler fared."""
    begin, rng = time.process_time(), np.random.default_rng([2011, seed])
    truth, sigma, x0 = draw_params(s.params, 1, rng)[0], s.noise.draw(1, rng)[0], np.array(s.x0)
    where = [s.model.states.index(n) for n in START]
    x0[where] += np.array(list(START.values())) * rng.standard_normal(len(where))
    par = s.params.place(s.model.with_values(CURRENT if current else {}), s.model.index, truth)
    states = simulate(s.model, par, s.plan, x0).states[:, [s.model.states.index(c) for c in NOISE]]
    readings = states + sigma * rng.standard_normal(states.shape)
    sd = np.array(list(START.values()))
    run = RunData("run", s.plan, tuple(NOISE), readings, s.noise.scale, s.x0, tuple(START), sd)
    problem = FitProblem(s.model, s.params, (run,), np.array(s.model.nominal))
    choice = SamplingSettings(memory=memory, noise_weight=NOISE_WEIGHT)  # type: ignore[arg-type]
    density = replace(trial_density(problem, fit(problem).z, choice, NOISE), threads=1)
    options = SamplerOptions(first=50, max_steps=4000, seed=seed, weights={"gaussian": 0.9, "de": 0.1})
    posterior = sample(density, density.laplace, options)
    whole = np.concatenate([truth, sigma])
    return {
        "names": posterior.names, "truth": whole, "rank": rank_of(posterior.flat, whole, RANKS),
        "inside50": inside(posterior.flat, whole, 0.5), "inside90": inside(posterior.flat, whole, 0.9),
        "z": (posterior.mean - whole) / posterior.sd, "sd_over_prior": posterior.sd / posterior.prior_sd,
        "converged": posterior.converged, "reasons": posterior.convergence.reasons,
        "rhat": float(posterior.convergence.rhat.max()), "tau": float(posterior.convergence.tau.max()),
        "ess": float(posterior.convergence.ess_bulk.min()), "steps": posterior.steps,
        "cpu_seconds": time.process_time() - begin,
    }  # fmt: skip


def main(out: Path, quick: bool, first_seed: int, executor: Executor = HERE) -> dict[str, Any]:
    """Run everything and write the report; returns the targets."""
    progress, s = Progress(), setting()
    records = {}
    for name, (current, memory, count) in CASES.items():
        seeds = range(first_seed, first_seed + (min(count, 4) if quick else count))
        key = name.replace(",", "").replace(" ", "-")
        with progress.stage(name, len(seeds)) as stage:
            work = partial(replicate, s, current, memory)
            records[name] = run_seeds(work, seeds, out / "seeds", key, executor, stage.step)
    findings = judged(records, RANKS)
    inputs = {
        "vehicle": VEHICLE, "vehicle_digest": s.model.vehicle.digest, "unknown": UNKNOWN, "quick": quick,
        "prior_sd": PRIOR_SD, "noise": NOISE, "noise_weight": NOISE_WEIGHT, "start_sd": START,
        "current": CURRENT, "duration": DURATION, "dt": DT, "first_seed": first_seed,
    }  # fmt: skip
    results = {"inputs": inputs, **findings}
    page = writer.write(calibration_report(records, findings, inputs), out, results)
    progress.note(f"report: {page}")
    return dict(findings["targets"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/calibration"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/calibration/run.py")
    main(given.out, given.quick, given.seed, executor=executor_from(given))
