"""What each run says about the parameters at an estimate, its initial states integrated out.

Takes a `FitProblem` and its unknowns. Gives one `RunInformation` per run or piece: whitened columns,
residuals, information and score, parameters in units of their scale. Does not know what the residuals are
made of.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class RunInformation:
    """One run about an estimate.

    Attributes
    ----------
    name : of the run or piece
    resid : (n, c) simulated minus read over the stated noise; 0 where nothing was read. Every run has the
        channels of all runs, so that one noise holds for them
    valid : (n, c) which readings count
    columns : (n, c, k) slopes of `resid` by the parameters per scale, what the initial state can imitate
        taken out
    start : (m, k) the same of the prior of the initial state
    score : (k,) falls of the cost per parameter scale: minus the gradient
    """

    name: str
    resid: Array
    valid: Array
    columns: Array
    start: Array
    score: Array

    @property
    def information(self) -> Array:
        """(k, k) Fisher information under white noise, initial state integrated out."""
        flat = self.columns.reshape(-1, self.columns.shape[2])
        return flat.T @ flat + self.start.T @ self.start


def run_information(problem: FitProblem, z: Array) -> Iterator[RunInformation]:
    """Every run of a problem at its unknowns z.

    Raises
    ------
    ModelError
        if the simulated vehicle diverges there
    """
    k = len(problem.params.names)
    scale = problem.scale[:k]
    block = problem.run_blocks(z)
    channels = list(dict.fromkeys(c for run in problem.runs for c in run.channels))
    at = k
    for i, run in enumerate(problem.runs):
        resid, jac = block(i)
        m = len(run.initial)
        here = (z[at : at + m] - problem.start[at : at + m]) / run.initial_sd
        at += m
        columns = np.vstack([jac[:, :k] * scale, np.zeros((m, k))])
        initial = np.vstack([jac[:, k:], np.diag(1.0 / run.initial_sd)])
        q, _ = np.linalg.qr(initial)
        columns = columns - q @ (q.T @ columns)
        n, c = run.readings.shape
        where = [channels.index(name) for name in run.channels]
        yield RunInformation(
            run.name,
            _placed(resid.reshape(n, c), where, len(channels)),
            _placed(run.valid, where, len(channels)),
            _placed(columns[: n * c].reshape(n, c, k), where, len(channels)),
            columns[n * c :],
            -columns.T @ np.concatenate([resid, here]),
        )


def _placed(values: Array, where: list[int], count: int) -> Array:
    """Values (n, c, ...) of a run's channels among all; 0 and False for those it has not."""
    if where == list(range(count)):
        return values
    out = np.zeros((values.shape[0], count, *values.shape[2:]), dtype=values.dtype)
    out[:, where] = values
    return out
