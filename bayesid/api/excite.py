"""`bayesid.excite`: which force terms the runs of a trial excite, by a regression that needs no fit."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.analysis.excitation import Excitation
from bayesid.analysis.excitation import excite as regress
from bayesid.analysis.excitation.regression import as_json
from bayesid.api.inputs import TrialLike, VehicleLike, trial_of, vehicle_of
from bayesid.api.result import Result, table
from bayesid.equations.model import build_model
from bayesid.files import write_json
from bayesid.model.vehicles import Vehicle
from bayesid.progress import Progress
from bayesid.report.excite import TERM_COLUMNS, excitation_report, finding, term_rows, write_excitation_report
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.threads import one_blas_thread
from bayesid.trials import Trial

if TYPE_CHECKING:
    import pandas


@one_blas_thread
def excite(
    trial: TrialLike,
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    form: str = "weak",
    draws: int = 100,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> ExciteResult:
    """Say which force terms the identify runs excite, and which beyond the vehicle file they ask for.

    Parameters
    ----------
    trial, vehicle, data : as in `bayesid.fit`
    form : "weak" (averages, no accelerations) or "strong" (smoothed accelerations)
    draws : bootstrap draws

    Raises
    ------
    TrialError, VehicleError, ModelError
        what cannot be read or regressed
    """
    read = trial_of(trial, data)
    model = build_model(vehicle_of(vehicle, read), read.dof)
    drift = (read.environment.nav_drift or 0.0) if read.environment else 0.0
    found = regress(
        model, read.identify, read.noise, form=form, draws=min(draws, 20) if quick else draws, seed=seed,
        drift=drift, notify=(progress or Progress(quiet=True)).note,
    )  # fmt: skip
    return ExciteResult(read, found, model.vehicle)


@dataclass(frozen=True, eq=False, repr=False)
class ExciteResult(Result):
    """What the runs say about every term of the force table."""

    trial: Trial
    found: Excitation
    vehicle: Vehicle

    def to_dataframe(self) -> pandas.DataFrame:
        return table(TERM_COLUMNS, term_rows(self.found, all_of_them=True, vehicle=self.vehicle))

    def report(self) -> Report:
        return excitation_report(self.found, self.trial, self.vehicle)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        record = self.record()
        write_json(Path(folder) / "excitation.json", record)
        return write_excitation_report(self.found, self.trial, folder, record, self.vehicle)

    def record(self) -> Mapping[str, Any]:
        return as_json(self.found)

    def summary(self, verbose: bool = False) -> str:
        rows = table_text(TERM_COLUMNS, term_rows(self.found, all_of_them=verbose, vehicle=self.vehicle))
        return "\n".join([rows, "", *finding(self.found)])
