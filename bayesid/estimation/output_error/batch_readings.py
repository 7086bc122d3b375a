"""Simulated readings of many parameter vectors at once.

Takes a `FitProblem` and unknowns. Gives arrays; a diverged vehicle gives non-finite rows, no error.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.simulation import TimePlan, observe, simulate_batch

Array = np.ndarray


def readings_batch(
    problem: FitProblem, params: Array, starts: Sequence[Array], threads: int = 1
) -> list[list[Array]]:
    """Readings of every run and channel for many vectors.

    Parameters
    ----------
    params : (b, k) free parameters of the problem's parameter set, SI
    starts : per run (nx,) or (b, nx) initial states
    threads : used from 128 vectors on

    Returns
    -------
    per run and channel of it a (b, n) array
    """
    positions, slopes = problem._chain
    zero = problem.params.place(problem.base, problem.model.index, np.zeros(params.shape[1]))
    pars = np.repeat(zero[None], params.shape[0], axis=0)
    pars[:, positions] += params @ slopes.T
    found = []
    for run, x0 in zip(problem.runs, starts, strict=True):
        states = simulate_batch(problem.model, pars, run.plan, x0, full=problem._full, threads=threads)
        if not problem._direct:
            pairs = zip(pars, states, strict=True)
            states = np.stack([_observed(problem, par, run.plan, one) for par, one in pairs])
        found.append([np.ascontiguousarray(states[:, :, j]) for j in problem._picked(run)])
    return found


def _observed(problem: FitProblem, par: Array, plan: TimePlan, states: Array) -> Array:
    """Channels of one vector; non-finite where its states are."""
    if np.isfinite(states).all():
        try:
            return observe(problem.model, par, plan, states, full=problem._full)
        except ModelError:
            pass
    return np.full((states.shape[0], len(problem.model.kernel.channels)), np.nan)
