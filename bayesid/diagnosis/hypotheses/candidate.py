"""One refitted hypothesis and the evidence it may claim.

Takes a `DiagnosisProblem` and filter-error fits. Gives frozen `RefittedHypothesis`s. Does not choose among
them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, log_ndtr, logsumexp, ndtri, stdtrit

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.size_scales import over_usual_size, sizes_of_effect
from bayesid.diagnosis.threshold_table import (
    FOLLOWS_DATA_CHI2,
    INTERVAL_TOLD,
    LEAST_NAMING_EVIDENCE,
    LEAST_RUNS,
    LINEARISATION_SCATTER,
    WALD_SLACK,
)
from bayesid.equations.layout import names_read
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import GaussianPosterior, NormalEquations, posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, stacked_equations, within_bounds
from bayesid.estimation.filter_error.noise_identification import MANOEUVRE_NOISE_SPREAD
from bayesid.estimation.filter_error.shared_linearisations import fresh
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.model.effects import Effect

COEFFICIENT_ERROR = "coefficient_error"
NO_LIMITS = (-np.inf, np.inf)
# Shifts of the logarithm of a measured environment that are averaged over.
NOISE_SCALE_SHIFTS = (-0.7, -0.35, 0.0, 0.35, 0.7, 1.05)

# Passes of Gauss-Newton along a path that stays: a third changed 15 of 17 gains of three trials by at most
# 0.02 nats, two that are far above what their refits gain by up to 1.6.
RELINEARISATIONS = 2


@dataclass(frozen=True, eq=False)
class RefittedHypothesis:
    """One refitted hypothesis.

    Attributes
    ----------
    effects : names, empty for none; "coefficient_error:N_r" for a widened coefficient
    log_evidence : Laplace, with ranges of parameters, repeatability of the environment and sizes smaller than
        usual (`repeatable_evidence`), or the less it may claim of that (`checked`)
    fit : FilterErrorFit
    """

    effects: tuple[str, ...]
    log_evidence: float
    fit: FilterErrorFit

    @property
    def widens(self) -> bool:
        """Whether it is a coefficient with a wide prior, not an effect."""
        return bool(self.effects) and self.effects[0].startswith(COEFFICIENT_ERROR)


def corrected_evidence(model: Model, fitted: FilterErrorFit) -> float:
    """Laplace evidence with the priors of effect parameters cut at the range in which it is that effect.

    The mass of the posterior inside the range over that of the prior, each parameter on its own.
    """
    return fitted.log_evidence + log_mass_in_range(model, fitted, fitted.posterior, _every(fitted))


def _every(fitted: FilterErrorFit) -> Array:
    return np.arange(len(fitted.free.where))


def log_mass_in_range(
    model: Model, fitted: FilterErrorFit, found: GaussianPosterior, columns: Array
) -> float:
    """Logarithm of what ranges leave of a posterior of some parameters, over the same of their prior."""
    out, free = 0.0, fitted.free
    # the optimum of the quadratic, beyond the bound where the data prefer the forbidden side
    for mean, sd, i in zip(found.mean, np.sqrt(np.diag(found.covariance)), columns, strict=True):
        limits = model.limits.get(int(free.where[i]), NO_LIMITS)
        low, high = ((x - free.mean[i]) / free.sd[i] for x in limits)
        if np.isfinite(low) or np.isfinite(high):
            out += _log_inside(low, high, mean, max(sd, 1e-12)) - _log_inside(low, high, 0.0, 1.0)
    return out


def _log_inside(low: float, high: float, mean: float, sd: float) -> float:
    """Logarithm of what a normal density holds between two limits."""
    a, b = (low - mean) / sd, (high - mean) / sd
    if a > 0:
        a, b = -b, -a  # the mirror image, where the logarithm of the distribution is exact
    upper, lower = log_ndtr(b), log_ndtr(a)
    return float(upper + np.log1p(-np.exp(min(lower - upper, -1e-15))))


def size_columns(model: Model, names: Sequence[str], effects: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Columns of the sizes of each effect among free parameters of these names."""
    out = []
    for effect in (model.effects[n] for n in effects if n in model.effects):
        keys = [effect.key(effect.parameters[i].name) for i in sizes_of_effect(effect)]
        out.append(tuple(names.index(k) for k in keys if k in names))
    return tuple(c for c in out if c)


def repeatable_evidence(
    problem: DiagnosisProblem, fitted: FilterErrorFit, effects: Sequence[str] = ()
) -> float:
    """Corrected log evidence where a measured environment may differ between runs by its own repeatability.

    Averaged over a log-normal factor on all amplitudes; as it is where the environment was stated. Effects
    are of any size (`size_scales`).
    """
    sizes = size_columns(problem.model, fitted.free.names, effects)
    total = sum(fitted.equations[1:], fitted.equations[0])
    alone = corrected_evidence(problem.model, fitted) + over_usual_size(total, sizes)
    if problem.environment.source == "stated" or not any(problem.environment.noise_model.force):
        return alone
    logs, paths = np.array(NOISE_SCALE_SHIFTS), fitted.paths
    weight = -0.5 * (logs / MANOEUVRE_NOISE_SPREAD) ** 2
    weight -= logsumexp(weight)
    values = []
    for shift in logs:
        equations = stacked_equations(
            problem.model,
            paths,
            fitted.free,
            problem.environment.noise_model.scaled(float(np.exp(shift))),
        )
        total = sum(equations[1:], equations[0])
        try:
            found = posterior(total)
        except ModelError:
            return alone
        # the ranges hold at every size of the environment: what a forbidden size gains in a calm is no gain
        inside = log_mass_in_range(problem.model, fitted, found, _every(fitted))
        values.append(found.log_evidence + inside + over_usual_size(total, sizes))
    return float(logsumexp(np.array(values) + weight))


def weighted_hypothesis(
    problem: DiagnosisProblem, effects: tuple[str, ...], fitted: FilterErrorFit
) -> RefittedHypothesis:
    """Candidate with its corrected evidence."""
    # some forty refits are kept to the end of a diagnosis; what they were linearised to is not
    return RefittedHypothesis(effects, repeatable_evidence(problem, fitted, effects), fitted.released())


def away_from_straight(
    problem: DiagnosisProblem, candidate: RefittedHypothesis, none: RefittedHypothesis
) -> RefittedHypothesis:
    """Candidate whose evidence for an input effect does not rest on straight runs.

    There a helmsman answers the disturbances: rudder and force are correlated, and a disturbance faster
    than the sampling looks like play or lag (play of 0.016 degrees at +25 nats on a clean campaign).
    """
    model = problem.model
    late = any(remembers(model.effects[n]) for n in candidate.effects if n in model.effects)
    straight = [log.straight for log in problem.logs]
    if not late or not any(straight) or all(straight):
        return candidate
    gains = []
    for c in (candidate, none):
        kept = [g for g, s in zip(c.fit.equations, straight, strict=True) if not s]
        total, sizes = sum(kept[1:], kept[0]), size_columns(model, c.fit.free.names, c.effects)
        try:
            gains.append(posterior(total).log_evidence + over_usual_size(total, sizes))
        except ModelError:  # its path left the region of one of the runs: it explains nothing
            return replace(candidate, log_evidence=-np.inf) if c is candidate else candidate
    limit = none.log_evidence + gains[0] - gains[1]
    return replace(candidate, log_evidence=min(candidate.log_evidence, float(limit)))


def remembers(effect: Effect) -> bool:
    """Whether an input effect answers with the past of the command: delay, lag, play or rate."""
    if effect.port != "input":
        return False
    return bool(effect.adjust) or any(stage.delay or "y" in names_read(stage.end) for stage in effect.stages)


def checked(
    problem: DiagnosisProblem,
    candidate: RefittedHypothesis,
    none: RefittedHypothesis,
    gains: Mapping[str, float],
) -> RefittedHypothesis:
    """Candidate whose evidence neither rests on straight runs nor exceeds what its parameters can gain.

    A refit that explains the data keeps its evidence, but a small gain must also be there along its own path
    (Savage-Dickey): the paths of two fits differ by chance. One that does not is held to its Wald limit; one
    that did not arrive and fits worse than no effect claims no more than its screen, `gains`.
    """
    c = away_from_straight(problem, candidate, none)
    lost = not none.fit.converged
    if c.widens or (lost and (problem.form is None or explains(c))):
        return c
    gain = c.log_evidence - none.log_evidence
    if explains(c):
        gain = gain if gain > LINEARISATION_SCATTER else min(gain, nested(problem, c))
        return replace(c, log_evidence=none.log_evidence + gain)
    limit = wald_limit(problem, c.fit)
    if lost:
        # beside a form that follows nothing either, only what an effect gains as itself counts
        return replace(c, log_evidence=min(c.log_evidence, none.log_evidence + limit))
    if not c.fit.converged and c.fit.chi2 > none.fit.chi2 and len(c.effects) == 1:
        limit = min(limit, gains.get(c.effects[0], limit))
    return replace(c, log_evidence=min(c.log_evidence, none.log_evidence + limit))


def nested(problem: DiagnosisProblem, candidate: RefittedHypothesis, keep: tuple[str, ...] = ()) -> float:
    """Log evidence of a refit over some of its effects, or none, along the refit's own path (Dickey 1971).

    Without the other effects the same path is linearised anew at the coefficients that take their place. At
    those of the refit a coefficient that an effect multiplies counts the more the larger the effect: a drag
    of 58 % more was worth 6.7 nats over coefficients there, and 13.9 as a fit without it tells.
    """
    fitted, effects = candidate.fit, problem.model.effects
    total = sum(fitted.equations[1:], fitted.equations[0])
    kept = {effects[n].key(p.name) for n in keep for p in effects[n].parameters}
    k = len(problem.coefficients.names)
    names, model = fitted.free.names, problem.model
    less = np.array([i for i, n in enumerate(names) if i < k or n in kept])
    fewer, without = _relinearised(fitted, less, total.pick(less))
    other_sizes = over_usual_size(total, size_columns(model, names, candidate.effects)) - over_usual_size(
        fewer, size_columns(model, [names[i] for i in less], keep)
    )
    return (
        corrected_evidence(model, fitted)
        - without.log_evidence
        - log_mass_in_range(model, fitted, without, less)
        + other_sizes
    )


def _relinearised(
    fitted: FilterErrorFit, less: Array, fewer: NormalEquations
) -> tuple[NormalEquations, GaussianPosterior]:
    """Equations and posterior of some of a fit's parameters, the others at their prior means, along its path;
    as they are at its own parameters where the path cannot be had at others.
    """
    free = fitted.free
    prior = GaussianPrior(
        tuple(free.names[i] for i in less), free.where[less], free.mean[less], free.sd[less], free.low[less],
        free.high[less],
    )  # fmt: skip
    found = posterior(fewer)
    for _ in range(RELINEARISATIONS):
        par = fitted.points[0].par.copy()
        par[free.where] = free.mean
        inside = within_bounds(fewer, found.mean, *prior.standard_bounds)
        par[prior.where] = prior.mean + prior.sd * inside
        points = [replace(point, par=par) for point in fitted.points]
        try:
            _, equations = fresh(fitted.model, fitted.logs, points, prior, fitted.noise_model)
            total = sum(equations[1:], equations[0])
            found, fewer = posterior(total), total
        except ModelError:
            break
    return fewer, found


def wald_limit(problem: DiagnosisProblem, fitted: FilterErrorFit) -> float:
    """Most that effect parameters can have gained: half their squared distance from zero in posterior sd.

    Parameters whose off value is not zero do not count. The place of a mass or weight does: a moment that
    shows is in the place alone, where the mass itself is hardly told. Evidence beyond this comes from refits
    of unlike quality, not from the effect. Where the equations lack a form, deviations are at least those
    from run to run: an effect that every run asks for in another size has gained nothing as itself.
    """
    k = len(problem.coefficients.names)
    model = problem.model
    where = [
        i
        for i in range(k, len(fitted.free.names))
        if model.effect_off.get(int(fitted.free.where[i]), 0.0) == 0.0
    ]
    if not where:
        return float("inf")
    z = (fitted.values - fitted.free.mean)[where] / fitted.free.sd[where]
    inside = fitted.posterior.covariance[np.ix_(where, where)]
    if problem.form is not None:
        times = np.maximum(jackknife(fitted)[where] / fitted.sd[where], 1.0)
        inside = inside * np.outer(times, times)
    return 0.5 * float(z @ np.linalg.solve(inside, z)) + WALD_SLACK


def explains(candidate: RefittedHypothesis) -> bool:
    """Whether a refit arrived and leaves residuals of about the size of the noise."""
    return candidate.fit.converged and candidate.fit.chi2 < FOLLOWS_DATA_CHI2


def standing(candidate: RefittedHypothesis, gain: float) -> tuple[bool, float]:
    """Rank of a candidate in forward selection.

    Refits that explain the data come first, by evidence. The others are ordered by the screen, which lets a
    free force take the rest, so that the first of two effects is not refused for the second's sake.
    """
    done = explains(candidate)
    return done, candidate.log_evidence if done else gain


def parameter_table(fitted: FilterErrorFit, problem: DiagnosisProblem) -> dict[str, tuple[float, float]]:
    """Effect parameters of a fit: name -> (value, sd) in SI.

    Where the equations lack a form, at least the sd by which single runs move them (jackknife): what a form
    leaves is the same in every reading of a run, not noise from one to the next. From few runs that sd is
    uncertain itself: it is widened until 1.96 of it hold the 95 % of Student's t.
    """
    between = from_run_to_run(fitted) if problem.form is not None else {}
    k = len(problem.coefficients.names)
    return {
        n: (float(v), max(float(s), between.get(n, 0.0)))
        for n, v, s in zip(fitted.free.names[k:], fitted.values[k:], fitted.sd[k:], strict=True)
    }


def from_run_to_run(fitted: FilterErrorFit) -> dict[str, float]:
    """Unknowns of a fit -> standard deviations [SI] by which single runs move them, widened for few runs."""
    sd = widened_by_few(len(fitted.equations)) * jackknife(fitted)
    return {n: float(s) for n, s in zip(fitted.free.names, sd, strict=True)}


def jackknife(fitted: FilterErrorFit) -> Array:
    """(k,) standard deviations [SI] of a fit's unknowns from run to run."""
    return spread_over_runs(fitted.equations, fitted.free.sd)


def widened_by_few(runs: int) -> float:
    """What a standard deviation estimated from a number of runs is short of: the 95 % point of Student's t
    with one degree of freedom less, over that of a normal (Tukey 1958). One or two runs tell none.
    """
    return float(stdtrit(max(runs - 1, 1), 0.975) / ndtri(0.975))


def spread_over_runs(equations: Sequence[NormalEquations], unit: Array) -> Array:
    """(k,) standard deviations [SI] from estimates without each run in turn (Efron 1982); 0 below three.

    Parameters
    ----------
    unit : (k,) prior standard deviations [SI], in which the equations are written
    """
    n = len(equations)
    if n < LEAST_RUNS:
        return np.zeros(unit.size)
    total = sum(equations[1:], equations[0])
    try:
        means = np.array([posterior(total - g).mean for g in equations])
    except ModelError:
        return np.zeros(unit.size)
    return np.asarray(np.sqrt((n - 1) ** 2 / n) * means.std(axis=0, ddof=1) * unit)


def idle(
    candidate: RefittedHypothesis,
    problem: DiagnosisProblem,
    table: Mapping[str, tuple[float, float]] | None = None,
    told: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[str, ...]:
    """Effects of a refit that explain nothing as themselves: sizes so near to off, by their own deviations,
    that they are worth less than a name asks for (half the sum of squares, each by itself; Wald 1943), sizes
    that would be told with an interval that holds no effect at all, or a parameter outside the range in which
    it is that effect.

    Parameters
    ----------
    table : parameter -> estimate and standard deviation; those of the fit where not given
    told : the same as a reader would see it, where that is known
    """
    model = problem.model
    table = parameter_table(candidate.fit, problem) if table is None else table
    out = [*beyond_range(candidate, problem, table)]
    for name in candidate.effects:
        if name not in model.effects or name in out:
            continue
        keys = [model.effects[name].key(p.name) for p in model.effects[name].parameters]
        sizes = [k for k in keys if k in table and model.effect_off.get(model.index[k], 0.0) == 0.0]
        if sizes and (
            0.5 * _squares(model, table, sizes) < LEAST_NAMING_EVIDENCE
            or (told is not None and _squares(model, told, sizes) < chdtri(len(sizes), 1.0 - INTERVAL_TOLD))
        ):
            out.append(name)
    return tuple(n for n in candidate.effects if n in out)


def beyond_range(
    candidate: RefittedHypothesis, problem: DiagnosisProblem, table: Mapping[str, tuple[float, float]]
) -> tuple[str, ...]:
    """Effects of a refit with a parameter outside the range in which it is that effect."""
    model, out = problem.model, []
    for name in (n for n in candidate.effects if n in model.effects):
        keys = [model.effects[name].key(p.name) for p in model.effects[name].parameters]
        limits = {k: model.effect_limits[model.index[k]] for k in keys if k in table}
        if any(not low <= table[k][0] <= high for k, (low, high) in limits.items()):
            out.append(name)
    return tuple(out)


def _squares(model: Model, table: Mapping[str, tuple[float, float]], names: Sequence[str]) -> float:
    """Sum of the squared distances from what the vehicle states, nought mostly, in standard deviations."""
    stated = {n: float(model.nominal[model.index[n]]) for n in names}
    return sum(((table[n][0] - stated[n]) / table[n][1]) ** 2 for n in names if n in table)


def pulls(fitted: FilterErrorFit, problem: DiagnosisProblem) -> Array:
    """(coefficients,) departure of the coefficients from their prior mean, in prior sd."""
    k = len(problem.stated.names)
    return (fitted.values[:k] - fitted.free.mean[:k]) / fitted.free.sd[:k]
