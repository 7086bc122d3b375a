"""`bayesid.compare`: which manoeuvre reveals which coefficient, adds what, and predicts which other."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bayesid.analysis.design.compare import (
    PlanningCase,
    crossing,
    rank_correlation,
    refit_all,
    refit_crossing,
    richness,
)
from bayesid.analysis.design.criteria import flat_names
from bayesid.analysis.design.regression_check import inclusion
from bayesid.analysis.design.ridge_map import per_minute, ridge_map
from bayesid.analysis.design.run_selection import best_sets
from bayesid.api.inputs import Names, VehicleLike
from bayesid.api.planning import case_of, orders, require_rudder, subject_of
from bayesid.api.result import Result, table
from bayesid.files import write_json
from bayesid.model.vehicles import Vehicle
from bayesid.progress import Progress
from bayesid.report import compare as words
from bayesid.report.compare import Comparison
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.threads import one_blas_thread
from bayesid.trials import Trial

if TYPE_CHECKING:
    import pandas


@one_blas_thread
def compare(
    source: Trial | Vehicle | str | os.PathLike[str],
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    resample: float | None = None,
    pieces: float | None = None,
    dof: int | None = None,
    model: str | os.PathLike[str] | None = None,
    executed: Iterable[str] = (),
    also: Iterable[str] = (),
    duration: float | None = None,
    rudder: float | None = None,
    plane: float | None = None,
    noise: Mapping[str, float] | None = None,
    dt: float | None = None,
    fix: Names = None,
    prior: float | None = None,
    draws: int = 8,
    refits: int = 3,
    time: float | None = None,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> CompareResult:
    """Compare the manoeuvres of the library before any is executed: information, cross prediction.

    Parameters
    ----------
    source : a vehicle, or a trial whose identify runs count as executed
    vehicle : instead of the one the trial names
    data, resample, pieces : of a trial, as in `bayesid.fit`
    model : folder of `bayesid.fit` of the trial; its estimate, noise and model form are taken. Without it
        the runs are refitted on the way
    executed : manoeuvres that count as executed already, of a vehicle
    also : manoeuvres compared with the library, e.g. "table:mine.csv"
    duration, dt : length of a run and time between readings [s]
    rudder, plane : largest angles [rad]
    noise : logged channel -> sigma [SI]
    fix : coefficients taken as known
    prior : relative prior sd of every coefficient; by default the vehicle file's, and 0.1 where it states
        none
    draws : vehicles drawn from what is known
    refits : true vehicles simulated and refitted to check
    time : of the best single run, pair and triple together [s]; by default without limit

    Raises
    ------
    TrialError, VehicleError, FitError, ManoeuvreError
        what cannot be read, set up or executed
    """
    subject, trial = subject_of(source, vehicle, dof, prior, data, resample)
    require_rudder(subject.vehicle, "compared")
    made = case_of(
        subject, trial, executed=executed, fitted=model, fix=fix, noise=noise, dt=dt, duration=duration,
        rudder=rudder, plane=plane, pieces=pieces,
    )  # fmt: skip
    found = compared(
        made.case, made.notes, orders(subject, also), 4 if quick else draws, 0 if quick else refits, seed,
        progress or Progress(quiet=True), math.inf if time is None else time,
    )  # fmt: skip
    return CompareResult(found)


def compared(
    case: PlanningCase,
    notes: tuple[str, ...],
    also: Mapping[str, Any],
    draws: int,
    refits: int,
    seed: int,
    progress: Progress,
    time: float = math.inf,
) -> Comparison:
    """The comparison of the library and of manoeuvres given."""
    rng = np.random.default_rng(seed)
    vehicles = case.draws(rng, draws)
    allowed, refused = case.allowed()
    manoeuvres = {**allowed, **also}
    progress.expect(refits + 2 if refits else 1)
    with progress.stage("information", len(manoeuvres)) as stage:
        now = case.now(vehicles)
        rich, infos = richness(case, manoeuvres, vehicles, lambda name: stage.step(info=name), now)
    refused |= {n: "not every vehicle drawn survives it" for n in manoeuvres if n not in infos}
    executed = {c.name: manoeuvres[c.name] for c in rich.criteria}
    cross = crossing(case, executed, {n: infos[n] for n in executed}, vehicles)
    trials = []
    for k, par in enumerate(case.draws(rng, refits) if refits else ()):
        with progress.stage(f"refits of vehicle {k + 1} of {refits}", len(executed)) as stage:
            trials.append(refit_all(case, executed, par, seed + k, lambda _: stage.step()))
    actual = included = None
    if trials:
        cross = refit_crossing(case, cross, trials)
        actual = np.array([
            np.mean([t.refits[n].contraction(case.knowledge) for t in trials if n in t.refits], axis=0)
            for n in executed
        ])  # fmt: skip
        with progress.stage("sparse regression", len(executed)) as stage:
            seen = inclusion(case, executed, case.model.nominal, seed, watch=lambda _: stage.step())
        included = np.array([seen.get(n, np.full(len(case.knowledge.names), np.nan)) for n in executed])
    fisher = rich.contraction()
    gains = np.array([c.gain for c in rich.criteria])
    ranks = {"richness and (small) predicted error over the other manoeuvres": rank_correlation(
        gains, -cross.others(cross.predicted))}  # fmt: skip
    if actual is not None and included is not None:
        ranks |= {
            "expected contraction and contraction of refits": rank_correlation(fisher, actual),
            "expected contraction and inclusion by sparse regression": rank_correlation(fisher, included),
            "contraction of refits and inclusion by sparse regression": rank_correlation(actual, included),
            "predicted and actual cross error": rank_correlation(cross.predicted, cross.actual),
            "richness and (small) actual error over the other manoeuvres": rank_correlation(
                gains, -cross.others(cross.actual)),
        }  # fmt: skip
    return Comparison(
        case, rich, {n: flat_names(case.knowledge, infos[n]) for n in executed}, actual, included, cross,
        ranks, refused, notes, seed, len(vehicles), len(trials),
        per_minute({n: infos[n] for n in executed}),
        ridge_map(case.knowledge, {n: infos[n] for n in executed}),
        best_sets(infos, now.matrices, time), time,
    )  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class CompareResult(Result):
    """What each manoeuvre would tell."""

    found: Comparison

    def to_dataframe(self) -> pandas.DataFrame:
        rows = words.richness_rows(self.found.case.knowledge, self.found.richness)
        return table(words.RICHNESS_COLUMNS, rows).set_index(words.RICHNESS_COLUMNS[0])

    def report(self) -> Report:
        return words.comparison_report(self.found)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        record = words.comparison_record(self.found)
        write_json(Path(folder) / "comparison.json", record)
        return words.write_comparison(self.found, folder, record)

    def record(self) -> Mapping[str, Any]:
        return words.comparison_record(self.found)

    def summary(self, verbose: bool = False) -> str:
        rows = words.richness_rows(self.found.case.knowledge, self.found.richness)
        return "\n".join([
            words.headline(self.found),
            "",
            *(f"note: {note}" for note in self.found.notes),
            *words.set_lines(self.found),
            "",
            table_text(words.RICHNESS_COLUMNS, rows, digits=3),
            *(f"left out: {name}: {why}" for name, why in self.found.refused.items()),
            *(f"rank correlation, {what}: {value:.2f}" for what, value in self.found.ranks.items()),
        ])  # fmt: skip
