"""A bank of localised distortions with one global p-value: does the simulator, as it is, explain the trial?

After Anau Montel, Alvey and Weniger (2025), "Tests for model misspecification in simulation-based inference:
from local distortions to global model checks", Phys. Rev. D 111, 083013. The null hypothesis is the simulator
with the prior of its coefficients. Every distortion of the bank is an alternative: the simulator with a pulse
in one reading or one force over one window (whole runs down to sixteenths), or with one cause of the
catalogue. Its local statistic t is twice the gain in log likelihood with the amplitude free, the coefficients
integrated over their prior: a matched filter. The global p-value comes from the smallest local p-value and
from the sum of all t, both calibrated by data simulated under the null hypothesis.

Beyond the published test, which names nothing: where the global p-value rejects, causes of the catalogue and
pulses share the rest of the probability by their likelihood ratios with amplitudes drawn from a prior, so
that the method can name as well as detect. Simulated data are linear about the fit, as the statistics are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from bayesid.benchmark.general_methods.common import (
    PRIOR_CATALOGUE,
    PRIOR_NONE,
    PRIOR_OUTSIDE,
    SET_PROBABILITY,
    Base,
    answer,
    base_of,
    one_family,
)
from bayesid.diagnosis.data.problem import sizes_tried
from bayesid.diagnosis.hypotheses.probabilities import credible_set
from bayesid.diagnosis.hypotheses.sensitivity_bank import levels_between, secants
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.linearise import Linearisation, forces, linearise
from bayesid.estimation.filter_error.noise_model import force_unit
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import effect_prior
from bayesid.trials import Trial

Array = np.ndarray
SIGNIFICANCE = 0.02  # of the global p-value: the false-alarm bar of every score sheet
NULL_DRAWS, CHUNK = 4000, 500
WINDOWS = (1, 2, 4, 8, 16)  # equal parts of a run
LEAST_SAMPLES = 3  # in a window
# Signal-to-noise ratios a pulse may have, as prior deviations of its amplitude.
SIGNALS = (1.0, 3.0, 10.0, 30.0, 100.0)
LEAST_VISIBLE = 1e-6  # share of a distortion that coefficients must leave for it to be asked


@dataclass(frozen=True, eq=False)
class Bank:
    """Whitened products of coefficients and distortions in one environment, run by run.

    Attributes
    ----------
    products : run -> (k, k) products of its columns: coefficients, causes, pulses of this run
    scores : run -> (k,) products with the residual, coefficients at their prior mean
    n_coef, n_shared : coefficients, and those with the columns of causes, which all runs share
    causes : (name, positions among the shared columns) of every cause, and of every secant of one
    places : run -> (place, first sample, sample after the last) of its pulses
    evidence : log evidence of the null hypothesis
    """

    products: tuple[Array, ...]
    scores: tuple[Array, ...]
    n_coef: int
    n_shared: int
    causes: tuple[tuple[str, Array], ...]
    places: tuple[tuple[tuple[str, int, int], ...], ...]
    evidence: float = 0.0


@dataclass(frozen=True, eq=False)
class Tested:
    """Local and global results.

    Attributes
    ----------
    t, log_p : local statistics and log p-values: causes, then pulses run by run
    p_smallest, p_sum, p_global : calibrated by null data; the last is that of the smaller of the two
    """

    t: Array
    log_p: Array
    p_smallest: float
    p_sum: float
    p_global: float


def distortion_verdict(trial: Trial, model: Model, seed: int = 0) -> dict[str, Any]:
    """Verdict of the test on a trial.

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    base = base_of(trial, model)
    banks = banks_of(base)
    bank = banks[0]
    found = global_test(bank, seed)
    none = probability_of_none(found.p_global)
    gains = gains_of(banks)
    each = math.log(PRIOR_CATALOGUE / max(len(gains) - 1, 1))
    weights = {n: g + (math.log(PRIOR_OUTSIDE) if n == "outside" else each) for n, g in gains.items()}
    total = float(logsumexp(list(weights.values())))
    rest = {n: math.exp(w - total) for n, w in weights.items()}
    probabilities = {"none": none} | {n: (1.0 - none) * p for n, p in rest.items()}
    flat = [place for run in bank.places for place in run]
    pulses = found.log_p[len(bank.causes) :]
    top = flat[int(np.argmin(pulses))] if pulses.size else None
    said = {
        "name": "distortions", "p_global": found.p_global, "p_smallest": found.p_smallest,
        "p_sum": found.p_sum, "distortions": int(found.t.size), "null_draws": NULL_DRAWS,
        "largest_pulse": None if top is None else {"place": top[0], "first": top[1], "last": top[2]},
    }  # fmt: skip
    channel = None if top is None or found.p_global >= SIGNIFICANCE else top[0]
    if found.p_global >= SIGNIFICANCE:
        return answer(trial, "none", probabilities, said)
    left = credible_set(rest, SET_PROBABILITY)
    if left == ("outside",):
        return answer(trial, "outside", probabilities, said, channel=channel)
    if "outside" not in left and one_family(left):
        return answer(trial, "effect", probabilities, said, named=left[:1], channel=channel)
    return answer(trial, "ambiguous", probabilities, said, channel=channel)


def probability_of_none(p: float) -> float:
    """Least probability of the null hypothesis a p-value leaves it (Sellke, Bayarri and Berger 2001)."""
    factor = -math.e * p * math.log(p) if 0.0 < p < 1.0 / math.e else 1.0
    return factor * PRIOR_NONE / (factor * PRIOR_NONE + 1.0 - PRIOR_NONE)


def banks_of(base: Base) -> list[Bank]:
    """All distortions along the points of a base: in the environment as it is, then in louder ones.

    Where coefficients alone do not follow the readings, slopes hold only as far as a free force takes the
    rest, so that the louder environments count for the naming of causes (and for nothing else).
    """
    problem, model = base.problem, base.problem.model
    levels = levels_between(problem, base.level)
    free = problem.coefficients
    n_coef = len(free.names)
    causes: list[tuple[str, Array]] = []
    for effect in (e for e in base.effects if e.smooth):
        more = effect_prior(model, effect)
        causes.append((effect.name, np.arange(len(free.names), len(free.names) + len(more.names))))
        free = free + more
    kinked = [e for e in base.effects if not e.smooth]
    first = len(free.names)
    for effect in kinked:
        for _ in sizes_tried(problem, effect):
            causes.append((effect.name, np.array([first])))
            first += 1
    by_run: list[list[NormalEquations]] = []
    places = []
    for k, (log, point) in enumerate(zip(problem.logs, base.points, strict=True)):
        path = linearise(model, log, point, free.where)
        direct, drive, where = pulses(model, path)
        if kinked:
            more_direct, more_drive = secants(problem, path, kinked)
            direct = np.concatenate([more_direct, direct], axis=2)
            drive = np.concatenate([more_drive, drive], axis=2)
        by_run.append([run_equations(model, path, free, n, run=k, extra=(direct, drive)) for n in levels])
        places.append(where)
        del path, direct, drive
    out = []
    for equations in zip(*by_run, strict=True):
        alone = [e.pick(np.arange(n_coef)) for e in equations]
        evidence = posterior(sum(alone[1:], alone[0])).log_evidence
        out.append(Bank(tuple(e.ss for e in equations), tuple(e.se for e in equations), n_coef, first,
                        tuple(causes), tuple(places), evidence))  # fmt: skip
    return out


def pulses(model: Model, path: Linearisation) -> tuple[Array, Array, tuple[tuple[str, int, int], ...]]:
    """Pulses in every measured channel and every force over every window of a run, as direct and drive.

    Parameters
    ----------
    path : the run, linearised

    Returns
    -------
    direct (n, q, k), drive (n-1, nx, k), and (place, first sample, sample after the last) of each
    """
    log = path.log
    n, q = path.resid.shape
    nx = path.defect.shape[1]
    axes = forces(model)
    size = dict(zip(axes, force_unit(model), strict=True))
    windows = [
        (a, b)
        for parts in WINDOWS
        for a, b in zip(cuts(n, parts)[:-1], cuts(n, parts)[1:], strict=True)
        if b - a >= LEAST_SAMPLES
    ]
    places: list[tuple[str, int, int]] = []
    count = len(windows) * (q + len(axes))
    direct, drive = np.zeros((n, q, count)), np.zeros((n - 1, nx, count))
    for a, b in windows:
        for j, channel in enumerate(log.channels):
            direct[a:b, j, len(places)] = np.where(log.valid[a:b, j], log.sigma[j], 0.0)
            places.append((channel, a, b))
        for j, name in enumerate(axes):
            end = min(b, n - 1)
            drive[a:end, :, len(places)] = path.gamma[a:end, :, j] * size[name]
            places.append((name.removeprefix("force_"), a, b))
    return direct, drive, tuple(places)


def cuts(n: int, parts: int) -> list[int]:
    """Borders of nearly equal parts of n samples."""
    return [round(n * i / parts) for i in range(parts + 1)]


class Projection:
    """What distortions show of themselves once the coefficients have taken their part."""

    def __init__(self, bank: Bank) -> None:
        c, s = self.n_coef, self.n_shared = bank.n_coef, bank.n_shared
        shared = np.sum([p[:s, :s] for p in bank.products], axis=0)
        inverse = np.linalg.inv(np.eye(c) + shared[:c, :c])
        self.taken = [p[s:, :c] @ inverse for p in bank.products]
        self.taken_shared = shared[c:, :c] @ inverse
        self.causes = [(name, at - c) for name, at in bank.causes]
        self.information = shared[c:, c:] - self.taken_shared @ shared[:c, c:]
        self.roots = [self._root(at, float(np.diag(shared)[c + at].sum())) for _, at in self.causes]
        self.variance = [np.diag(p)[s:] - np.einsum("ij,ij->i", t, p[s:, :c])
                         for p, t in zip(bank.products, self.taken, strict=True)]  # fmt: skip
        self.seen = [v > LEAST_VISIBLE * np.diag(p)[s:]
                     for v, p in zip(self.variance, bank.products, strict=True)]  # fmt: skip
        one = [np.asarray(ok, dtype=float) for ok in self.seen]
        self.freedom = np.concatenate([np.array([float(r.shape[1]) for r in self.roots]), *one])

    def _root(self, at: Array, whole: float) -> Array:
        """(k, m) directions of a cause that show, each over its deviation."""
        value, vector = np.linalg.eigh(self.information[np.ix_(at, at)])
        keep = value > LEAST_VISIBLE * max(whole, np.finfo(float).tiny)
        return np.asarray(vector[:, keep] / np.sqrt(value[keep]))

    def left(self, scores: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Scores of causes (draws, k), and of pulses run by run, from those of all columns (draws, columns)
        per run."""
        c, s = self.n_coef, self.n_shared
        together = np.sum([x[:, :s] for x in scores], axis=0)
        own = together[:, c:] - together[:, :c] @ self.taken_shared.T
        return own, [x[:, s:] - together[:, :c] @ t.T for x, t in zip(scores, self.taken, strict=True)]

    def statistics(self, scores: Sequence[Array]) -> Array:
        """(draws, distortions) local statistics: causes, then pulses run by run."""
        own, local = self.left(scores)
        out = [
            ((own[:, at] @ r) ** 2).sum(axis=1)[:, None]
            for (_, at), r in zip(self.causes, self.roots, strict=True)
        ]
        for x, v, ok in zip(local, self.variance, self.seen, strict=True):
            out.append(np.where(ok, x**2 / np.where(ok, v, 1.0), 0.0))
        return np.concatenate(out, axis=1)

    def log_p(self, t: Array) -> Array:
        """Local log p-values; 0 of what does not show."""
        return np.where(self.freedom > 0, chi2.logsf(t, np.maximum(self.freedom, 1.0)), 0.0)


def global_test(bank: Bank, seed: int = 0) -> Tested:
    """Local statistics, and their global p-value from data simulated under the null hypothesis."""
    seen = Projection(bank)
    t = seen.statistics([x[None] for x in bank.scores])[0]
    log_p = seen.log_p(t)
    smallest, total = [], []
    rng = np.random.default_rng(seed)
    roots = [root_of(p) for p in bank.products]
    for _ in range(NULL_DRAWS // CHUNK):
        z = rng.standard_normal((CHUNK, bank.n_coef))
        null = seen.statistics([
            rng.standard_normal((CHUNK, r.shape[1])) @ r.T + z @ p[: bank.n_coef]
            for r, p in zip(roots, bank.products, strict=True)
        ])  # fmt: skip
        smallest.append(seen.log_p(null).min(axis=1))
        total.append(-null.sum(axis=1))
    low, sums = np.concatenate(smallest), np.concatenate(total)
    p_smallest, p_sum = p_value(low, float(log_p.min())), p_value(sums, -float(t.sum()))
    both = np.minimum(ranks(low), ranks(sums))
    return Tested(t, log_p, p_smallest, p_sum, p_value(both, min(p_smallest, p_sum)))


def gains_of(banks: Sequence[Bank]) -> dict[str, float]:
    """Cause -> log likelihood ratio over the null hypothesis with its amplitude drawn from its prior, and
    "outside" -> that of a pulse, averaged over all; each in the environment in which it is largest."""
    null = max(bank.evidence for bank in banks)
    out: dict[str, float] = {}
    for bank in banks:
        seen = Projection(bank)
        own, local = seen.left([x[None] for x in bank.scores])
        offset = bank.evidence - null
        for name, at in seen.causes:
            gain = offset + drawn_gain(seen.information[np.ix_(at, at)], own[0, at])
            out[name] = max(gain, out.get(name, -np.inf))
        t = np.concatenate(
            [x[0][ok] ** 2 / v[ok] for x, v, ok in zip(local, seen.variance, seen.seen, strict=True)]
        )
        spread = np.array(SIGNALS)[:, None] ** 2
        pulse = 0.5 * t * spread / (1.0 + spread) - 0.5 * np.log1p(spread)
        gain = offset + float(logsumexp(pulse) - math.log(pulse.size)) if pulse.size else -np.inf
        out["outside"] = max(gain, out.get("outside", -np.inf))
    return out


def root_of(products: Array) -> Array:
    """(k, k) R with R R' the matrix of products, which may be singular."""
    value, vector = np.linalg.eigh(products)
    return vector * np.sqrt(np.maximum(value, 0.0))


def drawn_gain(information: Array, score: Array) -> float:
    """Log likelihood ratio of a cause whose parameters are unit normal."""
    wide = np.eye(score.size) + information
    return 0.5 * float(score @ np.linalg.solve(wide, score)) - 0.5 * float(np.linalg.slogdet(wide)[1])


def ranks(values: Array) -> Array:
    """Share of null draws at or below each: its p-value among the others."""
    ordered = np.sort(values)
    return np.searchsorted(ordered, values, side="right") / values.size


def p_value(null: Array, found: float) -> float:
    """Share of null draws at or below what was found, the finding counted as one of them."""
    return float((np.count_nonzero(null <= found) + 1) / (null.size + 1))
