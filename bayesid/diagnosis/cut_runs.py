"""Runs cut into pieces: one linear model of all of them, with a signal of its own in every piece.

Takes an explanation and its problem. Gives normal equations, and what is left of them beside what was found.
Does not search (see `brief_events`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import NOISE_SCALE_SHIFTS
from bayesid.diagnosis.hypotheses.localisation import channel_sets, units
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NOT_LINEARISABLE, NormalEquations, normal_equations
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, linearise_runs
from bayesid.estimation.filter_error.noise_identification import MANOEUVRE_NOISE_SPREAD
from bayesid.estimation.filter_error.noise_model import NoiseModel, whitened
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.simulation import TimePlan
from bayesid.threads import each

# A run is cut into pieces of this time [L/U], or more, so that there are at most so many of them.
FINEST, MOST_PIECES = 0.5, 100
# Bytes of the whitened columns of one run; a run of more samples is cut into fewer pieces.
MOST_BYTES = 200_000_000
# Correlation time of a signal [L/U].
CORRELATION_TIME = 8.0
# Places that are left out: one input after another is asked, and water that moves is not brief.
ELSEWHERE = ("current", "X+Y+N")


@dataclass(frozen=True, eq=False)
class CutRun:
    """One run cut into pieces of equal time.

    Attributes
    ----------
    run : its position
    start, width : of the first piece, and of each [s]
    count : how many
    equations : columns of the free parameters, then of every signal by piece, in units of `localisation`
    """

    run: int
    start: float
    width: float
    count: int
    equations: NormalEquations


@dataclass(frozen=True, eq=False)
class Sought:
    """What a signal is looked for in: an explanation, linearised, and all runs cut into pieces.

    Attributes
    ----------
    free : parameters of the explanation, integrated out
    """

    problem: DiagnosisProblem
    free: GaussianPrior
    paths: Sequence[Linearisation]
    runs: Sequence[CutRun]
    signals: tuple[str, ...]

    @property
    def known(self) -> int:
        """Number of free parameters."""
        return len(self.free.names)


@dataclass(frozen=True, eq=False)
class BriefSignal:
    """A signal allowed in some pieces of a run.

    Attributes
    ----------
    gain : log evidence beside what was found before, less `chosen`
    run : position among the runs
    place : as in `localisation`
    first, last : pieces, `last` exclusive
    columns : (m,) positions among those of the signals
    root : (m, m) prior as columns in the signals' units: a sum of them, each with unit sd
    chosen : logarithm of how many were tried
    """

    gain: float
    run: int
    place: str
    first: int
    last: int
    columns: Array
    root: Array
    chosen: float = 0.0


def signals_of(problem: DiagnosisProblem) -> tuple[str, ...]:
    """Inputs and sensor channels of all places."""
    sets = {k: v for k, v in channel_sets(problem).items() if k not in ELSEWHERE}
    return tuple(dict.fromkeys(name for both in sets.values() for part in both for name in part))


def linearised(problem: DiagnosisProblem, free: GaussianPrior, points: Sequence[Trajectory]) -> Sought:
    """The runs of a problem, linearised at points of an explanation, for who cuts them into pieces anew.

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    return Sought(problem, free, linearise_runs(problem.model, problem.logs, points, free.where), (), ())


def sought_in(problem: DiagnosisProblem, free: GaussianPrior, points: Sequence[Trajectory]) -> Sought:
    """The runs of a problem, linearised at points of an explanation and cut into pieces.

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    paths = linearise_runs(problem.model, problem.logs, points, free.where)
    signals = signals_of(problem)
    runs = each(lambda k, path: cut(problem, free, k, path, signals), range(len(paths)), paths)
    return Sought(problem, free, paths, runs, signals)


def at_noise_scales(sought: Sought) -> Iterator[tuple[float, Sequence[CutRun]]]:
    """The runs cut anew with the noise of the motion larger and smaller, by as much as a measured environment
    may differ between runs, and the log probability of each; once, as it is, where the environment is stated
    (as `candidate.repeatable_evidence`)."""
    problem, environment = sought.problem, sought.problem.environment
    if environment.source == "stated" or not any(environment.noise_model.force):
        yield 0.0, sought.runs
        return
    for shift in NOISE_SCALE_SHIFTS:
        noise = environment.noise_model.scaled(float(np.exp(shift)))

        def of_run(k: int, path: Linearisation, noise: NoiseModel = noise) -> CutRun:
            return cut(problem, sought.free, k, path, sought.signals, noise_model=noise)

        runs = each(of_run, range(len(sought.paths)), sought.paths)
        yield -0.5 * (shift / MANOEUVRE_NOISE_SPREAD) ** 2, runs


def cut(
    problem: DiagnosisProblem,
    free: GaussianPrior,
    run: int,
    path: Linearisation,
    signals: Sequence[str],
    taken: Sequence[tuple[str, Array]] = (),
    noise_model: NoiseModel | None = None,
) -> CutRun:
    """A run cut into pieces.

    Parameters
    ----------
    free : parameters of the explanation, which have the first columns
    taken : actuators that have one more column for every piece, which takes so much of them away, (n,) at the
        samples [rad, rpm]
    noise_model : default that of the problem

    Raises
    ------
    ModelError
        if the run cannot be linearised along its path
    """
    noise = noise_model if noise_model is not None else problem.environment.noise_model
    size, t = units(problem.model), path.log.plan.t
    (n, q), states = path.resid.shape, path.gamma.shape[1]
    time = problem.model.scales["L"] / problem.model.scales["U"]
    length, rows = float(t[-1] - t[0]), len(signals) + len(taken)
    most = min(MOST_PIECES, MOST_BYTES // (8 * n * q * rows))
    count = max(1, min(most, int(np.ceil(length / (FINEST * time)))))
    width, known = length / count, len(free.names)
    at = np.minimum(((t - t[0]) / width).astype(int), count - 1)
    middle = np.minimum(((0.5 * (t[1:] + t[:-1]) - t[0]) / width).astype(int), count - 1)
    step = free.mean - path.point.par[free.where]
    columns = np.empty((n * q, known + rows * count))
    for i, name in enumerate((*signals, *(name for name, _ in taken))):
        direct, drive = np.zeros((n, q, count)), np.zeros((n - 1, states, count))
        if name in path.inputs:
            push = path.gamma[:, :, path.inputs.index(name)]
            push = push * size[name] if i < len(signals) else -push * taken[i - len(signals)][1][:-1, None]
            drive[np.arange(n - 1), :, middle] = push
        elif name in path.log.channels:
            direct[np.arange(n), path.log.channels.index(name), at] = size[name]
        white = whitened(problem.model, path, step, free.sd, noise, None, run, (direct, drive))
        columns[:, :known] = white.columns[:, :known]
        columns[:, known + i * count : known + (i + 1) * count] = white.columns[:, known:]
    if not (np.isfinite(columns).all() and np.isfinite(white.resid).all()):
        raise ModelError(NOT_LINEARISABLE)
    g = normal_equations(white.resid, columns, white.logdet, white.used)
    return CutRun(run, float(t[0]), width, count, g)


def orders(problem: DiagnosisProblem, run: int, actuator: str) -> Array:
    """(n,) logged order of an actuator at the samples of a run, within its limit [rad, rpm]."""
    return orders_of(problem.model, problem.logs[run].plan, actuator)


def orders_of(model: Model, plan: TimePlan, actuator: str) -> Array:
    """(n,) order of an actuator at the samples of a plan, within its limit [rad, rpm]."""
    at = np.minimum(plan.record, plan.steps.size - 1)
    order = np.asarray(plan.command[at, model.kernel.actuators.index(actuator)])
    limit = model.limit(actuator)
    return np.clip(order, -limit, limit)


class Joint:
    """One linear model of all runs: the free parameters and what was found, beside any further signal.

    Parameters
    ----------
    known : number of free parameters, the first columns of every run

    Raises
    ------
    LinAlgError
        if its information is not positive definite
    """

    def __init__(self, runs: Sequence[CutRun], known: int, found: Sequence[BriefSignal]) -> None:
        self.runs, self.known = runs, known
        ends = np.cumsum([known, *(f.root.shape[1] for f in found)])
        self.parts = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        total, self.pull = np.eye(ends[-1]), np.zeros(ends[-1])
        self.crossed = []
        for r in runs:
            g = r.equations
            # columns of the run in terms of what is integrated out
            basis = np.zeros((g.se.size, ends[-1]))
            basis[:known, :known] = np.eye(known)
            for f, part in zip(found, self.parts, strict=True):
                if f.run == r.run:
                    basis[known + f.columns, part] = f.root
            total += basis.T @ g.ss @ basis
            self.pull += basis.T @ g.se
            self.crossed.append(basis.T @ g.ss[:, known:])
        self.factor = cho_factor(total, lower=True)

    @property
    def log_evidence(self) -> float:
        """Up to what does not depend on what was found."""
        fixed = -0.5 * sum(r.equations.ee + r.equations.logdet for r in self.runs)
        explained = 0.5 * float(self.pull @ cho_solve(self.factor, self.pull))
        return fixed + explained - float(np.log(np.diag(self.factor[0])).sum())

    def rest(self, run: int) -> tuple[Array, Array]:
        """Products of the signals' columns of a run with each other and with the residual, all of the model
        integrated out."""
        g, cross, known = self.runs[run].equations, self.crossed[run], self.known
        ss = g.ss[known:, known:] - cross.T @ cho_solve(self.factor, cross)
        return ss, g.se[known:] - cross.T @ cho_solve(self.factor, self.pull)

    def average(self, found: BriefSignal, part: slice) -> tuple[float, float]:
        """Mean of one signal over its pieces, and its standard deviation, in its unit."""
        over = np.zeros(self.pull.size)
        over[part] = found.root.mean(axis=0)
        spread = cho_solve(self.factor, over)
        return float(spread @ self.pull), float(over @ spread) ** 0.5


@lru_cache(maxsize=64)
def prior_root(count: int, lasts: int, width: float) -> Array:
    """Root of the covariance of `count` independent first-order Gauss-Markov processes of unit sd.

    Parameters
    ----------
    lasts : pieces
    width : of a piece [L/U]
    """
    at = np.arange(lasts)
    one = np.linalg.cholesky(np.exp(-np.abs(at[:, None] - at) * width / CORRELATION_TIME))
    return block_diag(*[one] * count)
