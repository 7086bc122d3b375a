"""`bayesid.check`: whether a log says what its header says, by kinematics and by its vehicle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.api.inputs import TrialLike, VehicleLike, model_of, trial_of
from bayesid.diagnosis.input import (
    check_trial,
    mended,
    missing_orders,
    not_enough,
    unmoved_inputs,
    without_missing,
)
from bayesid.report.input import check_record, finding_sentence, in_order_line, joint_mend
from bayesid.trials import Run, Trial
from bayesid.trials.health import check_run, check_runs
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.mistakes import InputCheck


@dataclass(frozen=True)
class Checked:
    """What was found.

    Attributes
    ----------
    check : mistakes, and what is in order
    lacking : why nothing could be told from the trial, one sentence each; empty where there is enough
    still : inputs of the vehicle that are not in the log or never move, one sentence each
    same : what the reader noticed that is one of these mistakes again: the mended log has it no more
    wind : whether a measured wind acts on the vehicle; None where none is measured
    """

    check: InputCheck
    lacking: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    same: frozenset[str] = frozenset()
    wind: str | None = None

    @property
    def mistakes(self) -> tuple[str, ...]:
        """One sentence per mistake, the surest first."""
        return tuple(finding_sentence(f) for f in self.check.findings)

    @property
    def joint_mend(self) -> str:
        """The mends of two or more mistakes as one table of trial.toml; empty for fewer."""
        return joint_mend(self.check)

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence per mistake, the surest first, then what is lacking."""
        return (*self.mistakes, *self.lacking)

    def record(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "input": check_record(self.check),
            "joint_mend": self.joint_mend,
            "input_in_order": in_order_line(self.check),
            "not_enough": list(self.lacking),
            "unmoved_inputs": list(self.still),
            "wind": self.wind,
        }


def check(trial: TrialLike, vehicle: VehicleLike | None = None, *, with_vehicle: bool = True) -> Checked:
    """Check a trial for mistakes of its log.

    Parameters
    ----------
    trial, vehicle : as in `bayesid.fit`
    with_vehicle : ask the vehicle too, where one is named
    """
    logged = trial_of(trial)
    named = bool(vehicle or logged.vehicle_ref) and with_vehicle
    model = model_of(logged, vehicle) if named else None
    still = unmoved_inputs(logged, model.vehicle) if model is not None else ()
    lost = missing_orders(logged, model.vehicle) if model is not None else {}
    # a run without its orders would speak against the vehicle
    found = check_trial(without_missing(logged, model.vehicle) if model is not None else logged, model)
    wind = wind_words(model.vehicle, logged) if model is not None else None
    lacking = (*lost.values(), *not_enough(logged, model))
    return Checked(found, lacking, still, _same(logged, found), wind)


def _same(logged: Trial, found: InputCheck) -> frozenset[str]:
    if not found.findings:
        return frozenset()
    with np.errstate(all="ignore"):
        before, after = ({*_notices(runs)} for runs in (logged.runs, mended(logged, found).runs))
    return frozenset(before - after)


def _notices(runs: Sequence[Run]) -> Iterator[str]:
    """As the reader of a bundle says them, without the file."""
    for run in runs:
        yield from check_run(run)
    yield from check_runs(runs)
