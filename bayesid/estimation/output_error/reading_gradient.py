"""The gradient of any scalar of the simulated readings by all unknowns, one simulation per run.

Takes a `FitProblem` and how the scalar changes with the readings of a run. Gives the gradient. Does not know
what the scalar is: `Problem.cost_gradient` is the same for half the sum of squares.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayesid.estimation.output_error.problem import FitProblem
from bayesid.simulation import gradient

Array = np.ndarray


def reading_gradient(problem: FitProblem, z: Array, slope: Callable[[int, Array], Array]) -> Array:
    """Gradient by z of a scalar that is a sum over runs.

    Parameters
    ----------
    z : (k,) unknowns, initial states included
    slope : (number of the run, (n, c) its simulated readings) -> (n, c) derivative of the scalar by each
        reading, 0 where none was taken

    Returns
    -------
    (k,) array; by the adjoint where every reading is a state, else by the sensitivities

    Raises
    ------
    ModelError
        if a run diverges
    """
    out = np.zeros(z.size)
    k = len(problem.params.names)
    if not problem._direct:
        readings = problem.readings(z)
        _, jac = problem.jacobian(z)
        row = 0
        for i, run in enumerate(problem.runs):
            weights = (slope(i, readings[i]) * run.sigma).ravel()
            out += jac[row : row + weights.size].T @ weights
            row += weights.size
        return out
    par, starts = problem.split(z)
    positions, slopes = problem._chain
    for i, run in enumerate(problem.runs):
        picked = problem._picked(run)

        def cotangent(states: Array, i: int = i, picked: list[int] = picked) -> Array:
            found = np.zeros_like(states)
            for j, column in zip(picked, slope(i, states[:, picked]).T, strict=True):
                found[:, j] += column
            return found

        _, by_par, by_x0 = gradient(problem.model, par, run.plan, starts[i], cotangent, full=False)
        out[:k] += slopes.T @ by_par[positions]
        out[problem._columns(i)] += by_x0[[problem.model.states.index(s) for s in run.initial]]
    return out
