"""A periodic signal put into each input: what it gains, and its period.

Takes a `DiagnosisProblem` and linearised runs. Gives evidence per place. Does not name a cause.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior, without
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import whitened
from bayesid.estimation.filter_error.normal_equations import run_equations, stacked_equations
from bayesid.estimation.filter_error.periodic_disturbance import periodic_columns, periodic_forces
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.threads import each


@dataclass(frozen=True)
class PeriodicSignal:
    """Log evidence of a periodic signal in one place, one per amplitude, averaged over frequencies."""

    evidence: tuple[float, ...]
    period: float


def periodic_signals(
    problem: DiagnosisProblem,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    sets: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]],
    size: Mapping[str, float],
    amplitudes: Sequence[float],
) -> dict[str, PeriodicSignal]:
    """Evidence by place of a sine of unknown size and phase in each run; empty where the runs show no line.

    Parameters
    ----------
    sets : inputs and sensor channels of each place; places of sensors are left out
    size : unit of each input [SI]
    amplitudes : prior sd in these units

    Notes
    -----
    All frequencies looked at are as probable before the data; those without a line in the innovations are
    left out of the sum, which can only lower it.
    """
    model, noise_model = problem.model, problem.environment.noise_model
    equations = stacked_equations(model, paths, free, noise_model)
    z = posterior(sum(equations[1:], equations[0])).mean
    standard = [_standardised(problem, k, p, free, z) for k, p in enumerate(paths)]
    found, tries = periodic_forces(problem.model, paths, standard)
    if not found:
        return {}
    names = tuple(dict.fromkeys(n for inputs, _ in sets.values() for n in inputs))
    known = len(free.names)
    spread = np.log(max(tries, 1.0))
    unit = [size[n] for n in names]
    by_line = []
    for frequency in found:

        def of_run(path: Linearisation, k: int, frequency: float = float(frequency)) -> NormalEquations:
            extra = periodic_columns(path, frequency, names, unit)
            return run_equations(model, path, free, noise_model, run=k, extra=extra)

        by_line.append(each(of_run, paths, range(len(paths))))
    out = {}
    for place, (inputs, _) in sets.items():
        if not inputs:
            continue
        at = [known + 2 * names.index(n) + i for n in inputs for i in (0, 1)]
        seen = np.array([[_evidence(runs, at, known, a) for a in amplitudes] for runs in by_line])
        best = int(np.argmax(seen.max(axis=1)))
        mean = np.logaddexp.reduce(seen, axis=0) - spread
        out[place] = PeriodicSignal(tuple(float(m) for m in mean), float(2 * np.pi / found[best]))
    return out


def _standardised(
    problem: DiagnosisProblem, k: int, path: Linearisation, free: GaussianPrior, z: Array
) -> Array:
    """(n, q) standardised innovations of one run at `z`; a run at a time is whitened as a whole."""
    step = free.mean - path.point.par[free.where]
    w = whitened(problem.model, path, step, free.sd, problem.environment.noise_model, None, k)
    return (w.resid - w.columns @ z).reshape(path.resid.shape)


def _evidence(runs: Sequence[NormalEquations], at: Sequence[int], known: int, amplitude: float) -> float:
    """Log evidence of all runs, each with a sine of its own of this prior sd."""
    scale = np.concatenate([np.ones(known), np.full(len(at), amplitude)])
    columns = np.array([*range(known), *at])
    parts = []
    for run in runs:
        g = run.pick(columns)
        scaled = NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, g.ee, g.logdet, g.used)
        parts.append(without(scaled, known))
    return posterior(sum(parts[1:], parts[0])).log_evidence
