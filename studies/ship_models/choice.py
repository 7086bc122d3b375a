"""What a fit of a ship by MMG may move, chosen by runs left out among those to identify.

Takes the runs to identify. Gives the candidates with their errors and the best one. Reads no held-out run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import outcomes
from bayesid.files import write_json
from bayesid.model.vehicles import Vehicle
from bayesid.progress import Progress
from bayesid.trials import Run, Trial, thin
from studies.real_logs.run import SETTINGS, SINGLE_SCREW
from studies.ship_models.errors import errors, lost
from studies.ship_models.report import MARKS
from studies.ship_models.ships import AT_ONE_RPM, INERTIA, KNOWN, SHARE, SHIP_WIND, free_of

FOLDS, ROUNDS = 2, 5
# Raised with every change of `errors` or the measures it asks: errors kept from before are not of the same.
MEASURES_VERSION = 1
# The side force of a screw as a share of its thrust: what goes with the square of the ship's speed is a tenth
# in a tight circle, at the revolutions of the approach. And the share of the wind that the water goes with.
BY_THRUST, WATER, LAG = "propeller_side_force.side_force", "wind.water", "actuator_lag.tau"
AT_THE_RUDDER = ("gamma_plus", "gamma_minus", "l_R")


@dataclass(frozen=True)
class Candidate:
    """Free coefficients and parameters of effects, and the noise; None is what the data ask for."""

    key: str
    free: tuple[str, ...]
    parts: NoiseParts | None


def candidates(name: str, ship: Vehicle) -> tuple[Candidate, ...]:
    """What is tried for a ship; of equal ones the first is taken."""
    share, usual = SHARE[name], free_of(ship)
    wind = SHIP_WIND if SETTINGS[name].wind else ()
    screw = (*SINGLE_SCREW, *wind)
    if name == "kvlcc2_hsva":
        every = tuple(n for n in ship.coef if n not in (*INERTIA, *KNOWN))
        hull = tuple(n for n in usual if n not in (*AT_ONE_RPM, *AT_THE_RUDDER))
        sets = {
            "hull and inflow to the rudder": usual,
            "hull alone": hull,
            "all but the open-water propeller": every,
        }
        return tuple(
            Candidate(f"{words}, {weight}", (*free, *screw), parts)
            for weight, parts in (("power as information", share), ("power as asked", None))
            for words, free in sets.items()
        )
    extra: Mapping[str, tuple[str, ...]] = {
        "": (),
        ", rudder stronger to one side": ("rudder_asymmetry.asymmetry",),
        ", servo lag": (LAG,),
    }
    return (
        *(
            Candidate(f"power as information{words}", (*usual, *screw, *more), share)
            for words, more in extra.items()
        ),
        *(
            Candidate(f"{weight}, {words}", (*usual, *wind, *more), parts)
            for weight, parts in (("power as information", share), ("power as asked", None))
            for words, more in (
                ("side force of the screw by its thrust", (BY_THRUST,)),
                ("side force of the screw by its thrust, water moved by the wind", (BY_THRUST, WATER)),
                (
                    "side force of the screw by its thrust, water moved by the wind, servo lag",
                    (BY_THRUST, WATER, LAG),
                ),
            )
        ),
        Candidate("power as asked", (*usual, *screw), None),
    )


def chosen(
    name: str, trial: Trial, ship: Vehicle, out: Path, seed: int, progress: Progress
) -> dict[str, Any]:
    """Record: candidate -> rms of every measure over left-out runs, and the key of the best.

    The score is the mean of the measures that have a mark, each over its mark. Candidates whose errors are
    there already for the same runs, ship, unknowns, noise, seed and measures are not fitted again.
    """
    runs = tuple(thin(run, 2 * SETTINGS[name].dt) for run in by_manoeuvre(trial.identify))
    kept = out / "choice.json"
    table: dict[str, Any] = json.loads(kept.read_text()) if kept.is_file() else {}
    tried: dict[str, dict[str, float]] = {}
    for candidate in candidates(name, ship):
        inputs = {
            "trial": replace(trial, runs=runs).digest, "ship": ship.digest, "seed": seed, "rounds": ROUNDS,
            "folds": FOLDS, "piece": SETTINGS[name].piece, "free": list(candidate.free),
            "parts": repr(candidate.parts), "measures": MEASURES_VERSION,
        }  # fmt: skip
        row = table.get(candidate.key, {})
        if {"measures": 1} | row.get("inputs", {}) != inputs:  # of before there were versions: the first
            found = _left_out(name, candidate, replace(trial, runs=runs), ship, seed, progress)
            row = table[candidate.key] = {"inputs": inputs, "errors": joined_errors(found)}
            write_json(kept, table)
        tried[candidate.key] = {measure: float(value) for measure, value in row["errors"].items()}
    return {"tried": tried, "best": min(tried, key=lambda key: tried[key]["score"])}


def by_manoeuvre(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Runs with those of one manoeuvre side by side, so that folds dealt in turn part them.

    Left out together, both circles to one side were predicted by a ship that had turned to the other.
    """
    first = {run.manoeuvre: i for i, run in reversed(list(enumerate(runs)))}
    return tuple(sorted(runs, key=lambda run: first[run.manoeuvre]))


def _left_out(
    name: str, candidate: Candidate, trial: Trial, ship: Vehicle, seed: int, progress: Progress
) -> list[dict[str, float]]:
    """Errors of every run by the fit to the other fold; of a fit that fails its runs are lost."""
    found: list[dict[str, float]] = []
    for fold in range(FOLDS):
        held = {run.name for run in trial.runs[fold::FOLDS]}
        roles = tuple(replace(r, role="holdout" if r.name in held else "identify") for r in trial.runs)
        by_name = {run.name: run for run in roles if run.name in held}
        with progress.stage(f"{name}: {candidate.key}, fold {fold + 1}") as stage:
            try:
                fit = fit_in_pieces(
                    replace(trial, runs=roles), SETTINGS[name].piece, ship, None, free=candidate.free,
                    parts=candidate.parts, options=FitOptions(seed=seed, profile=True, rounds=ROUNDS),
                    watch=lambda done, cost, step, s=stage: s.step(info=f"cost {cost:.5g}"),
                )  # fmt: skip
            except BayesidError as error:
                progress.note(f"{candidate.key}: {error}")
                found += [lost(run) for run in by_name.values()]
                continue
        judged = outcomes(fit.problem, replace(trial, runs=tuple(by_name.values())), fit.fit)
        found += [errors(one, by_name[one.name], "fitted") for one in judged]
    return found


def joined_errors(found: list[dict[str, float]]) -> dict[str, float]:
    """Rms of each measure over the runs that have it (median of those without a mark), score, count of runs.

    A run whose simulation is lost, NaN, counts as infinite.
    """
    out: dict[str, float] = {}
    for measure in ("psi", "r", "position", *MARKS):
        values = np.array([one[measure] for one in found if measure in one])
        if values.size:
            values = np.where(np.isnan(values), np.inf, values)
            out[measure] = float(np.sqrt(np.mean(values**2)) if measure in MARKS else np.median(values))
    gone = sum(not np.isfinite(one["psi"]) for one in found)
    marks = [out[m] / mark for m, mark in MARKS.items() if m in out]
    return out | {"score": float(np.mean(marks)) if marks else np.inf, "runs": len(found), "lost": gone}
