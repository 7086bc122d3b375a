"""The diagnosed model as something to predict with: hypotheses, parameters with covariance, disturbance.

Takes a `Diagnosis`. Gives a frozen `DiagnosedModel`. Does not simulate, write or read (`diagnosed_file`).

A verdict that names effects leaves one hypothesis, a model form the one without effects. Any other leaves a
mixture, weighed as the verdict weighed it, so that a prediction is as unsure of the cause. What no hypothesis
explains is not forgotten: each is given the disturbance its own residuals call for, and is fitted again
under it.

A vehicle has one cause and one set of coefficients. What is new whenever it runs, a deviation of its
coefficients and the size of the disturbance, is drawn apart from it, so that it can be followed through runs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp

from bayesid.diagnosis.coefficient_estimate import CoefficientEstimate, estimate_of
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.explained_model import as_stated
from bayesid.diagnosis.evidences import shares_of_wide
from bayesid.diagnosis.failed_checks import failures, needs_none
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR, RefittedHypothesis
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY
from bayesid.diagnosis.hypotheses.verdict import NAMING, Verdict, simplest
from bayesid.diagnosis.threshold_table import PRIOR_CATALOGUE, PRIOR_NONE
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NOT_LINEARISABLE, posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit, stacked_equations
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.truncated_normal import FLAT, about_each, within_bounds

if TYPE_CHECKING:
    from bayesid.diagnosis.run import Diagnosis

Array = np.ndarray
# Weight below which a hypothesis is left out of a prediction.
LEAST_WEIGHT = 0.01
# Refitted explanations weighed in a prediction, the best ones.
MOST_HYPOTHESES = 6
# Latent force over 1/2 rho L^2 U^2 tried as what a hypothesis leaves unexplained, its times in L/U, and the
# evidence [nats] from which it is believed.
REMAINDER_FORCES, REMAINDER_TAUS, REMAINDER_EVIDENCE = 10.0 ** np.arange(-5.0, -1.2, 0.5), (2.0, 8.0), 5.0
REMAINDER_SHARES = (0.1, 0.3, 1.0, 3.0)
# Probability below which an explanation that is not drawn is not kept.
LEAST_TOLD = 1e-4


@dataclass(frozen=True, eq=False)
class WeightedHypothesis:
    """One explanation, ready to draw from.

    Attributes
    ----------
    effects : names, empty for none
    weight : share of the draws
    names, mean, covariance, low, high : free parameters of the vehicle [SI], their Gaussian, and the bounds
        it is cut at
    noise_model : disturbance force and slow position error that go with it
    run_sd : (k,) sd of the parameters of single runs about those of the vehicle [SI], which `covariance` does
        not hold; zeros by default
    """

    effects: tuple[str, ...]
    weight: float
    names: tuple[str, ...]
    mean: Array
    covariance: Array
    low: Array
    high: Array
    noise_model: NoiseModel
    run_sd: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.run_sd is None:
            object.__setattr__(self, "run_sd", np.zeros(len(self.names)))

    @property
    def covariance_in_a_run(self) -> Array:
        """(k, k) covariance of the parameters of a vehicle in a run [SI]."""
        return self.covariance + np.diag(self.run_sd**2)

    @property
    def sd_in_a_run(self) -> Array:
        """(k,) their sd [SI]."""
        return np.sqrt(np.diag(self.covariance_in_a_run))

    def differs_in_noise_alone(self, other: WeightedHypothesis) -> bool:
        """Whether both have the same effects and parameters."""
        arrays = ("mean", "covariance", "low", "high", "run_sd")
        same = self.effects == other.effects and self.names == other.names
        return same and all(np.array_equal(getattr(self, a), getattr(other, a)) for a in arrays)


@dataclass(frozen=True, eq=False)
class DrawnVehicles:
    """Vehicles drawn from a diagnosed model, as they are in one run or on average over runs.

    Attributes
    ----------
    which : (m,) position of the hypothesis each is drawn from
    pars : (m, n_par) parameters [SI]
    """

    which: Array
    pars: Array


@dataclass(frozen=True, eq=False)
class DiagnosedModel:
    """A diagnosed model.

    Attributes
    ----------
    model : Model, nominal
    hypotheses : weights add up to 1
    noise : channel -> white sensor noise, one standard deviation [SI]
    verdict : word of the verdict it came from
    trial : digest of the trial
    failed_checks : sentences on the checks that the fit or the diagnosis failed
    left_out : names that act together -> probability the diagnosis gives what no draw has, most probable
        first; None where it is not known
    estimates : re-tuned coefficients under each explanation, also where hypotheses keep those of the file
    """

    model: Model
    hypotheses: tuple[WeightedHypothesis, ...]
    noise: Mapping[str, float]
    verdict: str
    trial: str
    failed_checks: tuple[str, ...] = ()
    left_out: Mapping[tuple[str, ...], float] | None = None
    estimates: tuple[CoefficientEstimate, ...] = ()

    @property
    def coefficients_as_given(self) -> bool:
        """Whether every explanation has coefficients, and has them as the vehicle file gives them."""
        known = set(self.model.coefficients)
        for h in self.hypotheses:
            at = [i for i, name in enumerate(h.names) if name in known]
            given = self.model.nominal[self.model.positions([h.names[i] for i in at])]
            if not at or not np.allclose(h.mean[at], given, rtol=1e-9, atol=0.0):
                return False
        return self.verdict != "fit"

    def draw(self, rng: np.random.Generator, count: int) -> list[tuple[WeightedHypothesis, Array]]:
        """Parameter vectors in a run of every hypothesis: (draws, n_par) each, `count` in all."""
        drawn = self.in_a_run(rng, count)
        each = [(h, drawn.pars[drawn.which == i]) for i, h in enumerate(self.hypotheses)]
        return [(h, pars) for h, pars in each if len(pars)]

    def in_a_run(self, rng: np.random.Generator, count: int) -> DrawnVehicles:
        """Vehicles as they are in one run, those of one hypothesis after those of another."""
        counts = rng.multinomial(count, [h.weight for h in self.hypotheses])
        which = np.repeat(np.arange(counts.size), counts)
        pars = np.repeat(self.model.nominal[None], count, axis=0)
        for at, h in self._each(which):
            both = h.covariance_in_a_run
            drawn = h.mean + _gaussian(both, at[0].size, rng)
            pars[at] = within_bounds(drawn, h.mean, both, h.low, h.high, rng)
        return DrawnVehicles(which, pars)

    def vehicles(self, seen: DrawnVehicles, rng: np.random.Generator) -> DrawnVehicles:
        """Vehicles of which `seen` is one run: theirs less a deviation of that run, given the sum of both."""
        pars = np.array(seen.pars)
        for at, h in self._each(seen.which):
            if not h.run_sd.any():
                continue
            unit = np.where(h.sd_in_a_run > 0, h.sd_in_a_run, 1.0)
            own = np.diag((h.run_sd / unit) ** 2)
            gain = own @ np.linalg.pinv(h.covariance_in_a_run / np.outer(unit, unit), FLAT, hermitian=True)
            left = own - gain @ own
            open_ones = np.diag(left) > FLAT * np.diag(own)  # of a known vehicle rounding alone is left
            left = np.where(np.outer(open_ones, open_ones), left, 0.0) * np.outer(unit, unit)
            mean = pars[at] - unit * (((pars[at] - h.mean) / unit) @ gain.T)
            pars[at] = within_bounds(mean + _gaussian(left, len(mean), rng), mean, left, h.low, h.high, rng)
        return DrawnVehicles(np.array(seen.which), pars)

    def in_another_run(self, vehicles: DrawnVehicles, rng: np.random.Generator) -> DrawnVehicles:
        """The same vehicles in another run: their parameters deviate anew, within the bounds.

        Hypotheses that differ in the noise model alone, which is that of the run, are drawn again by weight.
        """
        which, pars = np.array(vehicles.which), np.array(vehicles.pars)
        for some in self._alike():
            theirs = np.flatnonzero(np.isin(which, some))
            weights = np.array([self.hypotheses[i].weight for i in some])
            which[theirs] = rng.choice(some, theirs.size, p=weights / weights.sum())
        for at, h in self._each(which):
            pars[at] = about_each(pars[at], h.run_sd, h.low, h.high, rng)
        return DrawnVehicles(which, pars)

    def _each(self, which: Array) -> Iterator[tuple[tuple[Array, ...], WeightedHypothesis]]:
        """Rows and columns of the free parameters of every hypothesis."""
        for i, h in enumerate(self.hypotheses):
            yield np.ix_(np.flatnonzero(which == i), self.model.positions(h.names)), h

    def _alike(self) -> list[list[int]]:
        """Positions of hypotheses that differ in the noise model alone, where there are several."""
        out: list[list[int]] = []
        for i, h in enumerate(self.hypotheses):
            same = [some for some in out if h.differs_in_noise_alone(self.hypotheses[some[0]])]
            same[0].append(i) if same else out.append([i])
        return [some for some in out if len(some) > 1]


def _gaussian(covariance: Array, count: int, rng: np.random.Generator) -> Array:
    """(count, k) draws about zero."""
    sd = np.sqrt(np.diag(covariance))
    unit = np.where(sd > 0, sd, 1.0)  # a known coefficient has none
    # in units of the deviations: NumPy judges a covariance by an absolute tolerance
    scaled = covariance / np.outer(unit, unit)
    return np.asarray(unit * rng.multivariate_normal(np.zeros(sd.size), scaled, size=count, method="eigh"))


def diagnosed_model(
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    verdict: Verdict,
    trial: str,
    retuned: bool = True,
    without_effects: bool = False,
) -> DiagnosedModel:
    """The diagnosed model behind a verdict.

    Parameters
    ----------
    trial : digest of what was diagnosed
    retuned : whether coefficients are re-tuned; else they are as stated, as well known as stated
    without_effects : whether no effect is in it, because the simulator predicts no worse without any

    Raises
    ------
    ModelError
        if no hypothesis has a finite log evidence along its path
    """
    chosen = [candidates.none] if without_effects else _chosen(candidates, verdict)
    each = PRIOR_CATALOGUE / (len(problem.model.causes) + 1)
    fits, evidences, tuned = [], [], []
    for c in chosen:
        fitted, evidence = _with_remainder(problem, c.fit)
        tuned.append(fitted)
        if not retuned and (stated := as_stated(problem, c)) is not None:
            fitted, _ = _with_remainder(problem, stated)
        fits.append(fitted)
        evidences.append(evidence)
    weights = _log_weights(candidates, chosen, evidences, each, problem.coefficients.names)
    if not np.isfinite(weights.max()):
        raise ModelError(NOT_LINEARISABLE)
    share = np.exp(weights - weights.max())
    share = np.where(share >= LEAST_WEIGHT * share.sum(), share, 0.0)
    share /= share.sum()
    hypotheses = tuple(
        _hypothesis(c.effects, float(w), f, problem.stated)
        for c, w, f in zip(chosen, share, fits, strict=True)
        if w > 0
    )
    drawn = [c for c, w in zip(chosen, share, strict=True) if w > 0]
    estimates = tuple(
        estimate_of(c.effects, float(w), f, problem.stated.names)
        for c, w, f in zip(chosen, share, tuned, strict=True)
        if w > 0
    )
    return DiagnosedModel(
        problem.model,
        hypotheses,
        _noise(problem),
        verdict.word,
        trial,
        left_out=_left_out(candidates, drawn),
        estimates=estimates,
    )


def _key(c: RefittedHypothesis) -> tuple[str, ...]:
    """The set of names under which the comparison holds the probability of a refit."""
    return (COEFFICIENT_ERROR,) if c.widens else tuple(sorted(c.effects)) or ("none",)


def _left_out(
    candidates: HypothesisComparison, drawn: Iterable[RefittedHypothesis]
) -> dict[tuple[str, ...], float]:
    """Probability of every explanation that is not among the drawn ones, most probable first."""
    kept = {_key(c) for c in drawn}
    rest = [(n, p) for n, p in candidates.sets.items() if n not in kept and p >= LEAST_TOLD]
    return dict(sorted(rest, key=lambda item: -item[1]))


def diagnosed_model_of(d: Diagnosis) -> DiagnosedModel:
    """The diagnosed model of a diagnosis, with the checks it failed: the one it holds, else made now.

    Its noise is that of single readings: a prediction begins on them and is judged by them.
    """
    told = d.result.retuning
    found = d.diagnosed or diagnosed_model(
        d.problem, d.candidates, d.verdict, d.trial.digest, told is None or told.kept,
        told is not None and (told.as_given or told.alone),
    )  # fmt: skip
    noise = d.trial.of_single_readings(found.noise)
    return replace(found, failed_checks=failures(d.result), noise=noise)


def fitted_model(
    problem: DiagnosisProblem, effects: tuple[str, ...], fitted: FilterErrorFit, trial: str = ""
) -> DiagnosedModel:
    """The model of one fit, chosen by hand; its residuals' disturbance included."""
    again, _ = _with_remainder(problem, fitted)
    return DiagnosedModel(
        problem.model, (_hypothesis(effects, 1.0, again, problem.stated),), _noise(problem), "fit", trial
    )


def _noise(problem: DiagnosisProblem) -> dict[str, float]:
    return {c: float(s) for log in problem.logs for c, s in zip(log.channels, log.sigma, strict=True)}


def _chosen(c: HypothesisComparison, verdict: Verdict) -> list[RefittedHypothesis]:
    """The explanations a prediction weighs: the best few that hold every effect the verdict names.

    Where it names none, those of no effect, of one and of several compete; leaving out those of several made
    a track that needs three effects be predicted by one of them. A model form, or a force with the place or a
    period that explains more, needs none: effects that gain beside it may stand for what it leaves, and
    predict other manoeuvres worse than its answer shows.
    """
    if verdict.word != "none" and needs_none(verdict.word, verdict.rule, verdict.set95):
        return [c.none]
    named = set(verdict.effects) if verdict.word in NAMING else set()
    able = [r for r in c.refits if named <= set(r.effects)]
    best = sorted(able, key=lambda r: r.log_evidence, reverse=True)[:MOST_HYPOTHESES]
    exact = [r for r in able if named and set(r.effects) == named and r not in best]
    return [*best, *exact] if named and able else [simplest(c)] if named else [c.none, *best]


def _log_weights(
    candidates: HypothesisComparison,
    chosen: Sequence[RefittedHypothesis],
    evidence: Sequence[float],
    each: float,
    coefficients: Collection[str],
) -> Array:
    """Logarithm of what each explanation weighs, up to a constant; beside a form, where evidence between
    causes is worth less than it says, its probability, which refits of one name share by evidence.

    Parameters
    ----------
    evidence : log evidence of each fit under the disturbance its residuals call for
    each : prior of one effect
    coefficients : those each of which may as well be the one that is off
    """
    own = np.array([e + c.log_evidence - c.fit.log_evidence for e, c in zip(evidence, chosen, strict=True)])
    if candidates.error.leaves > 0.0:
        keys = [_key(c) for c in chosen]
        told = np.array([candidates.sets.get(key, 0.0) for key in keys])
        if np.any(told > 0.0):
            alike = [logsumexp([o for o, k in zip(own, keys, strict=True) if k == key]) for key in keys]
            with np.errstate(divide="ignore"):
                return np.log(told) + own - np.array(alike)
    wide = shares_of_wide({*coefficients, *EVERY})
    prior = [
        PRIOR_NONE
        if not c.effects
        else each * wide[c.effects[0].partition(":")[2]]
        if c.widens
        else each ** len(c.effects)
        for c in chosen
    ]
    return own + np.log(prior)


def _hypothesis(
    effects: tuple[str, ...], weight: float, f: FilterErrorFit, stated: GaussianPrior
) -> WeightedHypothesis:
    """What a fit says; coefficients it does not free are known as well as stated."""
    covariance = f.posterior.covariance * np.outer(f.free.sd, f.free.sd)
    free, values = f.free, f.values
    if not set(stated.names) & set(free.names):
        free, values = stated + free, np.concatenate([stated.mean, values])
        covariance = block_diag(np.diag(stated.sd**2), covariance)
    return WeightedHypothesis(
        effects, weight, free.names, values, covariance, free.low, free.high, f.noise_model
    )


def _with_remainder(problem: DiagnosisProblem, fitted: FilterErrorFit) -> tuple[FilterErrorFit, float]:
    """The fit under the disturbance its residuals call for, and its log evidence."""
    model = problem.model
    unit, time = force_unit(model), model.scales["L"] / model.scales["U"]
    real, paths = problem.environment.noise_model, fitted.paths

    def evidence(noise_model: NoiseModel) -> float:
        equations = stacked_equations(model, paths, fitted.free, noise_model)
        try:
            value = posterior(sum(equations[1:], equations[0])).log_evidence
        except ModelError:  # this disturbance is out of reach, others may not be
            return -np.inf
        return value if np.isfinite(value) else -np.inf

    def added(level: Array, tau: float) -> NoiseModel:
        force = np.sqrt(np.array(real.force) ** 2 + (level * unit) ** 2)
        return replace(real, force=tuple(float(f) for f in force), force_tau=tau)

    best, noise_model, level, tau = evidence(real), real, np.zeros(unit.size), real.force_tau
    start = best
    for trial in (added(np.full(unit.size, x), t * time) for x in REMAINDER_FORCES for t in REMAINDER_TAUS):
        value = evidence(trial)
        if value > best:
            best, noise_model = value, trial
    if best < start + REMAINDER_EVIDENCE:
        return fitted, start
    tau = noise_model.force_tau
    level = np.sqrt(np.maximum(np.array(noise_model.force) ** 2 - np.array(real.force) ** 2, 0.0)) / unit
    for axis in range(unit.size):  # one level for all axes, then each axis on its own
        for share in REMAINDER_SHARES:
            tried = level.copy()
            tried[axis] *= share
            value = evidence(added(tried, tau))
            if value > best:
                best, noise_model, level = value, added(tried, tau), tried
    again = fit(
        model,
        problem.logs,
        fitted.free,
        noise_model,
        start=fitted.points,
        initial_noise_scale=0.0,
        iterations=8,
    )
    return again, max(best, again.log_evidence)
