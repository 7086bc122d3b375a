"""`bayesid.excite`: which force terms the runs of a trial excite, by regressions that need no fit."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.analysis.excitation import Excitation
from bayesid.analysis.excitation.pysindy_regression import TermGroup, pysindy_terms
from bayesid.analysis.excitation.regression import as_json, excite_motions
from bayesid.analysis.excitation.track_smoother import smooth_tracks
from bayesid.analysis.identifiability import coefficient_rows, information, with_assumed_priors
from bayesid.api.inputs import TrialLike, VehicleLike, trial_of, vehicle_of
from bayesid.api.result import Result, table
from bayesid.equations.model import Model, build_model
from bayesid.errors import FitError, ModelError
from bayesid.estimation.output_error import coefficient_set, trial_problem
from bayesid.files import write_json
from bayesid.model.vehicles import ASSUMED_RELATIVE_SD, Vehicle
from bayesid.progress import Progress
from bayesid.report import excite_first_screen as screen
from bayesid.report.excite import TERM_COLUMNS, excitation_report, term_rows, write_excitation_report
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.simulation import with_shaft_speed
from bayesid.threads import one_blas_thread
from bayesid.trials import Trial

if TYPE_CHECKING:
    import pandas


MOST_PYSINDY_DRAWS = 60  # draws of PySINDy; more move no verdict


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
    """Say which force terms the identify runs excite: by PySINDy, beside it Fisher information and our own
    stepwise selection, which also says what the runs ask for beyond the vehicle file.

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
    read = with_shaft_speed(read, model.vehicle)
    drift = (read.environment.nav_drift or 0.0) if read.environment else 0.0
    if not read.identify:
        raise ModelError("no run to read; excitation needs at least one")
    shown = progress or Progress(quiet=True)
    shown.note(f"smoothing {len(read.identify)} run(s)")
    motions, _ = smooth_tracks(model, read.identify, read.noise, drift)
    shown.note("PySINDy")
    groups = pysindy_terms(
        model, motions, draws=20 if quick else min(draws, MOST_PYSINDY_DRAWS), seed=seed, form=form
    )
    found = excite_motions(
        model, motions, form=form, draws=min(draws, 20) if quick else draws, seed=seed, notify=shown.note
    )
    return ExciteResult(read, found, model.vehicle, groups, fisher_shares(model, read))


def fisher_shares(model: Model, trial: Trial) -> dict[str, tuple[float, str]]:
    """Coefficient -> share of the runs in its variance (0 to 1) and the verdict in words, from the
    information of the whole tracks at the vehicle file's values; empty where the vehicle diverges there.
    """
    try:
        problem = trial_problem(model, trial, coefficient_set(model, model.coefficients))
        info = information(with_assumed_priors(problem, ASSUMED_RELATIVE_SD))
    except (FitError, ModelError):
        return {}
    return {row.name: (row.index, row.words) for row in coefficient_rows(info)}


@dataclass(frozen=True, eq=False, repr=False)
class ExciteResult(Result):
    """What the runs say about every term of the force table."""

    trial: Trial
    found: Excitation
    vehicle: Vehicle
    groups: tuple[TermGroup, ...]
    fisher: Mapping[str, tuple[float, str]]

    def to_dataframe(self) -> pandas.DataFrame:
        return table(TERM_COLUMNS, term_rows(self.found, all_of_them=True, vehicle=self.vehicle))

    def report(self) -> Report:
        return excitation_report(self.found, self.trial, self.vehicle, self.groups, self.fisher)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        record = self.record()
        write_json(Path(folder) / "excitation.json", record)
        return write_excitation_report(
            self.found, self.trial, folder, record, self.vehicle, self.groups, self.fisher
        )

    def record(self) -> Mapping[str, Any]:
        told = [{k: _plain(v) for k, v in vars(g).items()} for g in self.groups]
        shares = {n: {"share_of_runs": share, "verdict": words} for n, (share, words) in self.fisher.items()}
        return {**as_json(self.found), "pysindy": told, "fisher": shares}

    def summary(self, verbose: bool = False) -> str:
        rows = screen.group_rows(self.groups, self.found, self.fisher, self.vehicle, all_of_them=verbose)
        lines = [screen.headline(self.groups), "", table_text(screen.COLUMNS, rows, 3)]
        if verbose:
            own = term_rows(self.found, all_of_them=True, vehicle=self.vehicle)
            lines += ["", "Stepwise selection, term by term:", "", table_text(TERM_COLUMNS, own)]
        return "\n".join([*lines, "", *screen.beyond(self.found)])


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return list(value) if isinstance(value, tuple) else value
