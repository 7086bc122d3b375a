"""Sizes of effects over all explanations that hold them, and over all sizes of a model form in each.

Takes a `DiagnosisProblem` and its `HypothesisComparison`. Gives values and standard deviations. Fits nothing.
"""

from __future__ import annotations

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains, from_run_to_run
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.form_average import averaged_over_forms
from bayesid.diagnosis.hypotheses.kinematic import by_kinematics, parameters_told
from bayesid.diagnosis.hypotheses.run_scatter import scatter_of_runs
from bayesid.diagnosis.threshold_table import ADD_EVIDENCE, LEAST_RUNS, SIZE_DEVIATIONS
from bayesid.estimation.filter_error.fit import FilterErrorFit

# Probability from which an explanation moves a mean or a deviation.
NEGLIGIBLE = 1e-3


def sizes_told(
    problem: DiagnosisProblem, candidates: HypothesisComparison, best: RefittedHypothesis
) -> dict[str, tuple[float, float]]:
    """Effect parameters: name -> (value, sd) in SI.

    Where the equations lack a form, explanations that follow the data alike ask for different sizes of the
    effect they share: mean and deviation of their mixture, each weighed by its probability (Bayesian model
    averaging; Hoeting et al. 1999), of `best` alone where no explanation of the effect has any. In each, what
    kinematics does not tell is averaged over the sizes of the form (`averaged_over_forms`). Deviations
    are multiplied by what they were short of on labelled trials (`SIZE_DEVIATIONS`). So it is where the runs
    show a form that no hypothesis has (`form_seen`): too faint to be weighed, it bends sizes all the same.
    Elsewhere as in `best`, deviations wider as the runs scatter (`run_scatter`).
    """
    lacking = problem.form is not None or candidates.form_seen > ADD_EVIDENCE
    if not lacking:
        return _scattered(parameters_told(problem, best), best.fit)
    table = _told(problem, best)
    found: dict[str, list[tuple[float, float, float]]] = {}
    for c in candidates.refits:
        weight = candidates.sets.get(tuple(sorted(c.effects)), 0.0)
        if not c.widens and weight > NEGLIGIBLE and explains(c):
            sizes = table if c is best else _told(problem, c)
            for name, (value, sd) in sizes.items():
                found.setdefault(name, []).append((weight, value, sd))
    told = table | {name: _mixture(np.array(parts).T) for name, parts in found.items()}
    return {name: (value, SIZE_DEVIATIONS * sd) for name, (value, sd) in told.items()}


def _told(problem: DiagnosisProblem, candidate: RefittedHypothesis) -> dict[str, tuple[float, float]]:
    """Sizes of one explanation, deviations at least those from run to run where runs can tell."""
    if problem.form is not None:  # deviations are that already
        sensors = by_kinematics(problem, candidate)
        table = parameters_told(problem, candidate, sensors)
        of_forces = {n: size for n, size in table.items() if n not in sensors.table}
        return table | averaged_over_forms(problem, candidate, of_forces)
    table = parameters_told(problem, candidate)
    between = from_run_to_run(candidate.fit)
    columns = np.array([candidate.fit.free.names.index(name) for name in table], dtype=int)
    checked = scatter_of_runs(candidate.fit.equations, columns).freedom > 0.0 if table else ()
    between = {name: between[name] for name, able in zip(table, checked, strict=True) if able}
    return {name: (value, max(sd, between.get(name, 0.0))) for name, (value, sd) in table.items()}


def _scattered(
    table: dict[str, tuple[float, float]], fitted: FilterErrorFit
) -> dict[str, tuple[float, float]]:
    """Sizes of a fit with deviations as wide as its runs scatter; few runs do not tell."""
    if not table or len(fitted.equations) < LEAST_RUNS:
        return table
    columns = np.array([fitted.free.names.index(name) for name in table])
    factors = scatter_of_runs(fitted.equations, columns).widening()
    return {
        name: (value, float(factor) * sd)
        for (name, (value, sd)), factor in zip(table.items(), factors, strict=True)
    }


def _mixture(parts: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation of a mixture of normals; rows weight, mean, standard deviation."""
    weight, value, sd = parts[0] / parts[0].sum(), parts[1], parts[2]
    mean = float(weight @ value)
    return mean, float(np.sqrt(weight @ (sd**2 + (value - mean) ** 2)))
