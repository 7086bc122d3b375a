"""Runs cut into pieces and joined: a force in every piece of every run, the explanation integrated out.

Takes what `cut_runs` gives. Gives what the pieces say of any force that is a sum of given columns, and the
motion at the pieces. Does not say which columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from bayesid.diagnosis.cut_runs import CutRun
from bayesid.diagnosis.evidence.force_terms import actuator_means
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.equations.layout import rows_of
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.run_data import Array
from bayesid.model.terms import Term
from bayesid.simulation import rates_on

# Signals times pieces of all runs together, and pieces of one run that are enough; of many runs the longest.
MOST_COLUMNS, ENOUGH_PIECES = 1500, 20
# Share of a usual motion below which it is rounding.
ROUNDING = 1e-9
# Symbols of rows that are forces of the hull alone, and parameters of the drag of its strips.
OF_THE_HULL = frozenset(("u", "v", "w", "p", "q", "r", "Rv", "Rw", "U", "S"))
STRIPS = ("strip_Y", "strip_Z")


@dataclass(frozen=True, eq=False)
class Pieces:
    """The motion at the pieces of all runs.

    Attributes
    ----------
    run : (m,) position of its run
    time : (m,) middle, from the start of its run [L/U]
    place : (m, 2) or (m, 3) over ground [L]
    heading : (m,)
    state : (m, k) velocities, heel and trim, actuators, each over its standard deviation; what never changes
        is left out
    hull : (m, axes) force of the hull's rows and strips, in the units of the signals
    width : (runs,) of a piece [L/U]
    """

    run: Array
    time: Array
    place: Array
    heading: Array
    state: Array
    hull: Array
    width: Array

    @property
    def count(self) -> int:
        """Number of pieces."""
        return self.run.size


@dataclass(frozen=True, eq=False)
class Joined:
    """Signals in all pieces: their products with each other and with the readings' residual.

    Attributes
    ----------
    ss, se : (rows * m, rows * m) and (rows * m,), signal by signal, all runs side by side
    """

    ss: Array
    se: Array

    def gains(self, columns: Array, amplitudes: Sequence[float]) -> list[float]:
        """Log evidence that a sum of these columns gains, by prior sd of their coefficients.

        Parameters
        ----------
        columns : (rows * m, k)
        """
        products, pull = columns.T @ self.ss @ columns, columns.T @ self.se
        out = []
        for a in amplitudes:
            factor = cho_factor(a * a * products + np.eye(pull.size), lower=True)
            moved = 0.5 * a * a * float(pull @ cho_solve(factor, pull))
            out.append(moved - float(np.log(np.diag(factor[0])).sum()))
        return out

    def squares(self, columns: Array) -> Array:
        """(rows * m,) mean square of a sum of these columns, unit prior sd, after the data."""
        factor = cho_factor(columns.T @ self.ss @ columns + np.eye(columns.shape[1]), lower=True)
        mean = columns @ cho_solve(factor, columns.T @ self.se)
        spread = solve_triangular(factor[0], columns.T, lower=True)
        return np.asarray(mean**2 + (spread**2).sum(axis=0))

    def mean(self, columns: Array) -> Array:
        """(rows * m,) mean of a sum of these columns, unit prior sd, after the data."""
        factor = cho_factor(columns.T @ self.ss @ columns + np.eye(columns.shape[1]), lower=True)
        return np.asarray(columns @ cho_solve(factor, columns.T @ self.se))

    def beside(self, columns: Array) -> Joined:
        """The same with a sum of these columns, unit prior sd, integrated out too."""
        crossed = self.ss @ columns
        factor = cho_factor(columns.T @ crossed + np.eye(columns.shape[1]), lower=True)
        return Joined(
            self.ss - crossed @ cho_solve(factor, crossed.T),
            self.se - crossed @ cho_solve(factor, columns.T @ self.se),
        )


def joined(runs: Sequence[CutRun], known: int, rows: Sequence[int], kept: Sequence[int]) -> Joined:
    """Some signals in all pieces of some runs, beside what all runs say of the free parameters.

    Parameters
    ----------
    runs : of equal signals
    known : number of free parameters, the first columns of each run; integrated out
    rows : positions of the signals wanted
    kept : positions of the runs whose pieces are wanted

    Raises
    ------
    LinAlgError
        if the information of the parameters is not positive definite
    """
    counts = [runs[k].count for k in kept]
    ends = np.cumsum([0, *counts])
    m = int(ends[-1])
    total, pull = np.eye(known), np.zeros(known)
    cross = np.zeros((known, len(rows) * m))
    ss, se = np.zeros((len(rows) * m, len(rows) * m)), np.zeros(len(rows) * m)
    for r in runs:
        total += r.equations.ss[:known, :known]
        pull += r.equations.se[:known]
    for k, first in zip(kept, ends[:-1], strict=True):
        g, count = runs[k].equations, runs[k].count
        piece = np.arange(count)
        at = np.concatenate([known + row * count + piece for row in rows])
        to = np.concatenate([i * m + first + piece for i in range(len(rows))])
        cross[:, to] = g.ss[:known, at]
        ss[np.ix_(to, to)] = g.ss[np.ix_(at, at)]
        se[to] = g.se[at]
    factor = cho_factor(total, lower=True)
    return Joined(ss - cross.T @ cho_solve(factor, cross), se - cross.T @ cho_solve(factor, pull))


def longest_runs(runs: Sequence[CutRun], signals: int) -> tuple[list[int], int]:
    """Runs whose pieces are asked for so many signals, in order, and how many pieces of each."""
    together = MOST_COLUMNS // signals
    by_length = sorted(range(len(runs)), key=lambda k: -runs[k].count * runs[k].width)
    kept = sorted(by_length[: together // ENOUGH_PIECES])
    return kept, together // len(kept)


def fewer(run: CutRun, known: int, most: int) -> CutRun:
    """The run cut into at most so many pieces: neighbours become one, the last piece may be shorter."""
    factor = -(-run.count // most)
    if factor == 1:
        return run
    count = -(-run.count // factor)
    of = np.arange(run.count) // factor
    rows = (run.equations.se.size - known) // run.count
    merge = np.zeros((run.equations.se.size, known + rows * count))
    merge[:known, :known] = np.eye(known)
    for row in range(rows):
        merge[known + row * run.count + np.arange(run.count), known + row * count + of] = 1.0
    g = run.equations
    equations = NormalEquations(merge.T @ g.ss @ merge, merge.T @ g.se, g.ee, g.logdet, g.used)
    return replace(run, width=run.width * factor, count=count, equations=equations)


def pieces_of(
    model: Model, paths: Sequence[Linearisation], runs: Sequence[CutRun], par: Array, sizes: Sequence[float]
) -> Pieces:
    """The motion at the pieces of runs.

    Parameters
    ----------
    par : parameters; those of the hull are read
    sizes : units of the forces by axis [N, N m]
    """
    length, time = model.scales["L"], model.scales["L"] / model.scales["U"]
    names = list(model.states)
    pose = [names.index(n) for n in ("x", "y", "z") if n in names]
    rest = [i for i, n in enumerate(names) if n not in ("x", "y", "z", "psi")]
    seen, felt, where, heading, run, when = [], [], [], [], [], []
    for k, (path, cut) in enumerate(zip(paths, runs, strict=True)):
        t = path.log.plan.t
        middle, states = 0.5 * (t[1:] + t[:-1]), 0.5 * (path.point.states[1:] + path.point.states[:-1])
        states, act = states[:, : len(names)], actuator_means(model, path)
        at = np.minimum(((middle - t[0]) / cut.width).astype(int), cut.count - 1)
        force = _of_the_hull(model, par, states, act) / np.asarray(sizes)
        mean = _by_piece(np.column_stack([states, act, force]), at, cut.count)
        where.append(mean[:, pose] / length)
        heading.append(mean[:, names.index("psi")])
        seen.append(mean[:, [*rest, *range(len(names), len(names) + act.shape[1])]])
        felt.append(mean[:, -force.shape[1] :])
        run.append(np.full(cut.count, k))
        when.append((np.arange(cut.count) + 0.5) * cut.width / time)
    state = np.concatenate(seen)
    sd = state.std(axis=0)
    usual = units(model)
    moving = [names[i] for i in rest] + list(model.kernel.actuators)
    least = np.array([usual.get(n, float(np.abs(x).max())) for n, x in zip(moving, state.T, strict=True)])
    moves = sd > ROUNDING * least
    return Pieces(
        np.concatenate(run), np.concatenate(when), np.concatenate(where), np.concatenate(heading),
        state[:, moves] / sd[moves], np.concatenate(felt), np.array([c.width / time for c in runs]),
    )  # fmt: skip


def _of_the_hull(model: Model, par: Array, states: Array, act: Array) -> Array:
    """(n, nv) force of the hull's rows and of its strips [N, N m], axis by axis as the velocities."""
    rows = [model.index[t.name] for t in rows_of(model.kernel.spec) if _hull_row(t) and t.name in model.index]
    rows += [model.index[n] for n in STRIPS if n in model.index]
    without = np.array(par, dtype=float)
    without[rows] = 0.0
    none = np.zeros(0, dtype=int)
    rates, _, mass = rates_on(model, par, states, act, none)
    return np.asarray((rates - rates_on(model, without, states, act, none)[0]) @ mass.T)


def _hull_row(row: Term) -> bool:
    return not (row.is_inertia or row.is_number) and {f.symbol for f in row.factors} <= OF_THE_HULL


def _by_piece(values: Array, at: Array, count: int) -> Array:
    """(count, k) means of the samples of every piece; of one without a sample that of the nearest."""
    n = np.bincount(at, minlength=count)
    total = np.zeros((count, values.shape[1]))
    np.add.at(total, at, values)
    full = np.flatnonzero(n)
    nearest = full[np.abs(np.arange(count)[:, None] - full).argmin(axis=1)]
    return total[nearest] / n[nearest, None]
