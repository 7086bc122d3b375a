"""What do real logs say whose answer is kept elsewhere? KVLCC2 in another tank, Esso Osaka without its wind.

Usage: bayesid study withheld_real --data FOLDER [--out FOLDER] [--quick] [--seed N] [--only NAME].
FOLDER holds `kvlcc2_hsva` and `esso_osaka` (see studies/real_logs/run.py). Written before any comparison:
bands of manoeuvres another facility ran with the same ship, and what acts on each run without a wind log.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.diagnosed_file import write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, fitted_model
from bayesid.files import write_atomic, write_json
from bayesid.lock import lock_or_exit
from bayesid.manoeuvres import Scale, parse
from bayesid.measures import named_measures as measure
from bayesid.model.vehicles import Vehicle
from bayesid.prediction.intervals import beside_readings, measure_bands, prediction_csv, thinned
from bayesid.prediction.manoeuvre_prediction import predict_manoeuvre
from bayesid.prediction.run_prediction import predict_run
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.trials import Run, Trial
from studies.sim_to_real_gap.esso_osaka import hidden_wind, picked, pond_logs
from studies.sim_to_real_gap.kept_results import keep
from studies.sim_to_real_gap.kvlcc2 import row_sets, tank, tank_logs
from studies.withheld_real.report import facility_report, wind_report

SPEED, RPM = 1.18, 613.8  # straight approach of the other facility, model scale
STEP, CSV_STEP = 0.125, 4  # [s] of orders; a table holds every fourth
MANOEUVRES = {
    "turn_35_port_pullout": "pullout:35,side=port,turning=200s,after=120s",
    "turn_35_starboard_pullout": "pullout:35,side=starboard,turning=200s,after=120s",
    "zigzag_10_10_port_first": "zigzag:10/10,side=port,duration=150s",
    "zigzag_10_10_starboard_first": "zigzag:10/10,side=starboard,duration=150s",
    "zigzag_20_20_port_first": "zigzag:20/20,side=port,duration=150s",
    "zigzag_20_20_starboard_first": "zigzag:20/20,side=starboard,duration=150s",
}
APPROACH = ",approach=1s"
DRAWS, QUICK_DRAWS = 200, 30
NORMAL_50, NORMAL_95 = 0.6745, 1.96  # half width of central intervals of a unit normal


def main(data: Path, out: Path, quick: bool, seed: int, only: str | None) -> None:
    """Both predictions, each into its own folder."""
    progress = Progress()
    if only in (None, "kvlcc2"):
        other_facility(data / "kvlcc2_hsva", out / "kvlcc2_other_facility", quick, seed, progress)
    if only in (None, "esso_osaka"):
        without_wind(data / "esso_osaka", out / "esso_osaka_wind", quick, seed, progress)


def other_facility(data: Path, out: Path, quick: bool, seed: int, progress: Progress) -> None:
    """Bands of circles and zig-zags, after the same was tried on held-out zig-zags of this facility."""
    trial, ship = tank_logs(data, 3.0 if quick else 1.5)
    draws = QUICK_DRAWS if quick else DRAWS
    store = out / "runs"
    held = cache(lambda: identified_on(trial, ship))
    checks = []
    for run in progress.track(trial.holdout[:2] if quick else trial.holdout, "held-out zig-zags"):
        checks.append(keep(store, f"{run.name}-{seed}", partial(check, held, run, draws, seed)))
    widen = widening(checks)
    everything = replace(trial, runs=tuple(replace(run, role="identify") for run in trial.runs))
    found = identified_on(everything, ship)
    write_diagnosed(found, out)
    rows = {}
    for name, text in progress.track(MANOEUVRES.items(), "manoeuvres of the other facility"):
        p = predict_manoeuvre(found, name, parse(text + APPROACH, scale_of(found)), draws, seed, SPEED)
        factor = widen if name.startswith("zigzag") else 1.0
        write_atomic(out / f"{name}.csv", prediction_csv(thinned(p, CSV_STEP), widen=factor))
        measures = [widened(row, factor) for row in measure_bands(p, measure)]
        rows[name] = {"order": text, "diverged": p.lost, "widened": factor, "measures": measures}
    results = {
        "inputs": {"speed": SPEED, "rpm": RPM, "draws": draws, "quick": quick, "trial": trial.digest},
        "seeds": [seed],
        "disturbance": found.hypotheses[0].noise_model,
        "checks": checks,
        "widened": widen,
        "predictions": rows,
        "attribution": trial.attribution,
    }
    write_json(out / "predictions.json", results)
    writer.write(facility_report(results), out, results)


def check(identified: Callable[[], DiagnosedModel], run: Run, draws: int, seed: int) -> dict[str, Any]:
    """A held-out zig-zag replayed with its rudder, and steered anew beside its own overshoots."""
    held = identified()
    replay = beside_readings(predict_run(held, run, draws, seed), run, seed)
    p = predict_manoeuvre(held, run.name, order_of(held, run), draws, seed, float(run.data["u"][0]))
    return {"run": run.name, "replay": replay, "bands": measure_bands(p, measure), "log": logged(run)}


def widening(checks: list[dict[str, Any]]) -> float:
    """Factor on the bands after which half of the held-out overshoots lie where half should.

    An error of the rows repeats in every draw; the bands of posterior and disturbance do not know it.
    """
    away = [
        abs(check["log"][b["quantity"]] - b["mean"]) / (0.5 * (b["high"] - b["low"]))
        for check in checks
        for b in check["bands"]
        if check["log"].get(b["quantity"]) is not None and b["share"] > 0.5
    ]
    return max(1.0, float(np.median(away)) * NORMAL_95 / NORMAL_50) if away else 1.0


def widened(row: dict[str, Any], factor: float) -> dict[str, Any]:
    mean = row["mean"]
    return {**row, "low": mean + factor * (row["low"] - mean), "high": mean + factor * (row["high"] - mean)}


def identified_on(trial: Trial, ship: Vehicle) -> DiagnosedModel:
    """The richest rows of `gap.kvlcc2`, re-tuned to the identify runs; what they leave is disturbance."""
    _, _, vehicle, effects = row_sets(ship)[-1]
    problem = build_problem(tank(vehicle), trial)
    fitted = fit_with(problem, tuple(problem.model.effects[n] for n in effects))
    return fitted_model(problem, effects, fitted, trial.digest)


def scale_of(found: DiagnosedModel) -> Scale:
    s = found.model.scales
    limit = float(found.model.vehicle.limits["delta_r"])
    return Scale(s["L"], SPEED, RPM, limit, limit, 3, STEP)


def order_of(found: DiagnosedModel, run: Run) -> Any:
    """The zig-zag a run of this facility was, from its name Z_<rudder>_<switch>[_P or _S]."""
    parts = re.fullmatch(r"Z_(\d+)_(\d+)(?:_([PS]))?", run.name)
    assert parts is not None, run.name
    side = first_side(run)
    text = f"zigzag:{int(parts[1])}/{int(parts[2])},side={side},duration={run.duration:.1f}s{APPROACH}"
    return parse(text, scale_of(found))


def first_side(run: Run) -> str:
    """To which side the rudder goes first; positive turns to port."""
    rudder = run.measured_inputs["delta_r"]
    first = rudder[abs(rudder) > 0.6 * abs(rudder).max()][0]
    return "port" if first > 0 else "starboard"


def logged(run: Run) -> dict[str, float]:
    """Overshoots of the log itself, degrees."""
    data = {**run.data, "delta_r": run.measured_inputs["delta_r"]}
    rows = [row for found in measure(run.manoeuvre, run.t, data) for row in found["rows"]]
    return {quantity: float(value) for quantity, value, _ in rows if quantity.startswith("overshoot")}


def without_wind(data: Path, out: Path, quick: bool, seed: int, progress: Progress) -> None:
    """Which effect acts on every run without wind columns; October, hidden, shows what that is worth."""
    trial, ship = pond_logs(data, 3.0 if quick else 1.5)
    known = {run.name for run in picked(trial, "Oct").runs}
    blind = picked(trial, "")
    blind = replace(blind, runs=tuple(run for run in blind.runs if run.name not in known))
    if quick:
        blind = replace(blind, runs=blind.runs[:2])
    hidden = (
        hidden_wind(trial, ship, picked(trial, "Oct"), out / "runs", seed, progress) if not quick else None
    )
    results = {
        "inputs": {"quick": quick, "trial": trial.digest, "channels": "x, y, psi"},
        "seeds": [seed],
        "hidden": hidden,
        "withheld": hidden_wind(trial, ship, blind, out / "runs", seed, progress),
        "attribution": trial.attribution,
    }
    write_json(out / "verdicts.json", results)
    writer.write(wind_report(results), out, results)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study withheld_real", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with kvlcc2_hsva and esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/withheld_real"))
    parser.add_argument("--quick", action="store_true", help="coarse logs, few draws and runs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=("kvlcc2", "esso_osaka"))
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/withheld_real/run.py")
    main(given.data, given.out, given.quick, given.seed, given.only)
