"""Refits: of the screen's shortlist and of widened coefficients, and what a refit leaves.

Takes a `DiagnosisProblem` and scores. Gives `RefittedHypothesis`s.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from bayesid.diagnosis.data.problem import (
    FOLLOWING_FORCE_LEVEL,
    SECANT_SIZES,
    USUAL_START,
    DiagnosisProblem,
    Starts,
    first_fit,
    fit_with,
)
from bayesid.diagnosis.hypotheses.candidate import (
    COEFFICIENT_ERROR,
    RefittedHypothesis,
    explains,
    weighted_hypothesis,
)
from bayesid.diagnosis.hypotheses.localisation import Localisation, locate
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY, ScreenScore, SensitivityBank
from bayesid.diagnosis.threshold_table import ARRIVED_SHARE, LINEARISATION_SCATTER
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.parameters import effect_prior
from bayesid.model.effects import Effect

SHORTLIST_SIZE = 6
# Passes of a refit that begins where a smaller one ended: nine of ten take five or fewer.
NEAR_ITERATIONS, MOST_ITERATIONS = 12, 25
Notify = Callable[[str], None]


def shortlist(scores: Sequence[ScreenScore]) -> list[ScreenScore]:
    """Best of the screen: at most `SHORTLIST_SIZE`, none that a correct screen would put 60 % and 20 nats
    below
    the best.
    """
    top = scores[0].gain
    return [s for s in scores[:SHORTLIST_SIZE] if s.gain > min(0.1 * top, top - 20.0) and s.gain > -8.0]


def likely_coefficients(wide: dict[str, float], scores: Sequence[ScreenScore]) -> list[str]:
    ranked = sorted(wide, key=lambda n: -wide[n])
    return [n for n in ranked[:2] if wide[n] > max(2.0, 0.05 * scores[0].gain)]


def refit(
    problem: DiagnosisProblem,
    effects: tuple[Effect, ...],
    notify: Notify,
    sizes: Starts = MappingProxyType({}),
    smaller: RefittedHypothesis | None = None,
    promised: float = np.inf,
) -> list[RefittedHypothesis]:
    """Candidate of some effects; none where the model cannot follow the data with them at all.

    It begins where the same effects ended in another environment, or else at a smaller one that explains the
    data, which takes a third of the passes, and is kept where it gains what the linear screen promised; else
    it begins anew along the readings' own path.

    Parameters
    ----------
    sizes : where effects without a slope when off begin (`sizes_of`)
    smaller, promised : refit with fewer of the effects, and the gain of the screen along its path [nats]
    """
    names = tuple(e.name for e in effects)
    notify(f"refit with {_together(names)}")
    at = _near(problem, effects, sizes, smaller, promised)
    # an explanation worth less than a smaller one that it holds is none, however its fit goes on
    worth = smaller.fit.log_evidence if smaller is not None and explains(smaller) else -np.inf

    def fitted(near: bool) -> RefittedHypothesis:
        if not near or at is None:
            return weighted_hypothesis(problem, names, fit_with(problem, effects, sizes=sizes, worth=worth))
        found = fit_with(
            problem,
            effects,
            start=at.points,
            initial_noise_scale=at.force_level,
            iterations=NEAR_ITERATIONS,
            worth=_least(smaller, promised),
        )
        return weighted_hypothesis(problem, names, found)

    return _near_or_anew(fitted, at is not None, _least(smaller, promised), notify)


@dataclass(frozen=True, eq=False)
class _Near:
    """Points near which a refit begins, and the latent force with which they follow the data (over 1/2 rho
    L^2 U^2; 0 for the real one)."""

    points: Sequence[Trajectory]
    force_level: float = 0.0


def _near(
    problem: DiagnosisProblem,
    effects: Sequence[Effect],
    sizes: Starts,
    smaller: RefittedHypothesis | None,
    promised: float,
) -> _Near | None:
    """Where a refit begins near what is known; None where nothing is."""
    if (ended := problem.ended_with(effects)) is not None:
        return _Near(ended, FOLLOWING_FORCE_LEVEL)
    if smaller is None or not np.isfinite(promised) or not explains(smaller):
        return None
    more = tuple(e for e in effects if e.name not in smaller.effects)
    return _Near(first_fit(problem, more, smaller.fit.points, sizes))


def _near_or_anew(
    fitted: Callable[[bool], RefittedHypothesis],
    known: bool,
    least: float,
    notify: Notify,
) -> list[RefittedHypothesis]:
    """Candidate begun near what is known, kept where it explains the data and gains what the screen promised;
    else the better of it and one begun anew. None where the model cannot follow the data.

    Parameters
    ----------
    fitted : candidate begun near what is known, or along the readings' own path
    known : whether anything is
    least : log evidence at which it has arrived
    """
    begun: list[RefittedHypothesis] = []
    if known:
        with suppress(ModelError):
            begun = [c for c in [fitted(True)] if explains(c)]
        if any(c.fit.log_evidence > least for c in begun):
            return begun
    try:
        return [_better(fitted(False), *begun)]
    except ModelError as exc:
        notify(f"given up: {exc}")
        return begun


def _better(*candidates: RefittedHypothesis) -> RefittedHypothesis:
    return max(candidates, key=lambda c: (explains(c), c.log_evidence))


def _least(smaller: RefittedHypothesis | None, promised: float) -> float:
    """Log evidence at which a refit has arrived: what a linear screen promised beside a smaller one, short
    of it by no more than a fifth, or than refits scatter. The screen knows no environment of another size,
    which may pass for what an effect gains."""
    if smaller is None or not explains(smaller) or not np.isfinite(promised):
        return -np.inf
    return smaller.fit.log_evidence + min(ARRIVED_SHARE * promised, promised - LINEARISATION_SCATTER)


def refit_screened(
    problem: DiagnosisProblem,
    bank: SensitivityBank,
    score: ScreenScore,
    notify: Notify,
    none: RefittedHypothesis | None = None,
) -> list[RefittedHypothesis]:
    """Candidate of one screened effect, begun at the fit without any where that explains the data.

    One without a slope when off begins at the size the screen finds best where that is not near off: it finds
    the nearest hill. Where that does not arrive it begins at the usual size and from the screen's estimate.
    """
    effect = problem.model.effects[score.name]
    far = not effect.smooth and effect.dated is None and score.start[0] > 2.0 * USUAL_START
    begun = {score.name: score.start} if far or effect.dated is not None else {}
    out = refit(problem, (effect,), notify, begun, none, score.gain)
    # a gain may be as small as refits scatter, and other explanations are held to it
    base = none.fit.log_evidence if far and none is not None and explains(none) else -np.inf

    def arrived() -> bool:
        return any(explains(c) and c.fit.log_evidence > base + ARRIVED_SHARE * score.gain for c in out)

    if effect.smooth or arrived():
        return out
    level = max(problem.path_level, FOLLOWING_FORCE_LEVEL)
    if far:
        usual = first_fit(problem, (effect,), problem.path)
        out = refit_again(problem, (effect,), usual, level, out, notify)
    if not arrived():
        out = refit_again(problem, (effect,), _estimated(problem, bank, score), level, out, notify)
    return out


def sizes_of(
    problem: DiagnosisProblem, candidates: Iterable[RefittedHypothesis]
) -> dict[str, tuple[float, ...]]:
    """Effect without a slope when off -> its parameters in the first candidate that has it, not off.

    Of one without a slope a search from off finds the nearest hill: a rudder late by longer than it moves
    came out as late by nothing beside another effect.
    """
    out: dict[str, tuple[float, ...]] = {}
    for c in candidates:
        for name in c.effects:
            effect = problem.model.effects.get(name)
            if effect is None or effect.smooth or name in out:
                continue
            at = [c.fit.free.names.index(effect.key(p.name)) for p in effect.parameters]
            away = (c.fit.values[at] - c.fit.free.mean[at]) / c.fit.free.sd[at]
            if abs(away[0]) > SECANT_SIZES[0]:  # at off there is no slope to leave it by
                out[name] = tuple(map(float, away))
    return out


def refit_again(
    problem: DiagnosisProblem,
    effects: tuple[Effect, ...],
    start: list[Trajectory],
    initial_noise_scale: float,
    first: list[RefittedHypothesis],
    notify: Notify,
) -> list[RefittedHypothesis]:
    """The better of a first candidate and one begun elsewhere."""
    names = tuple(e.name for e in effects)
    notify(f"refit with {_together(names)} from a second start")
    try:
        second = weighted_hypothesis(
            problem, names, fit_with(problem, effects, start=start, initial_noise_scale=initial_noise_scale)
        )
    except ModelError as exc:
        notify(f"given up: {exc}")
        return first
    return [_better(*first, second)]


def _estimated(problem: DiagnosisProblem, bank: SensitivityBank, score: ScreenScore) -> list[Trajectory]:
    """Points at the screen's posterior mean of coefficients and effect."""
    model = problem.model
    effect = model.effects[score.name]
    prior = effect_prior(model, effect)
    total = bank.total(score.level).pick(bank.columns((score.name,), (score.variant,)))
    z = posterior(total).mean
    par = problem.path[0].par.copy()
    c = problem.coefficients
    par[c.where] = np.clip(c.mean + c.sd * np.clip(z[: bank.n_coef], -3.0, 3.0), c.low, c.high)
    size = float(z[bank.n_coef])
    if effect.dated is not None:
        par[prior.where] = prior.mean + np.array(score.start) * prior.sd
    else:
        size = float(np.clip(size, 0.1, 3.0)) if np.isfinite(prior.low).any() else size
        par[prior.where] = prior.mean + size * prior.sd
    return [replace(point, par=par) for point in problem.path]


def _together(names: tuple[str, ...]) -> str:
    return " + ".join(names).replace("_", " ")


def refit_wide(
    problem: DiagnosisProblem,
    name: str,
    notify: Notify,
    none: RefittedHypothesis | None = None,
    promised: float = np.inf,
) -> list[RefittedHypothesis]:
    """Candidate in which one coefficient may be ten prior standard deviations off, or all of them several.

    Begun as `refit` begins: at the fit without any effect, and kept where it gains what the screen promised.
    """
    notify(f"refit with a wide prior on {name}")
    free = problem.coefficients
    sd = free.sd.copy()
    if name in EVERY:
        sd[: len(problem.stated.names)] *= EVERY[name]
    else:
        sd[free.names.index(name)] *= 10.0
    wide, effects = replace(free, sd=sd), (f"{COEFFICIENT_ERROR}:{name}",)

    follows = none is not None and np.isfinite(promised) and explains(none)

    def fitted(near: bool) -> RefittedHypothesis:
        found = fit(
            problem.model,
            problem.logs,
            wide,
            problem.environment.noise_model,
            start=none.fit.points if near and none is not None else problem.path,
            initial_noise_scale=0.0 if near else max(problem.path_level, FOLLOWING_FORCE_LEVEL),
            iterations=NEAR_ITERATIONS if near else MOST_ITERATIONS,
        )
        return weighted_hypothesis(problem, effects, found)

    return _near_or_anew(fitted, follows, _least(none, promised), notify)


def remainder(problem: DiagnosisProblem, candidate: RefittedHypothesis) -> Localisation:
    """Where the gap lies that a refit leaves."""
    fitted = candidate.fit
    return locate(problem, fitted.followed, fitted.free, masks=False)
