"""`bayesid.check`: whether a log says what its header says, by kinematics and by its vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.api.inputs import TrialLike, VehicleLike, model_of, trial_of
from bayesid.api.mistaken_log import held_out_mistakes
from bayesid.diagnosis.input import (
    check_trial,
    mended,
    missing_orders,
    not_enough,
    orders_by_run,
    unmoved_inputs,
    without_missing,
)
from bayesid.errors import VehicleError
from bayesid.model.channels import channel, is_channel
from bayesid.model.vehicles import load_vehicle
from bayesid.report.input import check_record, finding_sentence, in_order_line, joint_mend
from bayesid.trials import Run, Trial
from bayesid.trials.health import check_run, check_runs
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.mistakes import InputCheck
from bayesid.words import and_list


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
    held_out : mistakes that only the held-out runs tell, or have, one sentence or two
    """

    check: InputCheck
    lacking: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    same: frozenset[str] = frozenset()
    wind: str | None = None
    held_out: tuple[str, ...] = ()

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
            "held_out": list(self.held_out),
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
    # where fitted runs are mistaken, a mend comes first
    held = () if model is None or found.findings else held_out_mistakes(logged, model.vehicle)
    return Checked(found, lacking, still, _same(logged, found), wind, held)


def lacking_orders(trial: Trial, named: Iterable[str] = ()) -> tuple[str, ...]:
    """Orders that runs of a trial lack, one sentence each; by names alone where its vehicle cannot be read.

    Parameters
    ----------
    trial : as imported
    named : channels that the map of the import names
    """
    try:
        ship = load_vehicle(trial.vehicle_ref) if trial.vehicle_ref else None
    except VehicleError:
        ship = None
    logged = {name for run in trial.runs for name in (*run.commands, *run.measured_inputs)}
    orders = [n for n in named if is_channel(n) and channel(n).kind in ("command", "actuator")]
    nowhere = [name for name in orders if name not in logged]
    words = f"no run has {and_list(nowhere)}, which the map names: correct `from` of each, or delete its line"
    return (*([words] if nowhere else ()), *orders_by_run(trial, ship))


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
