"""What does a ship's motion alone say of the wind? Esso Osaka in its pond, then the anemometer is read.

Usage: bayesid study wind_from_motion --data FOLDER [--out FOLDER] [--quick] [--seed N]. FOLDER holds
`esso_osaka`. The wind column of a run is never read for its own wind. First the published ship tells it, and
no anemometer at all is read; then a ship fitted to the other half of the runs, in their measured wind. Then
the runs of the same hours tell their winds together. What was done before an interruption is kept.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.model.vehicles import CoefficientPrior, Vehicle
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.trials import Run, Trial, thin
from studies.blind_predictions.left_out import folds
from studies.blind_predictions.sets import REGIMES, SETS, fitted, kind, known_runs
from studies.real_logs.run import SETTINGS, SINGLE_SCREW, begun
from studies.ship_models.ships import SHIPS, of_all_quadrants
from studies.wind_from_motion.estimate import MotionWind, informed, unread, wind_of
from studies.wind_from_motion.hours import shared_winds
from studies.wind_from_motion.report import NO_SHIP, scores, wind_report

SHIP = "esso_osaka"
STEP = 2.0  # s between readings
SCREW_SHARE = 0.05  # side force of a screw over the resistance, sd, at half a length; assumed


def main(data: Path, out: Path, quick: bool, seed: int) -> None:
    """The report."""
    progress = Progress()
    trial = known_runs(SETS[SHIP], data)
    # with the start from rest, of which shaft and motor were not measured, five of seven zig-zags went wrong
    runs = [
        thin(begun(r, SETTINGS[SHIP].way) if kind(r.name) in REGIMES["ahead"] else r, STEP)
        for r in trial.runs
    ]
    if quick:
        runs = [r for k in dict.fromkeys(kind(r.name) for r in runs) for r in runs if kind(r.name) == k][:4]
    ship, free = of_all_quadrants(SHIPS[SHIP](data / SHIP))
    ship, unknowns = with_screw(ship), (*free, *SINGLE_SCREW)
    passes = {
        "published ship": winds(
            trial, runs, lambda run: ship, unknowns, seed, out / "published", progress, "published ship"
        )
    }
    if not quick:
        ships: dict[str, Vehicle] = {}
        blind = replace(SETS[SHIP], equations="mmg")
        for fold, names in folds(blind, trial).items():
            roles = tuple(replace(r, role="holdout" if r.name in names else "identify") for r in trial.runs)
            half = replace(trial, runs=roles)
            try:
                found = fitted(blind, half, "slow", data, False, seed, out / fold / "slow", progress)
            except BayesidError as error:
                progress.note(f"{fold}: {error}")
                continue
            if found is not None:
                ships |= dict.fromkeys(names, informed(found, ship))
        passes["fitted ship"] = winds(
            trial, runs, lambda run: ships.get(run.name), unknowns, seed, out / "fitted", progress,
            "fitted ship",
        )  # fmt: skip
    record = wind_record(runs, passes) | {
        "inputs": {"trial": trial.digest, "quick": quick, "step": STEP}, "seeds": [seed],
        "attribution": trial.attribution,
    }  # fmt: skip
    writer.write(wind_report(record), out, record)


def wind_record(runs: Sequence[Run], passes: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Rows and scores of every pass, its runs each alone and all together."""
    alone = {words: [row(run, found[run.name]) for run in runs] for words, found in passes.items()}
    together: dict[str, list[dict[str, Any]]] = {}
    hours = {}
    for words, found in passes.items():
        told = [run for run in runs if "failed" not in found[run.name]]
        shared = shared_winds(
            [read(run, found[run.name]) for run in told], [clock(run) + 0.5 * run.duration for run in told]
        )
        hours[words] = {"sd": shared.sd, "time": shared.time, "scatter": shared.scatter}
        records = {name: wind.record() for name, wind in shared.winds.items()}
        together[words] = [row(run, records.get(run.name, found[run.name])) for run in runs]
    return {
        "scores": {words: scores(rows) for words, rows in alone.items()},
        "scores_together": {words: scores(rows) for words, rows in together.items()},
        "passes": alone, "together": together, "hours": hours,
    }  # fmt: skip


def clock(run: Run) -> float:
    """Start of a run of the pond by its name, such as `turn_14-Oct_14_08_51` [s]; a last figure counts the
    parts of one record, each as long as this one.
    """
    date, *part = re.findall(r"(\d+-\w{3}_\d+_\d+_\d+)(?:_(\d+))?", run.name)[0]
    start = datetime.strptime(f"2020-{date}", "%Y-%d-%b_%H_%M_%S").replace(tzinfo=UTC).timestamp()
    return start + (int(part[0]) - 1 if part[0] else 0) * float(run.duration)


def with_screw(ship: Vehicle) -> Vehicle:
    """The ship with a side force of its screw that is zero, give or take.

    Left free, a steady side force and moment stand in for the wind of a zig-zag: of seven one came out right.
    """
    drag = abs(ship.coef["X_u|u|"])
    names, sd = SINGLE_SCREW, np.array([SCREW_SHARE * drag, 0.5 * SCREW_SHARE * drag])
    known = ship.prior.relative_sd if ship.prior else {}
    return replace(
        ship, coef=ship.coef | dict.fromkeys(names, 0.0), prior=CoefficientPrior(known, names, np.diag(sd**2))
    )


def winds(
    trial: Trial, runs: Sequence[Run], ship_of: Callable[[Run], Vehicle | None], free: Sequence[str],
    seed: int, folder: Path, progress: Progress, words: str,
) -> dict[str, Any]:  # fmt: skip
    """Run -> wind by its motion, as `MotionWind.record`, or why there is none.

    A kept wind serves the run, ship, unknowns and seed it was found with; else it is found anew.
    """
    out: dict[str, Any] = {}
    for run in progress.track(runs, f"winds, {words}"):
        file, ship = folder / f"{run.name}.json", ship_of(run)
        if ship is None:
            out[run.name] = {"failed": NO_SHIP}
            continue
        inputs = {
            "trial": replace(trial, runs=(unread(run),)).digest, "ship": ship.digest, "free": list(free),
            "seed": seed,
        }  # fmt: skip
        kept = json.loads(file.read_text()) if file.is_file() else {}
        if kept.get("inputs") != inputs:
            try:
                found: dict[str, Any] = wind_of(trial, run, ship, free, seed).record()
            except BayesidError as error:
                found = {"failed": str(error)}
            write_json(file, {"inputs": inputs, "wind": found})
            kept = json.loads(file.read_text())
        out[run.name] = kept["wind"]
    return out


def read(run: Run, found: Mapping[str, Any]) -> MotionWind:
    """A kept wind."""
    return MotionWind(run.name, np.array(found["mean"]), np.array(found["covariance"]), found["status"])


def _blowing(run: Run) -> np.ndarray:
    """(2, n) where the measured air goes [m/s]."""
    speed, come = run.exogenous["wind_speed"], run.exogenous["wind_from"]
    return -np.array([speed * np.cos(come), speed * np.sin(come)])


def mean_wind(run: Run) -> np.ndarray:
    """(2,) mean of the measured wind [m/s]."""
    return np.asarray(_blowing(run).mean(axis=1))


def pushing_wind(run: Run) -> np.ndarray:
    """(2,) steady wind that pushes as the measured one with its gusts does [m/s].

    The motion tells a force, which goes with |V| V, and not a speed.
    """
    air = _blowing(run)
    push = (np.hypot(*air) * air).mean(axis=1)
    return np.asarray(push / max(float(np.sqrt(np.hypot(*push))), 1e-9))


def row(run: Run, found: Mapping[str, Any]) -> dict[str, Any]:
    """A wind by the motion beside the anemometer, which is read here for the first time."""
    air, push = mean_wind(run), pushing_wind(run)
    told = {"run": run.name, "kind": kind(run.name), "seconds": float(run.duration), "measured": air.tolist(),
            "pushing": push.tolist()}  # fmt: skip
    if "failed" in found:
        return told | dict(found)
    wind = read(run, found)
    turn = np.arctan2(wind.mean[1], wind.mean[0]) - np.arctan2(air[1], air[0])
    return told | dict(found) | {
        "direction_error": float((turn + np.pi) % (2 * np.pi) - np.pi),
        "z": ((wind.mean - push) / np.sqrt(np.diag(wind.covariance))).tolist(),
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study wind_from_motion",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/wind_from_motion"))
    parser.add_argument("--quick", action="store_true", help="four runs of a kind, published ship")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    lock_or_exit(chosen.out, "studies/wind_from_motion/run.py")
    main(chosen.data, chosen.out, chosen.quick, chosen.seed)
