"""Which equations follow two real tankers? MMG as published, MMG fitted, Gertler-Hagen rows fitted.

Usage: bayesid study ship_models --data FOLDER [--out FOLDER] [--quick] [--seed N] [--only NAME].
FOLDER holds `kvlcc2_hsva` and `esso_osaka` (see studies/real_logs/run.py). Runs to identify and held-out runs
are those of that study; what the fit by MMG moves is chosen by runs left out among those to identify. An
interrupted fit goes on where it was.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces, in_pieces
from bayesid.estimation.trial_fit import RunOutcome, TrialFit, outcomes
from bayesid.lock import lock_or_exit
from bayesid.model.vehicles import Vehicle, load_vehicle
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.trials import Run, Trial, thin, window
from studies.real_logs.run import HERE as LOGS
from studies.real_logs.run import SETTINGS, SINGLE_SCREW, WIND, begun
from studies.ship_models.choice import candidates, chosen
from studies.ship_models.errors import errors
from studies.ship_models.report import models_report
from studies.ship_models.ships import INERTIA, SHIPS, logs_of, of_all_quadrants, slow_logs


@dataclass(frozen=True)
class Fitted:
    """One set of equations: words, fit, its held-out runs whole and in pieces."""

    key: str
    words: str
    found: TrialFit
    pieces: tuple[RunOutcome, ...]


def main(data: Path, out: Path, quick: bool, seed: int, only: str | None) -> None:
    """One report for the ships that are in the folder."""
    progress = Progress()
    record: dict[str, Any] = {"seeds": [seed], "inputs": {"quick": quick}, "ships": {}}
    for name in SHIPS:
        if only in (None, name) and (data / name).is_dir():
            record["ships"][name] = study(name, data / name, out / name, quick, seed, progress)
    if not record["ships"]:
        raise SystemExit(f"{data}: holds none of the folders {', '.join(SHIPS)}")
    writer.write(models_report(record), out, record)


def study(name: str, data: Path, out: Path, quick: bool, seed: int, progress: Progress) -> dict[str, Any]:
    """Fit the sets of equations to the same runs and judge them on the others."""
    setting = SETTINGS[name]
    step = (2 if quick else 1) * setting.dt
    logged = logs_of(name, data)
    trial = replace(logged, runs=tuple(thin(begun(run, setting.way), step) for run in logged.runs))
    inside = replace(trial, runs=tuple(r for r in trial.runs if not r.manoeuvre.startswith("random")))
    rows = load_vehicle(LOGS / name / "vehicle.toml")
    ship = SHIPS[name](data)
    choice = chosen(name, inside, ship, out, seed, progress)
    best = next(c for c in candidates(name, ship) if c.key == choice["best"])
    sets: list[tuple[str, str, Vehicle, tuple[str, ...], NoiseParts | None]] = [
        ("mmg", "MMG", ship, best.free, best.parts),
        ("gertler_hagen", "Gertler-Hagen, cubic and race rows", rows,
         (*(n for n in rows.coef if n not in INERTIA), *SINGLE_SCREW, *((WIND,) if setting.wind else ())),
         None),
    ]  # fmt: skip
    options = FitOptions(seed=seed, profile=True, rounds=6 if quick else 12)
    told: dict[str, Any] = {
        "attribution": trial.attribution, "trial": trial.digest, "runs": {}, "sets": {}, "choice": choice,
        "quick": quick,
    }  # fmt: skip
    slow: tuple[Run, ...] = ()
    if setting.wind:  # the pond has runs in all quadrants
        slow = tuple(thin(run, step) for run in slow_logs(data).runs)
        wide, unknowns = wide_set(ship, best.free)
        sets.append(("mmg_all", "MMG, all quadrants", wide, unknowns, best.parts))
    for key, words, vehicle, free, parts in sets:
        fitted = replace(inside, runs=(*inside.runs, *slow)) if key == "mmg_all" else inside
        with progress.stage(f"{name}: {words}") as stage:
            found = fit_in_pieces(
                fitted, setting.piece, vehicle, out / "fits" / key, free=free, options=options,
                parts=parts, watch=lambda done, cost, step, s=stage: s.step(info=f"cost {cost:.5g}"),
            )  # fmt: skip
        fit = found.fit
        told["sets"][key] = {
            "words": words, "unknowns": len(free), "piece": setting.piece, "status": fit.status,
            "values": fit.values, "sd": dict(zip(fit.names[: len(free)], fit.sd.tolist(), strict=False)),
        }  # fmt: skip
        everything = replace(inside, runs=(*inside.runs, *slow))
        held = replace(everything, runs=everything.holdout)
        collect(told["runs"], outcomes(found.problem, held, fit), held, key, published=key == "mmg")
        short = held_pieces(everything, setting.piece)
        collect(told["runs"], outcomes(found.problem, short, fit), short, key, key == "mmg", " piece")
    return told


def wide_set(ship: Vehicle, chosen: tuple[str, ...]) -> tuple[Vehicle, tuple[str, ...]]:
    """Ship and unknowns of the fit to all quadrants: screw and wind as in the fit that was chosen."""
    wide, free = of_all_quadrants(ship)
    return wide, (*free, *(n for n in chosen if n not in ship.coef))


def held_pieces(trial: Trial, seconds: float) -> Trial:
    """Held-out runs cut into pieces, each predicted from its own first readings."""
    held = tuple(replace(run, role="identify") for run in trial.holdout)
    cut = in_pieces(replace(trial, runs=held), seconds)
    return replace(cut, runs=tuple(replace(_at_most(run, seconds), role="holdout") for run in cut.runs))


def _at_most(run: Run, seconds: float) -> Run:
    """The first seconds of a run: pieces are up to half as long again, and errors grow with time."""
    return window(run, float(run.t[0]), float(run.t[0]) + seconds)


def collect(
    told: dict[str, Any], judged: tuple[RunOutcome, ...], trial: Trial, key: str, published: bool,
    suffix: str = "",
) -> None:  # fmt: skip
    """Errors of held-out runs by run and set of equations; `published` adds the set as given."""
    runs: dict[str, Run] = {run.name: run for run in trial.runs}
    for outcome in judged:
        if outcome.role != "holdout" or outcome.name not in runs:
            continue
        row = told.setdefault(outcome.name + suffix, {
            "manoeuvre": outcome.manoeuvre, "seconds": float(outcome.t[-1] - outcome.t[0]), "errors": {},
            "piece": bool(suffix),
        })  # fmt: skip
        row["errors"][key] = errors(outcome, runs[outcome.name], "fitted")
        if published:
            row["errors"]["published"] = errors(outcome, runs[outcome.name], "nominal")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study ship_models",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--data", type=Path, required=True, help="folder with kvlcc2_hsva and esso_osaka")
    parser.add_argument("--out", type=Path, default=Path("out/ship_models"))
    parser.add_argument("--quick", action="store_true", help="half the samples, six rounds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=tuple(SHIPS), default=None)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/ship_models/run.py")
    main(given.data, given.out, given.quick, given.seed, given.only)
