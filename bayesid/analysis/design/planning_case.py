"""From a vehicle or a trial to a `PlanningCase`: what is known, what was executed, how it is logged, what
is allowed.

Takes a `Model` and either manoeuvres taken as executed or a trial. Does not judge or choose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.executed_runs import learned_by_fit, learned_by_refit
from bayesid.analysis.design.information import Logging, usual_logging
from bayesid.analysis.design.limits import OrderLimits
from bayesid.analysis.design.prior_knowledge import ASSUMED_RELATIVE_SD, Knowledge, knowledge
from bayesid.equations.model import Model
from bayesid.errors import FitError, TrialError
from bayesid.estimation.output_error import measured_base, output_error_run
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.manoeuvres import Manoeuvre
from bayesid.trials import Trial
from bayesid.words import did_you_mean

RAISED = 1.05  # factor on a channel's noise from which it is said


@dataclass(frozen=True, eq=False)
class PlanningSetup:
    """A case and what the reader should know of how it was made."""

    case: PlanningCase
    notes: tuple[str, ...]


def known_of(model: Model, assumed: float = ASSUMED_RELATIVE_SD, fixed: Iterable[str] = ()) -> Knowledge:
    """Knowledge of every coefficient but those held.

    Raises
    ------
    FitError
        a name the vehicle does not have
    """
    kept, there = set(fixed), model.coefficients
    unknown = sorted(kept - set(there))
    if unknown:
        raise FitError(
            f"{model.vehicle.name} has no coefficient {', '.join(unknown)} to keep"
            + (did_you_mean(unknown, there) or f"; it has {', '.join(there)}")
        )
    return knowledge(model, [n for n in there if n not in kept], assumed)


def vehicle_case(
    model: Model,
    known: Knowledge,
    logging: Logging,
    bounds: OrderLimits,
    executed: Mapping[str, Manoeuvre] | None = None,
) -> PlanningSetup:
    """Case of a vehicle without logs; `flown` manoeuvres count as executed by the nominal vehicle."""
    case = PlanningCase(model, known, logging, bounds)
    runs = tuple(case.execution(m, name=name).run for name, m in (executed or {}).items())
    return PlanningSetup(replace(case, executed=runs), _guessed(known))


def trial_case(
    model: Model,
    trial: Trial,
    known: Knowledge,
    bounds: OrderLimits,
    sigma: Mapping[str, float] | None = None,
    dt: float | None = None,
    earlier: Fit | None = None,
) -> PlanningSetup:
    """Case after the identify runs of a trial; vehicles come from their posterior where a refit succeeds
    and the runs agree, and their noise is taken for that of the next.

    Parameters
    ----------
    earlier : fit of these runs, whose estimate, noise and model form are taken instead of a refit's

    Raises
    ------
    TrialError
        no run to identify from
    FitError
        a fit of other runs
    """
    if not trial.identify:
        raise TrialError(f"{trial.name}: no run has role 'identify'; name the vehicle instead of the bundle")
    noise = {**trial.noise, **(sigma or {})}
    runs = tuple(
        output_error_run(model, r, noise, measured_point=trial.measured_point) for r in trial.identify
    )
    seen: dict[str, list[float]] = {}
    for run in runs:
        for channel, s in zip(run.channels, run.sigma, strict=True):
            seen.setdefault(channel, []).append(float(s))
    step = float(np.median(np.concatenate([np.diff(run.plan.t) for run in runs])))
    logged = {c: float(np.median(s)) for c, s in seen.items() if c in model.states}
    logging = Logging(logged, dt or step) if logged else usual_logging(model, sigma, dt)
    base = measured_base(model, trial)
    learned = (
        learned_by_refit(model, known, runs, base, step)
        if earlier is None
        else learned_by_fit(model, known, runs, base, step, earlier)
    )
    notes = [*_guessed(known), *learned.said]
    logging = replace(logging, sigma={c: s * learned.raised.get(c, 1.0) for c, s in logging.sigma.items()})
    if raised := {c: f for c, f in learned.raised.items() if f > RAISED and c in logging.sigma}:
        factors = ", ".join(f"{c} {f:.3g} times" for c, f in raised.items())
        notes.append(f"Noise raised to what the model misses of these runs: {factors}.")
    noise_found = learned.noise
    if noise_found is not None and not set(logging.sigma) <= set(noise_found.channels):
        noise_found = None
        notes.append("The runs executed log other channels than the next will: its noise is white.")
    case = PlanningCase(model, learned.known, logging, bounds, learned.runs, learned.drawn, noise_found)
    return PlanningSetup(case, tuple(notes))


def _guessed(known: Knowledge) -> tuple[str, ...]:
    if not known.assumed:
        return ()
    which = "all" if len(known.assumed) == len(known.names) else f"{len(known.assumed)} of {len(known.names)}"
    share = known.sd[known.names.index(known.assumed[0])] / abs(
        known.mean[known.names.index(known.assumed[0])]
    )
    return (f"The vehicle file states no spread for {which} coefficients; {share:.0%} is assumed.",)
