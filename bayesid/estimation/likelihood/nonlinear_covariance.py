"""How far an estimate may be off where the readings are not linear in the parameters: along ridges that bend.

Takes a `FitProblem`, its estimate and the covariance there by linear theory. Gives the second moment of the
error about the estimate. Does not search, and does not choose what the noise is made of.

Draws of linear theory are carried to where the readings, projected on their slopes at the estimate, are those
that linear theory foretells (randomise-then-optimise; Bardsley, Solonen, Haario and Laine 2014). A
combination that runs fix at the estimate is not quite the one they fix a standard deviation along a long
ridge: of 22 coefficients found from a spiral the best known combinations were 2 to 5 times less sure than
their linear sd, and 75 % of their 90 % intervals held the truth (`reports/posterior`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import norm, qmc

from bayesid.errors import ModelError
from bayesid.estimation.output_error.elimination import with_own_prior
from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
# Pairs of opposite draws, a power of two, at least so many per parameter (their sample covariance is made
# that of linear theory), and pairs after which a problem that is linear enough is left alone.
PAIRS, PAIRS_EACH, FIRST_PAIRS = 64, 2, 8
# Added variance of any combination, over its linear variance, that is not worth telling.
LINEAR = 0.1
# Steps of a draw, distance [sd] at which it has arrived, shortest part of a step.
STEPS, ARRIVED, SHORTEST = 12, 0.03, 0.05
# Share of the draws that must arrive; eigenvalue of a correlation matrix, or rest of a column, that is
# rounding.
LEAST_ARRIVED, ROUNDING = 0.5, 1e-12


@dataclass(frozen=True, eq=False)
class NonlinearCovariance:
    """Second moment of the error about an estimate.

    Attributes
    ----------
    covariance : (k, k) [SI]
    pairs : pairs of opposite draws it rests on; 0 where linear theory stands
    lost : pairs of which one did not arrive; 0 where enough did to tell that linear theory stands
    widest : largest sd of a combination over its linear sd
    """

    covariance: Array
    pairs: int
    lost: int
    widest: float

    def record(self) -> dict[str, float]:
        """For JSON."""
        return {"pairs": self.pairs, "lost": self.lost, "widest_over_linear": self.widest}


def nonlinear_covariance(
    problem: FitProblem,
    z: Array,
    covariance: Array,
    seed: int = 0,
    held: Sequence[int] = (),
    tick: Callable[[], None] = lambda: None,
) -> NonlinearCovariance:
    """Second moment of the error about an estimate, readings not being linear in the parameters.

    Parameters
    ----------
    problem : whose noise is what the readings count for
    z : unknowns at the estimate, k parameters first, then initial states, which follow the parameters
    covariance : (k, k) of linear theory [SI]
    seed : of the draws
    held : positions of parameters on a bound: no draw leaves it, what they add stays that of linear theory
    tick : called after every pair of draws

    Returns
    -------
    that of linear theory where the problem is linear enough, or where too few draws arrive; along no
    combination narrower than it

    Raises
    ------
    ModelError
        if the simulated vehicle diverges at the estimate
    """
    k = len(problem.params.names)
    with np.errstate(invalid="ignore", divide="ignore"):
        sd = np.sqrt(np.diag(covariance))
        inner = _given(covariance, held)
        correlation = inner / np.outer(sd, sd)
    if not np.isfinite(correlation).all() or len(held) == k:
        return NonlinearCovariance(covariance, 0, 0, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    kept = values > ROUNDING * values[-1]  # coefficients that are one, as symmetric added masses, stay so
    values, vectors = values[kept], vectors[:, kept]
    spread = vectors * np.sqrt(values)
    starts = np.concatenate([np.zeros(0), *(run.initial_sd for run in problem.runs)])
    unit = np.concatenate([sd, np.where(np.isfinite(starts), starts, 1.0)])
    carried = _Carried(problem, np.asarray(z, dtype=float), unit)
    if carried.open:
        return NonlinearCovariance(covariance, 0, 0, 1.0)
    linear = _standard(values.size, seed)[:, None, :] * np.array([[1.0], [-1.0]])
    errors, lost = linear.copy(), 0  # a pair that does not arrive counts as linear: losing it would narrow
    for number, pair in enumerate(linear):
        there = [carried.to(spread @ draw) for draw in pair]
        arrived = [vectors.T @ x[:k] / np.sqrt(values) for x in there if x is not None]
        if len(arrived) == len(pair):
            errors[number] = arrived
        else:
            lost += 1
        tick()
        if number + 1 == FIRST_PAIRS:
            bent = _moment((errors - linear)[:FIRST_PAIRS])
            if lost > LEAST_ARRIVED * FIRST_PAIRS or (not lost and np.linalg.eigvalsh(bent)[-1] < LINEAR):
                return NonlinearCovariance(covariance, 0, lost, 1.0)
    more, along = np.linalg.eigh(_moment(errors))
    if lost > LEAST_ARRIVED * len(linear):
        return NonlinearCovariance(covariance, 0, lost, 1.0)
    if more[-1] < 1.0 + LINEAR:
        return NonlinearCovariance(covariance, 0, 0, 1.0)
    wide = spread @ along * np.sqrt(np.maximum(more, 1.0))
    told = wide @ wide.T * np.outer(sd, sd) + covariance - inner
    return NonlinearCovariance(told, len(linear) - lost, lost, float(np.sqrt(more[-1])))


def _given(covariance: Array, held: Sequence[int]) -> Array:
    """(k, k) covariance of the parameters where some are known; zero in their rows."""
    at = list(held)
    if not at:
        return covariance
    gain = np.linalg.solve(covariance[np.ix_(at, at)], covariance[at])
    out = covariance - covariance[:, at] @ gain
    out[at], out[:, at] = 0.0, 0.0
    return out


def _moment(errors: Array) -> Array:
    """(q, q) second moment of errors (pairs, 2, q)."""
    rows = errors.reshape(-1, errors.shape[-1])
    return rows.T @ rows / len(rows)


def _standard(k: int, seed: int) -> Array:
    """(pairs, k) standard normal draws of a low-discrepancy sequence whose second moment is the identity."""
    power = max(PAIRS, PAIRS_EACH * k).bit_length() - 1
    power += 2**power < PAIRS_EACH * k
    rows = norm.ppf(qmc.Sobol(k, seed=np.random.default_rng([seed, k])).random_base2(power))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(rows.T @ rows / len(rows)), rows.T).T)


@dataclass(frozen=True, eq=False)
class _Turned:
    """Readings of one run, and the prior of its initial states, turned so that those states come first.

    Attributes
    ----------
    rows : (r, n) orthogonal: what the slopes see of n residuals
    there : (r,) of the residuals at the estimate
    prior : positions of the prior's residuals that are of this run
    own, by : (s, s) triangle of the run's initial states; (s, k) slopes of the same rows by the parameters
    """

    rows: Array
    there: Array
    prior: Array
    own: Array
    by: Array


class _Carried:
    """Carries deviations of the parameters from linear theory to the readings that theory foretells.

    Initial states are taken out run by run: with hundreds of short pieces there are thousands of them.
    """

    def __init__(self, problem: FitProblem, z: Array, unit: Array) -> None:
        self.problem, self.z, self.unit = problem, z, unit
        self.k = k = len(problem.params.names)
        block, at = problem.run_blocks(z), k
        self.prior, of_prior = problem.prior(z)
        self.runs: list[_Turned] = []
        below: list[Array] = []
        common = np.ones(self.prior.size, dtype=bool)
        for i, run in enumerate(problem.runs):
            resid, jac = block(i)
            own = slice(at, at + len(run.initial))
            at = own.stop
            slopes, mine = with_own_prior(jac, of_prior, own, k)
            common[mine] = False
            slopes = slopes * np.concatenate([unit[own], unit[:k]])
            # orthogonal, not normal equations: an unstable vehicle feels its start e^20 times
            turn, triangle = np.linalg.qr(slopes)
            there = turn.T @ np.concatenate([resid, self.prior[mine]])
            first = len(run.initial)
            if triangle.shape[0] < first:  # fewer readings than initial states
                self.open = True
                return
            self.runs.append(_Turned(turn.T, there, mine, triangle[:first, :first], triangle[:first, first:]))
            below.append(triangle[first:, first:])
        self.common = np.flatnonzero(common)
        self.q, self.triangle = np.linalg.qr(np.vstack([*below, of_prior[self.common, :k] * unit[:k]]))
        if self.triangle.shape[0] < k:  # fewer rows than parameters
            self.open = True
            return
        size = np.sqrt(sum((r.by**2).sum(axis=0) for r in self.runs) + (self.triangle**2).sum(axis=0))
        sized = [np.abs(np.diag(self.triangle)) / np.maximum(size, 1e-300)]
        sized += [
            np.abs(np.diag(r.own)) / np.maximum(np.linalg.norm(r.own, axis=0), 1e-300) for r in self.runs
        ]
        #: whether some unknown is held by neither readings nor prior
        self.open = bool(np.concatenate(sized).min() < ROUNDING)

    def to(self, deviation: Array) -> Array | None:
        """(nz,) deviation of the unknowns in `unit`; None where the steps do not arrive or a run diverges.

        Parameters
        ----------
        deviation : (k,) of the parameters by linear theory
        """
        # the initial states are those that suit the parameters best
        goal = np.concatenate([np.zeros(self.z.size - self.k), self.triangle @ deviation])
        x, best, part = self._solved(goal), np.inf, 1.0
        base = move = np.zeros_like(x)
        for _ in range(STEPS):
            missed = self._missed(x, goal)
            far = np.inf if missed is None else float(np.linalg.norm(missed))
            if far < ARRIVED:
                return x
            if missed is not None and far < best:
                base, best, part = x, far, 1.0
                move = self._solved(missed)
            elif not np.isfinite(best):
                x = 0.5 * x
                continue
            else:
                part *= 0.5
                if part < SHORTEST:
                    return None
            x = base + part * move
        return None

    def _missed(self, x: Array, goal: Array) -> Array | None:
        """(nz,) what the projected readings at x lack of the goal, those of initial states first; None where
        a run diverges."""
        z = self.z + x * self.unit
        try:
            simulated = self.problem.readings(z)
        except ModelError:
            return None
        prior = self.problem.prior(z)[0]
        first, below = [np.zeros(0)], []
        for turned, run, y in zip(self.runs, self.problem.runs, simulated, strict=True):
            resid = np.concatenate([run.residuals(y).ravel(), prior[turned.prior]])
            moved = turned.rows @ resid - turned.there
            first.append(moved[: len(turned.own)])
            below.append(moved[len(turned.own) :])
        of_all = self.q.T @ np.concatenate([*below, (prior - self.prior)[self.common]])
        missed = goal - np.concatenate([*first, of_all])
        return missed if np.isfinite(missed).all() else None

    def _solved(self, projected: Array) -> Array:
        """(nz,) deviation in `unit` that linear theory has for projected readings."""
        at = self.z.size - self.k
        parameters = solve_triangular(self.triangle, projected[at:])
        out, first = [parameters], 0
        for r in self.runs:
            last = first + len(r.own)
            out.append(solve_triangular(r.own, projected[first:last] - r.by @ parameters))
            first = last
        return np.concatenate(out)
