"""Coefficients that a fit holds although its runs move them, and forces of actuators it holds, in words.

Takes a `TrialFit`. Gives sentences. Does not fit.
"""

from __future__ import annotations

import numpy as np

from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.effects.named import whole_forces
from bayesid.model.vehicles.orders import has_propeller, spread
from bayesid.report.fit_first_screen import percent
from bayesid.words import digits, first_few

MOST_NAMED = 4


def held_words(found: TrialFit) -> list[str]:
    """A sentence where the runs ask for coefficients that the fit holds as given."""
    told = found.fit.uncertainty.get("held")
    if not told:
        return []
    moves = [_move(found, name, *one) for name, one in told["moves"].items()]
    change = (
        f"They would change, with one sd, by {first_few(moves, MOST_NAMED)}."
        if moves
        else "No single one would change by more than two sd."
    )
    return [
        "Coefficients that this fit holds as given explain errors of these runs when they are free within "
        f"what is known of them (log evidence +{digits(told['evidence'], 2)}). {change} The free "
        "coefficients make up for them: their values and intervals hold only if those held are right."
    ]


def freeing_words(found: TrialFit) -> list[str]:
    """What to type where `held_words` says something: the shorter of what to free and what to hold."""
    told = found.fit.uncertainty.get("held")
    if not told:
        return []
    every = "Without `--free` and `--fix` the fit frees all."
    free = [n for n in found.problem.params.names if n in found.model.coefficients]
    wanted = [*free, *told["moves"]]
    held = [n for n in found.model.coefficients if n not in wanted]
    if not told["moves"] or not held:
        return [f"Free more coefficients. {every}"]
    if len(held) < len(wanted):
        return [f"Hold fewer coefficients: `--fix '{','.join(held)}'`. {every}"]
    return [f"Free these as well: `--free '{','.join(wanted)}'`. {every}"]


def actuator_words(found: TrialFit) -> list[str]:
    """What to type where a fit is not final and holds thrust, or forces of named actuators, that act in a
    fitted run."""
    not_final = held_words(found) or (found.posterior is not None and found.posterior.not_final())
    freed = {name.partition(".")[0] for name in found.problem.params.names}
    inputs = [
        spread(found.vehicle, {**run.commands, **{f"{k}_cmd": v for k, v in run.measured_inputs.items()}})
        for run in found.trial.identify
    ]
    forces = whole_forces(found.vehicle.actuators)
    if has_propeller(found.vehicle):
        forces = {"thrust_loss": ("n",), **forces}
    held = [
        name
        for name, signals in forces.items()
        if name not in freed and any(np.any(run.get(f"{s}_cmd", 0.0)) for run in inputs for s in signals)
    ]
    if not not_final or not held:
        return []
    return [
        "Coefficients may make up for forces of rudders, shafts and thrusters that are not as the vehicle "
        f"file has them; free these as well: `--with {','.join(held)}`."
    ]


def _move(found: TrialFit, name: str, change: float, sd: float) -> str:
    value = float(found.problem.base[found.model.index[name]])
    if not value:
        return f"{name} {digits(change, 3)} ± {digits(sd, 2)}"
    return f"{name} {percent(change / value, sd / abs(value))}"
