"""`bayesid.excite`: which force terms the runs of a trial excite, by regressions that need no fit."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.analysis.design import limits
from bayesid.analysis.design.planning_case import known_of, trial_case
from bayesid.analysis.excitation import Excitation
from bayesid.analysis.excitation.pysindy_regression import TermGroup, pysindy_terms
from bayesid.analysis.excitation.regression import as_json, excite_motions
from bayesid.analysis.excitation.track_smoother import smooth_tracks
from bayesid.analysis.identifiability import coefficient_rows, information, with_assumed_priors
from bayesid.api.earlier_fit import fit_of, form_rows_of, problem_at, with_share
from bayesid.api.inputs import TrialLike, VehicleLike, trial_of, vehicle_of
from bayesid.api.result import Result, table
from bayesid.equations.model import Model, build_model
from bayesid.errors import FitError, ModelError
from bayesid.estimation.likelihood.weighted_fit import weighed
from bayesid.estimation.output_error import Fit, FitProblem, coefficient_set, trial_problem
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
from bayesid.words import counted

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
    model: str | os.PathLike[str] | None = None,
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
    model : folder of `bayesid.fit` of the trial: the Fisher information is that at its values, under its
        noise and beside its model form. Without it a refit on the way tells what the readings carry

    Raises
    ------
    TrialError, VehicleError, ModelError
        what cannot be read or regressed
    """
    read = trial_of(trial, data)
    subject = build_model(vehicle_of(vehicle, read), read.dof)
    read = with_shaft_speed(read, subject.vehicle)
    drift = (read.environment.nav_drift or 0.0) if read.environment else 0.0
    if not read.identify:
        raise ModelError("no run to read; excitation needs at least one")
    shown = progress or Progress(quiet=True)
    shown.note(f"smoothing {counted(len(read.identify), 'run')}")
    motions, _ = smooth_tracks(subject, read.identify, read.noise, drift)
    shown.note("PySINDy")
    groups = pysindy_terms(
        subject, motions, draws=20 if quick else min(draws, MOST_PYSINDY_DRAWS), seed=seed, form=form
    )
    found = excite_motions(
        subject, motions, form=form, draws=min(draws, 20) if quick else draws, seed=seed, notify=shown.note
    )
    shown.note("Fisher information")
    if model is not None:
        shares, notes = shares_at_fit(subject, read, fit_of(model))
    else:
        shares, notes = shares_under_noise(subject, read)
    return ExciteResult(read, found, subject.vehicle, groups, shares, tuple(notes))


def fisher_shares(
    model: Model, trial: Trial, sigma: Mapping[str, float] | None = None, share: float = 1.0
) -> dict[str, tuple[float, str]]:
    """Coefficient -> share of the runs in its variance (0 to 1) and the verdict in words, from the
    information of the whole tracks at the vehicle file's values; empty where the vehicle diverges there.

    Parameters
    ----------
    sigma : channel -> noise [SI] instead of the stated
    share : of the information of white noise that the readings carry
    """
    try:
        problem = trial_problem(model, trial, coefficient_set(model, model.coefficients), sigma=sigma)
        return _rows(problem if share == 1.0 else weighed(problem, share))
    except (FitError, ModelError):
        return {}


def _rows(problem: FitProblem) -> dict[str, tuple[float, str]]:
    info = information(with_assumed_priors(problem, ASSUMED_RELATIVE_SD))
    return {row.name: (row.index, row.words) for row in coefficient_rows(info)}


def shares_at_fit(model: Model, trial: Trial, earlier: Fit) -> tuple[dict[str, tuple[float, str]], list[str]]:
    """`fisher_shares` as `bayesid identify --fit` has them."""
    formed = form_rows_of(earlier, model)
    names = tuple(n for n in earlier.values if n in model.coefficients and n not in formed)
    problem, said = problem_at(model, trial, names, earlier)
    problem, more = with_share(problem, earlier)
    try:
        return _rows(problem), [*said, *more]
    except (FitError, ModelError) as error:
        return {}, [f"no Fisher information at the values of the fit: {error}"]


def shares_under_noise(model: Model, trial: Trial) -> tuple[dict[str, tuple[float, str]], list[str]]:
    """`fisher_shares` under the noise that a refit of the runs leaves; as stated where it fails."""
    made = trial_case(model, trial, known_of(model), limits(model))
    noise = made.case.noise
    if noise is None:
        return fisher_shares(model, trial), [note for note in made.notes if "refit" in note]
    parts = noise.parts
    said = (
        f"readings carry {100 * parts.share:.2g} % of the information of white noise ({parts.describe()}), "
        "by a refit of the runs"
    )
    return fisher_shares(model, trial, made.case.logging.sigma, parts.share), [said]


@dataclass(frozen=True, eq=False, repr=False)
class ExciteResult(Result):
    """What the runs say about every term of the force table."""

    trial: Trial
    found: Excitation
    vehicle: Vehicle
    groups: tuple[TermGroup, ...]
    fisher: Mapping[str, tuple[float, str]]
    notes: tuple[str, ...] = ()

    def to_dataframe(self) -> pandas.DataFrame:
        return table(TERM_COLUMNS, term_rows(self.found, all_of_them=True, vehicle=self.vehicle))

    def report(self) -> Report:
        return excitation_report(self.found, self.trial, self.vehicle, self.groups, self.fisher, self.notes)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        record = self.record()
        write_json(Path(folder) / "excitation.json", record)
        return write_excitation_report(
            self.found, self.trial, folder, record, self.vehicle, self.groups, self.fisher, self.notes
        )

    def record(self) -> Mapping[str, Any]:
        told = [{k: _plain(v) for k, v in vars(g).items()} for g in self.groups]
        shares = {n: {"share_of_runs": share, "verdict": words} for n, (share, words) in self.fisher.items()}
        return {**as_json(self.found), "pysindy": told, "fisher": shares, "notes": list(self.notes)}

    def summary(self, verbose: bool = False) -> str:
        rows = screen.group_rows(self.groups, self.found, self.fisher, self.vehicle, all_of_them=verbose)
        notes = [f"note: {note}" for note in self.notes] + [""] * bool(self.notes)
        lines = [screen.headline(self.groups), "", *notes, table_text(screen.COLUMNS, rows, 3)]
        if verbose:
            own = term_rows(self.found, all_of_them=True, vehicle=self.vehicle)
            lines += ["", "Stepwise selection, term by term:", "", table_text(TERM_COLUMNS, own)]
        return "\n".join([*lines, "", *screen.beyond(self.found)])


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return list(value) if isinstance(value, tuple) else value
