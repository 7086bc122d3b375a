"""Events that are not gross: seconds of a run in which a free force, allowed only there, gains beyond chance.

Takes a refitted hypothesis and its problem. Gives dated `Event`s. A force that depends on the motion comes
back whenever the motion does, and a gap that lasts is found where it lies (`localisation`): what is left in a
few seconds only is neither. Does not leave anything out (`exclusions`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import block_diag, cho_factor, cho_solve

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.event_search import MOST_EVENTS, MOST_TIME_SHARE
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.localisation import SENSORS, channel_sets, units
from bayesid.diagnosis.threshold_table import BRIEF_EVENT_EVIDENCE
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.linearise import Linearisation, linearise_runs
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.run_data import Array

# A run is cut into pieces of this time [L/U], or more, so that there are at most so many of them.
FINEST, MOST_PIECES = 0.5, 100
# Bytes of the columns of one run that are held at once; longer runs are cut into fewer pieces.
MOST_BYTES = 200_000_000
# Pieces an event lasts, the correlation time of its force [L/U], and its prior sd over a large disturbance.
LASTS = (2, 4, 6, 8, 12, 16)
CORRELATION_TIME = 8.0
AMPLITUDES = (0.1, 1.0)
# Places that are left out: one input after another is asked, and water that moves is no event.
ELSEWHERE = ("current", "X+Y+N")


@dataclass(frozen=True, eq=False)
class Pieces:
    """One run cut into pieces of equal time.

    Attributes
    ----------
    run : its position
    start, width : of the first, and of each [s]
    count : how many
    equations : columns of the free parameters, then of every signal by piece, in a unit of it
    """

    run: int
    start: float
    width: float
    count: int
    equations: NormalEquations


@dataclass(frozen=True, eq=False)
class Found:
    """A signal allowed in some pieces of a run.

    Attributes
    ----------
    gain : log evidence beside what was found before, less the logarithm of how many were tried
    run : position among the runs
    place : as in `localisation`
    first, last : pieces, `last` exclusive
    columns : (m,) positions among those of the signals
    root : (signals, m) prior as columns in the signals' units: a sum of them, each with unit sd
    """

    gain: float
    run: int
    place: str
    first: int
    last: int
    columns: Array
    root: Array


def brief_events(problem: DiagnosisProblem, beside: RefittedHypothesis, least: float) -> tuple[Event, ...]:
    """Events beside an explanation; none where together they gain less than what would do instead of them.

    Parameters
    ----------
    beside : explanation of the whole trial; no event is looked for where its fit has not converged
    least : log evidence that they have to gain together

    Notes
    -----
    Signals of `LASTS` pieces, each with the prior of a first-order Gauss-Markov process, in every place and
    run; parameters of the explanation are integrated out. The one that gains most is kept, then the next
    beside it, while each gains `BRIEF_EVENT_EVIDENCE`. None is an event where all together last more than
    `MOST_TIME_SHARE` of the time: what lasts is a gap. An error of a sensor is asked for as well and stands
    beside the rest, but is no event while it is not gross: heading of a vehicle that rolls begins with one.
    """
    if not beside.fit.converged:
        return ()
    free = beside.fit.free
    paths = linearise_runs(problem.model, problem.logs, beside.fit.points, free.where)
    signals = _signals(problem)
    runs = [_cut(problem, beside, k, path, signals) for k, path in enumerate(paths)]
    most = MOST_TIME_SHARE * sum(r.count * r.width for r in runs)
    found: list[Found] = []
    while len(found) < MOST_EVENTS:
        rest = Joint(runs, len(free.names), found).beside()
        one = _largest([_largest_of(problem, r, g, signals) for r, g in zip(runs, rest, strict=True)])
        if one is None or one.gain < BRIEF_EVENT_EVIDENCE:
            break
        found.append(one)
        if sum((f.last - f.first) * runs[f.run].width for f in found) > most:
            return ()
    if not sum(f.gain for f in found if f.place not in SENSORS) > least:
        return ()
    return _told(problem, Joint(runs, len(free.names), found), found)


def _largest(of_runs: Sequence[tuple[int, Found | None]]) -> Found | None:
    """The signal that gains most of all runs, its choice among all of them counted."""
    tried = max(sum(count for count, _ in of_runs), 1)
    best = max((f for _, f in of_runs if f is not None), key=lambda f: f.gain, default=None)
    return None if best is None else replace(best, gain=best.gain - float(np.log(tried)))


def _signals(problem: DiagnosisProblem) -> tuple[str, ...]:
    """Inputs and sensor channels of all places."""
    sets = {k: v for k, v in channel_sets(problem).items() if k not in ELSEWHERE}
    return tuple(dict.fromkeys(name for both in sets.values() for part in both for name in part))


def _cut(
    problem: DiagnosisProblem,
    beside: RefittedHypothesis,
    run: int,
    path: Linearisation,
    signals: Sequence[str],
) -> Pieces:
    """Normal equations of a run with a column for every signal and piece."""
    size, t = units(problem.model), path.log.plan.t
    (n, q), states = path.resid.shape, path.gamma.shape[1]
    held = MOST_BYTES // (8 * n * (q + states) * len(signals))
    time = problem.model.scales["L"] / problem.model.scales["U"]
    length = float(t[-1] - t[0])
    count = max(1, min(MOST_PIECES, held, int(np.ceil(length / (FINEST * time)))))
    width = length / count
    at = np.minimum(((t - t[0]) / width).astype(int), count - 1)
    middle = np.minimum(((0.5 * (t[1:] + t[:-1]) - t[0]) / width).astype(int), count - 1)
    direct, drive = np.zeros((n, q, len(signals) * count)), np.zeros((n - 1, states, len(signals) * count))
    for i, name in enumerate(signals):
        if name in path.inputs:
            push = path.gamma[:, :, path.inputs.index(name)] * size[name]
            drive[np.arange(n - 1), :, i * count + middle] = push
        elif name in path.log.channels:
            direct[np.arange(n), path.log.channels.index(name), i * count + at] = size[name]
    noise = problem.environment.noise_model
    g = run_equations(problem.model, path, beside.fit.free, noise, run=run, extra=(direct, drive))
    return Pieces(run, float(t[0]), width, count, g)


class Joint:
    """One linear model of all runs: the free parameters, and what was found, beside any further signal.

    Parameters
    ----------
    known : number of free parameters, the first columns of every run
    """

    def __init__(self, runs: Sequence[Pieces], known: int, found: Sequence[Found]) -> None:
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

    def beside(self) -> list[NormalEquations]:
        """Equations of the signals of every run, all of the model integrated out."""
        out = []
        for r, cross in zip(self.runs, self.crossed, strict=True):
            g = r.equations
            ss = g.ss[self.known :, self.known :] - cross.T @ cho_solve(self.factor, cross)
            se = g.se[self.known :] - cross.T @ cho_solve(self.factor, self.pull)
            out.append(NormalEquations(ss, se, g.ee, g.logdet, g.used))
        return out

    def average(self, found: Found, part: slice) -> tuple[float, float]:
        """Mean of one signal over its pieces, and its standard deviation, in its unit."""
        over = np.zeros(self.pull.size)
        over[part] = found.root.mean(axis=0)
        return float(over @ cho_solve(self.factor, self.pull)), float(
            over @ cho_solve(self.factor, over)
        ) ** 0.5


def _largest_of(
    problem: DiagnosisProblem, piece: Pieces, rest: NormalEquations, signals: Sequence[str]
) -> tuple[int, Found | None]:
    """How many signals were tried in a run, and the one that gains most."""
    tried, best = 0, None
    time = problem.model.scales["L"] / problem.model.scales["U"]
    for place, (inputs, channels) in channel_sets(problem).items():
        if place in ELSEWHERE:
            continue
        rows = np.array([signals.index(n) for n in (*inputs, *channels)])
        for lasts in (n for n in LASTS if n <= piece.count):
            starts = np.arange(piece.count - lasts + 1)
            at = rows[None, :, None] * piece.count + starts[:, None, None] + np.arange(lasts)
            at = at.reshape(starts.size, -1)
            for amplitude in AMPLITUDES:
                root = amplitude * _root(rows.size, lasts, round(piece.width / time, 6))
                gains = _gains(rest, at, root)
                tried += starts.size
                k = int(np.argmax(gains))
                if best is None or gains[k] > best.gain:
                    best = Found(float(gains[k]), piece.run, place, k, k + lasts, at[k], root)
    return tried, best


@lru_cache(maxsize=64)
def _root(count: int, lasts: int, width: float) -> Array:
    """Root of the covariance of `count` independent Gauss-Markov processes of unit sd by piece [L/U]."""
    at = np.arange(lasts)
    one = np.linalg.cholesky(np.exp(-np.abs(at[:, None] - at) * width / CORRELATION_TIME))
    return block_diag(*[one] * count)


def _gains(g: NormalEquations, at: Array, root: Array) -> Array:
    """(w,) log evidence of signals in the columns `at` (w, m), each with the prior `root`."""
    h = root.T @ g.ss[at[:, :, None], at[:, None, :]] @ root + np.eye(root.shape[1])
    pull = g.se[at] @ root
    try:
        low = np.linalg.cholesky(h)
    except LinAlgError:
        return np.full(len(at), -np.inf)
    moved = np.linalg.solve(low, pull[:, :, None])[:, :, 0]
    return 0.5 * (moved**2).sum(axis=1) - np.log(np.diagonal(low, axis1=1, axis2=2)).sum(axis=1)


def _told(problem: DiagnosisProblem, joint: Joint, found: Sequence[Found]) -> tuple[Event, ...]:
    """Events of motion by run and time."""
    out, size, sets = [], units(problem.model), channel_sets(problem)
    for f, part in zip(found, joint.parts, strict=True):
        if f.place in SENSORS:
            continue
        piece, (inputs, _) = joint.runs[f.run], sets[f.place]
        start, end = (piece.start + piece.width * k for k in (f.first, f.last))
        event = Event(problem.logs[f.run].name, start, end, f.place, "motion", None, f.gain)
        if len(inputs) == 1:
            value, sd = (size[inputs[0]] * x for x in joint.average(f, part))
            event = replace(event, value=value, sd=sd)
        out.append(event)
    return tuple(sorted(out, key=lambda e: (e.run, e.start)))
