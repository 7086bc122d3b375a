"""`bayesid.identify`: what a trial can tell about coefficients and what it leaves open; nothing is fitted."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bayesid.analysis.identifiability import Derived, Identifiability, derived, full_vectors
from bayesid.analysis.identifiability import identify as look
from bayesid.api.earlier_fit import fit_of, form_rows_of, problem_at, with_share
from bayesid.api.inputs import Names, TrialLike, VehicleLike, names_of, prepared, trial_of, vehicle_of
from bayesid.api.result import Result, table
from bayesid.diagnosis.input import missing_orders
from bayesid.equations.model import build_model
from bayesid.errors import TrialError
from bayesid.estimation.output_error import FitProblem, coefficient_set, trial_problem
from bayesid.estimation.segments import in_pieces
from bayesid.model.vehicles import ASSUMED_RELATIVE_SD, Vehicle
from bayesid.places import NOWHERE, Places, places_of
from bayesid.progress import Progress
from bayesid.report import identify as words
from bayesid.report import identify_first_screen as screen
from bayesid.report.writer import Report
from bayesid.report.writer.text import table_text
from bayesid.simulation import shaft_speed_note, with_shaft_speed
from bayesid.threads import one_blas_thread
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.noise import raised, raised_words

if TYPE_CHECKING:
    import pandas

QUICK_SAMPLES = 300
MOST_LEFT = 12  # open directions of a summary; a 6-DOF vehicle may have seventy
DRAWS, ZIGZAGS = 200, 40  # of prior and posterior, for what the vehicle does


@one_blas_thread
def identify(
    trial: TrialLike,
    vehicle: VehicleLike | None = None,
    *,
    data: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    free: Names = None,
    fix: Names = None,
    runs: Names = None,
    resample: float | None = None,
    pieces: float | None = None,
    fitted: str | os.PathLike[str] | None = None,
    prior: float | None = None,
    profile: bool = True,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> IdentifyResult:
    """Say which coefficients and combinations a trial fixes, and which rest on the prior.

    Parameters
    ----------
    trial, vehicle, data, free, fix, runs, resample, pieces : as in `bayesid.fit`
    out : folder in which an interrupted profile goes on where it was
    fitted : folder (or fit.json) of an earlier fit, whose values and noise are looked at
    prior : relative prior sd of every coefficient; by default the vehicle file's, and 0.1 where it states
        none
    profile : refit around every coefficient, and fly vehicles drawn from what is known

    Raises
    ------
    TrialError, VehicleError, FitError
        what cannot be read or set up
    """
    logged = trial_of(trial, data)
    ship = vehicle_of(vehicle, logged, prior)
    chosen = with_shaft_speed(prepared(logged, runs, resample, QUICK_SAMPLES if quick else None), ship)
    if lacking := missing_orders(chosen, ship):
        raise TrialError(f"{logged.name}: {'; '.join(lacking.values())}")
    chosen = in_pieces(chosen, pieces) if pieces else chosen
    model = build_model(ship, 3 if ship.planar_only else chosen.dof)
    earlier = fit_of(fitted) if fitted is not None else None
    formed = form_rows_of(earlier, model) if earlier is not None else frozenset()
    wanted = names_of(free) or (earlier.names[: earlier.n_params] if earlier else model.coefficients)
    kept = set(names_of(fix) or ())
    names = tuple(n for n in wanted if n not in kept | formed)
    point, remarks = "the values of the vehicle file", list[str]()
    bound: tuple[str, ...] = ()
    if earlier is not None:
        point, bound = "the values of an earlier fit", earlier.at_bound
        problem, remarks = problem_at(model, chosen, names, earlier)
    else:
        problem = trial_problem(model, chosen, coefficient_set(model, names))
    remarks += filter(None, (shaft_speed_note(chosen), wind_words(ship, chosen)))
    problem, words_of_noise = _with_least_noise(problem)
    remarks += words_of_noise
    told = earlier.uncertainty if earlier is not None else {}
    if earlier is not None:
        problem, words_of_noise = with_share(problem, earlier)
        remarks += words_of_noise
    if not told.get("final", True):
        remarks.append(
            "the earlier fit is not final: its runs disagree or its coefficients conflict with their prior, "
            "so nothing here is fixed by data"
        )
    seen = {c for run in problem.runs for c in run.channels}
    guessed = sorted(seen - set(chosen.noise) - set(earlier.sigma if earlier else ()))
    if guessed:
        remarks.append(f"no noise is stated for {', '.join(guessed)}; taken from the readings themselves")
    shown = progress or Progress(quiet=True)
    log = Path(out) / "profile.jsonl" if out is not None and profile else None
    shown.expect(2 if profile and not quick else 1)
    with shown.stage("identify", 4 * len(problem.params.names) if profile else None) as stage:
        found = look(
            problem, level=ASSUMED_RELATIVE_SD, profile=profile,
            at_bound=[n for n in bound if n in problem.params.names], log=log, step=stage.step,
        )  # fmt: skip
    facts = {
        "trial": chosen.name, "trial_digest": chosen.digest, "vehicle": ship.name,
        "vehicle_digest": ship.digest, "digest": problem.digest, "point": point, "remarks": remarks,
        "assumed_prior": ASSUMED_RELATIVE_SD if prior is None else prior,
    }  # fmt: skip
    behaviour = None
    if profile and not quick:
        with shown.stage("turning circles and zig-zags", 2 * ZIGZAGS) as stage:
            behaviour = _behaviour(problem, found, seed, stage.step)
    return IdentifyResult(found, facts, behaviour, ship, places_of(trial, out, data, vehicle))


def _with_least_noise(problem: FitProblem) -> tuple[FitProblem, list[str]]:
    """The problem with no channel below the least noise a log can have, and what was raised, in words.

    A simulated log without noise would fix every coefficient to rounding, also those nothing excites.
    """
    scales = problem.model.scales
    levels = {c: float(s) for run in problem.runs for c, s in zip(run.channels, run.sigma, strict=True)}
    least = raised(levels, scales["L"], scales["U"])
    if not least:
        return problem, []
    runs = tuple(
        run.with_sigma({
            c: max(float(s), least.get(c, 0.0)) for c, s in zip(run.channels, run.sigma, strict=True)
        })
        for run in problem.runs
    )  # fmt: skip
    return replace(problem, runs=runs), [raised_words(least)]


def _behaviour(problem: Any, found: Identifiability, seed: int, step: Any) -> tuple[Derived, Derived]:
    """Derived quantities of draws of the prior and of the posterior."""
    rng = np.random.default_rng(seed)
    draws = [found.information.draws(DRAWS, rng, prior) for prior in (True, False)]
    prior, posterior = (
        derived(problem.model, full_vectors(problem, d), zigzags=ZIGZAGS, step=step) for d in draws
    )
    return prior, posterior


@dataclass(frozen=True, eq=False, repr=False)
class IdentifyResult(Result):
    """What a trial fixes and leaves open.

    Attributes
    ----------
    found : verdict per coefficient, open combinations, spectra, profiles
    facts : what was looked at
    behaviour : turning circle and overshoots of vehicles drawn from the prior and from the posterior, or None
    vehicle : whose coefficients they are
    """

    found: Identifiability
    facts: Mapping[str, Any]
    behaviour: tuple[Derived, Derived] | None
    vehicle: Vehicle
    places: Places = NOWHERE

    def to_dataframe(self) -> pandas.DataFrame:
        rows = words.coefficient_rows(self.found, self.vehicle)
        return table(words.COEFFICIENT_COLUMNS, rows).set_index(words.COEFFICIENT_COLUMNS[0])

    def report(self) -> Report:
        return words.identify_report(self.found, self.facts, self.behaviour, self.vehicle, self.places)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        return words.write_identify_report(
            self.found, self.facts, Path(folder), self.behaviour, self.vehicle, self.places
        )

    def record(self) -> Mapping[str, Any]:
        extra = {"derived": words.derived_numbers(*self.behaviour)} if self.behaviour else {}
        return {**self.facts, **words.numbers(self.found), **extra}

    def summary(self, verbose: bool = False) -> str:
        found, facts = self.found, self.facts
        lines = [
            screen.headline(found, self.behaviour),
            *screen.cautions(found),
            "",
            f"{facts['trial']}: {found.n_readings} readings, {len(found.names)} coefficients of "
            f"{facts['vehicle']}",
            words.sentence(found),
            *(f"note: {remark}" for remark in facts["remarks"]),
            "",
        ]
        if self.behaviour is not None:
            lines += [table_text(words.DERIVED_COLUMNS, words.derived_rows(*self.behaviour)), ""]
        chosen = range(len(words.COEFFICIENT_COLUMNS)) if verbose else (0, 1, 2, 4, 5, 6, 8)
        rows = [[row[i] for i in chosen] for row in words.coefficient_rows(found, self.vehicle)]
        lines.append(table_text([words.COEFFICIENT_COLUMNS[i] for i in chosen], rows, digits=3))
        if found.directions:
            lines += ["\nLeft open:", *self._open(verbose)]
        lines += [
            "",
            "Next:",
            *(f"  {s.replace('`', '')}" for s in screen.next_steps(found, self.places, self.vehicle)),
        ]
        return "\n".join(lines)

    def _open(self, verbose: bool) -> list[str]:
        directions = self.found.directions
        shown = directions if verbose else directions[:MOST_LEFT]
        lines = []
        for d, (name, what, sd, _) in zip(shown, words.direction_rows(shown), strict=True):
            lines.append(f"  {name}  (sd from the data: {sd})" + (f"\n    {what}" if what else ""))
            if verbose:
                lines.append("    |cos| " + ", ".join(f"{k} {v:.4f}" for k, v in d.agreement.items()))
        if more := len(directions) - len(shown):
            lines.append(f"  and {more} more that the data know better: -v and the report show them")
        return lines
