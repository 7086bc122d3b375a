"""From a vehicle or a trial to a `PlanningCase`: what is known, what was executed, how it is logged, what
is allowed.

Takes a `Model` and either manoeuvres taken as executed or a trial. Does not judge or choose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.information import Logging, usual_logging
from bayesid.analysis.design.limits import OrderLimits
from bayesid.analysis.design.prior_knowledge import ASSUMED_RELATIVE_SD, Knowledge, knowledge
from bayesid.analysis.design.virtual_refit import Refit, refit
from bayesid.equations.model import Model
from bayesid.errors import FitError, ModelError, TrialError
from bayesid.estimation.likelihood.composite import root as root_of
from bayesid.estimation.likelihood.posterior import (
    CoefficientPosterior,
    composite_of,
    posterior_of_scores,
    scores_and_noise,
)
from bayesid.estimation.output_error import FitProblem, measured_base, output_error_run
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre
from bayesid.trials import Trial

Array = np.ndarray
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
) -> PlanningSetup:
    """Case after the identify runs of a trial; vehicles come from their posterior where a refit succeeds
    and the runs agree, and their noise is taken for that of the next.

    Raises
    ------
    TrialError
        no run to identify from
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
    notes = list(_guessed(known))
    drawn, found_noise = None, None
    try:
        problem = FitProblem(model, known.parameters(), runs, measured_base(model, trial))
        problem, found, missed = _fitted(problem, known)
        if found.converged:
            runs = problem.runs
            logging = replace(logging, sigma={c: s * missed.get(c, 1.0) for c, s in logging.sigma.items()})
            if raised := {c: f for c, f in missed.items() if f > RAISED and c in logging.sigma}:
                factors = ", ".join(f"{c} {f:.3g} times" for c, f in raised.items())
                notes.append(f"Noise raised to what the model misses of these runs: {factors}.")
            drawn, found_noise, said = _learned(problem, found, known, step)
            notes += said
            if found_noise is not None and not set(logging.sigma) <= set(found_noise.channels):
                found_noise = None
                notes.append("The runs executed log other channels than the next will: its noise is white.")
        else:
            notes.append(
                "A refit of the runs executed did not converge: vehicles are drawn from what was known "
                "before, and noise is white as stated. Where the vehicle is unstable on course, cut the runs "
                "(--pieces)."
            )
    except ModelError as exc:
        notes.append(
            f"No refit of the runs executed was possible ({exc}): vehicles are drawn from what was known "
            "before, and noise is white as stated. Where the vehicle is unstable on course, cut the runs "
            "(--pieces)."
        )
    return PlanningSetup(PlanningCase(model, known, logging, bounds, runs, drawn, found_noise), tuple(notes))


def _fitted(problem: FitProblem, known: Knowledge) -> tuple[FitProblem, Refit, dict[str, float]]:
    """The refit of the runs executed; where it does not converge, again with the noise of each channel
    raised to what the model misses, as channel -> factor: of a real ship the model is the limit, not the
    sensor, and exact readings make valleys no search leaves."""
    found = refit(problem, known)
    if found.converged:
        return problem, found, {}
    squares: dict[str, list[Array]] = {}
    for run, simulated in zip(problem.runs, problem.readings(found.unknowns), strict=True):
        resid = run.residuals(simulated.copy())
        for j, channel in enumerate(run.channels):
            squares.setdefault(channel, []).append(resid[run.valid[:, j], j] ** 2)
    missed = {c: max(1.0, float(np.sqrt(np.mean(np.concatenate(s))))) for c, s in squares.items()}
    weighed = tuple(
        run.with_sigma({c: s * missed[c] for c, s in zip(run.channels, run.sigma, strict=True)})
        for run in problem.runs
    )
    again = replace(problem, runs=weighed)
    return again, refit(again, known, start=found.unknowns), missed


def campaign_noise(
    problem: FitProblem, z: Array, known: Knowledge, dt: float
) -> tuple[CoefficientPosterior, CampaignNoise | None]:
    """Composite posterior of a campaign at its best point, and the noise of its residuals; None where white.

    Parameters
    ----------
    z : (n,) unknowns of the best point, initial states included
    dt : time between samples [s]
    """
    k = len(known.names)
    scores, residuals = scores_and_noise(problem, z)
    posterior = posterior_of_scores(problem, z, scores, residuals.order)
    if posterior.parts.white:
        return posterior, None
    deviation = np.linalg.solve(known.root, np.diag(composite_of(problem, z, scores).spread))
    channels = tuple(dict.fromkeys(c for run in problem.runs for c in run.channels))
    scale = problem.scale[:k]
    return posterior, CampaignNoise(
        posterior.parts, residuals, channels, _gaps(problem.runs), dt, deviation * scale
    )


def _learned(
    problem: FitProblem, found: Refit, known: Knowledge, dt: float
) -> tuple[Knowledge | None, CampaignNoise | None, list[str]]:
    """Posterior of the runs executed, where they agree, the noise of their residuals, and what to say."""
    k = len(known.names)
    posterior, noise = campaign_noise(problem, found.unknowns, known, dt)
    parts = posterior.parts
    share = "" if parts.white else f"; they tell {100 * parts.share:.2g} % of what white noise would"
    said = [f"Noise of the runs executed: {parts.describe()}{share}."]
    if not posterior.final:
        why = posterior.doubts()[0].removeprefix("Not final: ")
        return None, noise, [*said, f"Vehicles are drawn from what was known before: {why}"]
    root = np.linalg.cholesky(found.covariance)
    if not parts.white:
        inner = np.linalg.solve(known.root, root_of(posterior.covariance))
        root = np.linalg.cholesky(inner @ inner.T + 1e-12 * np.eye(k))
    drawn = replace(known, mean=posterior.mean, root=known.root @ root)
    return drawn, noise, [*said, "Vehicles are drawn from the posterior of the runs executed."]


def _gaps(runs: Iterable[RunData]) -> dict[str, int]:
    """Channel -> median samples between two of its readings."""
    seen: dict[str, list[Array]] = {}
    for run in runs:
        for j, channel in enumerate(run.channels):
            seen.setdefault(channel, []).append(np.diff(np.flatnonzero(run.valid[:, j])))
    gaps = {c: np.concatenate(d) for c, d in seen.items()}
    return {c: int(np.median(g)) if g.size else 1 for c, g in gaps.items()}


def _guessed(known: Knowledge) -> tuple[str, ...]:
    if not known.assumed:
        return ()
    which = "all" if len(known.assumed) == len(known.names) else f"{len(known.assumed)} of {len(known.names)}"
    share = known.sd[known.names.index(known.assumed[0])] / abs(
        known.mean[known.names.index(known.assumed[0])]
    )
    return (f"The vehicle file states no spread for {which} coefficients; {share:.0%} is assumed.",)
