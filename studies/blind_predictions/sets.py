"""The sets of runs to be predicted, their known logs, and ships fitted to them.

Takes the data folder. Gives trials and fits. Does not predict.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import Vehicle, load_vehicle
from bayesid.progress import Progress
from bayesid.trials import Run, Trial, load_trial, thin
from studies.real_logs.run import HERE as LOGS
from studies.real_logs.run import INERTIA, SETTINGS, SINGLE_SCREW, WIND, begun, plain, with_wind
from studies.ship_models.ships import SHARE, SHIP_WIND, SHIPS, free_of, of_all_quadrants

HERE = Path(__file__).parent


@dataclass(frozen=True)
class BlindSet:
    """One folder of runs to be predicted.

    logs : the known logs of the same ship
    lead : first seconds of a run that hold readings [s]
    step : between predicted samples [s]
    from_rest : whether the runs begin at rest, so that known ones are taken from their first sample too
    extra : free parameters beside the coefficients of the vehicle file
    equations : "rows" or "mmg"
    """

    logs: str
    lead: float
    step: float
    from_rest: bool
    extra: tuple[str, ...]
    equations: str = "rows"


REGIMES = {"ahead": ("zigzag", "turn", "circle"), "slow": ("berthing", "random")}
SETS = {
    "esso_osaka": BlindSet("esso_osaka", 15.0, 0.5, True, (*SINGLE_SCREW, WIND)),
    "kvlcc2_other_basin": BlindSet("kvlcc2_hsva", 6.0, 0.25, False, ()),
}


def kind(name: str) -> str:
    """Kind of motion of a run, from its name."""
    head = name.split("_")[0].lower()
    return {"z": "zigzag", "turn": "turn", "circle": "circle"}.get(head, head)


def known_runs(blind: BlindSet, data: Path) -> Trial:
    """The known logs, wind given wherever it was measured; berthing runs, which the bundle leaves out, as
    well.
    """
    trial = load_trial(LOGS / blind.logs, data / blind.logs)
    if (HERE / f"{blind.logs}_more").is_dir():
        more = load_trial(HERE / f"{blind.logs}_more", data / blind.logs)
        trial = replace(trial, runs=(*(r for r in trial.runs if kind(r.name) != "random"), *more.runs))
    opened = data / blind.logs / "wind_opened"
    runs = [
        with_wind(run, opened / f"{run.name}.csv") if (opened / f"{run.name}.csv").is_file() else run
        for run in trial.runs
    ]
    return replace(trial, runs=tuple(runs))


def fitted(
    blind: BlindSet,
    trial: Trial,
    regime: str,
    data: Path,
    quick: bool,
    seed: int,
    out: Path,
    progress: Progress,
) -> TrialFit | None:
    """The ship fitted in pieces to the runs with role "identify" of one regime; None where there is none.

    At low speed and astern, cubic rows, which hold at one speed, run away: there products of velocities
    serve. A ship by MMG holds there too: its second fit is to all runs, from rest.
    """
    setting, mmg = SETTINGS[blind.logs], blind.equations == "mmg"
    step = setting.dt * (2 if quick or mmg else 1)
    there = [r for r in trial.runs if r.role == "identify"]
    inside = [r for r in there if kind(r.name) in REGIMES[regime]]
    if not inside:
        return None
    way = setting.way if regime == "ahead" else None
    if mmg and regime == "slow":
        inside = there
    chosen = replace(trial, runs=tuple(thin(begun(run, way), step) for run in inside))
    ship, free = equations_of(blind, regime, data)
    options = FitOptions(seed=seed, profile=True, rounds=3 if quick else 8 if mmg else 12)
    with progress.stage(f"{trial.name}: fit to {' and '.join(REGIMES[regime])} runs") as stage:
        return fit_in_pieces(
            chosen, setting.piece, ship, out, free=free, options=options,
            watch=lambda done, cost, step: stage.step(info=f"cost {cost:.5g}"),
            parts=SHARE[blind.logs] if mmg else None,
        )  # fmt: skip


def equations_of(blind: BlindSet, regime: str, data: Path) -> tuple[Vehicle, tuple[str, ...]]:
    """The ship a fit starts from and what it may move; MMG holds in both regimes."""
    if blind.equations == "mmg":
        ship = SHIPS[blind.logs](data / blind.logs)
        wide, free = of_all_quadrants(ship) if regime == "slow" else (ship, free_of(ship))
        wind = SHIP_WIND if WIND in blind.extra else ()
        return wide, (*free, *SINGLE_SCREW, *wind)
    ship = load_vehicle(LOGS / blind.logs / "vehicle.toml")
    ship = ship if regime == "ahead" else plain(ship)
    return ship, (*(n for n in ship.coef if n not in INERTIA), *blind.extra)


def prepared(blind: BlindSet, run: Run) -> Run:
    """A known run as a blind one is given: from its first sample, at the step of the predictions."""
    return thin(run if blind.from_rest else begun(run, SETTINGS[blind.logs].way), max(blind.step, 0.5))
