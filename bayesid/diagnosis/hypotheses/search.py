"""Several effects at once: forward selection, exchange of alike effects, and back.

Takes a `DiagnosisProblem` and the refits of single effects. Gives `RefittedHypothesis`s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.data.problem import FOLLOWING_FORCE_LEVEL, DiagnosisProblem, first_fit
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains, nested, standing
from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.hypotheses.refit import refit, refit_again, remainder, sizes_of
from bayesid.diagnosis.hypotheses.sensitivity_bank import (
    Isolability,
    ScreenScore,
    build_bank,
    levels_between,
    screen,
)
from bayesid.diagnosis.threshold_table import (
    ADD_EVIDENCE,
    DROP_EVIDENCE,
    LEAST_FREE_SIGNAL_SHARE,
    LINEARISATION_SCATTER,
    MOST_EFFECTS,
    MOST_EXCHANGES,
    RIVALS_TRIED,
)
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.model.effects import Effect

Notify = Callable[[str], None]


def search_several(
    problem: DiagnosisProblem,
    refits: list[RefittedHypothesis],
    current: RefittedHypothesis,
    effects: list[Effect],
    alike: Isolability,
    notify: Notify,
    left: Mapping[tuple[str, ...], Localisation] | None = None,
) -> tuple[list[RefittedHypothesis], dict[tuple[str, ...], Localisation]]:
    """Forward selection from the best single effect, or what is known to be better, then backward: the first
    one may owe its place to the second.

    A step must raise the evidence of the refit where the smaller model explains the data, and the screen's
    otherwise. It must also raise it by half as much as a free force does: an effect that explains less of a
    remainder only bends towards it. Not by as much: a free force is linear about one path, the refit has its
    own. Also returns what was left where this was asked.

    Parameters
    ----------
    alike : whose rivals take an effect's place in pairs. Beside the wrong one of two alike effects the second
        cause is not found, or not in its full size. So in triples where no pair follows the readings: the
        first two were chosen without a fit that does.
    left : what some explanations leave, where it is known
    """
    left = dict(left or {})
    model = problem.model
    if len(current.effects) > 1:
        # best elsewhere, where two may have stood for one that is better here
        refits, current = _exchanged(problem, refits, current, alike, notify)
    while len(current.effects) < MOST_EFFECTS:
        chosen = [model.effects[n] for n in current.effects]
        ranked = [s for s in gains_beside(problem, current, effects)[:3] if s.gain > 0.5 * ADD_EVIDENCE]
        if not ranked:
            break
        tried = [
            c
            for s in ranked
            for c in _beside(problem, refits, (*chosen, model.effects[s.name]), notify, s, current)
        ]
        if not tried:
            break
        gains = {s.name: s.gain for s in ranked}
        best = max(tried, key=lambda c: standing(c, gains[c.effects[-1]]))
        if explains(current):
            step = _step(problem, best, current)
            if step < ADD_EVIDENCE:
                break
            if current.effects not in left:
                left[current.effects] = remainder(problem, current)
            if step < LEAST_FREE_SIGNAL_SHARE * (left[current.effects].outside - left[current.effects].base):
                break
        refits, followed = [*tried, *refits], explains(current)
        current = best
        if len(current.effects) == 2 or not followed:
            refits, current = _exchanged(problem, refits, current, alike, notify)
    while len(current.effects) > 1:
        less = _one_less(problem, refits, current, notify)
        refits += [c for c in less if c not in refits]
        smaller = max(less, key=lambda c: c.log_evidence, default=None)
        if smaller is None or smaller.log_evidence < current.log_evidence - DROP_EVIDENCE:
            break
        current = smaller
    return sorted(refits, key=lambda c: -c.log_evidence), left


def _one_less(
    problem: DiagnosisProblem,
    refits: Sequence[RefittedHypothesis],
    current: RefittedHypothesis,
    notify: Notify,
) -> list[RefittedHypothesis]:
    """Refits of an explanation without each of its effects in turn, known ones as they are."""
    less = []
    for name in current.effects:
        fewer = tuple(problem.model.effects[n] for n in current.effects if n != name)
        known = [c for c in refits if set(c.effects) == {e.name for e in fewer}]
        found = known or refit(problem, fewer, notify, sizes_of(problem, [current]))
        if explains(current) and not any(explains(c) for c in found):
            # a smaller truth beside which the search went astray arrives from the larger one
            start = _switched_off(problem, current, fewer)
            found = refit_again(problem, fewer, start, FOLLOWING_FORCE_LEVEL, found, notify)
        less += found
    return less


def gains_beside(
    problem: DiagnosisProblem, current: RefittedHypothesis, effects: Sequence[Effect]
) -> list[ScreenScore]:
    """Screen of one more effect of another family beside those of a refit, along its path, best first."""
    chosen = [problem.model.effects[n] for n in current.effects]
    families = {e.family for e in chosen}
    others = [e for e in effects if e.family not in families]
    points = current.fit.followed
    level = 0.0 if current.fit.converged else current.fit.path_force_level
    levels = levels_between(problem, level)
    return screen(build_bank(problem, points, levels, others, _joint(problem.model, chosen)))


def _exchanged(
    problem: DiagnosisProblem,
    refits: list[RefittedHypothesis],
    current: RefittedHypothesis,
    alike: Isolability,
    notify: Notify,
) -> tuple[list[RefittedHypothesis], RefittedHypothesis]:
    """Each of several effects replaced by those like it, as long as the data gain by it."""
    model = problem.model
    asked = {frozenset(c.effects) for c in refits}
    for _ in range(int(MOST_EXCHANGES)):
        found: list[RefittedHypothesis] = []
        for name in current.effects:
            others = tuple(n for n in current.effects if n != name)
            taken = {model.effects[n].family for n in others}
            for rival in alike.rivals(name)[: int(RIVALS_TRIED)]:
                key = frozenset((*others, rival))
                if model.effects[rival].family not in taken and key not in asked:
                    asked.add(key)
                    both = tuple(model.effects[n] for n in (*others, rival))
                    found += _beside(problem, refits, both, notify)
        refits = [*found, *refits]
        best = max((c for c in found if explains(c)), key=lambda c: c.log_evidence, default=None)
        if best is None or (explains(current) and best.log_evidence <= current.log_evidence):
            break
        current = best
    return refits, current


def _switched_off(
    problem: DiagnosisProblem, larger: RefittedHypothesis, fewer: Sequence[Effect]
) -> list[Trajectory]:
    """Points of a refit with those of its effects as the vehicle states them that are not among `fewer`."""
    effects, out = problem.model.effects, []
    for point in larger.fit.points:
        par = point.par.copy()
        for name in set(larger.effects) - {e.name for e in fewer}:
            for p in effects[name].parameters:
                at = problem.model.index[effects[name].key(p.name)]
                par[at] = problem.model.nominal[at]
        out.append(replace(point, par=par))
    return out


def _beside(
    problem: DiagnosisProblem,
    refits: Sequence[RefittedHypothesis],
    effects: tuple[Effect, ...],
    notify: Notify,
    score: ScreenScore | None = None,
    screened_at: RefittedHypothesis | None = None,
) -> list[RefittedHypothesis]:
    """Candidate of several effects; a second start from a part that explains the data where the first does
    not.

    Effects without a slope when off begin at the size they have alone, or else in the best set that has them;
    one that was only screened, where its screen points.

    Parameters
    ----------
    score, screened_at : screen of the last effect, and the refit along whose path it was
    """
    names = {e.name for e in effects}
    sizes = sizes_of(problem, sorted(refits, key=lambda c: (len(c.effects), -c.log_evidence)))
    if score is not None and not problem.model.effects[score.name].smooth:
        sizes.setdefault(score.name, score.start)
    promised = np.inf if score is None else score.gain
    out = refit(problem, effects, notify, sizes, screened_at, promised)
    part = [c for c in refits if set(c.effects) < names and explains(c)]
    if not part or any(explains(c) for c in out):
        return out
    smaller = max(part, key=lambda c: c.log_evidence)
    more = tuple(e for e in effects if e.name not in smaller.effects)
    return refit_again(
        problem, effects, first_fit(problem, more, smaller.fit.points), FOLLOWING_FORCE_LEVEL, out, notify
    )


def _step(problem: DiagnosisProblem, larger: RefittedHypothesis, smaller: RefittedHypothesis) -> float:
    """Gain in log evidence; a small one must also be there along the larger refit's own path."""
    gain = larger.log_evidence - smaller.log_evidence
    return gain if gain > LINEARISATION_SCATTER else min(gain, nested(problem, larger, smaller.effects))


def _joint(model: Model, effects: Sequence[Effect]) -> GaussianPrior:
    parts = [effect_prior(model, e) for e in effects]
    out = parts[0]
    for part in parts[1:]:
        out = out + part
    return out


def in_plainer_form(
    problem: DiagnosisProblem,
    refits: Sequence[RefittedHypothesis],
    effects: Sequence[Effect],
    notify: Notify,
) -> list[RefittedHypothesis]:
    """Refits of the best explanation with one of its effects in a plainer form, where that was not tried.

    The step that chose the richer form may have gained nothing by it, and what was added later was added
    beside it alone: of a current that does not change "changes on the way" would stand in the headline.

    Parameters
    ----------
    refits : best first
    effects : those that can show in this trial
    """
    best, known = refits[0], problem.model.effects
    if best.widens or not explains(best):
        return []
    tried, out = {frozenset(c.effects) for c in refits}, []
    for name in best.effects:
        for plain in (e for e in effects if e.family == known[name].family and e.name not in best.effects):
            fewer = tuple(plain.name if n == name else n for n in best.effects)
            if frozenset(fewer) in tried or not _plainer(known, fewer, best.effects):
                continue
            kept = [
                replace(p, par=_in_place(problem.model, p.par, plain, known[name])) for p in best.fit.points
            ]
            chosen = tuple(known[n] for n in fewer)
            out += refit_again(problem, chosen, kept, FOLLOWING_FORCE_LEVEL, [], notify)
    return out


def _in_place(model: Model, par: np.ndarray, plain: Effect, rich: Effect) -> np.ndarray:
    """Parameters with a plainer form at the values of a richer one, which is off."""
    out = par.copy()
    for p in plain.parameters:
        out[model.index[plain.key(p.name)]] = par[model.index[rich.key(p.name)]]
    off = [model.index[rich.key(p.name)] for p in rich.parameters]
    out[off] = model.nominal[off]
    return out


def plainest_first(
    effects: Mapping[str, Effect], refits: Sequence[RefittedHypothesis]
) -> list[RefittedHypothesis]:
    """Refits with the plainer form of the best explanation in front, where what the richer one has more is
    worth less than odds of 20 to 1: a current that does not change, in place of one that changes by nothing.

    Parameters
    ----------
    refits : best first
    """
    out = list(refits)
    for c in out[1:]:
        if c.log_evidence < out[0].log_evidence - DROP_EVIDENCE:
            break
        if not c.widens and explains(c) and _plainer(effects, c.effects, out[0].effects):
            return [c, *(x for x in out if x is not c)]
    return out


def _plainer(effects: Mapping[str, Effect], fewer: Sequence[str], more: Sequence[str]) -> bool:
    """Whether the effects are the same but for some that have fewer of the parameters of their family."""

    def parts(name: str) -> frozenset[str]:
        return frozenset(p.name for p in effects[name].parameters)

    lost, gained = set(more) - set(fewer), set(fewer) - set(more)
    partner = {effects[n].family: n for n in gained if n in effects}
    return (
        {*fewer, *more} <= set(effects)
        and len(fewer) == len(more) == len(set(more))
        and bool(lost)
        and len(partner) == len(lost) == len(gained)
        and all(effects[n].family in partner and parts(partner[effects[n].family]) < parts(n) for n in lost)
    )
