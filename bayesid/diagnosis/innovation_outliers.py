"""Outliers that show only once the environment is known.

Takes a trial. Gives its `DiagnosisProblem` without them, and the fit without any effect. Before anything is
known a path may bend a little, and one yaw rate off by ten sigma is a possible motion; under the measured
environment it is not. Only asked where the fit without any effect leaves residuals of the size of the noise:
what a gap does to single readings is not to be taken away.
"""

from __future__ import annotations

from collections.abc import Callable

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.outliers import stripped
from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.trials import Trial

Say = Callable[[str], None]


def prepare(
    model: Model,
    trial: Trial,
    say: Say = lambda text: None,
    as_built: float | None = None,
    events: tuple[Event, ...] = (),
) -> tuple[DiagnosisProblem, FilterErrorFit]:
    """Problem of a trial (see `build_problem`) and its fit without any effect.

    Readings this fit contradicts are left out and the environment measured again without them: a few wrong
    yaw rates doubled it.
    """
    problem = build_problem(model, trial, say, as_built, events)
    say("fit without any effect")
    base = fit_with(problem, ())
    if not explains(RefittedHypothesis((), base.log_evidence, base)):
        return problem, base
    found = stripped(model, problem.logs, base.points, problem.environment.noise_model)[1]
    if not found:
        return problem, base
    say(f"once more without {len(found)} reading(s) that all others contradict")
    problem = build_problem(model, trial, say, as_built, events, (*problem.outliers, *found))
    say("fit without any effect")
    return problem, fit_with(problem, ())
