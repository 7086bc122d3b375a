"""Which effect: refits of a shortlist, probabilities of every hypothesis, several effects at once.

Takes a `Problem`. Gives frozen `Candidates`. Probabilities follow from evidence and stated priors only;
thresholds and
words are the verdict's business.

Priors (design note A4): 0.5 none, 0.4 shared by the catalogue, 0.1 outside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr, logsumexp

from bayesid.coloured.evidence import posterior
from bayesid.coloured.fit import ColouredFit, Free, fit, stack
from bayesid.coloured.free import effect_prior
from bayesid.coloured.levels import REPEATABLE, is_straight
from bayesid.coloured.log import Array
from bayesid.coloured.path import Point
from bayesid.diagnose.bank import (
    Ambiguity,
    Bank,
    Score,
    ambiguity,
    build_bank,
    levels_between,
    screen,
    testable,
    widened,
)
from bayesid.diagnose.problem import Problem, fit_with
from bayesid.diagnose.where import Where, locate
from bayesid.effects import Effect
from bayesid.kernels.layout import names_read

PRIOR_NONE, PRIOR_CATALOGUE, PRIOR_OUTSIDE = 0.5, 0.4, 0.1
COEFFICIENT_ERROR = "coefficient_error"
SHORTLIST = 6
# A further effect must raise the log evidence by this much, and is dropped again if its removal costs less
# than 3.
ADD, DROP, MOST = 5.0, 3.0, 3
# Slack of the check of evidence against the distance of the parameters from zero [nats].
WALD_SLACK = 3.0
# Shifts of the logarithm of a measured environment that are averaged over.
LOUDER = (-0.7, -0.35, 0.0, 0.35, 0.7, 1.05)
Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One refitted hypothesis.

    Attributes
    ----------
    effects : names, empty for none; "coefficient_error:N_r" for a widened coefficient
    log_evidence : Laplace, with ln 2 + ln Phi for one-sided parameters
    fit : ColouredFit
    """

    effects: tuple[str, ...]
    log_evidence: float
    fit: ColouredFit


@dataclass(frozen=True, eq=False)
class Candidates:
    """All hypotheses of a trial.

    Attributes
    ----------
    none : Candidate without effects
    refits : refitted hypotheses, best first
    scores : screen of every effect
    evidence : name -> log evidence over none, for every catalogue name, "outside" and "coefficient_error"
    probabilities : name -> posterior probability, same names and "none"
    bank : Bank the screen used
    ambiguity : Ambiguity
    where, where_after : Where before any effect and after the best one
    """

    none: Candidate
    refits: tuple[Candidate, ...]
    scores: tuple[Score, ...]
    evidence: dict[str, float]
    probabilities: dict[str, float]
    bank: Bank
    ambiguity: Ambiguity
    where: Where
    where_after: Where | None

    @property
    def best(self) -> Candidate:
        """Most probable refit (None if there is none better than no effect)."""
        return self.refits[0] if self.refits else self.none


def corrected_evidence(fitted: ColouredFit) -> float:
    """Laplace evidence with the half-normal correction of one-sided parameters (design note A9)."""
    out = fitted.log_evidence
    z = (fitted.values - fitted.free.mean) / fitted.free.sd
    sd = np.sqrt(np.diag(fitted.posterior.covariance))
    for i in np.flatnonzero(np.isfinite(fitted.free.low)):
        out += float(np.log(2.0) + log_ndtr(z[i] / max(sd[i], 1e-12)))
    return out


def repeatable_bonus(problem: Problem, fitted: ColouredFit) -> float:
    """Gain in log evidence when a measured environment may differ between runs by its own repeatability.

    Averaged over a log-normal factor on all amplitudes; 0 where the environment was stated.
    """
    if problem.environment.source == "stated" or not any(problem.environment.colours.force):
        return 0.0
    logs = np.array(LOUDER)
    weight = -0.5 * (logs / REPEATABLE) ** 2
    weight -= logsumexp(weight)
    values = []
    for shift in logs:
        grams = stack(
            problem.model, fitted.paths, fitted.free, problem.environment.colours.scaled(float(np.exp(shift)))
        )
        values.append(posterior(sum(grams[1:], grams[0])).log_evidence)
    return float(logsumexp(np.array(values) + weight) - fitted.log_evidence)


def weighed(problem: Problem, effects: tuple[str, ...], fitted: ColouredFit) -> Candidate:
    """Candidate with its corrected evidence."""
    return Candidate(effects, corrected_evidence(fitted) + repeatable_bonus(problem, fitted), fitted)


def away_from_straight(problem: Problem, candidate: Candidate, none: Candidate) -> Candidate:
    """Candidate whose evidence for an input effect does not rest on straight runs.

    There a helmsman answers the disturbances: rudder and force are correlated, and a disturbance faster
    than the sampling looks like play or lag (play of 0.016 degrees at +25 nats on a clean campaign).
    """
    model = problem.model
    remembers = any(_remembers(model.effects[n]) for n in candidate.effects if n in model.effects)
    straight = [is_straight(model, log) for log in problem.logs]
    if not remembers or not any(straight) or all(straight):
        return candidate
    gains = []
    for c in (candidate, none):
        kept = [g for g, s in zip(c.fit.grams, straight, strict=True) if not s]
        gains.append(posterior(sum(kept[1:], kept[0])).log_evidence)
    limit = none.log_evidence + gains[0] - gains[1]
    return replace(candidate, log_evidence=min(candidate.log_evidence, float(limit)))


def _remembers(effect: Effect) -> bool:
    """Whether an input effect answers with the past of the command: delay, lag, play or rate."""
    if effect.port != "input":
        return False
    return bool(effect.adjust) or any(stage.delay or "y" in names_read(stage.end) for stage in effect.stages)


def checked(problem: Problem, candidate: Candidate, none: Candidate) -> Candidate:
    """Candidate whose evidence neither rests on straight runs nor exceeds what its parameters can gain."""
    c = away_from_straight(problem, candidate, none)
    if none.fit.converged and not c.effects[0].startswith(COEFFICIENT_ERROR):
        c = replace(c, log_evidence=min(c.log_evidence, none.log_evidence + wald_limit(problem, c.fit)))
    return c


def wald_limit(problem: Problem, fitted: ColouredFit) -> float:
    """Most that effect parameters can have gained: half their squared distance from zero in posterior sd.

    Shape parameters, whose off value is not zero, do not count. Evidence beyond this comes from refits of
    unlike quality, not from the effect.
    """
    k = len(problem.coefficients.names)
    model = problem.model
    where = [
        i
        for i in range(k, len(fitted.free.names))
        if model.effect_off.get(int(fitted.free.where[i]), 0.0) == 0.0
    ]
    if not where:
        return float("inf")
    z = (fitted.values - fitted.free.mean)[where] / fitted.free.sd[where]
    inside = fitted.posterior.covariance[np.ix_(where, where)]
    return 0.5 * float(z @ np.linalg.solve(inside, z)) + WALD_SLACK


def explains(candidate: Candidate) -> bool:
    """Whether a refit arrived and leaves residuals of about the size of the noise."""
    return candidate.fit.converged and candidate.fit.chi2 < 1.5


def standing(candidate: Candidate, gain: float) -> tuple[bool, float]:
    """Rank of a candidate in forward selection.

    Refits that explain the data come first, by evidence. The others are ordered by the screen, which lets a
    free force
    take the rest, so that the first of two effects is not refused for the second's sake.
    """
    done = explains(candidate)
    return done, candidate.log_evidence if done else gain


def compare(problem: Problem, say: Say = lambda text: None) -> Candidates:
    """Screen the catalogue, refit a shortlist, weigh every hypothesis."""
    model = problem.model
    say("fit without any effect")
    base = fit_with(problem, ())
    none = weighed(problem, (), base)
    fine = explains(none)
    follow = list(base.points) if fine else list(problem.path)
    level = 0.0 if fine else problem.path_level
    effects = [e for e in model.kernel.effects if testable(problem, e)]
    say(f"screen {len(effects)} effects from one bank of sensitivities")
    bank = build_bank(problem, follow, levels_between(problem, level), effects)
    scores = screen(bank)
    known = ambiguity(bank)
    say("where the gap lies")
    where = locate(problem, follow, problem.coefficients)
    wide = widened(bank, problem.coefficients.names)
    refits = [_refit(problem, (model.effects[s.name],), say) for s in _shortlist(scores)]
    refits += [_refit_wide(problem, name, base, say) for name in _likely_coefficients(wide, scores)]
    refits = sorted((checked(problem, c, none) for c in refits), key=lambda c: -c.log_evidence)
    after = None
    single = [c for c in refits if not c.effects[0].startswith(COEFFICIENT_ERROR)]
    gains = {s.name: s.gain for s in scores}
    if single:
        first = max(single, key=lambda c: standing(c, gains[c.effects[0]]))
        if (
            (first.log_evidence > none.log_evidence + ADD)
            if explains(first)
            else gains[first.effects[0]] > ADD
        ):
            refits = _several(problem, refits, first, effects, say)
            refits = sorted((checked(problem, c, none) for c in refits), key=lambda c: -c.log_evidence)
    if refits and refits[0].log_evidence > none.log_evidence + ADD:
        say("what the best explanation leaves")
        best = refits[0].fit
        after = locate(problem, best.follow if not best.converged else best.points, best.free, masks=False)
    evidence = _evidence(problem, none, refits, scores, wide, where)
    name = refits[0].effects[0] if refits else ""
    if after is not None and name in evidence and evidence[name] > 0.5 * evidence["outside"]:
        # The effect explains most of it, a free force may take the rest.
        with_rest = after.outside - none.log_evidence + float(np.log(PRIOR_OUTSIDE))
        evidence[name] = float(np.logaddexp(evidence[name], with_rest))
    probability = probabilities(evidence, refits, none)
    return Candidates(none, tuple(refits), tuple(scores), evidence, probability, bank, known, where, after)


def _shortlist(scores: Sequence[Score]) -> list[Score]:
    """Best of the screen: at most `SHORTLIST`, none that a correct screen would put 60 % and 20 nats below
    the best.
    """
    top = scores[0].gain
    return [s for s in scores[:SHORTLIST] if s.gain > min(0.1 * top, top - 20.0) and s.gain > -8.0]


def _likely_coefficients(wide: dict[str, float], scores: Sequence[Score]) -> list[str]:
    ranked = sorted(wide, key=lambda n: -wide[n])
    return [n for n in ranked[:2] if wide[n] > max(2.0, 0.05 * scores[0].gain)]


def _refit(
    problem: Problem, effects: tuple[Effect, ...], say: Say, start: list[Point] | None = None
) -> Candidate:
    say("refit with " + " + ".join(e.name for e in effects))
    fitted = fit_with(problem, effects, start=start)
    return weighed(problem, tuple(e.name for e in effects), fitted)


def _refit_wide(problem: Problem, name: str, base: ColouredFit, say: Say) -> Candidate:
    say(f"refit with a wide prior on {name}")
    free = problem.coefficients
    sd = free.sd.copy()
    sd[free.names.index(name)] *= 10.0
    fitted = fit(
        problem.model,
        problem.logs,
        replace(free, sd=sd),
        problem.environment.colours,
        start=problem.path,
        loud=max(problem.path_level, 1e-5),
    )
    return weighed(problem, (f"{COEFFICIENT_ERROR}:{name}",), fitted)


def _several(
    problem: Problem, refits: list[Candidate], current: Candidate, effects: list[Effect], say: Say
) -> list[Candidate]:
    """Forward selection from the best single effect, then backward.

    A step must raise the evidence of the refit where the smaller model explains the data, and the screen's
    otherwise.
    """
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
        tried = [_refit(problem, (*chosen, model.effects[s.name]), say) for s in ranked]
        gains = {s.name: s.gain for s in ranked}
        best = max(tried, key=lambda c: standing(c, gains[c.effects[-1]]))
        if explains(current) and best.log_evidence < current.log_evidence + ADD:
            break
        refits = [best, *refits]
        current = best
    if len(current.effects) > 2:
        for name in current.effects:
            fewer = tuple(model.effects[n] for n in current.effects if n != name)
            smaller = _refit(problem, fewer, say)
            refits.append(smaller)
            if smaller.log_evidence > current.log_evidence - DROP:
                current = smaller
                break
    return sorted(refits, key=lambda c: -c.log_evidence)


def _joint(model: object, effects: Sequence[Effect]) -> Free:
    parts = [effect_prior(model, e) for e in effects]  # type: ignore[arg-type]
    out = parts[0]
    for part in parts[1:]:
        out = out + part
    return out


def _evidence(
    problem: Problem,
    none: Candidate,
    refits: Sequence[Candidate],
    scores: Sequence[Score],
    wide: dict[str, float],
    where: Where,
) -> dict[str, float]:
    """Log evidence over none of every name; effects that were not refitted keep their screen, capped by
    the refits.
    """
    out: dict[str, float] = {}
    # Two linearisations of no effect. The worse one must not speak for "outside", nor for a refit that itself
    # did not arrive: both are then measured against the better.
    zero = max(none.log_evidence, where.base)
    refitted = {
        c.effects[0]: c.log_evidence - (none.log_evidence if explains(c) else zero)
        for c in refits
        if len(c.effects) == 1
    }
    floor = min(refitted.values()) if refitted else 0.0
    for score in scores:
        out[score.name] = refitted.get(score.name, min(score.gain, floor))
    for effect in problem.model.kernel.effects:
        out.setdefault(effect.name, 0.0 if testable(problem, effect) else -np.inf)
    prefix = f"{COEFFICIENT_ERROR}:"
    wide = {n: refitted.get(prefix + n, min(v, floor if refitted else v)) for n, v in wide.items()}
    out[COEFFICIENT_ERROR] = float(logsumexp(list(wide.values())) - np.log(max(len(wide), 1)))
    out["outside"] = where.outside - zero
    return out


def probabilities(
    evidence: dict[str, float], refits: Sequence[Candidate], none: Candidate
) -> dict[str, float]:
    """Posterior probability of none, every catalogue name, coefficient_error and outside.

    The mass of several effects at once is shared by them; every further effect pays the catalogue's prior
    again.
    """
    names = [n for n in evidence if n != "outside"]
    each = float(np.log(PRIOR_CATALOGUE / len(names)))
    joint: dict[tuple[str, ...], float] = {(n,): each + evidence[n] for n in names}
    joint[("outside",)] = float(np.log(PRIOR_OUTSIDE)) + evidence["outside"]
    joint[("none",)] = float(np.log(PRIOR_NONE))
    for c in refits:
        if len(c.effects) > 1:
            key = tuple(sorted(c.effects))
            joint[key] = max(joint.get(key, -np.inf), len(key) * each + c.log_evidence - none.log_evidence)
    total = logsumexp(list(joint.values()))
    out = dict.fromkeys([*names, "outside", "none"], 0.0)
    for key, value in joint.items():
        for n in key:
            out[n] += float(np.exp(value - total)) / len(key)
    return out


def credible_set(probability: dict[str, float], mass: float = 0.95) -> tuple[str, ...]:
    """Smallest set of names that holds the mass, most probable first."""
    out, total = [], 0.0
    for name in sorted(probability, key=lambda n: -probability[n]):
        out.append(name)
        total += probability[name]
        if total >= mass:
            break
    return tuple(out)


def parameter_table(fitted: ColouredFit, problem: Problem) -> dict[str, tuple[float, float]]:
    """Effect parameters of a fit: name -> (value, sd) in SI."""
    k = len(problem.coefficients.names)
    return {
        n: (float(v), float(s))
        for n, v, s in zip(fitted.free.names[k:], fitted.values[k:], fitted.sd[k:], strict=True)
    }


def pulls(fitted: ColouredFit, problem: Problem) -> Array:
    """(coefficients,) departure of the coefficients from their prior mean, in prior sd."""
    k = len(problem.coefficients.names)
    return (fitted.values[:k] - fitted.free.mean[:k]) / fitted.free.sd[:k]
