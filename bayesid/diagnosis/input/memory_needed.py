"""How much memory a diagnosis takes, told before it begins.

Takes a trial and a model. Gives bytes, and a sentence where there is less. An upper estimate: measured peaks
of zig-zags of a planar vehicle at 1 Hz lie at 0.5 to 0.9 of it (docs/guide/many_machines.md).
"""

from __future__ import annotations

from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.memory import available_memory, taken_memory
from bayesid.trials import Trial

# Libraries, compiled kernels and what is kept of linearisations whatever the length (two bounded caches).
FIXED = 600e6
# A model form about doubles the free parameters.
FORM = 2
# Linearisations alive at once in a fit, and covariances a smoother keeps.
ALIVE, COVARIANCES = 2, 5
NUMBER = 8  # bytes


def memory_needed(trial: Trial, model: Model) -> float:
    """Bytes a diagnosis takes at most, about."""
    sizes = [run.t.size for run in trial.identify]
    if not sizes:
        return FIXED
    nx, every = len(model.kernel.full.states), len(model.kernel.channels)
    used = len({c for run in trial.identify for c in run.data} & set(model.kernel.channels))
    # per sample and column: maps, slopes of all channels and of those read, the filter's copy and its answer
    column = 2 * nx + every + 3 * used
    coefficients = FORM * len(model.coefficients)
    effects = sum(len(e.parameters) for e in model.causes if e.acts_in(model.dof))
    state = nx + len([n for n in model.kernel.exogenous if n.startswith("force_")]) + 3
    in_fit = ALIVE * coefficients * column + COVARIANCES * state**2
    return FIXED + NUMBER * (sum(sizes) * in_fit + max(sizes) * (coefficients + effects) * column)


def check_memory(trial: Trial, model: Model) -> None:
    """Refuse what would not fit.

    Raises
    ------
    TrialError
        more memory is needed than there is; says how much, and the sampling that would fit
    """
    free, needed = available_memory(), memory_needed(trial, model)
    there = 0.0 if free is None else free + taken_memory()
    if free is None or needed <= there:
        return
    samples = sum(run.t.size for run in trial.identify)
    if there <= FIXED:
        advice = "free some, or use another machine"
    else:
        step = max(float(run.t[-1] - run.t[0]) / max(run.t.size - 1, 1) for run in trial.identify)
        fewer = step * (needed - FIXED) / (there - FIXED)
        advice = (
            f"read every {fewer:.2g} s only (--resample {fewer:.2g}), give shorter windows of the runs, or "
            "use another machine"
        )
    raise TrialError(
        f"{trial.name}: {samples} samples need about {needed / 1e9:.1f} GB to be diagnosed and "
        f"{there / 1e9:.1f} GB are there; {advice}"
    )
