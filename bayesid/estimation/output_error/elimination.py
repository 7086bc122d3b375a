"""Initial states taken out of the linear problem of a fit, run by run.

Takes a `FitProblem` and unknowns. Gives what is left for the parameters. A log in hundreds of pieces has
thousands of initial states, each of which only its own piece feels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
FLAT = 1e-12  # singular value over the largest, below which initial states are not felt


@dataclass(frozen=True, eq=False)
class OwnRows:
    """What one run says of its initial states.

    Attributes
    ----------
    own : (s, s) slopes by the states
    by : (s, k) slopes of the same rows by the parameters
    resid : (s,)
    """

    own: Array
    by: Array
    resid: Array


@dataclass(frozen=True, eq=False)
class Eliminated:
    """A linear problem whose initial states suit the parameters best.

    Attributes
    ----------
    runs : rows that the states take
    jac, resid : (m, k) and (m,), what is left for the parameters
    """

    runs: tuple[OwnRows, ...]
    jac: Array
    resid: Array

    @property
    def squares(self) -> float:
        """Sum of squared residuals of the whole problem."""
        return float(self.resid @ self.resid) + self.squares_of_states

    @property
    def squares_of_states(self) -> float:
        """The part of it that initial states take away."""
        return float(sum(r.resid @ r.resid for r in self.runs))

    def state_variance(self, root: Array) -> Array:
        """(n_initial,) variances of the initial states; inf where a run does not feel its own.

        Parameters
        ----------
        root : (k, k) of the covariance of the parameters
        """
        out = [np.zeros(0)]
        for r in self.runs:
            if r.own.shape[0] < r.own.shape[1]:
                out.append(np.full(r.own.shape[1], np.inf))
                continue
            inverse = np.linalg.inv(r.own)
            out.append((inverse**2).sum(axis=1) + ((inverse @ r.by @ root) ** 2).sum(axis=1))
        return np.concatenate(out)


def eliminated(problem: FitProblem, z: Array, triangles: Sequence[Array], prior: bool = True) -> Eliminated:
    """The linear problem at `z`, its initial states taken out.

    Parameters
    ----------
    triangles : of the runs there (`FitProblem.triangles`)
    prior : with the prior's rows, those of the states with their runs

    Returns
    -------
    rows in units of `problem.scale`; rows of a run that its own states hardly move stay with the parameters
    """
    k = len(problem.params.names)
    resid_prior, of_prior = problem.prior(z) if prior else (np.zeros(0), np.zeros((0, z.size)))
    common = np.ones(resid_prior.size, dtype=bool)
    runs, below, left, at = [], [], [], k
    for run, turned in zip(problem.runs, triangles, strict=True):
        own = slice(at, at + len(run.initial))
        at = own.stop
        slopes, mine = with_own_prior(turned[:, :-1], of_prior, own, k)
        common[mine] = False
        slopes = slopes * np.concatenate([problem.scale[own], problem.scale[:k]])
        rows = np.column_stack([slopes, np.concatenate([turned[:, -1], resid_prior[mine]])])
        triangle, s = np.asarray(np.linalg.qr(rows, mode="r")), len(run.initial)
        first, rest = triangle[:s], triangle[s:]
        if s:
            turn, size, _ = np.linalg.svd(first[:, :s])
            felt = np.flatnonzero(size > FLAT * max(size.max(initial=0.0), 1e-300))
            if felt.size < s:
                first = turn.T @ first
                rest = np.vstack([rest, np.delete(first, felt, axis=0)])
                first = first[felt]
            runs.append(OwnRows(first[:, :s], first[:, s:-1], first[:, -1]))
        below.append(rest[:, s:-1])
        left.append(rest[:, -1])
    below.append(of_prior[common][:, :k] * problem.scale[:k])
    left.append(resid_prior[common])
    return Eliminated(tuple(runs), np.vstack(below), np.concatenate(left))


def with_own_prior(jac: Array, of_prior: Array, own: slice, k: int) -> tuple[Array, Array]:
    """Slopes of a run's readings, and of the prior of its initial states, by those states, then by the
    parameters; positions of these prior rows."""
    mine = np.flatnonzero(of_prior[:, own].any(axis=1))
    by_states = np.vstack([jac[:, k:], of_prior[mine, own]])
    return np.hstack([by_states, np.vstack([jac[:, :k], of_prior[mine, :k]])]), mine
