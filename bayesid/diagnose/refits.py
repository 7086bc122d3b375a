"""Refits: of the screen's shortlist, of widened coefficients, and of several effects by forward selection.

Takes a `Problem` and scores. Gives `Candidate`s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bayesid.coloured.evidence import posterior
from bayesid.coloured.fit import Free, fit
from bayesid.coloured.free import effect_prior
from bayesid.coloured.path import Point
from bayesid.diagnose.bank import Bank, Score, build_bank, levels_between, screen
from bayesid.diagnose.candidate import (
    COEFFICIENT_ERROR,
    PATH_NOISE,
    Candidate,
    explains,
    nested,
    standing,
    weighed,
)
from bayesid.diagnose.problem import Problem, fit_with
from bayesid.diagnose.where import Where, locate
from bayesid.effects import Effect
from bayesid.errors import ModelError
from bayesid.model import Model

SHORTLIST = 6
# A further effect must raise the log evidence by this much, and is dropped again if its removal costs less
# than 3.
ADD, DROP, MOST = 5.0, 3.0, 3
Say = Callable[[str], None]


def shortlist(scores: Sequence[Score]) -> list[Score]:
    """Best of the screen: at most `SHORTLIST`, none that a correct screen would put 60 % and 20 nats below
    the best.
    """
    top = scores[0].gain
    return [s for s in scores[:SHORTLIST] if s.gain > min(0.1 * top, top - 20.0) and s.gain > -8.0]


def likely_coefficients(wide: dict[str, float], scores: Sequence[Score]) -> list[str]:
    ranked = sorted(wide, key=lambda n: -wide[n])
    return [n for n in ranked[:2] if wide[n] > max(2.0, 0.05 * scores[0].gain)]


def refit(problem: Problem, effects: tuple[Effect, ...], say: Say) -> list[Candidate]:
    """Candidate of some effects; none where the model cannot follow the data with them at all."""
    names = tuple(e.name for e in effects)
    say("refit with " + " + ".join(names))
    try:
        return [weighed(problem, names, fit_with(problem, effects))]
    except ModelError as exc:
        say(f"given up: {exc}")
        return []


def refit_screened(problem: Problem, bank: Bank, score: Score, say: Say) -> list[Candidate]:
    """Candidate of one screened effect.

    One without a slope when off gets a second start, from the screen's own estimate, where the first does not
    explain the data.
    """
    effect = problem.model.effects[score.name]
    out = refit(problem, (effect,), say)
    if effect.smooth or any(explains(c) for c in out):
        return out
    say(f"refit with {effect.name} from the screen's estimate")
    start = _estimated(problem, bank, score)
    try:
        loud = max(problem.path_level, 1e-5)
        again = weighed(problem, (effect.name,), fit_with(problem, (effect,), start=start, loud=loud))
    except ModelError as exc:
        say(f"given up: {exc}")
        return out
    return [max([*out, again], key=lambda c: (explains(c), c.log_evidence))]


def _estimated(problem: Problem, bank: Bank, score: Score) -> list[Point]:
    """Points at the screen's posterior mean of coefficients and effect."""
    model = problem.model
    prior = effect_prior(model, model.effects[score.name])
    total = bank.total(score.level).pick(bank.columns((score.name,), (score.variant,)))
    z = posterior(total).mean
    par = model.nominal.copy()
    c = problem.coefficients
    par[c.where] = np.maximum(c.mean + c.sd * np.clip(z[: bank.n_coef], -3.0, 3.0), c.low)
    size = float(np.clip(z[bank.n_coef], 0.1, 3.0)) if np.isfinite(prior.low).any() else float(z[bank.n_coef])
    par[prior.where] = prior.mean + size * prior.sd
    return [replace(point, par=par) for point in problem.path]


def refit_wide(problem: Problem, name: str, say: Say) -> list[Candidate]:
    """Candidate in which one coefficient may be ten prior standard deviations off."""
    say(f"refit with a wide prior on {name}")
    free = problem.coefficients
    sd = free.sd.copy()
    sd[free.names.index(name)] *= 10.0
    try:
        fitted = fit(
            problem.model,
            problem.logs,
            replace(free, sd=sd),
            problem.environment.colours,
            start=problem.path,
            loud=max(problem.path_level, 1e-5),
        )
    except ModelError as exc:
        say(f"given up: {exc}")
        return []
    return [weighed(problem, (f"{COEFFICIENT_ERROR}:{name}",), fitted)]


def several(
    problem: Problem, refits: list[Candidate], current: Candidate, effects: list[Effect], say: Say
) -> tuple[list[Candidate], dict[tuple[str, ...], Where]]:
    """Forward selection from the best single effect, then backward: the first one may owe its place to the
    second.

    A step must raise the evidence of the refit where the smaller model explains the data, and the screen's
    otherwise. It must also raise it by more than a free force does: an effect that explains less of a
    remainder than a force that knows nothing only bends towards it. Also returns what was left where this was
    asked.
    """
    left: dict[tuple[str, ...], Where] = {}
    model = problem.model
    while len(current.effects) < MOST:
        chosen = [model.effects[n] for n in current.effects]
        families = {e.family for e in chosen}
        others = [e for e in effects if e.family not in families]
        inside = _joint(model, chosen)
        points = current.fit.points if current.fit.converged else current.fit.follow
        level = 0.0 if current.fit.converged else current.fit.follow_level
        bank = build_bank(problem, points, levels_between(problem, level), others, inside)
        ranked = [s for s in screen(bank)[:3] if s.gain > 0.5 * ADD]
        if not ranked:
            break
        tried = [c for s in ranked for c in refit(problem, (*chosen, model.effects[s.name]), say)]
        if not tried:
            break
        gains = {s.name: s.gain for s in ranked}
        best = max(tried, key=lambda c: standing(c, gains[c.effects[-1]]))
        if explains(current):
            step = _step(problem, best, current)
            if step < ADD:
                break
            left[current.effects] = remainder(problem, current)
            if step < left[current.effects].outside - left[current.effects].base:
                break
        refits = [*tried, *refits]
        current = best
    while len(current.effects) > 1:
        less = []
        for name in current.effects:
            fewer = tuple(model.effects[n] for n in current.effects if n != name)
            known = [c for c in refits if set(c.effects) == {e.name for e in fewer}]
            less += known or refit(problem, fewer, say)
            refits += [c for c in less if c not in refits]
        smaller = max(less, key=lambda c: c.log_evidence, default=None)
        if smaller is None or smaller.log_evidence < current.log_evidence - DROP:
            break
        current = smaller
    return sorted(refits, key=lambda c: -c.log_evidence), left


def remainder(problem: Problem, candidate: Candidate) -> Where:
    """Where the gap lies that a refit leaves."""
    fitted = candidate.fit
    points = fitted.points if fitted.converged else fitted.follow
    return locate(problem, points, fitted.free, masks=False)


def _step(problem: Problem, larger: Candidate, smaller: Candidate) -> float:
    """Gain in log evidence; a small one must also be there along the larger refit's own path."""
    gain = larger.log_evidence - smaller.log_evidence
    return gain if gain > PATH_NOISE else min(gain, nested(problem, larger, smaller.effects))


def _joint(model: Model, effects: Sequence[Effect]) -> Free:
    parts = [effect_prior(model, e) for e in effects]
    out = parts[0]
    for part in parts[1:]:
        out = out + part
    return out
