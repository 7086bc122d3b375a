"""A force of the motion and the controls, of any shape, beside an explanation: a Gaussian process over both.

Takes an explanation and all runs cut into pieces. Gives log evidence with such a force. Does not say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import logsumexp

from bayesid.diagnosis.cut_runs import BriefSignal, CutRun, Joint, Sought
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.diagnosis.joined_runs import MOST_COLUMNS, pieces_of
from bayesid.estimation.run_data import Array

# Distances over which the force changes, over that of two usual motions; its sizes over units.
STATE_DISTANCES = (0.3, 0.6, 1.2)
STATE_SIZES = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0)
# Share of the force's variance that its columns may leave out.
NEGLIGIBLE = 1e-4
AXES = dict(zip("uvwpqr", "XYZKMN", strict=True))


@dataclass(frozen=True, eq=False)
class ForceOfMotion:
    """The force in every piece, as a sum of columns with unit sd, by distance over which it changes.

    Attributes
    ----------
    roots : (m, k) each, the pieces of all runs one after the other; the same in every axis
    rows : positions of the forces among the signals
    """

    roots: tuple[Array, ...]
    rows: tuple[int, ...]

    def log_evidence(self, runs: Sequence[CutRun], known: int, found: Sequence[BriefSignal]) -> float:
        """That of `Joint` with such a force, averaged over its shapes and sizes and none.

        Parameters
        ----------
        runs : all that were cut; known, found : as of `Joint`

        Raises
        ------
        LinAlgError
            if the information of the parameters is not positive definite
        """
        seen = [Joint(runs, known, found).log_evidence]
        fixed = -0.5 * sum(r.equations.ee + r.equations.logdet for r in runs)
        for root in self.roots:
            total, pull, others = self._equations(runs, known, found, root)
            for size in STATE_SIZES:
                sd = np.where(np.arange(pull.size) < others, 1.0, size)
                factor = cho_factor(sd[:, None] * total * sd + np.eye(sd.size), lower=True)
                moved = 0.5 * float((sd * pull) @ cho_solve(factor, sd * pull))
                seen.append(fixed + moved - float(np.log(np.diag(factor[0])).sum()))
        return float(logsumexp(seen)) - float(np.log(len(seen)))

    def _equations(
        self, runs: Sequence[CutRun], known: int, found: Sequence[BriefSignal], root: Array
    ) -> tuple[Array, Array, int]:
        """Products of all columns with each other and with the residual; how many are not of the force."""
        ends = np.cumsum([known, *(f.root.shape[1] for f in found)])
        others, k = int(ends[-1]), root.shape[1]
        size = others + len(self.rows) * k
        total, pull, first = np.zeros((size, size)), np.zeros(size), 0
        for r in runs:
            own = [(f, at) for f, at in zip(found, ends[:-1], strict=True) if f.run == r.run]
            forces = [known + row * r.count + np.arange(r.count) for row in self.rows]
            used = np.concatenate([np.arange(known), *forces, *(known + f.columns for f, _ in own)])
            basis, below = np.zeros((used.size, size)), known
            basis[:known, :known] = np.eye(known)
            for i in range(len(self.rows)):
                at = others + i * k
                basis[below : below + r.count, at : at + k] = root[first : first + r.count]
                below += r.count
            for f, at in own:
                basis[below : below + f.columns.size, at : at + f.root.shape[1]] = f.root
                below += f.columns.size
            total += basis.T @ r.equations.ss[np.ix_(used, used)] @ basis
            pull += basis.T @ r.equations.se[used]
            first += r.count
        return total, pull, others


def force_of_motion(sought: Sought) -> ForceOfMotion:
    """The force in all pieces of an explanation's runs.

    Raises
    ------
    ModelError
        if the motion along a path cannot be worked out
    """
    model = sought.problem.model
    forces = [f"force_{AXES[v]}" for v in model.kernel.velocities]
    sizes = [units(model)[n] for n in forces]
    state = pieces_of(model, sought.paths, sought.runs, sought.paths[0].point.par, sizes).state
    rows = tuple(sought.signals.index(n) for n in forces)
    most = MOST_COLUMNS // len(rows)
    return ForceOfMotion(tuple(_root(state, distance, most) for distance in STATE_DISTANCES), rows)


def correlation(state: Array, others: Array, distance: float) -> Array:
    """(m, n) correlation of the force at two motions.

    Parameters
    ----------
    state, others : (m, k), (n, k) over their standard deviations
    distance : over which it changes, over that of two usual motions
    """
    apart = ((state[:, None] - others) ** 2).sum(axis=2)
    usual = 2.0 * max(state.shape[1], 1)
    return np.asarray(np.exp(-0.5 * apart / (usual * distance**2)))


def _root(state: Array, distance: float, most: int) -> Array:
    """(m, k) columns whose products are the correlation of all pieces, by Cholesky with pivots; of more than
    `most` those that leave least variance."""
    left, columns = np.ones(len(state)), np.zeros((len(state), 0))
    while left.max() > NEGLIGIBLE and columns.shape[1] < most:
        k = int(np.argmax(left))
        new = correlation(state, state[[k]], distance)[:, 0] - columns @ columns[k]
        columns = np.column_stack([columns, new / np.sqrt(left[k])])
        left = np.maximum(1.0 - (columns**2).sum(axis=1), 0.0)
    return columns
