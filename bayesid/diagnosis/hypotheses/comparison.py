"""Which effect: screen, refits of a shortlist, several effects at once, probabilities of every hypothesis.

Takes a `DiagnosisProblem`. Gives frozen `HypothesisComparison`. Probabilities follow from evidence and
stated priors only; thresholds and words are the verdict's business.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from bayesid.diagnosis.data.problem import (
    FOLLOWING_FORCE_LEVEL,
    DiagnosisProblem,
    fit_with,
    fit_without,
)
from bayesid.diagnosis.evidences import effect_first, evidences
from bayesid.diagnosis.hypotheses.candidate import (
    COEFFICIENT_ERROR,
    RefittedHypothesis,
    checked,
    explains,
    standing,
    weighted_hypothesis,
)
from bayesid.diagnosis.hypotheses.cross_validation import excess_where_apart, left_out
from bayesid.diagnosis.hypotheses.form_part import axes_of, beyond, form_gain
from bayesid.diagnosis.hypotheses.kinematic import by_kinematics, readable
from bayesid.diagnosis.hypotheses.localisation import Localisation, locate, tried
from bayesid.diagnosis.hypotheses.moved_coefficients import (
    StandsFor,
    certainly_wrong,
    explained_by,
    standing_for,
)
from bayesid.diagnosis.hypotheses.probabilities import NO_ERROR, FormError, Remainder, probabilities
from bayesid.diagnosis.hypotheses.refit import (
    likely_coefficients,
    refit_again,
    refit_screened,
    refit_wide,
    remainder,
    shortlist,
)
from bayesid.diagnosis.hypotheses.search import in_plainer_form, plainest_first, search_several
from bayesid.diagnosis.hypotheses.sensitivity_bank import (
    Isolability,
    ScreenScore,
    SensitivityBank,
    build_bank,
    isolability,
    levels_between,
    screen,
    testable,
    widened,
)
from bayesid.diagnosis.hypotheses.thresholds import Thresholds, thresholds
from bayesid.diagnosis.hypotheses.unusual_sizes import cost_of_sizes
from bayesid.diagnosis.threshold_table import (
    ADD_EVIDENCE,
    FORM_LEAVES,
    LEAST_FREE_SIGNAL_SHARE,
    LINEARISATION_SCATTER,
    NOT_FOLLOWING_CHI2,
    PRIOR_CONFLICT,
    REMAINDER_EVIDENCE,
)
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.parameters import effect_prior
from bayesid.model.effects import Effect

Notify = Callable[[str], None]
# Most effects looked at beside the shortlist.
MOST_RIVALS = 6


@dataclass(frozen=True, eq=False)
class HypothesisComparison:
    """All hypotheses of a trial.

    Attributes
    ----------
    none : RefittedHypothesis without effects
    refits : refitted hypotheses, best first, but for an effect before a less probable coefficient
        (`effect_first`) and a plainer form of the best (`plainest_first`)
    scores : screen of every effect
    evidence : name -> log evidence over none, for every catalogue name, "outside" and "coefficient_error"
    probabilities : name -> posterior probability, same names and "none"
    inside : name -> probability that it acts, alone or with others
    bank : SensitivityBank the screen used
    ambiguity : Isolability
    where, where_after : Localisation before any effect and after the best one
    thresholds : Thresholds of this design
    carried, carried_beside : log evidence the model form is worth without an effect, and beside the best
    form_instead : what a form would gain in place of those effects of the best that depend on the motion
        alone, where the runs ask for either [nats]; infinite where they do not, or have a form
    form_seen : what a form that is not taken gains beside the best [nats]; the refits do not bear it out, or
        it is too little
    error : how far evidence between causes holds where the equations lack a form
    sets : names that act together, sorted -> probability of exactly these
    off, stand : effects that stand for coefficients certainly off, without any effect and beside the best
    within : those that stand beside the best for coefficients within what was stated
    """

    none: RefittedHypothesis
    refits: tuple[RefittedHypothesis, ...]
    scores: tuple[ScreenScore, ...]
    evidence: dict[str, float]
    probabilities: dict[str, float]
    inside: dict[str, float]
    bank: SensitivityBank
    ambiguity: Isolability
    where: Localisation
    where_after: Localisation | None
    thresholds: Thresholds
    carried: float = 0.0
    carried_beside: float = 0.0
    form_instead: float = np.inf
    form_seen: float = 0.0
    error: FormError = NO_ERROR
    sets: Mapping[tuple[str, ...], float] = field(default_factory=dict)
    off: tuple[StandsFor, ...] = ()
    stand: tuple[StandsFor, ...] = ()
    within: tuple[StandsFor, ...] = ()

    @property
    def best(self) -> RefittedHypothesis:
        """First of the refits; no effect where nothing was refitted."""
        return self.refits[0] if self.refits else self.none


@dataclass(frozen=True, eq=False)
class SingleEffects:
    """What is known of a trial before effects are joined.

    Attributes
    ----------
    none : without effects
    refits : one effect or wider coefficients each, best first
    effects : those that can show in this trial
    scores, bank, ambiguity, thresholds : as in `HypothesisComparison`
    points : along which the gap is located where nothing else is known of it
    wide : coefficient -> gain in log evidence under a wider prior
    """

    none: RefittedHypothesis
    refits: tuple[RefittedHypothesis, ...]
    effects: tuple[Effect, ...]
    scores: tuple[ScreenScore, ...]
    bank: SensitivityBank
    ambiguity: Isolability
    thresholds: Thresholds
    points: tuple[Trajectory, ...]
    wide: dict[str, float]

    @property
    def gains(self) -> dict[str, float]:
        """Effect -> gain of the screen."""
        return {s.name: s.gain for s in self.scores}

    @property
    def leading(self) -> RefittedHypothesis:
        """Best single effect where it gains, no effect otherwise."""
        single, gains = [c for c in self.refits if not c.widens], self.gains
        if not single:
            return self.none
        first = max(single, key=lambda c: standing(c, gains[c.effects[0]]))
        gain = first.log_evidence - self.none.log_evidence if explains(first) else gains[first.effects[0]]
        return first if gain > ADD_EVIDENCE else self.none


def compare(
    problem: DiagnosisProblem,
    notify: Notify = lambda text: None,
    seed: int = 0,
    base: FilterErrorFit | None = None,
    known: SingleEffects | None = None,
    earlier: RefittedHypothesis | None = None,
) -> HypothesisComparison:
    """Screen the catalogue, refit a shortlist, weigh every hypothesis; `seed` draws the thresholds.

    Parameters
    ----------
    base : the fit without any effect, if it is there already (`exclusions.compare_without`)
    known : single effects of the problem without a form, from which refits begin anew that have not arrived
    earlier : best explanation in another environment (`weigh`)
    """
    single = single_effects(problem, notify, seed, base)
    if known is not None:
        single = _arrived(problem, single, known, notify)
    return weigh(problem, single, notify, earlier=earlier)


def single_effects(
    problem: DiagnosisProblem,
    notify: Notify = lambda text: None,
    seed: int = 0,
    base: FilterErrorFit | None = None,
) -> SingleEffects:
    """Screen of the catalogue and refits of a shortlist, one effect or wider coefficients each."""
    model = problem.model
    if base is None:
        notify("fit without any effect")
        base = fit_without(problem)
    none = weighted_hypothesis(problem, (), base)
    fine = explains(none)
    points = list(base.points) if fine else list(problem.path)
    level = 0.0 if fine else problem.path_level
    effects = [e for e in model.kernel.effects if testable(problem, e)]
    notify(f"screen {len(effects)} effects from one bank of sensitivities")
    bank = build_bank(problem, points, levels_between(problem, level), effects)
    scores = screen(bank)
    known = isolability(bank)
    limits = thresholds(bank, tried(problem), seed)
    wide = widened(bank, problem.stated.names)
    first = shortlist(scores)
    refits = [c for s in first for c in refit_screened(problem, bank, s, notify, none)]
    refits += [
        c
        for name in likely_coefficients(wide, scores)
        for c in refit_wide(problem, name, notify, none, wide[name])
    ]
    none = _second_start(problem, none, refits, notify)
    gains = {s.name: s.gain for s in scores}
    ranked = _ranked(problem, refits, none, gains)
    if more := _rivals(problem, bank, [s for s in scores if s not in first], ranked, none, notify):
        ranked = _ranked(problem, [*ranked, *more], none, gains)
    return SingleEffects(
        none, ranked, tuple(effects), tuple(scores), bank, known, limits, tuple(points), wide
    )


def _rivals(
    problem: DiagnosisProblem,
    bank: SensitivityBank,
    screened: Sequence[ScreenScore],
    refits: Sequence[RefittedHypothesis],
    none: RefittedHypothesis,
    notify: Notify,
) -> list[RefittedHypothesis]:
    """Refits of effects that the screen puts no lower than the refits that explain the data, where these lie
    so close together that any of them may be meant. Not refitted they would claim as much as the least of
    those does (`evidences`): three of them took 7 % from a rudder offset 153 times as large as the gap.

    Parameters
    ----------
    screened : effects that were not refitted, best first
    """
    out: list[RefittedHypothesis] = []
    for score in screened[:MOST_RIVALS]:
        sound = [c.log_evidence for c in (*refits, *out) if explains(c)]
        if not sound or min(sound) < max(sound) - LINEARISATION_SCATTER:
            break
        if none.log_evidence + score.gain >= min(sound):
            out += refit_screened(problem, bank, score, notify, none)
    return out


def weigh(
    problem: DiagnosisProblem,
    single: SingleEffects,
    notify: Notify = lambda text: None,
    left: Mapping[tuple[str, ...], Localisation] | None = None,
    earlier: RefittedHypothesis | None = None,
) -> HypothesisComparison:
    """Several effects at once, what the best explanation leaves, and the probability of every hypothesis.

    Parameters
    ----------
    left : what some explanations leave, where it is known; of () without any effect
    earlier : best explanation in another environment: several effects are looked for from there where that
        is better in this one than the best single effect. Not tried, a pair was lost with the environment it
        had been found in.
    """
    none, scores, limits = single.none, single.scores, single.thresholds
    refits, gains = list(single.refits), single.gains
    after, left = None, dict(left or {})
    where = left[()] if () in left else without_effects(problem, single, notify)
    first = single.leading
    if earlier is not None and (also := _tried_again(problem, single, earlier, notify)) is not None:
        refits = [also, *refits]
        if also.log_evidence > first.log_evidence:
            first = also
    if first.effects:
        found, left = search_several(
            problem, refits, first, list(single.effects), single.ambiguity, notify, left
        )
        refits = list(_ranked(problem, found, none, gains))
    refits = effect_first(refits, single.wide, none.log_evidence + limits.named)
    if refits and not refits[0].widens:
        if plainer := in_plainer_form(problem, refits, single.effects, notify):
            refits = list(_ranked(problem, [*refits, *plainer], none, gains))
        refits = plainest_first({e.name: e for e in single.effects}, refits)
    if refits and refits[0].log_evidence > none.log_evidence + ADD_EVIDENCE:
        notify("what the best explanation leaves")
        after = left.get(refits[0].effects) or remainder(problem, refits[0])
    evidence = evidences(problem, none, refits, scores, single.wide, where)
    best = refits[0] if refits and refits[0].log_evidence > none.log_evidence else none
    carried, beside = form_gain(problem, none), form_gain(problem, best)
    # what a form leaves may be as large as what it carries; only the rest speaks for another cause
    evidence["outside"] = beyond(evidence["outside"], carried)
    rest = {k: beyond(v, beside) for k, v in _rests(refits, after).items()}
    excess = _excess(refits, none, len(problem.coefficients.names), evidence["outside"])
    left_by = Remainder(rest)
    if after is not None:
        shows = excess > 1.0 or beyond(after.places[0].evidence, beside) > limits.remainder
        # beside a form, evidence compares without it: what does not follow is held to what it gains as itself
        astray = problem.form is not None or refits[0].fit.chi2 > NOT_FOLLOWING_CHI2
        share = (
            1.0 if astray else after.places[0].evidence / max(where.places[0].evidence, REMAINDER_EVIDENCE)
        )
        left_by = Remainder(rest, shows, share, where.kept(after))
    places = {e.name: e.where for e in single.effects}
    least = max(PRIOR_CONFLICT, limits.conflict)
    off = standing_for(problem, single.bank, none.fit, FORM_LEAVES * carried, least)
    shown, leaves = (none, carried) if best.widens else (best, beside)
    alike = standing_for(problem, single.bank, shown.fit, FORM_LEAVES * leaves, 0.0)
    stand = tuple(s for s in alike if s.moved >= least)
    error = _form_error(problem, best, refits, beside, off, list(single.wide), least)
    weights = probabilities(evidence, refits, none, where, excess, left_by, places, error)
    return HypothesisComparison(
        none,
        tuple(refits),
        scores,
        evidence,
        weights.shared,
        weights.inside,
        single.bank,
        single.ambiguity,
        where,
        after,
        limits,
        carried,
        beside,
        error=error,
        sets=weights.sets,
        off=off,
        stand=stand,
        within=tuple(s for s in alike if s.moved < least),
    )


def without_effects(
    problem: DiagnosisProblem, single: SingleEffects, notify: Notify = lambda text: None
) -> Localisation:
    """Where the gap lies before any effect."""
    notify("where the gap lies")
    return locate(problem, single.points, problem.coefficients)


def _arrived(
    problem: DiagnosisProblem, single: SingleEffects, known: SingleEffects, notify: Notify
) -> SingleEffects:
    """Single effects with a form, begun once more from where they ended without one where that was better by
    more than refits scatter, or where the best of them was not tried: a form may be nought.
    """
    ended = {c.effects: c for c in known.refits if explains(c) and not c.widens}

    def again(before: RefittedHypothesis, first: list[RefittedHypothesis]) -> list[RefittedHypothesis]:
        effects, points = tuple(problem.model.effects[n] for n in before.effects), before.fit.points
        start = list(points if problem.form is None else problem.swinging(points, problem.form, 0.0))
        return refit_again(problem, effects, start, FOLLOWING_FORCE_LEVEL, first, notify)

    refits = []
    for c in single.refits:
        before = ended.get(c.effects)
        worse = before is not None and c.log_evidence < before.log_evidence - LINEARISATION_SCATTER
        refits += again(before, [c]) if before is not None and worse else [c]
    best, tried = known.leading, {c.effects for c in single.refits}
    # what is part of the form is no effect beside it
    if best.effects in ended and best.effects not in tried and set(best.effects) <= set(single.gains):
        refits += again(best, [])
    return replace(single, refits=_ranked(problem, refits, single.none, single.gains))


def _tried_again(
    problem: DiagnosisProblem, single: SingleEffects, earlier: RefittedHypothesis, notify: Notify
) -> RefittedHypothesis | None:
    """An explanation that was the best elsewhere, begun where it ended; nothing where it is there already, is
    none of this problem or does not follow the data.
    """
    wanted, tried = set(earlier.effects), [set(c.effects) for c in single.refits]
    if earlier.widens or not wanted or wanted in tried or not wanted <= {e.name for e in single.effects}:
        return None
    effects = tuple(problem.model.effects[n] for n in earlier.effects)
    free = problem.coefficients
    for effect in effects:
        free = free + effect_prior(problem.model, effect)
    # what is not free here, as a form that is not asked for, is as the vehicle has it
    par = problem.path[0].par.copy()
    par[free.where] = earlier.fit.points[0].par[free.where]
    start = [replace(point, par=par) for point in earlier.fit.points]
    found = refit_again(problem, effects, start, FOLLOWING_FORCE_LEVEL, [], notify)
    return next((c for c in found if explains(c)), None)


def _ranked(
    problem: DiagnosisProblem,
    refits: Sequence[RefittedHypothesis],
    none: RefittedHypothesis,
    gains: Mapping[str, float],
) -> tuple[RefittedHypothesis, ...]:
    """Refits by the evidence they may claim, best first."""
    return tuple(sorted((checked(problem, c, none, gains) for c in refits), key=lambda c: -c.log_evidence))


def _form_error(
    problem: DiagnosisProblem,
    best: RefittedHypothesis,
    refits: Sequence[RefittedHypothesis],
    beside: float,
    off: Sequence[StandsFor],
    wide: Sequence[str],
    least: float,
) -> FormError:
    """How far evidence between these refits holds, by what the form is worth beside the best of them.

    Parameters
    ----------
    off : effects that stand for coefficients certainly off
    wide : names of what was tried with a wider prior
    least : normal deviate from which on a coefficient is further off than stated
    """
    if beside <= 0.0:
        return NO_ERROR
    causes = [c for c in refits if not c.widens]
    sets = [(), *(c.effects for c in causes)]
    axes = {n: axes_of(problem, n) for key in sets for n in key}
    certain = {s.effect: s.certain for s in off}
    alone: dict[tuple[str, ...], float] = {(n,): v for n, v in certain.items()}
    alone[(COEFFICIENT_ERROR,)] = certainly_wrong(off, wide)
    by_run: dict[tuple[str, ...], np.ndarray] = {}
    costs: dict[tuple[str, ...], float] = {}
    for c in sorted((c for c in causes if explains(c)), key=lambda c: c.log_evidence):
        key = tuple(sorted(c.effects))
        straight = max(sum(certain.get(n, 0.0) for n in key), explained_by(off, c.fit, least))
        sensors_of = by_kinematics(problem, c)
        kept = sensors_of.evidence + straight
        alone[key] = max(alone.get(key, 0.0), kept)
        by_run[key] = left_out(c.fit.equations)
        costs[key] = cost_of_sizes(problem, c, sensors_of)
    sensors = frozenset(e.name for e in problem.model.kernel.effects if readable(problem, e, {}))
    whole = FormError(FORM_LEAVES * beside, alone, sensors, axes, by_run=by_run, costs=costs)
    asked = {whole.apart(one, other) for one, other in combinations(sets, 2)} - {None}
    return replace(whole, parts={a: FORM_LEAVES * form_gain(problem, best, a) for a in asked if a})


def _rests(refits: Sequence[RefittedHypothesis], after: Localisation | None) -> dict[tuple[str, ...], float]:
    """What a free force adds to the best explanation, and to those that it cannot tell from it."""
    if after is None or refits[0].widens:
        return {}
    more = after.outside - after.base
    near = [
        c for c in refits if c.log_evidence > refits[0].log_evidence - LINEARISATION_SCATTER and not c.widens
    ]
    return {c.effects: more for c in near if len(c.effects) == len(refits[0].effects)}


def _second_start(
    problem: DiagnosisProblem, none: RefittedHypothesis, refits: Sequence[RefittedHypothesis], notify: Notify
) -> RefittedHypothesis:
    """No effect fitted once more from where a refit explains the data, if its first start did not arrive."""
    done = [c for c in refits if explains(c)]
    if explains(none) or not done:
        return none
    notify("fit without any effect from a second start")
    best = max(done, key=lambda c: c.log_evidence).fit
    par = problem.path[0].par.copy()
    where = problem.coefficients.where
    par[where] = best.par[where]
    start = [replace(point, par=par) for point in best.points]
    again = weighted_hypothesis(problem, (), fit_with(problem, (), start=start))
    return max(none, again, key=lambda c: c.log_evidence)


def _excess(
    refits: Sequence[RefittedHypothesis], none: RefittedHypothesis, coefficients: int, outside: float
) -> float:
    """How much the runs disagree about the best explanation; 1 where they agree or it explains too little: of
    less than half of what a free force explains (`outside` [nats]) they disagree because it is a part of
    something else."""
    best = refits[0] if refits else none
    gain = best.log_evidence - none.log_evidence
    if gain <= max(LINEARISATION_SCATTER, LEAST_FREE_SIGNAL_SHARE * outside):
        return 1.0
    if not explains(best) or best.widens:
        return 1.0
    return excess_where_apart(best.fit.equations, coefficients)
