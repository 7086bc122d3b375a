"""A trial as the diagnosis reads it: a shaft speed in every run, mistakes mended, dense readings averaged.

Takes a trial and a model. Gives the trial that `diagnosis.run.diagnose` is to be given.
"""

from __future__ import annotations

from bayesid.diagnosis.input.check import check_trial, mended
from bayesid.diagnosis.input.missing_orders import missing_orders
from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.simulation import with_shaft_speed
from bayesid.trials import Trial
from bayesid.trials.condensing import condensed, thinned
from bayesid.trials.mistakes import InputCheck

# Samples to identify above which dense readings are averaged: a planar vehicle then takes 5 to 30 s.
MOST_SAMPLES = 1_000


def as_read(trial: Trial, model: Model, resample: float | None = None, trust_noise: bool = False) -> Trial:
    """The trial thinned where that is asked for, else averaged where it is dense.

    Parameters
    ----------
    resample : time between readings [s]
    trust_noise : keep the noise as stated
    """
    taken = with_shaft_speed(thinned(trial, resample) if resample else trial, model.vehicle)
    return taken if resample else condensed(taken, model.vehicle, MOST_SAMPLES, trust_noise, as_seen=True)


def checked_and_mended(trial: Trial, model: Model) -> tuple[Trial, InputCheck]:
    """The trial with all its readings where one verdict is wanted of every log, and what was found.

    Mistakes of the log are mended in memory; those that one of the simulator explains better are left to the
    diagnosis, which looks for it. One without a mend, where the command asks for another log, stays.

    Raises
    ------
    TrialError
        a run lacks an order
    """
    if lost := missing_orders(trial, model.vehicle):
        raise TrialError(f"{trial.name}: {'; '.join(lost.values())}")
    checked = check_trial(trial, model)
    return mended(trial, checked.of_log), checked


def checked_and_read(trial: Trial, model: Model) -> tuple[Trial, InputCheck]:
    """The same as the diagnosis reads it."""
    logged, checked = checked_and_mended(trial, model)
    return as_read(logged, model), checked
