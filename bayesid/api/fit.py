"""`bayesid.fit`: coefficients from a trial, judged on the runs that were kept back."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bayesid.api.inputs import (
    Names,
    TrialLike,
    VehicleLike,
    compiling_words,
    declared_effects,
    names_of,
    prepared,
    trial_of,
    vehicle_of,
    with_believed_noise,
)
from bayesid.api.mistaken_log import with_log_checked
from bayesid.api.result import Result, table
from bayesid.diagnosis.diagnosed_file import remove_fitted, write_diagnosed, write_why_not
from bayesid.diagnosis.input import missing_orders, not_enough
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError, FitError, TrialError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.posterior import CONFLICT
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.terms import term
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.convention import moving_with
from bayesid.places import NOWHERE, Places, places_of
from bayesid.prediction.fitted_model import Calibration, diverging_draws, predictive_model
from bayesid.progress import Progress
from bayesid.report import coefficient_cells
from bayesid.report.fit import (
    MISFIT,
    calibration_words,
    diverging_words,
    failed_checks,
    fit_report,
    force_left_out,
    form_words,
    noise_level,
    predictive_words,
    write_fit_report,
)
from bayesid.report.fit_effects import effect_words
from bayesid.report.fit_first_screen import NO_VALUE, headline, moved
from bayesid.report.fit_form import form_rows_of
from bayesid.report.fit_held import actuator_words, freeing_words
from bayesid.report.prediction_error import (
    PREDICTION_COLUMNS,
    no_fit_note,
    prediction_numbers,
    prediction_rows,
)
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.simulation import with_shaft_speed
from bayesid.threads import one_blas_thread, processors, several_threads
from bayesid.trials.condensing import condensed
from bayesid.trials.measured_wind import wind_words
from bayesid.words import and_list, counted, did_you_mean

if TYPE_CHECKING:
    import pandas

QUICK_SAMPLES, QUICK_ROUNDS = 300, 6
QUICK_FIT = "it was made with --quick; run it again without"
# Samples to identify above which dense readings are averaged.
MOST_SAMPLES = 100_000
COLUMNS = ("coefficient", "start (prime)", *coefficient_cells.COLUMNS, "sd [%]", "remark")


@one_blas_thread
def fit(
    trial: TrialLike,
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    free: Names = None,
    fix: Names = None,
    with_effects: Names = None,
    effects: str | os.PathLike[str] | None = None,
    runs: Names = None,
    resample: float | None = None,
    pieces: float | None = None,
    estimate_noise: bool = False,
    residuals: Literal["auto", "white"] = "auto",
    starts: int = 1,
    resume: bool = True,
    seed: int = 0,
    quick: bool = False,
    trust_input: bool = False,
    progress: Progress | None = None,
) -> FitResult:
    """Identify a vehicle's coefficients from a trial and predict its held-out runs.

    Parameters
    ----------
    trial : bundle or `Trial`
    vehicle : by default the one the trial names
    data : folder of the logs where they are kept outside the bundle
    out : folder for every iterate as it is found, fit.json, vehicle.toml and, unless `quick`, model.json,
        which `bayesid.predict` reads; `FitResult.save` adds the report
    free, fix : coefficients to free (default: all of the vehicle file) or to keep, "N_v,N_r" or an iterable
    with_effects : effects of the catalogue, or parameters of theirs, to free beside the coefficients, with
        their declared priors: "wind,actuator_lag.tau". The vehicle found keeps them
    effects : Python file whose EFFECTS are added to the catalogue; it is run
    runs : runs to fit; all others are held out. By default the roles of the trial
    resample : read every so many seconds only
    pieces : fit runs in pieces of this length [s], for unstable vehicles
    estimate_noise : weights from the residuals instead of the stated noise
    residuals : "auto" gives readings the weight, and coefficients the interval, that memory of the residuals
        and differences between runs ask for; "white" takes residuals as white noise
    starts : number of starts
    resume : go on from an interrupted fit in `out`
    trust_input : take the log as it is, whatever its channels say of one another

    Returns
    -------
    FitResult                  also where the search did not converge

    Raises
    ------
    TrialError, VehicleError, FitError
        what cannot be read or set up; a log that does not say what its header says (`MistakenLogError`)
    """
    logged = trial_of(trial, data)
    ship = vehicle_of(vehicle, logged)
    kept = names_of(fix) or []
    unknown = [name for name in kept if name not in ship.coef]
    if unknown:
        raise FitError(
            f"{ship.name} has no coefficient {', '.join(unknown)} to keep"
            + (did_you_mean(unknown, ship.coef) or f"; it has {', '.join(ship.coef)}")
        )
    chosen = with_shaft_speed(prepared(logged, runs, resample, QUICK_SAMPLES if quick else None), ship)
    if lacking := (*missing_orders(chosen, ship).values(), *not_enough(chosen)):
        raise TrialError(f"{logged.name}: {'; '.join(lacking)}")
    if not trust_input:
        chosen = with_log_checked(chosen, prepared(logged, runs), ship)
    if not estimate_noise:
        chosen = with_believed_noise(chosen, ship)
    if not resample:
        chosen = condensed(chosen, ship, MOST_SAMPLES, trust_noise=True)
    # profile None: the noise is estimated where the trial leaves that of a channel open
    options = FitOptions(seed=seed, starts=starts, profile=True if estimate_noise else None)
    options = replace(options, rounds=QUICK_ROUNDS) if quick else options
    shown = progress or Progress(quiet=True)
    if blown := wind_words(ship, chosen):
        shown.note(blown)
    if not ship.planar_only and chosen.dof == 6 and (words := compiling_words(build_model(ship, 6))):
        shown.note(words)
    wanted = names_of(free)
    if wanted and (beside := _moved_with(ship, 3 if ship.planar_only else chosen.dof, wanted, kept)):
        wanted = [*wanted, *beside]
        shown.note(
            f"{and_list(list(beside))} of {ship.name}, made of the added masses that are freed (Kirchhoff's "
            "equations), freed as well; `fix` keeps what it names"
        )
    shown.expect(1 if out is None or quick else 2)
    with shown.stage("fit") as stage:
        found = fit_in_pieces(
            chosen, pieces, ship, out, free=wanted, fixed=kept, options=options, resume=resume,
            effects=names_of(with_effects) or [], declared=declared_effects(effects),
            parts=NoiseParts() if residuals == "white" else None,
            watch=lambda done, cost, step: stage.step(info=f"cost {cost:.6g}, step {step:.1g}"),
            say=(lambda text: shown.note(f"{out}: {text}")) if resume else None,
        )  # fmt: skip
    places = places_of(trial, out, data, vehicle, effects)
    if out is not None:
        remove_fitted(out)  # it would predict with the coefficients of the fit before
    if out is None:
        return FitResult(found, places=places)
    if quick or found.posterior is None:
        why = QUICK_FIT if quick else "the vehicle diverges at its estimate"
        write_why_not(out, why)
        return FitResult(found, places=places, no_model="" if quick else why)
    try:
        with shown.stage("predict the fitted runs") as stage, several_threads(processors()):
            model, calibration = predictive_model(found, seed=seed, say=lambda text: stage.step(info=text))
            lost = diverging_draws(model, found.trial.holdout or found.trial.identify, seed=seed)
    except BayesidError as error:
        shown.note(f"no model for predictions: {error}")
        write_why_not(out, str(error))
        return FitResult(found, places=places, no_model=str(error))
    noise = found.trial.of_single_readings(model.noise)
    write_diagnosed(replace(model, failed_checks=tuple(failed_checks(found)), noise=noise), out)
    return FitResult(found, replace(calibration, diverge=lost), places)


def _moved_with(ship: Vehicle, dof: int, wanted: Sequence[str], kept: Sequence[str]) -> tuple[str, ...]:
    """Rows that hold added masses among those wanted, of a vehicle whose rows were completed from its added
    masses: left as they are, the other coefficients would make up for them."""
    if not ship.completed:
        return ()
    inertia = [name for name in wanted if name in ship.coef and term(name).is_inertia]
    aside = {*wanted, *kept}
    there = build_model(ship, dof).coefficients
    return tuple(name for name in moving_with(inertia) if name in there and name not in aside)


@dataclass(frozen=True, eq=False, repr=False)
class FitResult(Result):
    """A fit.

    Attributes
    ----------
    calibration : how well the fitted runs are predicted from their first readings; None without `out`
    no_model : why no model for predictions could be made; empty where it could, or was not asked for
    found : trial, vehicle as given and as identified, problem, estimates, runs beside their simulations
    """

    found: TrialFit
    calibration: Calibration | None = None
    places: Places = NOWHERE
    no_model: str = ""

    @property
    def success(self) -> bool:
        """Whether the search converged and data and prior together determine every free combination."""
        return self.found.fit.success

    @property
    def failures(self) -> list[str]:
        """Checks that failed, one sentence or two each."""
        return failed_checks(self.found)

    @property
    def vehicle(self) -> Vehicle:
        """The identified vehicle."""
        return self.found.identified

    def coefficients(self) -> list[list[Any]]:
        """Rows of start, estimate (prime and SI) and sd per coefficient."""
        result, vehicle = self.found.fit, self.found.vehicle
        rows: list[list[Any]] = []
        for i, name in enumerate(result.names[: result.n_params]):
            bound = "on a bound" if name in result.at_bound else self._remark(i)
            size = abs(result.z[i])
            told = size > NO_VALUE * abs(result.start[i])
            relative = 100 * result.sd[i] / size if told else math.nan
            start = coefficient_cells.prime(vehicle, name, result.start[i])
            cells = coefficient_cells.cells(vehicle, name, result.z[i])
            cells[2] = cells[2] or self.found.model.parameter_unit(name)
            rows.append([name, start, *cells, relative, bound])
        return rows

    def _remark(self, i: int) -> str:
        posterior = self.found.posterior
        if self.found.fit.names[i] in form_rows_of(self.found.fit):
            return "model form"
        if posterior is None:
            return ""
        said = []
        if abs(posterior.conflict[i]) > CONFLICT:
            said.append(f"prior conflict of {abs(posterior.conflict[i]):.1f} sd")
        if self.found.fit.names[i] in posterior.wider_than_prior:
            said.append("less sure than the prior")
        return ", ".join(said)

    def to_dataframe(self) -> pandas.DataFrame:
        return table(COLUMNS, self.coefficients()).set_index("coefficient")

    def report(self) -> Report:
        return fit_report(self.found, self.calibration, self.places, self.no_model)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        written = self.places.written(folder)
        return write_fit_report(self.found, folder, self.calibration, written, self.no_model)

    def record(self) -> Mapping[str, Any]:
        found, result = self.found, self.found.fit
        columns = {"start": result.start, "value": result.z, "sd": result.sd}
        return {
            "trial": found.trial.name, "vehicle": found.vehicle.name, "digest": result.digest,
            "seed": result.seed,
            "success": result.success, "converged": result.converged, "status": result.status,
            "verdict": result.verdict, "cost": [result.cost_start, result.cost],
            "estimates_SI": {
                name: {key: float(values[i]) for key, values in columns.items()}
                for i, name in enumerate(result.names[: result.n_params])
            },
            "at_bound": result.at_bound, "failed_checks": self.failures,
            "uncertainty": result.uncertainty,
            "prediction": self.calibration,
            "flat": [{"name": d.name, "held_by": d.decided_by} for d in result.flat],
            "runs": prediction_numbers(found.runs),
        }  # fmt: skip

    def summary(self, verbose: bool = False) -> str:
        found, result = self.found, self.found.fit
        size = (
            f"{counted(len(found.problem.runs), 'run')}, {result.n_readings} readings, "
            f"{counted(result.n_params, 'unknown')}"
        )
        before, after = (noise_level(found.runs, "identify", key) for key in ("rms_nominal", "rms_fitted"))
        lines = [headline(found)]
        lines += effect_words(found)
        if words := moved(found):
            lines.append(words)
        lines += [f"CHECK FAILED: {text}" for text in self.failures]
        lines += [s.replace("`", "") for s in (*freeing_words(found), *actuator_words(found))]
        lines += [
            "",
            f"{found.trial.name}: {size}, {result.seconds:.1f} s",
            f"{result.verdict}.",
            f"residuals of the fitted runs: from {before} to {after} times the noise{force_left_out(found)}",
        ]
        lines += self._doubts()
        lines += ["", table_text(COLUMNS, self.coefficients())]
        if result.flat:
            lines.append("\nNot determined by these data:")
            lines += [f"  {d.name}: held by {d.decided_by}" for d in result.flat]
        if self.calibration is not None:
            lines += ["", calibration_words(self.calibration), *diverging_words(self.calibration)]
        held = [run for run in found.runs if run.role == "holdout"]
        if held or verbose:
            of_held = " of the held-out runs, predicted from their first readings" if held else ""
            shown = held if held and not verbose else found.runs
            whole = "; of whole runs, where a diagnosis counts after the first seconds"
            lines.append("\nRms errors" + of_held + whole)
            lines.append(table_text(PREDICTION_COLUMNS, prediction_rows(shown), digits=3))
            lines += filter(None, [no_fit_note(shown)])
        return "\n".join(lines)

    def _doubts(self) -> list[str]:
        """What the standard deviations rest on, and reasons not to trust them."""
        found, result, lines = self.found, self.found.fit, []
        if found.posterior is not None:
            lines += found.posterior.less_sure()
        if not found.fit.uncertainty.get("form_failed"):
            lines += form_words(found.fit)
        lines += predictive_words(found.fit)
        if found.posterior is not None:
            lines.append(f"errors of the fit: {found.posterior.parts.describe()}")
        if found.posterior is None or found.posterior.parts.white:
            trust = "the standard deviations are those of white noise and do not allow for it."
        elif found.posterior.halves is None:
            trust = "with a single run the standard deviations are not to be trusted."
        else:
            trust = "the standard deviations allow for it as far as the runs show it."
        raised = bool(result.uncertainty.get("noise_raised"))
        if not force_left_out(found) and (raised or 2 * result.cost > MISFIT**2 * result.n_readings):
            advice = "Try --estimate-noise, or `bayesid diagnose`."
            if raised:
                advice = "The channels are weighed by their residuals; see `bayesid diagnose`."
            lines.append(f"The model misses these runs, or the stated noise is too small: {trust} {advice}")
        stated = found.trial.noise
        above = {c: v / stated[c] for c, v in result.sigma.items() if stated.get(c, 0) > 0}
        far = [f"{c} {ratio:.3g}" for c, ratio in above.items() if ratio > MISFIT]
        if far:
            lines.append(
                f"Estimated noise, times the stated: {', '.join(far)}. So much is error of the model or a "
                "disturbance rather than noise; see `bayesid diagnose`."
            )
        return lines
