"""KVLCC2 zig-zags in a towing tank: how well a submarine's polynomial explains a tanker, and what is left.

Four sets of rows and the MMG equations, each re-tuned to the identify runs alone and judged on held-out
zig-zags; then a diagnosis of the poorest rows, of the richest and of MMG, without the effects a tank and a
measured rudder rule out.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.evidence.holdout import validate_holdout
from bayesid.diagnosis.run import diagnose
from bayesid.equations.model import Model, build_model, without_effects
from bayesid.model.terms import term
from bayesid.model.vehicles import Vehicle, load_vehicle
from bayesid.progress import Progress
from bayesid.trials import Trial, load_trial, thin
from studies.real_logs.run import HERE, plain
from studies.ship_models import ships
from studies.sim_to_real_gap.kept_results import keep

STEP = 1.5  # between readings [s], a quarter of the time the ship takes for its own length
# no wind, current or tether in a tank; rudder and revolutions are measured where they act
NOT_HERE = (
    "wind", "steady_force", "tether_drag", "ocean_current", "ocean_current_varying", "actuator_lag",
    "actuator_dead_time", "actuator_backlash", "actuator_rate_limit", "rudder_offset",
)  # fmt: skip


def tank_logs(data: Path, step: float = STEP) -> tuple[Trial, Vehicle]:
    """The thinned logs and the vehicle file of the study of real logs."""
    logged = load_trial(HERE / "kvlcc2_hsva", data)
    ship = load_vehicle(HERE / "kvlcc2_hsva" / "vehicle.toml")
    return replace(logged, runs=tuple(thin(run, step) for run in logged.runs)), ship


def row_sets(ship: Vehicle) -> list[tuple[str, str, Vehicle, tuple[str, ...]]]:
    """Name, words, vehicle and effects of four sets of rows, from poor to rich."""
    without_race = {n: v for n, v in ship.coef.items() if term(n).group != "eta"}
    cubic = replace(ship, coef=without_race)
    return [
        ("plain", "products of two velocities, as for a submarine", plain(ship), ()),
        ("cubic", "and cubic rows of drift and yaw", cubic, ()),
        ("race", "and the rudder in the propeller race", ship, ()),
        ("side", "and a side force of the screw", ship, ("propeller_side_force",)),
    ]


def kvlcc2(data: Path, store: Path, quick: bool, seed: int, progress: Progress) -> dict[str, Any]:
    """Row sets on held-out zig-zags, and diagnoses of the poorest, the richest and the MMG equations."""
    trial, ship = tank_logs(data, 2 * STEP if quick else STEP)
    mmg = ("mmg", "no rows but the MMG equations, hull and rudder as published", ships.kvlcc2(data), ())
    told = [*row_sets(ship), mmg]
    sets = []
    for key, words, vehicle, effects in progress.track(told, "KVLCC2 rows"):

        def judged(vehicle: Vehicle = vehicle, effects: tuple[str, ...] = effects) -> dict[str, Any]:
            return row_set(trial, vehicle, effects, seed)

        sets.append({"key": key, "words": words, **keep(store, f"kvlcc2-rows-{key}-{seed}", judged)})
    diagnoses = {}
    for key, words, vehicle, _ in told:
        if key not in (("plain",) if quick else ("plain", "side", "mmg")):
            continue
        with progress.stage(f"KVLCC2: diagnosis, {words}"):
            model = tank(vehicle)
            diagnoses[key] = keep(
                store,
                f"kvlcc2-diagnosis-{key}-{seed}",
                partial(
                    lambda model: diagnose(trial, model, seed=seed, plan_next=False).result.record(),
                    model,
                ),
            )
    return {
        "sets": sets,
        "diagnoses": diagnoses,
        "holdout": [r.name for r in trial.holdout],
        "excluded": NOT_HERE,
        "attribution": trial.attribution,
    }


def row_set(trial: Trial, vehicle: Vehicle, effects: tuple[str, ...], seed: int) -> dict[str, Any]:
    """One set of rows re-tuned to the identify runs: what is left there, errors on held-out zig-zags."""
    model = tank(vehicle)
    problem = build_problem(model, trial)
    fitted = fit_with(problem, tuple(model.effects[n] for n in effects))
    models = {"nominal": model.nominal, "recalibrated": fitted.par, "with effect": fitted.par}
    steps = validate_holdout(problem, trial, models, problem.environment.noise_model, seed)
    return {
        "converged": fitted.converged,
        "left": missing_force(problem, fitted),
        "rms": {r.horizon: r.rms["recalibrated"] for r in steps.horizons},
        "nominal": {r.horizon: r.rms["nominal"] for r in steps.horizons},
        "seconds": {r.horizon: r.seconds for r in steps.horizons},
    }


def tank(vehicle: Vehicle) -> Model:
    """Model without what a tank rules out."""
    return without_effects(build_model(vehicle, 3), NOT_HERE)


def missing_force(problem: DiagnosisProblem, fitted: Any) -> dict[str, float]:
    """rms of the latent force of a fit over that of the force that moves the ship, per axis."""
    model = problem.model
    at = {n: i for i, n in enumerate(model.kernel.full.states)}
    mass, izz, x_g = (float(model.nominal[model.index[n]]) for n in ("m", "Izz", "x_G"))
    latent, moving = [], []
    for log, point in zip(problem.logs, fitted.points, strict=True):
        x, t = point.states, log.plan.t
        u, v, r = (x[:, at[n]] for n in ("u", "v", "r"))
        udot, vdot, rdot = (np.gradient(s, t) for s in (u, v, r))
        sway = mass * (vdot + u * r + x_g * rdot)
        surge, yaw = mass * (udot - v * r - x_g * r**2), izz * rdot + mass * x_g * (vdot + u * r)
        moving.append(np.column_stack([surge, sway, yaw])[:-1])
        latent.append(point.force)
    rest, whole = np.concatenate(latent), np.concatenate(moving)
    share = np.sqrt(np.mean(rest**2, axis=0) / np.mean(whole**2, axis=0))
    return {axis: float(s) for axis, s in zip("XYN", share, strict=True)}
