"""Fresh runs of vehicles beside the band that a fit of four or more other runs gives them.

Takes a seed and a group. Gives plain records: errors over the predicted sd per fresh run and channel. Does
not judge.

Half of the vehicles obey equations that the fit has not. Half are simulated with the code of the fit, a truth
drawn from the prior; the others by the independent plant, which shares no equation with it.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.plant import draw_campaign, write_bundle
from bayesid.errors import BayesidError
from bayesid.estimation.trial_fit import fit_trial
from bayesid.manoeuvres.standard import turn
from bayesid.model.vehicles import Vehicle, load_vehicle
from bayesid.prediction.fitted_model import predictive_model
from bayesid.prediction.intervals import beside_readings, standard_errors
from bayesid.prediction.run_prediction import predict_run
from bayesid.simulation import plan_trial_run
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Run, Trial, load_trial
from studies.coverage.campaigns import (
    DEG,
    DT,
    DURATION,
    Condition,
    Setting,
    campaign,
    drawn_truth,
    setting,
    with_rows,
)

INSIDE90 = 1.6448536269514722
DRAWS, CALIBRATION_DRAWS = 200, 40
ANGLES, TURN = (6.0, 20.0), 15.0  # deg: of a fresh zig-zag, drawn; of a turn, a motion that was not fitted
OWN, FOREIGN = "equations of the fit", "other equations"
PLANT, PLANT_CAUSE = "independent plant", "independent plant, unlisted cause"
GROUPS = (OWN, FOREIGN, PLANT, PLANT_CAUSE)
Conditions = Mapping[str, Condition]


def fresh_runs(s: Setting, conditions: Conditions, group: str, seed: int) -> dict[str, Any]:
    """One vehicle, the fit of its runs, and what it predicts of runs it has not read."""
    begin = time.process_time()
    make: dict[str, Callable[..., tuple[Trial, Vehicle, Any, tuple[Run, ...], str]]] = {
        OWN: partial(_simulated, s, conditions), FOREIGN: partial(_simulated, s, conditions),
        PLANT: _of_plant, PLANT_CAUSE: _of_plant,
    }  # fmt: skip
    try:
        trial, vehicle, params, fresh, what = make[group](group, seed)
        found = fit_trial(trial, vehicle, params=params, threads=1)
        model, _ = predictive_model(found, CALIBRATION_DRAWS, seed)
        rows = []
        for run in fresh:
            p = predict_run(model, run, DRAWS, seed)
            z = standard_errors(p, run)
            rows.append({
                "kind": run.manoeuvre,
                "square": {c: float(np.mean(v**2)) for c, v in z.items()},
                "inside90": {c: float(np.mean(np.abs(v) < INSIDE90)) for c, v in z.items()},
                "inside95": {c: v["inside"] for c, v in beside_readings(p, run, seed).items()},
            })  # fmt: skip
    except BayesidError as error:
        return {"failed": str(error)}
    posterior = found.posterior
    return {
        "failed": "", "what": what, "runs": rows, "final": posterior is not None and posterior.final,
        "cpu_seconds": time.process_time() - begin,
    }  # fmt: skip


def _simulated(
    s: Setting, conditions: Conditions, group: str, seed: int
) -> tuple[Trial, Vehicle, Any, tuple[Run, ...], str]:
    """Four zig-zags to fit; a zig-zag of another angle and a turn that are not."""
    names = [
        n
        for n, c in conditions.items()
        if n.startswith(FOREIGN) == (group == FOREIGN) and not c.piece and c.dt == s.dt
    ]
    name = names[seed % len(names)]
    condition, rng = conditions[name], np.random.default_rng([2027, GROUPS.index(group), seed])
    truth = drawn_truth(s, rng)
    trial = campaign(s, condition, truth, rng, with_rows(s, condition.rows))
    angle = float(rng.uniform(*ANGLES))
    fresh = [setting((angle,), s.model), _turning(s)]
    runs = tuple(
        run
        for one in fresh
        for run in campaign(one, condition, truth, rng, with_rows(one, condition.rows)).runs
    )
    return trial, s.model.vehicle, s.params, runs, name


def _turning(s: Setting) -> Setting:
    time = s.time
    rpm = float(s.model.vehicle.rpm_ref or 0.0)
    manoeuvre = turn(TURN * DEG, rpm, approach=2 * time, duration=DURATION * time, dt=DT * time)
    run = virtual_run(s.model, s.model.nominal, manoeuvre, name="turn")
    return replace(s, runs=(run,), plans=(plan_trial_run(s.model, run),))


def _of_plant(group: str, seed: int) -> tuple[Trial, Vehicle, None, tuple[Run, ...], str]:
    """A campaign of the plant; its held-out runs are the fresh ones."""
    kind = "none" if group == PLANT else ("outside", "variant")[seed % 2]
    made = draw_campaign(seed, kind=kind, dof=3)
    with tempfile.TemporaryDirectory() as folder:
        write_bundle(made, Path(folder) / "bundle")
        trial = load_trial(Path(folder) / "bundle")
        vehicle = load_vehicle(Path(folder) / "bundle" / "vehicle.toml")
    fresh = tuple(trial.holdout)
    kept = replace(trial, runs=tuple(run for run in trial.runs if run.role == "identify"))
    return kept, vehicle, None, fresh, ", ".join(p.name for p in made.planted) or "none"
