"""The model that stands for an explanation: its coefficients re-tuned, or as the vehicle file states them.

Takes a `DiagnosisProblem` and the refit of an explanation. Gives a frozen `ExplainedModel`. Reads no held-out
run and never changes a verdict.

The fit that weighs causes lets a latent force take what the model misses between readings, and moves
coefficients for the same end. What so predicts the next seconds can predict the next minutes worse: on a
tanker in wind re-tuning turned 29 degrees of heading of held-out turns into 36 to 45. So both models replay
every run from its first readings, each run left out of its own estimate, and coefficients stay as stated
unless re-tuning misses those runs by less, by more than one standard error over runs (Breiman et al. 1984).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.replay import misses
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.parameters import NO_PARAMETERS, effect_prior
from bayesid.estimation.run_data import Array

# Most a run counts for, logarithm of a ratio of errors: a model that diverges misses by no finite number.
MOST_LOG_RATIO = 5.0


@dataclass(frozen=True, eq=False)
class ExplainedModel:
    """The model of an explanation.

    Attributes
    ----------
    effects : names, empty for none
    fit : with the coefficients to predict with
    retuned : whether they are re-tuned; where they are not, the fit is of the effects' parameters alone
    gain : mean over runs left out in turn, and over channels, of the logarithm of the rms error with the
        coefficients as stated over that with them re-tuned; nan where it was not asked
    error : its standard error over runs
    """

    effects: tuple[str, ...]
    fit: FilterErrorFit
    retuned: bool = True
    gain: float = float("nan")
    error: float = float("nan")


def explained_model(problem: DiagnosisProblem, refit: RefittedHypothesis) -> ExplainedModel:
    """The model of a refitted hypothesis. Re-tuned where there is one run, or nothing to compare it with."""
    whole = ExplainedModel(refit.effects, refit.fit)
    stated = as_stated(problem, refit) if len(problem.logs) > 1 else None
    if stated is None:
        return whole
    ratios = []
    for i, log in enumerate(problem.logs):
        try:
            pars = [_without(f, i) for f in (stated, refit.fit)]
        except ModelError:
            continue
        with np.errstate(all="ignore"):
            given, tuned = (np.array(list(misses(problem, log, par).values())) for par in pars)
            ratio = np.log(given) - np.log(tuned)
        if np.isfinite(given).any() or np.isfinite(tuned).any():
            ratios.append(float(np.clip(np.nanmean(ratio), -MOST_LOG_RATIO, MOST_LOG_RATIO)))
    if len(ratios) < 2:
        return whole
    gain, error = float(np.mean(ratios)), float(np.std(ratios, ddof=1) / np.sqrt(len(ratios)))
    if gain > error:
        return ExplainedModel(refit.effects, refit.fit, True, gain, error)
    return ExplainedModel(refit.effects, stated, False, gain, error)


def as_stated(problem: DiagnosisProblem, refit: RefittedHypothesis) -> FilterErrorFit | None:
    """The parameters of the effects with the coefficients as stated; None where that fit does not arrive.

    As stated there is no model form either: what re-tuning is compared with is the simulator the user has. It
    starts along the path and from the sizes of the refit: from off a lag does not arrive.
    """
    free, par = NO_PARAMETERS, problem.model.nominal.copy()
    for name in () if refit.widens else refit.effects:
        free = free + effect_prior(problem.model, problem.model.effects[name])
    par[free.where] = refit.fit.par[free.where]
    start = [replace(p, par=par) for p in refit.fit.points]
    try:
        found = fit(problem.model, problem.logs, free, problem.environment.noise_model, start=start)
    except ModelError:
        return None
    return found if found.converged else None


def _without(fitted: FilterErrorFit, run: int) -> Array:
    """(n_par,) parameters that the other runs give, along the path of all."""
    free, out = fitted.free, fitted.par.copy()
    if free.names:
        total = sum(fitted.equations[1:], fitted.equations[0])
        mean = posterior(total - fitted.equations[run]).mean
        out[free.where] = np.maximum(free.mean + free.sd * mean, free.low)
    return out
