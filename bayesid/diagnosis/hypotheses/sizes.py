"""Sizes of effects over all explanations that hold them.

Takes a `DiagnosisProblem` and its `HypothesisComparison`. Gives values and standard deviations. Fits nothing.
"""

from __future__ import annotations

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.kinematic import parameters_told
from bayesid.diagnosis.threshold_table import SIZE_DEVIATIONS


def sizes_told(
    problem: DiagnosisProblem, candidates: HypothesisComparison, best: RefittedHypothesis
) -> dict[str, tuple[float, float]]:
    """Effect parameters: name -> (value, sd) in SI.

    Where the equations lack a form, explanations that follow the data alike ask for different sizes of the
    effect they share: mean and deviation of their mixture, each weighed by its probability (Bayesian model
    averaging; Hoeting et al. 1999), of `best` alone where no explanation of the effect has any. Deviations
    are multiplied by what they were short of on labelled trials (`SIZE_DEVIATIONS`). Elsewhere as in `best`.
    """
    table = parameters_told(problem, best)
    if problem.form is None:
        return table
    found: dict[str, list[tuple[float, float, float]]] = {}
    for c in candidates.refits:
        weight = candidates.sets.get(tuple(sorted(c.effects)), 0.0)
        if not c.widens and weight > 0.0 and explains(c):
            for name, (value, sd) in parameters_told(problem, c).items():
                found.setdefault(name, []).append((weight, value, sd))
    told = table | {name: _mixture(np.array(parts).T) for name, parts in found.items()}
    return {name: (value, SIZE_DEVIATIONS * sd) for name, (value, sd) in told.items()}


def _mixture(parts: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation of a mixture of normals; rows weight, mean, standard deviation."""
    weight, value, sd = parts[0] / parts[0].sum(), parts[1], parts[2]
    mean = float(weight @ value)
    return mean, float(np.sqrt(weight @ (sd**2 + (value - mean) ** 2)))
