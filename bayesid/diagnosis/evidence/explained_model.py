"""The model that stands for an explanation: re-tuned, with coefficients as stated, or the simulator as given.

Takes a `DiagnosisProblem` and the refit of an explanation. Gives a frozen `ExplainedModel`. Reads no held-out
run and changes no verdict (`hypotheses.verdict.after_left_out` does).

The fit that weighs causes lets a latent force take what the model misses between readings, and moves
coefficients for the same end. What so predicts the next seconds can predict the next minutes worse: on a
tanker in wind re-tuning turned 29 degrees of heading of held-out turns into 36 to 45. So both models replay
every run from its first readings, each run left out of its own estimate, and coefficients stay as stated
unless re-tuning misses those runs by less, by more than one standard error over runs (Breiman et al. 1984).
An explanation is itself held to that. One that the verdict names predicts unless it misses runs left out by
more than the simulator as given does; one that is not named must miss them by less, by more than one
standard error. Else that simulator predicts. Runs in other winds than those of the fit are such a case: what
one hour's wind does is no property of the vehicle. Where neither has coefficients re-tuned, and re-tuned
coefficients alone miss runs left out by less than it, by more than one standard error, they predict.
Runs are left out of the normal equations along the path of all; where what so comes out diverges, the others
are fitted anew (an AUV's one vertical zig-zag was lost so, and predicted as well as by all with that fit).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.replay import misses
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.parameters import NO_PARAMETERS, effect_prior
from bayesid.estimation.run_data import Array, RunData

# Most a run counts for, logarithm of a ratio of errors: a model that diverges misses by no finite number.
MOST_LOG_RATIO = 5.0

Misses = Sequence[Array | None]


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
    given_gain, given_error : the same of the simulator as given over the better of the two; nan where it was
        not asked
    given : the simulator as given along the runs, nothing free; None where it was not asked
    refused : the fit of an explanation in whose place `fit` is the simulator as given or, where `retuned`,
        with re-tuned coefficients alone; None where it stands
    alone_gain, alone_error : as `gain`, of what predicts without re-tuned coefficients over these alone; nan
        where it was not asked
    left, given_left : errors of `fit` and of the simulator as given, by channel of every run, left out of
        the estimate
    """

    effects: tuple[str, ...]
    fit: FilterErrorFit
    retuned: bool = True
    gain: float = float("nan")
    error: float = float("nan")
    given_gain: float = float("nan")
    given_error: float = float("nan")
    given: FilterErrorFit | None = None
    refused: FilterErrorFit | None = None
    alone_gain: float = float("nan")
    alone_error: float = float("nan")
    left: Misses = ()
    given_left: Misses = ()

    def predicting(self, named: bool) -> ExplainedModel:
        """The model to predict with, given whether the verdict names the explanation."""
        least = 0.0 if named else self.given_error
        if self.given is None or not self.given_gain <= least:
            return self
        return replace(
            self, effects=(), fit=self.given, retuned=False, refused=self.fit, left=self.given_left
        )

    @property
    def as_given(self) -> bool:
        """Whether the simulator as given predicts in place of the explanation."""
        return self.refused is not None and not self.retuned

    @property
    def coefficients_alone(self) -> bool:
        """Whether re-tuned coefficients alone predict in place of the explanation."""
        return self.refused is not None and self.retuned

    def or_retuned(self, coefficients: ExplainedModel) -> ExplainedModel:
        """Re-tuned coefficients alone, in place of a model with stated ones, where they predict better."""
        if self.retuned or not coefficients.retuned or len(coefficients.left) != len(self.left):
            return self
        gain, error = _left_out_gain(self.left, coefficients.left)
        asked = replace(self, alone_gain=gain, alone_error=error)
        if not gain > error:
            return asked
        return replace(
            asked,
            effects=(),
            fit=coefficients.fit,
            retuned=True,
            refused=self.fit if self.refused is None else self.refused,
            left=coefficients.left,
        )


def explained_model(problem: DiagnosisProblem, refit: RefittedHypothesis) -> ExplainedModel:
    """The model of a refitted hypothesis. Re-tuned where there is one run, or nothing to compare it with."""
    found = ExplainedModel(refit.effects, refit.fit)
    if len(problem.logs) < 2:
        return found
    stated, left = as_stated(problem, refit), _misses_without_each(problem, refit.fit)
    if stated is not None:
        as_is = _misses_without_each(problem, stated)
        gain, error = _left_out_gain(as_is, left)
        if math.isnan(gain):
            return found
        kept = gain > error
        if not kept:
            left = as_is
        found = ExplainedModel(refit.effects, refit.fit if kept else stated, kept, gain, error)
    found = replace(found, left=left)
    if not found.fit.free.names:
        return found
    if not _stated_effects(refit):  # as stated, nothing is free: that is the simulator as given
        if stated is None:
            return found
        return replace(found, given=stated, given_gain=gain, given_error=error, given_left=as_is)
    if (nothing := _with_effects(problem, refit, ())) is None:
        return found
    given = _misses_without_each(problem, nothing)
    gain, error = _left_out_gain(given, left)
    return replace(found, given=nothing, given_gain=gain, given_error=error, given_left=given)


def _misses_without_each(problem: DiagnosisProblem, fitted: FilterErrorFit) -> Misses:
    """Errors by channel of every run, left out of the estimate; None where the others give none."""
    out: list[Array | None] = []
    for i, log in enumerate(problem.logs):
        try:
            found = _misses(problem, log, _without(fitted, i))
            if np.isinf(found).any():  # along the path of all runs what the others say may be no estimate
                found = _misses(problem, log, _fitted_without(problem, fitted, i))
        except ModelError:
            out.append(None)
            continue
        out.append(found)
    return out


def _misses(problem: DiagnosisProblem, log: RunData, par: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.array(list(misses(problem, log, par).values()))


def _fitted_without(problem: DiagnosisProblem, fitted: FilterErrorFit, run: int) -> Array:
    """(n_par,) parameters that the other runs give, fitted anew from where the fit to all ended."""
    logs = [log for i, log in enumerate(problem.logs) if i != run]
    start = [point for i, point in enumerate(fitted.points) if i != run]
    return fit(problem.model, logs, fitted.free, fitted.noise_model, start=start).par


def _left_out_gain(one: Misses, other: Misses) -> tuple[float, float]:
    """Mean over runs, each left out of its estimate, of the logarithm of the error of the one over that of
    the other, and its standard error; nan where fewer than two runs can be told."""
    ratios = []
    for first, second in zip(one, other, strict=True):
        if first is None or second is None:
            continue
        with np.errstate(all="ignore"):
            ratio = np.log(first) - np.log(second)
        if np.isfinite(first).any() or np.isfinite(second).any():
            ratios.append(float(np.clip(np.nanmean(ratio), -MOST_LOG_RATIO, MOST_LOG_RATIO)))
    if len(ratios) < 2:
        return math.nan, math.nan
    return float(np.mean(ratios)), float(np.std(ratios, ddof=1) / np.sqrt(len(ratios)))


def as_stated(problem: DiagnosisProblem, refit: RefittedHypothesis) -> FilterErrorFit | None:
    """The parameters of the effects with the coefficients as stated; None where that fit does not arrive.

    As stated there is no model form either: what re-tuning is compared with is the simulator the user has. It
    starts along the path and from the sizes of the refit: from off a lag does not arrive.
    """
    return _with_effects(problem, refit, _stated_effects(refit))


def _stated_effects(refit: RefittedHypothesis) -> tuple[str, ...]:
    """Effects of an explanation beside coefficients as stated; a wider coefficient is none."""
    return () if refit.widens else refit.effects


def _with_effects(
    problem: DiagnosisProblem, refit: RefittedHypothesis, names: Iterable[str]
) -> FilterErrorFit | None:
    """The simulator with effects alone free, along the runs; None where it cannot follow them."""
    free, par = NO_PARAMETERS, problem.model.nominal.copy()
    for name in names:
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
        out[free.where] = np.clip(free.mean + free.sd * mean, free.low, free.high)
    return out
