"""`bayesid.diagnose`: where the gap between simulator and trial lies, what causes it, how far it shrinks."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.api.input_result import InputResult
from bayesid.api.inputs import (
    Names,
    TrialLike,
    VehicleLike,
    compiling_words,
    declared_effects,
    model_of,
    trial_of,
)
from bayesid.api.mistaken_log import with_held_out_checked
from bayesid.api.result import Result, table
from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.attempt import attempt
from bayesid.diagnosis.diagnosed_file import write_diagnosed
from bayesid.diagnosis.diagnosed_model import diagnosed_model_of
from bayesid.diagnosis.failed_checks import failures
from bayesid.diagnosis.input import as_read, check_trial, mended, missing_orders, not_enough
from bayesid.diagnosis.input.memory_needed import enough_memory
from bayesid.diagnosis.input_gap import NO_GAP, input_gap
from bayesid.diagnosis.of_log import or_with_earlier_orders
from bayesid.diagnosis.run import Diagnosis
from bayesid.diagnosis.run import diagnose as run
from bayesid.diagnosis.summary import summary
from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.estimation.filter_error.fit_journal import SUFFIX, FitJournal, fits_kept
from bayesid.files import write_json
from bayesid.places import NOWHERE, Places, places_of
from bayesid.progress import Progress, RouteStep
from bayesid.report.diagnosis.report import diagnosis_report, write_diagnosis_report
from bayesid.report.input import check_record, in_order_line
from bayesid.report.writer import Report
from bayesid.threads import one_blas_thread, processors, several_threads
from bayesid.trials import Trial
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.mistakes import InputCheck

if TYPE_CHECKING:
    import pandas

ROUTE = {
    "read": RouteStep(("reading:", "environment:", "path:"), 0.2),
    "none": RouteStep(("fit without any effect",), 0.05),
    "screen": RouteStep(("screen", "where the gap lies"), 0.08),
    "refits": RouteStep(
        ("refit", "what the best", "whether the equations", "the same", "events:"),
        0.22,
        "more explanations than usual come near, or all are weighed again",
    ),
    "held-out": RouteStep(("what the missing", "held-out runs"), 0.07),
    "next": RouteStep(("which manoeuvre",), 0.15),
    "draws": RouteStep(("posterior",), 0.16),
    "model": RouteStep(("model for predictions",), 0.07),
}
# Usual shares in six degrees of freedom, where reading costs little beside refits.
SPATIAL_SHARES = {
    "read": 0.04, "none": 0.02, "screen": 0.02, "refits": 0.62, "held-out": 0.1, "next": 0.1, "draws": 0.04,
    "model": 0.06,
}  # fmt: skip
# Folder of refits beside the results while a diagnosis is under way.
JOURNAL = "refits"
EFFECT_COLUMNS = ("effect", "probability", "parameter", "value", "sd", "unit")


@one_blas_thread
def diagnose(
    trial: TrialLike,
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    prior: float | None = None,
    effects: str | os.PathLike[str] | None = None,
    exclude: Names = None,
    resample: float | None = None,
    next_manoeuvre: bool = True,
    draws: bool = False,
    keep_model: bool = True,
    seed: int = 0,
    trust_input: bool = False,
    threads: int | None = None,
    first_look: bool = False,
    progress: Progress | None = None,
    journal: str | os.PathLike[str] | None = None,
) -> DiagnoseResult | InputResult:
    """Diagnose the gap between a simulator and a trial; held-out runs are read only after the verdict stands.

    A log that does not say what its header says is told first: the verdict is then `input`, with the mend and
    the diagnosis of the log mended in memory. One that holds too little to say anything gets
    `not_enough`.

    Parameters
    ----------
    trial, vehicle, data : as in `bayesid.fit`
    prior : coefficients known to this share from an earlier clean trial, e.g. 0.02
    effects : Python file whose EFFECTS are added to the catalogue; it is run
    exclude : effects that cannot be here, e.g. "wind,ocean_current" in a towing tank
    resample : time between readings [s]; commands keep their own times
    next_manoeuvre : also rank manoeuvres to execute next
    draws : also sample the named effects' parameters by emcee
    keep_model : also make the model that `bayesid.predict` draws from
    trust_input : take the log, and the noise it states, as they are
    threads : runs taken at a time, at most; a thread per processor where not given, fewer where memory is
        short. The numbers are the same
    first_look : compare explanations once: no events, no actuator that sticks, no environment beside the best
        explanation where straight runs told one; for six axes, where each takes minutes
    journal : folder that keeps every refit until `DiagnoseResult.save`: a diagnosis that is stopped goes on
        from there, with the very same numbers

    Raises
    ------
    TrialError, VehicleError, ModelError
        what cannot be read, or nothing to identify from
    """
    kept = None if journal is None else Path(journal) / JOURNAL
    places = places_of(trial, journal, data, vehicle, effects)
    logged = trial_of(trial, data)
    model = model_of(logged, vehicle, declared_effects(effects), exclude)
    shown = progress or Progress(quiet=True)
    if blown := wind_words(model.vehicle, logged):
        shown.note(blown)
    if words := compiling_words(model):
        shown.note(words)

    def used(of: Trial) -> Trial:
        return as_read(of, model, resample, trust_input)

    def diagnosis(of: Trial, checked: InputCheck, right: Trial | None = None) -> DiagnoseResult:
        told = shown.route(diagnosis_route(next_manoeuvre, draws, keep_model, model.dof == 6))
        if before := 0 if kept is None else len(list(kept.glob(f"*{SUFFIX}"))):
            shown.note(
                f"goes on with {before} refits kept of a diagnosis that was stopped; the log is read again"
            )
        run_on = partial(
            run, model=model, seed=seed, notify=told, as_built=prior, plan_next=next_manoeuvre, draw=draws,
            keep_model=keep_model, trust_noise=trust_input, first_look=first_look,
        )  # fmt: skip
        with fits_kept(kept) as fits, several_threads(threads_of(of, model, threads)):
            found = run_on(of)
            if right is not None:
                found = or_with_earlier_orders(found, of, right, used, run_on, shown.note)
        if not trust_input:  # after the verdict: held-out runs take no part in it
            found = with_held_out_checked(found, of if right is None else right, model.vehicle)
        if fits is not None and fits.used:
            shown.note(f"{fits.used} refits of the diagnosis that was stopped before were used")
        return DiagnoseResult(found, checked, fits, places)

    def of_mended(checked: InputCheck, result: DiagnoseResult) -> InputResult:
        untold: list[str] = []
        gap = attempt(
            "how far the log as it is was missed could not be told",
            lambda: input_gap(result.found, used(logged), checked.findings),
            NO_GAP,
            untold,
        )
        for text in untold:
            shown.note(text)
        return InputResult(logged.name, checked, (), result, gap)

    def mistaken_simulator(of_log: InputCheck) -> DiagnoseResult | InputResult | None:
        """What only the vehicle tells of the log, or a log that looks like another vehicle's, where a mistake
        of the simulator explains it."""
        if any(f.correction is None for f in of_log.findings):
            return None
        right = mended(logged, of_log)
        trial = used(right)
        if not_enough(trial, model):
            return None
        found = diagnosis(trial, of_log, right)
        if found.found.result.simulator:
            return of_mended(of_log, found) if of_log.findings else found
        if found.journal is not None:  # nobody saves it
            found.journal.clear()
        return None

    lost = tuple(missing_orders(logged, model.vehicle).values())
    if trust_input:
        for text in lost:
            shown.note(text)
        return diagnosis(used(logged), InputCheck())
    if lost:
        return InputResult(logged.name, InputCheck(), lost)
    shown.note("input: what the channels say of one another")
    checked = check_trial(logged, model)
    if any(finding.instead for finding in checked.findings):
        if (found := mistaken_simulator(checked.of_log)) is not None:
            return found
        checked = checked.insisted
    if any(finding.correction is None for finding in checked.findings):
        return InputResult(logged.name, checked)
    right = mended(logged, checked) if checked.findings else logged
    trial = used(right)
    trial = replace(trial, warnings=(*trial.warnings, *checked.left_open))
    if reasons := not_enough(trial, model):
        return InputResult(logged.name, checked, reasons)
    result = diagnosis(trial, checked, right)
    return of_mended(checked, result) if checked.findings else result


def threads_of(trial: Trial, model: Model, wanted: int | None) -> int:
    """Threads over the runs to identify: no more than there are runs, nor than there is memory for.

    Raises
    ------
    TrialError
        if so many are wanted as cannot be
    """
    if wanted is not None and (not isinstance(wanted, int) or wanted < 1):
        raise TrialError(f"threads is {wanted!r}; it is a whole number of at least 1")
    count = min(processors() if wanted is None else wanted, len(trial.identify))
    while count > 1 and not enough_memory(trial, model, count):
        count -= 1
    return max(count, 1)


def diagnosis_route(
    next_manoeuvre: bool, draws: bool, keep_model: bool, spatial: bool = False
) -> list[RouteStep]:
    """Steps that a diagnosis goes through; shares of the time as measured on the practice bundles."""
    asked = {"next": next_manoeuvre, "draws": draws, "model": keep_model}
    shares = SPATIAL_SHARES if spatial else {}
    return [
        replace(step, share=shares.get(name, step.share))
        for name, step in ROUTE.items()
        if asked.get(name, True)
    ]


@dataclass(frozen=True, eq=False, repr=False)
class DiagnoseResult(Result):
    """A diagnosis."""

    found: Diagnosis
    checked: InputCheck = field(default_factory=InputCheck)
    journal: FitJournal | None = None
    places: Places = NOWHERE

    @property
    def verdict(self) -> str:
        """The word of the verdict."""
        return self.found.result.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects the verdict stands on; of an ambiguous one those in question."""
        return tuple(effect.name for effect in self.found.result.effects)

    @property
    def failures(self) -> tuple[str, ...]:
        """Checks that failed, one sentence each."""
        return failures(self.found.result)

    @property
    def headline(self) -> str:
        """The answer in a sentence or two."""
        return answer(self.found.result).headline

    @cached_property
    def _record(self) -> dict[str, Any]:
        return {**self.found.result.record(), "input": check_record(self.checked)}

    def record(self) -> Mapping[str, Any]:
        return self._record

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per parameter of every effect in question."""
        rows: list[list[Any]] = []
        for effect in self.found.result.effects:
            for name, p in effect.parameters.items():
                rows.append([effect.name, effect.probability, name, p.value, p.sd, p.unit])
        return table(EFFECT_COLUMNS, rows)

    def report(self) -> Report:
        return diagnosis_report(self.found.result, self.places)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write_json(target / "diagnosis.json", self._record)
        if self.found.diagnosed is not None:
            write_diagnosed(diagnosed_model_of(self.found), target)
        if self.found.posterior is not None:
            self.found.posterior.posterior.to_netcdf(target / "posterior.nc")
        report = write_diagnosis_report(self.found.result, target, self.places.written(target))
        if self.journal is not None:
            self.journal.clear()
        return report

    def summary(self, verbose: bool = False) -> str:
        lines = (in_order_line(self.checked), *(f"but {text}" for text in self.checked.left_open))
        return "\n".join([*filter(None, lines), summary(self.found.result, verbose, self.places)])
