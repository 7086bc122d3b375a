"""Whether what looks like another vehicle may be this one, its simulator mistaken.

Takes a trial and a model. Gives names of mistakes. Does not weigh them: a diagnosis does.
"""

from __future__ import annotations

from bayesid.diagnosis.input.wrong_vehicle import wrong_vehicle
from bayesid.diagnosis.simulator.mending import mended_model, numbers_of
from bayesid.diagnosis.simulator.table import MISTAKES
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.trials import Trial


def mistakes_that_clear(trial: Trial, model: Model) -> tuple[str, ...]:
    """Mistakes with whose mend, at their middle size, the log is no longer another vehicle's."""
    numbers = numbers_of(model)
    out = []
    for mistake in MISTAKES:
        change = mistake.mend(numbers, mistake.sizes[len(mistake.sizes) // 2])
        if change is None or not change.within(model.index).values or change.sd:
            continue
        try:
            if wrong_vehicle(mended_model(model, change), trial.identify) is None:
                out.append(mistake.name)
        except BayesidError:
            continue
    return tuple(out)
