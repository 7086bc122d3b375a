"""How far the simulator as given misses a log read as its header says, and the same log mended.

Takes the diagnosis of the mended log and the trial as logged. Gives `ErrorRow`s of one run. Judges nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from numpy.linalg import LinAlgError

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.replay import misses
from bayesid.diagnosis.result_parts import RunError
from bayesid.diagnosis.run import Diagnosis
from bayesid.diagnosis.run_errors import ErrorRow, error_rows, miss, missed_too, name_of_run
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.trials import Run, Trial
from bayesid.trials.mistakes import InputFinding

DEGREE = 180 / math.pi
MOST_RUNS, TINY = 8, 1e-9


@dataclass(frozen=True)
class InputGap:
    """Errors of the simulator as given on one run (rms after its first seconds).

    Attributes
    ----------
    run : in words
    rows : position, heading, depth: (as logged, with the log mended); nan where it diverges
    """

    run: str
    rows: tuple[ErrorRow, ...]

    def sentence(self) -> str:
        """Both gaps in degrees and metres."""
        logged = miss(self.rows, 0)
        first = f"misses the {self.run} by {logged} (rms)" if logged else f"diverges on the {self.run}"
        then = missed_too(self.rows, 1, 0).replace("misses the log", "misses it")
        return (
            f"With the log read as its header says, the simulator as given {first}; with it mended, {then}."
        )


NO_GAP: InputGap | None = None


def input_gap(found: Diagnosis, logged: Trial, findings: Sequence[InputFinding]) -> InputGap | None:
    """The gap before and after the mend, on the run on which the mend changes it most.

    Parameters
    ----------
    found : diagnosis of the mended log
    logged : the trial as it was logged, with the readings that `found` has

    Returns
    -------
    None where no run of both can be replayed
    """
    every = any(f.all_runs for f in findings)
    concerned = {name for f in findings for name in f.runs}
    shown = [r for r in found.result.runs if every or r.run in concerned][:MOST_RUNS]
    runs = {run.name: run for run in logged.runs}
    gaps = [_gap(found.problem, r, runs[r.run]) for r in shown if r.run in runs]
    return max((g for g in gaps if g.rows), key=_change, default=None)


def _change(gap: InputGap) -> float:
    """Largest ratio of an error before the mend and after it, either way, as a logarithm."""
    return max(
        abs(math.log(max(before, TINY) / max(after, TINY)))
        if math.isfinite(before) and math.isfinite(after)
        else math.inf if math.isfinite(before) or math.isfinite(after) else 0.0
        for before, after in (row.values for row in gap.rows)
    )  # fmt: skip


def _gap(problem: DiagnosisProblem, mended: RunError, run: Run) -> InputGap:
    """Errors of one run as logged beside those of it mended; without rows where it cannot be replayed."""
    noise = {c: float(s) for log in problem.logs for c, s in zip(log.channels, log.sigma, strict=True)}
    try:
        log = filter_error_run(problem.model, run, noise, problem.channels)
        before = misses(problem, log, problem.model.nominal)
    except (BayesidError, LinAlgError):
        before = {}
    there = {
        "position": math.hypot(before.get("x", math.nan), before.get("y", math.nan)),
        "heading": before.get("psi", math.nan) * DEGREE,
        "depth": before.get("z", math.nan),
    }
    rows = tuple(
        ErrorRow(row.what, row.unit, (there[row.what], row.values[0]))
        for row in error_rows(mended)
        if row.what in there and before
    )
    return InputGap(name_of_run(mended.run, mended.manoeuvre, mended.role), rows)
