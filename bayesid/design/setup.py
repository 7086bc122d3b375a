"""From a vehicle or a trial to a `Case`: what is known, what was flown, how it is logged, what is allowed.

Takes a `Model` and either manoeuvres taken as flown or a trial. Does not judge or choose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.design.compare import Case
from bayesid.design.information import Logging, usual_logging
from bayesid.design.knowledge import ASSUMED, Knowledge, knowledge
from bayesid.design.limits import Limits
from bayesid.design.refit import refit
from bayesid.errors import FitError, ModelError, TrialError
from bayesid.likelihood import Problem, measured_base, run_data
from bayesid.manoeuvres import Manoeuvre
from bayesid.model import Model
from bayesid.trials import Trial

MISFIT = 9.0  # mean squared residual over noise variance above which a refit's posterior means nothing


@dataclass(frozen=True, eq=False)
class Setup:
    """A case and what the reader should know of how it was made."""

    case: Case
    notes: tuple[str, ...]


def known_of(model: Model, assumed: float = ASSUMED, fixed: Iterable[str] = ()) -> Knowledge:
    """Knowledge of every coefficient but those held.

    Raises
    ------
    FitError
        a name the vehicle does not have
    """
    kept = set(fixed)
    unknown = kept - set(model.coefficients)
    if unknown:
        raise FitError(
            f"{model.vehicle.name} has no coefficient {', '.join(sorted(unknown))} to keep; "
            f"it has {', '.join(model.coefficients)}"
        )
    return knowledge(model, [n for n in model.coefficients if n not in kept], assumed)


def vehicle_case(
    model: Model,
    known: Knowledge,
    logging: Logging,
    bounds: Limits,
    flown: Mapping[str, Manoeuvre] | None = None,
) -> Setup:
    """Case of a vehicle without logs; `flown` manoeuvres count as flown by the nominal vehicle."""
    case = Case(model, known, logging, bounds)
    runs = tuple(case.flight(m, name=name).run for name, m in (flown or {}).items())
    return Setup(replace(case, flown=runs), _guessed(known))


def trial_case(
    model: Model,
    trial: Trial,
    known: Knowledge,
    bounds: Limits,
    sigma: Mapping[str, float] | None = None,
    dt: float | None = None,
) -> Setup:
    """Case after the identify runs of a trial; vehicles come from their posterior where a refit succeeds.

    Raises
    ------
    TrialError
        no run to identify from
    """
    if not trial.identify:
        raise TrialError(f"{trial.name}: no run has role 'identify'; name the vehicle instead of the bundle")
    noise = {**trial.noise, **(sigma or {})}
    runs = tuple(run_data(model, r, noise, measured_point=trial.measured_point) for r in trial.identify)
    seen: dict[str, list[float]] = {}
    for run in runs:
        for channel, s in zip(run.channels, run.sigma, strict=True):
            seen.setdefault(channel, []).append(float(s))
    step = float(np.median(np.concatenate([np.diff(run.plan.t) for run in runs])))
    logged = {c: float(np.median(s)) for c, s in seen.items() if c in model.states}
    logging = Logging(logged, dt or step) if logged else usual_logging(model, sigma, dt)
    notes = list(_guessed(known))
    drawn = None
    try:
        problem = Problem(model, known.parameters(), runs, measured_base(model, trial))
        found = refit(problem, known)
        chi2 = 2.0 * found.cost / max(problem.n_readings, 1)
        if found.converged and chi2 < MISFIT:
            inner = np.linalg.cholesky(found.covariance) * np.sqrt(max(chi2, 1.0))
            drawn = replace(known, mean=found.values, root=known.root @ inner)
            notes.append(f"Vehicles are drawn from the posterior of the runs flown (misfit {chi2:.2f}).")
        else:
            why = f"the misfit is {chi2:.3g} times the noise" if found.converged else "it did not converge"
            notes.append(f"Vehicles are drawn from what was known before: a refit was made, but {why}.")
    except ModelError as exc:
        notes.append(f"Vehicles are drawn from what was known before; no refit was possible ({exc}).")
    return Setup(Case(model, known, logging, bounds, runs, drawn), tuple(notes))


def _guessed(known: Knowledge) -> tuple[str, ...]:
    if not known.assumed:
        return ()
    which = "all" if len(known.assumed) == len(known.names) else f"{len(known.assumed)} of {len(known.names)}"
    share = known.sd[known.names.index(known.assumed[0])] / abs(
        known.mean[known.names.index(known.assumed[0])]
    )
    return (f"The vehicle file states no spread for {which} coefficients; {share:.0%} is assumed.",)
