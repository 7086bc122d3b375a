"""The diagnosis of a log: read, and read once more where its orders act before they are logged.

Takes a trial as logged and a model. Gives a `Diagnosis`. What `bayesid diagnose` does, a blind pack, and the
study that counts verdicts on vehicles of other equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from bayesid.diagnosis.input import as_read, checked_and_mended
from bayesid.diagnosis.input.order_stamps import (
    acts_before_its_stamp,
    better,
    between_stamps,
    earlier_by,
    same_readings,
    step_of,
)
from bayesid.diagnosis.run import Diagnosis, diagnose
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.trials import Trial
from bayesid.trials.mistakes import InputCheck


def or_with_earlier_orders(
    found: Diagnosis,
    of: Trial,
    logged: Trial,
    read: Callable[[Trial], Trial],
    run: Callable[[Trial], Diagnosis],
    say: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """The diagnosis, or one of orders as much earlier as one acts where that explains more.

    Parameters
    ----------
    found, of : the diagnosis, and the trial it is of
    logged : the same with all its readings
    read, run : how `of` is made of `logged`, and `found` of `of`
    say : called with a sentence about what is tried
    """
    if (step := step_of(logged)) is None or not (early := acts_before_its_stamp(found)):
        return found
    earlier, text = between_stamps(logged, step, early)
    try:
        once_more = read(earlier)
        if not same_readings(of, once_more):
            say("an order acts before it is logged; averages of earlier orders do not compare")
            return found
        by = f"{earlier_by(step, early):.3g}"
        say(f"an order acts before it is logged; once more with orders {by} s earlier")
        new = (w for w in once_more.warnings if w not in of.warnings)
        again = run(replace(once_more, warnings=(*of.warnings, *new, text)))
    except BayesidError as error:
        say(f"earlier orders could not be tried ({error})")
        return found
    if better(found, again):
        return again
    say("orders stay as logged: earlier they explain no more")
    return found


def diagnose_log(trial: Trial, model: Model, **options: Any) -> tuple[Diagnosis, InputCheck]:
    """The diagnosis of a log where one verdict is wanted of every log, and what was found of the log.

    Parameters
    ----------
    trial : as logged; its mistakes are mended as by `checked_and_mended`
    options : of `diagnosis.run.diagnose`

    Raises
    ------
    TrialError
        a run lacks an order, or nothing to identify from
    """
    logged, checked = checked_and_mended(trial, model)
    read = partial(as_read, model=model)

    def run(of: Trial) -> Diagnosis:
        return diagnose(of, model, **options)

    return or_with_earlier_orders(run(of := read(logged)), of, logged, read, run), checked
