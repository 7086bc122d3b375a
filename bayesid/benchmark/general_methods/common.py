"""What both general methods start from, and the form in which they answer.

Takes a trial and a model. Gives readings, noise and the fit without any cause; later a verdict as plain data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bayesid.benchmark.protocol.cause_families import family_of
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains, weighted_hypothesis
from bayesid.diagnosis.hypotheses.probabilities import credible_set
from bayesid.diagnosis.hypotheses.sensitivity_bank import testable
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.model.effects import Effect
from bayesid.trials import Trial
from bayesid.trials.noise_stated import with_seen_noise

# Shared by all methods: nothing wrong, one cause of the catalogue, another cause.
PRIOR_NONE, PRIOR_CATALOGUE, PRIOR_OUTSIDE = 0.5, 0.4, 0.1
SET_PROBABILITY = 0.95


@dataclass(frozen=True, eq=False)
class Base:
    """A trial before any cause is asked for.

    Attributes
    ----------
    problem : readings, coefficients with their prior, environment
    none : fit of the coefficients alone
    points : where to linearise: that fit, or a path along the readings where it does not follow them
    level : latent force the points need, 0 at the fit
    effects : causes of the catalogue that can show in this trial
    """

    problem: DiagnosisProblem
    none: RefittedHypothesis
    points: tuple[Trajectory, ...]
    level: float
    effects: tuple[Effect, ...]


def base_of(trial: Trial, model: Model) -> Base:
    """Fit without any cause.

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    problem = build_problem(model, with_seen_noise(trial, (model.scales["L"], model.scales["U"])))
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    fine = explains(none)
    points = tuple(none.fit.points if fine else problem.path)
    effects = tuple(e for e in model.kernel.effects if testable(problem, e))
    return Base(problem, none, points, 0.0 if fine else problem.path_level, effects)


def answer(
    trial: Trial,
    word: str,
    probabilities: Mapping[str, float],
    method: Mapping[str, Any],
    named: Sequence[str] = (),
    parameters: Mapping[str, Any] | None = None,
    channel: str | None = None,
) -> dict[str, Any]:
    """A verdict as plain data in the form of diagnosis.json.

    Parameters
    ----------
    word : of the verdict
    method : what the method itself says: its name, p-values, rejections
    named : causes it names
    parameters : of the named cause
    channel : where the gap shows most, as far as the method says
    """
    effects = [
        {
            "name": name,
            "probability": float(probabilities.get(name, 0.0)),
            "parameters": dict(parameters or {}),
        }
        for name in named
    ]
    return {
        "format": 1,
        "trial": {"name": trial.name, "dof": trial.dof},
        "verdict": word,
        "effects": effects,
        "set95": list(credible_set(probabilities, SET_PROBABILITY)),
        "probabilities": {n: float(p) for n, p in probabilities.items()},
        "where": {"channel": channel, "evidence": {}},
        "gap": {"shrink": None, "before": None, "after": None, "horizons": []},
        "method": dict(method),
    }


def one_family(names: Sequence[str]) -> bool:
    """Whether all names are the same cause."""
    return len({family_of(n) for n in names}) == 1
