"""Do the intervals of a fit hold the truth where noise has memory, the sea pushes or equations are wrong?
And do its predictions hold fresh runs?

Usage: bayesid study coverage [--out FOLDER] [--quick] [--seed N] [--replicates N]. Truths are drawn
from the prior, a campaign of four zig-zags is simulated and fitted as `bayesid fit` does, and as it did with
white noise. Replicates are kept in FOLDER/seeds and not run again.
"""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.posterior import CONFLICT
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.output_error.simulated_recovery import run_seeds
from bayesid.estimation.sampling.rank_statistics import rank_of
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.coverage.campaigns import (
    ANGLES,
    DT,
    DURATION,
    FORCE_MEMORY,
    NOISE,
    PRIOR_SD,
    VEHICLE,
    Condition,
    Setting,
    campaign,
    drawn_truth,
    fitted,
    setting,
    with_rows,
)
from studies.coverage.control import projected_truth, white_by_theory
from studies.coverage.predictions import GROUPS, fresh_runs
from studies.coverage.report import CONTROL_CONDITION, coverage_report, judged

INSIDE90, RANKS = 1.6448536269514722, 99
REPLICATES, QUICK = 200, 6
PREDICTED, QUICK_PREDICTED = 25, 2  # vehicles per group whose fresh runs are predicted
# Campaigns whose fit takes several times as long, and how many of them at most.
COSTLY, FEWER = (
    (
        "large disturbing force", "large disturbing force, pieces", "coefficients differ from run to run",
        CONTROL_CONDITION,
    ),
    60,
)  # fmt: skip
# effects and rows of the size that changes the zig-zags by a few times the noise once all else is refitted
CONDITIONS = {
    "white noise": Condition(),
    "white noise, pieces": Condition(piece=10.0),
    "noise remembers 5 samples": Condition(memory=5.0),
    "noise remembers 10 samples": Condition(memory=10.0),
    "noise remembers 20 samples": Condition(memory=20.0),
    "noise remembers 10 samples, pieces": Condition(memory=10.0, piece=10.0),
    CONTROL_CONDITION: Condition(memory=20.0, dt=0.05),
    "small disturbing force": Condition(force=3e-5),
    "large disturbing force": Condition(force=3e-4),
    "large disturbing force, pieces": Condition(force=3e-4, piece=10.0),
    "coefficients differ from run to run": Condition(run_spread=0.5),
    "other equations: cross-flow drag": Condition(effect={"crossflow_drag.Cd": 0.3}),
    "other equations: three more rows": Condition(rows={"Y_r|r|": 10.0, "N_v|v|": -20.0, "X_vv": 10.0}),
}


def replicate(s: Setting, real: Setting, condition: Condition, seed: int) -> dict[str, Any]:
    """One truth, one campaign, the fit and the white one: errors in sd, and what the fit said."""
    begin, rng = time.process_time(), np.random.default_rng([2026, seed])
    truth = drawn_truth(s, rng)
    try:
        trial = campaign(s, condition, truth, rng, real)
        options = FitOptions(profile=condition.estimate_noise, seed=seed)
        problem, found, posterior = fitted(s, trial, options, condition.piece)
        _, _, white = fitted(s, trial, options, condition.piece, NoiseParts())
    except BayesidError as error:
        return {"failed": str(error)}
    if posterior is None or white is None or not found.converged:
        return {"failed": found.message}
    k = truth.size  # rows of a model form come after the vehicle's own coefficients and have no truth
    z = (posterior.mean[:k] - truth) / posterior.sd[:k]
    white_z = (white.mean - truth) / white.sd
    parts = posterior.parts
    told: dict[str, Any] = {}
    if condition.rows or condition.effect:
        nearest = projected_truth(s, condition, truth, problem, real)
        if nearest is not None:
            far = (posterior.mean[:k] - nearest) / posterior.sd[:k]
            moved = (nearest - truth) / posterior.prior_sd[:k]
            told = {"projected_z": far, "projected_inside": np.abs(far) < INSIDE90, "projected_move": moved}
    return {
        "failed": "", "names": posterior.names[:k], "z": z, "inside": np.abs(z) < INSIDE90,
        "white_z": white_z, "white_inside": np.abs(white_z) < INSIDE90,
        "rank": rank_of(posterior.draws(RANKS, rng)[:, :k], truth, RANKS),
        "white_rank": rank_of(white.draws(RANKS, rng), truth, RANKS),
        "sd_over_prior": (posterior.sd / posterior.prior_sd)[:k],
        "white_sd_over_prior": white.sd / white.prior_sd,
        "weight": parts.weight, "order": parts.order, "run_spread": parts.run_spread, "excess": parts.excess,
        "final": posterior.final, "halves_p": posterior.halves.p if posterior.halves else None,
        "halves_sd": posterior.halves.combined_rms if posterior.halves else None,
        "conflicts": int(np.sum(np.abs(posterior.conflict[:k]) > CONFLICT)),
        "form": found.uncertainty.get("form", {}).get("size", 0.0),
        "white_final": white.final, "white_conflicts": int(np.sum(np.abs(white.conflict) > CONFLICT)),
        "efficient": parts.efficient, "filtered": parts.disturbance > 0.0,
        "cpu_seconds": time.process_time() - begin, **told,
    }  # fmt: skip


def main(
    out: Path, quick: bool, first_seed: int, replicates: int = REPLICATES, executor: Executor = HERE
) -> dict[str, Any]:
    """Run everything and write the report; returns the targets."""
    progress, s = Progress(), setting()
    often = {dt: setting(dt=dt) for dt in {c.dt for c in CONDITIONS.values()} - {s.dt}} | {s.dt: s}
    count = min(replicates, QUICK) if quick else replicates
    records: dict[str, list[dict[str, Any]]] = {}
    for name, condition in CONDITIONS.items():
        key = "".join(c if c.isalnum() else "-" for c in name)
        number = min(count, FEWER) if name in COSTLY else count
        with progress.stage(name, number) as stage:
            here = often[condition.dt]
            work = partial(replicate, here, with_rows(here, condition.rows), condition)
            seeds = range(first_seed, first_seed + number)
            records[name] = run_seeds(work, seeds, out / "seeds", key, executor, stage.step)
    fresh: dict[str, list[dict[str, Any]]] = {}
    number = QUICK_PREDICTED if quick else PREDICTED
    for group in GROUPS:
        key = "fresh-" + "".join(c if c.isalnum() else "-" for c in group)
        with progress.stage(f"fresh runs: {group}", number) as stage:
            seeds = range(first_seed, first_seed + number)
            work = partial(fresh_runs, s, CONDITIONS, group)
            fresh[group] = run_seeds(work, seeds, out / "seeds", key, executor, stage.step)
    theory = {n: white_by_theory(often[c.dt], c) for n, c in CONDITIONS.items() if c.memory}
    findings = judged(records, RANKS, fresh, theory)
    inputs = {
        "vehicle": VEHICLE, "vehicle_digest": s.model.vehicle.digest, "unknown": s.params.names,
        "prior_sd": PRIOR_SD, "noise": NOISE, "zigzags": ANGLES, "duration": DURATION, "dt": DT,
        "force_memory": FORCE_MEMORY, "replicates": count, "first_seed": first_seed, "quick": quick,
        "predicted": number,
        "conditions": {name: vars(c) for name, c in CONDITIONS.items()},
    }  # fmt: skip
    writer.write(coverage_report(findings, inputs), out, {"inputs": inputs, **findings})
    return dict(findings["targets"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study coverage", description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/coverage"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--replicates", type=int, default=REPLICATES)
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/coverage/run.py")
    main(given.out, given.quick, given.seed, given.replicates, executor=executor_from(given))
