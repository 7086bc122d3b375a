"""How much memory a diagnosis takes, told before it begins.

Takes a trial and a model. Gives bytes, and a sentence where there is less. An upper estimate: peaks of
zig-zags of a planar vehicle at 1 Hz lay at 0.6 to 0.7 of it when what is kept per sample was measured, at 0.5
since slopes of all runs are held together (10 800 samples). Not counted is what every run keeps of its fins:
at most 4 MB of their motion (`interval_maps`) and 16 MB of cut steps (`follow`).
"""

from __future__ import annotations

from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.estimation.filter_error.parameter_slopes import BLOCK, NUMBER, runs_held
from bayesid.estimation.filter_error.smoother import BLOCK as SMOOTHED_AT_ONCE
from bayesid.memory import available_memory, taken_memory
from bayesid.trials import Trial

# Libraries, compiled kernels and what is kept of linearisations whatever the length (two bounded caches).
FIXED = 600e6
# A model form about doubles the free parameters.
FORM = 2
# Linearisations alive at once in a fit; slopes, their stack and what is whitened of it; paths that the fits
# of all hypotheses keep, as measured (20 kB a sample in all).
ALIVE, COPIES, PATHS = 2, 3, 240
FINER = 1.1  # steps in which a sampling that fits is sought


def memory_needed(trial: Trial, model: Model, every: float = 1.0, threads: int = 1) -> float:
    """Bytes a diagnosis takes at most, about, were one of `every` samples read and `threads` runs taken at a
    time."""
    sizes = [run.t.size / every for run in trial.identify]
    if not sizes:
        return FIXED
    nx, channels = len(model.kernel.full.states), len(model.kernel.channels)
    used = len({c for run in trial.identify for c in run.data} & set(model.kernel.channels))
    latent = len(model.kernel.exogenous) + len(model.kernel.actuators)

    def slopes(samples: list[float], parameters: int) -> float:
        """Those of all runs that are held, and copies of one block."""
        size = NUMBER * (nx + channels) * parameters
        kept = runs_held(samples, nx + channels, parameters)
        held = sum(n for n, hold in zip(samples, kept, strict=True) if hold)
        copied = sorted((min(n, BLOCK) for n in samples), reverse=True)
        return size * (held + COPIES * sum(copied[:threads]))

    coefficients = FORM * len(model.coefficients)
    effects = sum(len(e.parameters) for e in model.causes if e.acts_in(model.dof))
    state = nx + len([n for n in model.kernel.exogenous if n.startswith("force_")]) + 3
    maps = ALIVE * nx * (nx + latent + used) + PATHS * nx
    longest = sorted(sizes, reverse=True)[:threads]
    smoother = sum(min(n, SMOOTHED_AT_ONCE) for n in longest) * state**2
    return (
        FIXED
        + slopes(sizes, coefficients)
        + sum(slopes([n], coefficients + effects) for n in longest)
        + NUMBER * (sum(sizes) * maps + smoother)
    )


def enough_memory(trial: Trial, model: Model, threads: int = 1) -> bool:
    """Whether there is memory for so many runs at a time; yes where nobody knows."""
    free = available_memory()
    return free is None or memory_needed(trial, model, 1.0, threads) <= free + taken_memory()


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
    every = 1.0
    while every < samples and memory_needed(trial, model, every) > there:
        every *= FINER
    if every >= samples:
        advice = "free some, or use another machine"
    else:
        step = max(float(run.t[-1] - run.t[0]) / max(run.t.size - 1, 1) for run in trial.identify)
        fewer = step * every
        advice = (
            f"read every {fewer:.2g} s only (--resample {fewer:.2g}), give shorter windows of the runs, or "
            "use another machine"
        )
    raise TrialError(
        f"{trial.name}: {samples} samples need about {needed / 1e9:.1f} GB to be diagnosed and "
        f"{there / 1e9:.1f} GB are there; {advice}"
    )
