"""What the runs already executed taught: where vehicles are, what their noise is made of, a model form.

Takes `Knowledge` and logged runs, and a fit of them where there is one. Gives `Learned`. The likelihood is
that of `bayesid fit` (`estimation.likelihood`), so that a run to come promises what a fit of it will hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.prior_knowledge import Knowledge, knowledge
from bayesid.analysis.design.virtual_refit import Refit, refit
from bayesid.equations.model import Model
from bayesid.errors import FitError, ModelError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.composite import root as root_of
from bayesid.estimation.likelihood.model_form import form_rows, form_size, typical
from bayesid.estimation.likelihood.posterior import (
    CoefficientPosterior,
    composite_of,
    posterior_of_scores,
    scores_and_noise,
)
from bayesid.estimation.output_error import FitProblem
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.run_data import RunData
from bayesid.words import first_few

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Learned:
    """What the runs executed taught.

    Attributes
    ----------
    known : before them; with the rows of a model form where they ask for one
    runs : with the noise they are weighed by
    drawn : posterior, where vehicles are drawn from; None where the runs disagree or no fit succeeded
    noise : of their residuals; None where white
    raised : channel -> factor on its stated noise that gives its noise in `runs`
    said : what the reader should know
    """

    known: Knowledge
    runs: tuple[RunData, ...]
    drawn: Knowledge | None = None
    noise: CampaignNoise | None = None
    raised: Mapping[str, float] = field(default_factory=dict)
    said: tuple[str, ...] = ()


def learned_by_refit(
    model: Model, known: Knowledge, runs: tuple[RunData, ...], base: Array, dt: float
) -> Learned:
    """From a refit of the runs, with the parts of noise and the model form that they ask for."""
    try:
        problem, found, missed = _fitted(FitProblem(model, known.parameters(), runs, base), known)
        if not found.converged:
            return _nothing_learned(known, runs, "A refit of the runs executed did not converge")
        posterior, noise = campaign_noise(problem, found.unknowns, known, dt)
        size = form_size(problem, found.unknowns, posterior.parts)
        said: list[str] = []
        if size:
            wide = with_form(known, model, size)
            formed = replace(problem, params=wide.parameters())
            begun = np.insert(found.unknowns, len(known.names), np.zeros(len(wide.names) - len(known.names)))
            again = refit(formed, wide, start=begun)
            said = [_form_failed(size)]
            if again.converged:
                known, problem, found = wide, formed, again
                posterior, noise = campaign_noise(problem, found.unknowns, known, dt)
                said = [_formed(size)]
    except ModelError as exc:
        return _nothing_learned(known, runs, f"No refit of the runs executed was possible ({exc})")
    drawn = None
    if posterior.final:
        mean, covariance = posterior.mean, found.covariance
        if not posterior.parts.white:
            inner = np.linalg.solve(known.root, root_of(posterior.covariance))
            covariance = inner @ inner.T + 1e-12 * np.eye(mean.size)
        drawn = replace(known, mean=mean, root=known.root @ np.linalg.cholesky(covariance))
    told = (*said, *_told(posterior, "the runs executed"))
    return Learned(known, problem.runs, drawn, noise, missed, told)


def learned_by_fit(
    model: Model, known: Knowledge, runs: tuple[RunData, ...], base: Array, dt: float, earlier: Fit
) -> Learned:
    """From a fit of the same runs: its estimate, the noise its readings were weighed by, its model form.

    Raises
    ------
    FitError
        a fit of other runs, or one that stores no parts of noise
    """
    told = earlier.uncertainty
    if "parts" not in told:
        raise FitError("the fit has no posterior: its vehicle diverges at the estimate; give another fit")
    stored = NoiseParts(**{k: v for k, v in told["parts"].items() if k != "words"})
    # those of a filter are of its innovations; here residuals of a simulation tell the noise
    parts = None if stored.disturbance else stored
    fitted = [n for n in earlier.values if n in model.coefficients and n in known.names]
    if not fitted:
        raise FitError("the fit freed none of the coefficients that are open here; give another fit")
    known = knowledge(model, fitted)
    size = float(told.get("form", {}).get("size", 0.0))
    if size:
        known = with_form(known, model, size, told["form"].get("rows"))
    base = base.copy()
    stay = [n for n in earlier.values if n in model.index]
    base[model.positions(stay)] = [earlier.values[n] for n in stay]
    weighed = tuple(
        r.with_sigma({c: earlier.sigma.get(c, s) for c, s in zip(r.channels, r.sigma, strict=True)})
        for r in runs
    )
    problem = FitProblem(model, known.parameters(), weighed, base)
    estimate = dict(zip(earlier.names, earlier.z, strict=True))
    lacking = [n for n in problem.names[len(known.names) :] if n not in estimate]
    if lacking:
        ours = dict.fromkeys(r.name for r in runs)
        theirs = dict.fromkeys(n.rsplit(":", 1)[0] for n in earlier.names[earlier.n_params :])
        raise FitError(
            f"the fit is of {first_few(theirs, 4)}, the runs here are {first_few(ours, 4)}; give the trial "
            "that was fitted, resampled and cut as it was (--resample, --pieces)"
        )
    z = np.array([estimate.get(n, s) for n, s in zip(problem.names, problem.start, strict=True)])
    posterior, noise = campaign_noise(problem, z, known, dt, parts)
    drawn = None
    if told.get("final", True):
        inner = np.linalg.solve(known.root, root_of(posterior.covariance))
        spread = np.linalg.cholesky(inner @ inner.T + 1e-12 * np.eye(len(known.names)))
        drawn = replace(known, mean=z[: len(known.names)], root=known.root @ spread)
    said = [_formed(size)] if size else []
    held = [n for n in earlier.values if n not in known.names]
    if held:
        said.append(f"Held as the fit found them: {', '.join(held)}.")
    raised = {
        c: earlier.sigma[c] / float(s)
        for r in runs
        for c, s in zip(r.channels, r.sigma, strict=True)
        if c in earlier.sigma
    }
    final = bool(told.get("final", True))
    return Learned(
        known, problem.runs, drawn, noise, raised, (*said, *_told(posterior, "the fit given", final))
    )


def with_form(known: Knowledge, model: Model, size: float, rows: Iterable[str] | None = None) -> Knowledge:
    """The knowledge with the rows of a model form of this size beside it, normal about zero; by default all,
    for runs to come may move what stood still."""
    rows = tuple(n for n in (form_rows(model) if rows is None else rows) if n not in known.names)
    sd = [size * abs(typical(model, n)) for n in rows]
    return Knowledge(
        (*known.names, *rows),
        np.concatenate([known.where, model.positions(rows)]),
        np.concatenate([known.mean, np.zeros(len(rows))]),
        block_diag(known.root, np.diag(sd)),
        known.assumed,
    )


def campaign_noise(
    problem: FitProblem, z: Array, known: Knowledge, dt: float, parts: NoiseParts | None = None
) -> tuple[CoefficientPosterior, CampaignNoise | None]:
    """Composite posterior of a campaign at its best point, and the noise of its residuals; None where white.

    Parameters
    ----------
    z : (n,) unknowns of the best point, initial states included
    dt : time between samples [s]
    parts : of the noise; by default what the data ask for
    """
    k = len(known.names)
    scores, residuals = scores_and_noise(problem, z, white=parts is not None and parts.order == 0)
    posterior = posterior_of_scores(problem, z, scores, residuals.order, parts)
    if posterior.parts.white:
        return posterior, None
    deviation = np.linalg.solve(known.root, np.diag(composite_of(problem, z, scores).spread))
    channels = tuple(dict.fromkeys(c for run in problem.runs for c in run.channels))
    scale = problem.scale[:k]
    return posterior, CampaignNoise(
        posterior.parts, residuals, channels, _gaps(problem.runs), dt, deviation * scale
    )


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


def _told(posterior: CoefficientPosterior, of: str, final: bool | None = None) -> list[str]:
    parts = posterior.parts
    share = "" if parts.white else f"; they tell {100 * parts.share:.2g} % of what white noise would"
    said = [f"Noise of {of}: {parts.describe()}{share}."]
    if posterior.final if final is None else final:
        return [*said, "Vehicles are drawn from the posterior of the runs executed."]
    doubts = posterior.doubts()
    why = doubts[0].removeprefix("Not final: ") if doubts and not posterior.final else "the fit is not final."
    return [*said, f"Vehicles are drawn from what was known before: {why}"]


def _formed(size: float) -> str:
    return (
        f"The runs ask for a model form of {size:.0e} of 1/2 rho L^2 U^2: its rows are unknown beside the "
        "coefficients."
    )


def _form_failed(size: float) -> str:
    return (
        f"The runs ask for a model form of {size:.0e} of 1/2 rho L^2 U^2, the refit with it did not "
        "converge: the next run may tell less than is said here."
    )


def _nothing_learned(known: Knowledge, runs: tuple[RunData, ...], why: str) -> Learned:
    said = (
        f"{why}: vehicles are drawn from what was known before, and noise is white as stated. Where the "
        "vehicle is unstable on course, cut the runs (--pieces)."
    )
    return Learned(known, runs, said=(said,))


def _gaps(runs: Iterable[RunData]) -> dict[str, int]:
    """Channel -> median samples between two of its readings."""
    seen: dict[str, list[Array]] = {}
    for run in runs:
        for j, channel in enumerate(run.channels):
            seen.setdefault(channel, []).append(np.diff(np.flatnonzero(run.valid[:, j])))
    gaps = {c: np.concatenate(d) for c, d in seen.items()}
    return {c: int(np.median(g)) if g.size else 1 for c, g in gaps.items()}
