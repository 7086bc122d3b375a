"""`bayesid.check`: whether a log says what its header says, by kinematics and by its vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bayesid.api.inputs import TrialLike, VehicleLike, model_of, trial_of
from bayesid.diagnosis.input import check_trial, not_enough, unmoved_inputs
from bayesid.report.input import check_record, finding_sentence, in_order_line
from bayesid.trials.mistakes import InputCheck


@dataclass(frozen=True)
class Checked:
    """What was found.

    Attributes
    ----------
    check : mistakes, and what is in order
    lacking : why nothing could be told from the trial, one sentence each; empty where there is enough
    still : inputs of the vehicle that are not in the log or never move, one sentence each
    """

    check: InputCheck
    lacking: tuple[str, ...] = ()
    still: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """One sentence per mistake, the surest first, then what is lacking."""
        return (*(finding_sentence(f) for f in self.check.findings), *self.lacking)

    def record(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "input": check_record(self.check),
            "input_in_order": in_order_line(self.check),
            "not_enough": list(self.lacking),
            "unmoved_inputs": list(self.still),
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
    return Checked(check_trial(logged, model), not_enough(logged, model), still)
