"""What a fit of a ship by MMG may move, chosen by runs left out among those to identify.

Takes the runs to identify. Gives the candidates with their errors and the best one. Reads no held-out run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
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
from bayesid.trials import Trial, thin
from studies.real_logs.run import SETTINGS, SINGLE_SCREW
from studies.ship_models.errors import errors
from studies.ship_models.report import MARKS
from studies.ship_models.ships import AT_ONE_RPM, INERTIA, KNOWN, SHARE, SHIP_WIND, free_of

FOLDS, ROUNDS = 2, 5
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
    screw = (*SINGLE_SCREW, *(SHIP_WIND if SETTINGS[name].wind else ()))
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
        ", servo lag": ("actuator_lag.tau",),
    }
    return (
        *(
            Candidate(f"power as information{words}", (*usual, *screw, *more), share)
            for words, more in extra.items()
        ),
        Candidate("power as asked", (*usual, *screw), None),
    )


def chosen(
    name: str, trial: Trial, ship: Vehicle, out: Path, seed: int, progress: Progress
) -> dict[str, Any]:
    """Record: candidate -> rms of every measure over left-out runs, and the key of the best.

    The score is the mean of the measures that have a mark, each over its mark. Candidates whose errors are
    there already are not fitted again.
    """
    runs = [thin(run, 2 * SETTINGS[name].dt) for run in trial.identify]
    kept = out / "choice.json"
    table: dict[str, Any] = json.loads(kept.read_text()) if kept.is_file() else {}
    for candidate in candidates(name, ship):
        if candidate.key in table:
            continue
        found: list[dict[str, float]] = []
        for fold in range(FOLDS):
            held = {run.name for run in runs[fold::FOLDS]}
            roles = tuple(replace(r, role="holdout" if r.name in held else "identify") for r in runs)
            with progress.stage(f"{name}: {candidate.key}, fold {fold + 1}") as stage:
                try:
                    fit = fit_in_pieces(
                        replace(trial, runs=roles), SETTINGS[name].piece, ship, None, free=candidate.free,
                        parts=candidate.parts, options=FitOptions(seed=seed, profile=True, rounds=ROUNDS),
                        watch=lambda done, cost, step, s=stage: s.step(info=f"cost {cost:.5g}"),
                    )  # fmt: skip
                except BayesidError as error:
                    progress.note(f"{candidate.key}: {error}")
                    continue
            by_name = {run.name: run for run in roles}
            judged = outcomes(
                fit.problem, replace(trial, runs=tuple(r for r in roles if r.name in held)), fit.fit
            )
            found += [errors(one, by_name[one.name], "fitted") for one in judged]
        table[candidate.key] = joined_errors(found)
        write_json(kept, table)
    best = min(table, key=lambda key: table[key]["score"])
    return {"tried": table, "best": best}


def joined_errors(found: list[dict[str, float]]) -> dict[str, float]:
    """Rms of each measure over runs and the score; a lost run counts as infinite."""
    out: dict[str, float] = {}
    for measure in ("psi", "r", "position", *MARKS):
        values = [one[measure] for one in found if measure in one and not np.isnan(one[measure])]
        if values:
            join = np.sqrt(np.mean(np.square(values))) if measure in MARKS else np.median(values)
            out[measure] = float(join)
    marks = [out[m] / mark for m, mark in MARKS.items() if m in out]
    return out | {"score": float(np.mean(marks)) if marks else float("inf"), "runs": len(found)}
