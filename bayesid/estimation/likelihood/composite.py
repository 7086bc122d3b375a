"""Composite likelihood of runs: their scores as Gaussian data about the parameters.

Takes `RunInformation` and the noise of residuals. Gives posterior and log evidence for any parts. Linear
algebra about one estimate; parameters in units of their scale.

Output error maximises a likelihood that treats correlated errors as independent. Its score of run r is then
unbiased with covariance C_r, not with the information H_r: g_r ~ N(H_r (theta - theta0 + d_r), f B_r),
where d_r ~ N(0, t^2 S) is how the coefficients of run r differ from those of the ship, B_r follows from the
memory of the residuals, and C_r = f B_r + t^2 H_r S H_r. With prior precision P and the readings'
likelihood to the power w the estimate has M = w H + P, and its error the covariance M^-1 (w^2 C + P) M^-1;
white noise has C = H, w = 1 and gives back (J^T J + P)^-1. (Composite likelihood and its power: Varin, Reid
and Firth 2011; Pauli, Racugno and Ventura 2011. Random effects of runs: DerSimonian and Laird 1986.)

The estimate of least error weighs every score by its own covariance, A = sum of H_r C_r^-1 H_r for w H: it is
the mean of the posterior of theta given the scores and has its covariance (A + P)^-1 (scores as data: Hansen
1982, Econometrica 50(4)). One power for all directions forgets what the prior knew in some and what the
readings know in others. It stays where left-out runs are predicted better with it than chance makes them, as
on real ships whose prior is too narrow.

With all of the power 22 coefficients of a real tanker went up to 8 prior sd away to follow errors of the
model, and left-out runs were predicted worse beyond the length of a piece.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from bayesid.estimation.likelihood.mixed_rates import MixedRateNoise
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.run_information import RunInformation
from bayesid.estimation.parameters import WIDE

Array = np.ndarray
# Eigenvalue of a score's covariance over its largest up to which a direction is one without data.
FLAT = 1e-10
# The same of what readings and prior hold together, below which a direction is open.
OPEN = 1e-12
# Runs from which leaving one out tells how much a likelihood counts, and of a model form.
LEAST_RUNS = 4


@dataclass(frozen=True, eq=False)
class RunScore:
    """What one run, all its pieces together, says: information H, covariance B of the score, score g."""

    name: str
    information: Array
    covariance: Array
    score: Array

    @cached_property
    def seen(self) -> Array:
        """(k, m) directions this run has data of, in which the covariance of its score is one.

        In all others the score is nothing whatever the noise is; counted as readings without error they
        would speak against any noise.
        """
        size = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        unit = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        values, vectors = np.linalg.eigh(self.covariance * np.outer(unit, unit))
        kept = values > FLAT * max(float(values[-1]), 1e-300)
        return unit[:, None] * vectors[:, kept] / np.sqrt(values[kept])

    def joined(self, other: RunScore) -> RunScore:
        """This piece of a run and another one of it."""
        return RunScore(
            self.name, self.information + other.information, self.covariance + other.covariance,
            self.score + other.score,
        )  # fmt: skip

    def weighed(self, excess: float, deviation: Array) -> tuple[Array, Array, float]:
        """Precision (k, k), score (k,) and log density at the estimate, where the score's covariance is
        `excess` B + H D D' H with `deviation` D (k, k) the root of how the run's coefficients vary."""
        h, g = self.seen.T @ self.information, self.seen.T @ self.score
        if not g.size:
            return np.zeros_like(self.information), np.zeros_like(self.score), 0.0
        smeared = h @ deviation
        c = excess * np.eye(g.size) + smeared @ smeared.T
        factor = cho_factor(c, lower=True)
        whole = cho_solve(factor, np.column_stack([h, g]))
        logdet = 2.0 * float(np.log(np.diag(factor[0])).sum())
        return h.T @ whole[:, :-1], h.T @ whole[:, -1], -0.5 * (logdet + float(g @ whole[:, -1]))


class Law(NamedTuple):
    """Estimate of the parameters and its error, deviations from theta0 in units of scale.

    mean : of the parameters
    response : (k, k) how the estimate follows the true value
    noise : (k, k) covariance of the estimate about that
    known, unknown : (k, k) covariance of the parameters in directions that readings or prior hold, and in
        those of which neither says anything; `covariance` is the sum
    """

    mean: Array
    known: Array
    response: Array
    noise: Array
    unknown: Array

    @property
    def covariance(self) -> Array:
        return self.known + self.unknown


@dataclass(frozen=True, eq=False)
class Composite:
    """Scores of runs beside a Gaussian prior.

    Attributes
    ----------
    runs : one score per run
    prior_precision, prior_score : (k, k), (k,) of the prior at the estimate
    spread : (k,) sd of a coefficient from run to run at `run_spread` 1
    """

    runs: tuple[RunScore, ...]
    prior_precision: Array
    prior_score: Array
    spread: Array

    def as_white(self) -> Composite:
        """The same scores as if the residuals had no memory: their covariance is their information."""
        return replace(self, runs=tuple(replace(run, covariance=run.information) for run in self.runs))

    def score_covariance(self, run: RunScore, parts: NoiseParts) -> Array:
        """(k, k) covariance C_r of the score of one run."""
        smeared = run.information * self.spread
        return parts.excess * run.covariance + parts.run_spread**2 * smeared @ smeared.T

    def weighed(self, run: RunScore, parts: NoiseParts) -> tuple[Array, Array, float]:
        """Precision (k, k) and score (k,) of one run under its noise, and its log density at the estimate."""
        if id(run) not in self._turned:
            return run.weighed(parts.excess, parts.run_spread * np.diag(self.spread))
        sizes, h, g = self._turned[id(run)]
        variance = parts.excess + parts.run_spread**2 * sizes
        whole = h.T / variance
        log = -0.5 * float(np.log(variance).sum() + g @ (g / variance))
        return whole @ h, whole @ g, log

    @cached_property
    def _turned(self) -> dict[int, tuple[Array, Array, Array]]:
        """Run -> variances (m,) that run spread 1 adds, information (m, k) and score (m,), in directions in
        which all noise is independent: hundreds of parts are tried on the same runs.
        """
        out = {}
        for run in self.runs:
            h, g = run.seen.T @ run.information, run.seen.T @ run.score
            vectors, sizes, _ = np.linalg.svd(h * self.spread, full_matrices=True)
            added = np.zeros(g.size)
            added[: sizes.size] = sizes**2
            out[id(run)] = added, vectors.T @ h, vectors.T @ g
        return out

    def data(self, parts: NoiseParts, runs: Iterable[RunScore] | None = None) -> tuple[Array, Array, float]:
        """Sum of `weighed` over some runs, by default all."""
        k = self.prior_score.size
        precision, score, log = np.zeros((k, k)), np.zeros(k), 0.0
        for run in self.runs if runs is None else runs:
            a, b, c = self.weighed(run, parts)
            precision, score, log = precision + a, score + b, log + c
        return 0.5 * (precision + precision.T), score, log

    def law(self, parts: NoiseParts, runs: Iterable[RunScore] | None = None) -> Law:
        """Estimate and error given some runs, by default all."""
        chosen = tuple(self.runs if runs is None else runs)
        if parts.efficient:
            a, score, _ = self.data(parts, chosen)
            gain, unknown = self._held_and_open(a + self.prior_precision)
            return Law(gain @ (score + self.prior_score), gain, gain @ a, gain @ a @ gain, unknown)
        h = sum((r.information for r in chosen), np.zeros_like(self.prior_precision))
        c = sum((self.score_covariance(r, parts) for r in chosen), np.zeros_like(self.prior_precision))
        g = sum((r.score for r in chosen), np.zeros_like(self.prior_score))
        w = parts.weight
        gain, unknown = self._held_and_open(w * h + self.prior_precision)
        spread, pull = w * gain @ root(c), gain @ root(self.prior_precision)
        noise = spread @ spread.T  # products of roots: no variance comes out negative by rounding
        mean = gain @ (w * g + self.prior_score)
        return Law(mean, noise + pull @ pull.T, w * gain @ h, noise, unknown)

    def _held_and_open(self, precision: Array) -> tuple[Array, Array]:
        """Inverse of a precision in the directions it holds, and the covariance in those it leaves open: that
        of coefficients as likely anywhere within bounds of the usual width, there.

        The error of an estimate is nothing in a direction of which readings say nothing: they do not move it.
        Taken for what is known of it, N_v was told as -21 +- 0.8 % where the runs left it open altogether.
        """
        basis, values, flat = _directions(precision)
        gain = (basis / values) @ basis.T
        if not flat.shape[1]:
            return gain, np.zeros_like(gain)
        reach = WIDE / np.sqrt(3.0) * self.spread
        held = flat.T @ (flat / reach[:, None] ** 2)
        return gain, flat @ np.linalg.solve(held, flat.T)

    def without_each(self, parts: NoiseParts) -> Iterator[tuple[RunScore, Law, Array]]:
        """Every run of several, with the estimate that the others give and their `prior_kept`."""
        for run in self.runs if len(self.runs) > 1 else ():
            others = tuple(r for r in self.runs if r is not run)
            yield run, self.law(parts, others), self.prior_kept(parts, others)

    def prior_kept(self, parts: NoiseParts, runs: Iterable[RunScore] | None = None) -> Array:
        """(k, k) covariance where every reading has the weight its noise leaves it: never above the prior's,
        and nothing in directions that neither holds.

        `law` is the error of an estimate made with one power for all, which forgets what the prior knew.
        """
        return self._held_and_open(self.data(parts, runs)[0] + self.prior_precision)[0]

    def left_out_costs(self, parts: NoiseParts) -> Array:
        """(n,) cost of every run at the estimate the others give, over that at theta0.

        Half the sum of squared multi-step residuals, to second order: prediction error of left-out runs.
        """
        if parts.efficient:
            each = [self.weighed(run, parts)[:2] for run in self.runs]
        else:
            each = [(parts.weight * run.information, parts.weight * run.score) for run in self.runs]
        a = sum((one for one, _ in each), np.zeros_like(self.prior_precision))
        b = sum((one for _, one in each), np.zeros_like(self.prior_score))
        costs = []
        for run, (own, score) in zip(self.runs, each, strict=True):
            step = inverse(a - own + self.prior_precision) @ (b - score + self.prior_score)
            costs.append(0.5 * float(step @ run.information @ step) - float(step @ run.score))
        return np.array(costs)

    def log_evidence(self, parts: NoiseParts) -> float:
        """Log density of all scores, parameters integrated out, up to a constant.

        Directions that neither readings nor prior hold have no density and are left out, whatever the parts.
        """
        precision, score, log = self.data(parts)
        basis, sizes = self.held
        inner = basis.T @ (precision + self.prior_precision) @ basis
        right = basis.T @ (score + self.prior_score)
        _, logdet = np.linalg.slogdet(inner)
        stated = np.diag(self.prior_precision) > 0  # a flat prior has no norm and adds none
        prior = self.prior_precision[np.ix_(stated, stated)]
        unit = np.sqrt(np.diag(prior))
        norm = 0.5 * float(np.linalg.slogdet(prior / np.outer(unit, unit))[1]) + float(np.log(unit).sum())
        explained = 0.5 * float(right @ np.linalg.solve(inner, right)) if right.size else 0.0
        return log + explained - 0.5 * float(logdet) - float(np.log(sizes).sum()) + norm

    @cached_property
    def held(self) -> tuple[Array, Array]:
        """(k, m) directions that readings or prior hold, parameters in units of their size; the sizes."""
        whole = sum((r.information for r in self.runs), np.zeros_like(self.prior_precision))
        whole = whole + self.prior_precision
        size = np.sqrt(np.maximum(np.diag(whole), 0.0))
        unit = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        values, vectors = np.linalg.eigh(whole * np.outer(unit, unit))
        kept = values > OPEN * max(float(values[-1]), 1e-300)
        basis = unit[:, None] * vectors[:, kept]
        return basis, size[size > 0]


def root(matrix: Array) -> Array:
    """R with R R^T = a symmetric positive matrix whose units differ; negative by rounding counts as 0."""
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def _directions(matrix: Array) -> tuple[Array, Array, Array]:
    """Directions (k, m) a symmetric positive matrix holds, what it holds them with (m,), and those (k, n) it
    leaves open."""
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > OPEN * max(float(values[-1]), 1e-300)
    scaled = vectors / size[:, None]
    return scaled[:, kept], values[kept], scaled[:, ~kept]


def inverse(matrix: Array) -> Array:
    """Inverse of a symmetric positive matrix whose units differ; flat directions get that of rounding."""
    held, values, flat = _directions(matrix)
    least = OPEN * max(float(values[-1]), 1e-300) if values.size else 1e-300
    return (held / values) @ held.T + flat @ flat.T / least


def run_scores(
    infos: Sequence[RunInformation], noise: MixedRateNoise, groups: Sequence[str]
) -> tuple[RunScore, ...]:
    """Scores of runs whose pieces belong together; `groups` names the run of every piece.

    Without memory the covariance of a score is its information, whatever the residuals are.
    """
    found: dict[str, RunScore] = {}
    for info, group in zip(infos, groups, strict=True):
        h = info.information
        b = h if noise.order == 0 else noise.of_score(info.columns, info.valid) + info.start.T @ info.start
        one = RunScore(group, h, b, info.score)
        found[group] = found[group].joined(one) if group in found else one
    return tuple(found.values())
