"""What a verdict is decided on: numbers and yes-or-no answers, taken from the hypotheses once.

Takes a `DiagnosisProblem` and its `HypothesisComparison`. Gives frozen `Facts` and the names the outcomes
speak of. Does not decide.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import (
    COEFFICIENT_ERROR,
    RefittedHypothesis,
    beyond_range,
    explains,
    idle,
    pulls,
    remembers,
)
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.cross_validation import CrossValidation, cross_validate, excess_where_apart
from bayesid.diagnosis.hypotheses.form_part import axes_of, beyond, form_excess, lost_without_form
from bayesid.diagnosis.hypotheses.kinematic import (
    NOTHING,
    Kinematics,
    by_kinematics,
    given_by_leeway,
    given_by_roll,
    parameters_told,
)
from bayesid.diagnosis.hypotheses.localisation import SENSORS, Localisation
from bayesid.diagnosis.hypotheses.probabilities import credible_set, of_causes, told
from bayesid.diagnosis.hypotheses.sizes import sizes_told
from bayesid.diagnosis.threshold_table import (
    ADD_EVIDENCE,
    BARE_MENTION,
    CONFOUNDED_SHARE,
    EVEN_ODDS,
    FOLLOWS_DATA_CHI2,
    FORM_LEAVES,
    FORM_LEAVES_BESIDE,
    GAP_IS_SURE_BELOW,
    LISTED_BESIDE_EVIDENCE,
    MINOR_SHARE,
    NAMING_PROBABILITY,
    UNDETECTABLE_NONCENTRALITY,
)
from bayesid.equations.model import Model

# Why one of several effects of the best explanation is not named: a parameter is out of the range in which it
# is that effect, its size is not told from none, the leeway of a constant side force reads the same, it gains
# no more than the model form may leave or is a shape of it, what is left is a large part of what it explains,
# its probability of acting is below `NAMING_PROBABILITY`.
Unnamed = Literal["range", "size", "leeway", "form", "remainder", "probability"]


@dataclass(frozen=True)
class Facts:
    """Numbers and booleans the rules read. "Best" is the simplest best explanation.

    Attributes
    ----------
    gain, gain_by_chance : log evidence of the best over no effect, and what chance allows [nats]
    free, free_by_chance : the same of a free signal without any effect [nats]
    left : what a free signal adds beside the best [nats]
    conflict, conflict_by_chance : largest coefficient move without an effect [prior sd]
    none, outside, undetectable : probability of no effect, of a cause that is not listed, and of effects
        that these runs could not show
    outside_acts : probability that a cause that is not listed acts, alone or with others
    most_acts : the same of whatever else acts most probably, an effect with its family
    none_in_set : whether the 95 % set holds no effect
    effects : number of effects of the best
    widens : whether the best is a coefficient with a wide prior
    explains : whether the best follows the data
    acts : probability that what the best names acts, alone or with others of its family
    absorbed : share of the best effect's trace that coefficients absorb
    re_tuned : probability that coefficients explain all, those stated or one further off
    idle : whether an effect of the best has a size too near to off for a name
    turns_beside : whether all runs turn to one side with the rudder amidships, and the best is of sensors
    leeway : whether the best alone is what the leeway of a constant side force gives
        alone, which kinematics does not tell
    sure : of several effects, how many may be named
    form : whether every hypothesis has a model form, as the runs ask for one
    of_motion : whether of several effects only such are sure as depend on the motion alone, as a form does
    moved : whether a coefficient certainly is further off than stated that an effect stands for
    covered : whether what the form leaves may be as large as each effect of the best, and as all of them; of
        several, those without a size and a list that reads as a gyro's scale are asked with the others only
    others_covered : the same of all effects of the best but those that may be named
    over_motion : by how much a free force beside the best gains more than a force of the motion and the
        controls, of any shape [nats]; infinite where it was not asked
    runs_refute : whether runs are predicted worse from the others with the best than without
    runs_disagree : whether runs ask for different sizes of it
    """

    gain: float
    gain_by_chance: float
    free: float
    free_by_chance: float
    left: float
    conflict: float
    conflict_by_chance: float
    none: float
    outside: float
    outside_acts: float
    most_acts: float
    undetectable: float
    none_in_set: bool
    effects: int
    widens: bool
    explains: bool
    acts: float
    absorbed: float
    re_tuned: float
    idle: bool
    turns_beside: bool
    leeway: bool
    sure: int
    form: bool
    of_motion: bool
    moved: bool
    covered: bool
    others_covered: bool
    over_motion: float
    runs_refute: bool
    runs_disagree: bool

    @property
    def gains(self) -> bool:
        """Whether the best gains at least what chance allows."""
        return not self.gain < self.gain_by_chance

    @property
    def free_shows(self) -> bool:
        """Whether a free signal gains more than the best of all tried does by chance."""
        return self.free > self.free_by_chance

    @property
    def rest_shows(self) -> bool:
        """Whether one still does beside the best."""
        return self.left > self.free_by_chance


@dataclass(frozen=True)
class Named:
    """The names outcomes speak of.

    Attributes
    ----------
    best : effects of the best explanation
    sure : those of several that may be named
    unnamed : the others of several, and why
    confounded : effects the coefficients can absorb
    along : of these the ones about as good as the best
    set95 : credible set
    undetectable : effects these runs could not show
    form : whether no effect means a model form alone
    like : effects of the best that depend on the motion alone, beside others
    stand : effects that stand for coefficients certainly further off than stated, beside the best
    """

    best: tuple[str, ...]
    sure: tuple[str, ...]
    confounded: tuple[str, ...]
    along: tuple[str, ...]
    set95: tuple[str, ...]
    undetectable: tuple[str, ...]
    form: bool = False
    like: tuple[str, ...] = ()
    unnamed: Mapping[str, Unnamed] = field(default_factory=dict)
    stand: tuple[str, ...] = ()

    @property
    def rivals(self) -> tuple[str, ...]:
        """Members of the set that are effects."""
        return tuple(n for n in self.set95 if n not in ("none", "outside"))


@dataclass(frozen=True)
class Grounds:
    """Facts, the names that go with them, and what the sentences beside the rules quote."""

    facts: Facts
    named: Named
    place: str
    misfit: float
    follows: bool
    runs: CrossValidation | None


def grounds_of(
    problem: DiagnosisProblem, candidates: HypothesisComparison, over_motion: float = np.inf
) -> Grounds:
    """Facts and names of a comparison; `over_motion` as of `Facts`."""
    probability, limit = candidates.probabilities, candidates.thresholds
    none, best = candidates.none, simplest(candidates)
    before = candidates.where.places[0]
    faint = undetectable(candidates)
    like = () if best.widens else like_a_form(candidates, best, problem.model)
    set95 = credible_set(of_causes(probability, candidates.sets, like), silent=faint)
    # of several at once each is listed that acts more probably than not, whatever its share of their mass
    beyond_set = (n for n, p in candidates.inside.items() if p > EVEN_ODDS and n not in set95)
    likely = (n for n in beyond_set if n not in (*faint, *like))
    set95 = (*set95, *sorted(likely, key=lambda n: -candidates.inside[n]))
    absorbed = _absorbed(problem, candidates)
    families = {e.name: e.family for e in problem.model.kernel.effects}
    gain = best.log_evidence - none.log_evidence
    pull = pulls(none.fit, problem)
    left = candidates.where_after.places[0].evidence if candidates.where_after is not None else 0.0
    if candidates.where_after is not None and candidates.where_after.places[0].channel not in SENSORS:
        left = beyond(left, candidates.carried_beside)
    free = before.evidence if before.channel in SENSORS else beyond(before.evidence, candidates.carried)
    sensors = NOTHING if problem.form is None else by_kinematics(problem, best)
    table = parameters_told(problem, best, sensors)
    off = () if best.widens else idle(best, problem, table, sizes_told(problem, candidates, best))
    several = len(best.effects) > 1
    beside = (
        problem.form is not None and problem.turns and not best.widens and _of_sensors(problem, best, sensors)
    )
    if beside:
        set95 = (*set95, *(n for n in _of_the_vehicle(problem, candidates) if n not in set95))
    within, together = ((), False) if best.widens else _covered(problem, candidates, best, sensors)
    covered = tuple(dict.fromkeys((*within, *like)))
    no_cause = _no_cause(problem, best, off, table)
    # those are asked for their size with the others only
    all_within = (
        together if not no_cause else _small(problem, candidates, best, {*within, *no_cause}, FORM_LEAVES)
    )
    acting = {} if best.widens else {n: problem.model.effects[n] for n in best.effects}
    leeway = tuple(
        n
        for n, e in acting.items()
        if given_by_leeway(problem, e, table, [other for m, other in acting.items() if m != n])
    )
    unnamed: dict[str, Unnamed] = {}
    if several:
        shows = left > limit.remainder
        # What kinematics tells of a sensor holds whatever else is left.
        holds = [n for n in sensors.told if not _reads(problem, n, candidates.where_after)]
        beyond_it = beyond_range(best, problem, table) if off else ()
        for n in best.effects:
            # An effect that explains little beside what is left is a part of the remainder; one whose size is
            # nought mends something else.
            if n in off:
                unnamed[n] = "range" if n in beyond_it else "size"
            elif n in leeway:
                unnamed[n] = "leeway"
            elif n in covered:
                unnamed[n] = "form"
            elif shows and n not in holds and not left < MINOR_SHARE * _part(candidates, best, {n}):
                unnamed[n] = "remainder"
            elif acts(candidates, families, n) < NAMING_PROBABILITY:
                unnamed[n] = "probability"
    sure = tuple(n for n in best.effects if several and n not in unnamed)
    named = COEFFICIENT_ERROR if best.widens else best.effects[0] if best.effects else ""
    unlisted = free > limit.remainder and probability["outside"] > EVEN_ODDS
    # runs are set against each other where a name is at stake
    asked = not gain < limit.named and not best.widens and not unlisted
    runs = cross_validate(best, none, len(problem.coefficients.names)) if asked else None
    confounded = tuple(n for n, a in absorbed.items() if a > CONFOUNDED_SHARE)
    facts = Facts(
        gain=gain,
        gain_by_chance=limit.named,
        free=free,
        free_by_chance=limit.remainder,
        left=left,
        conflict=float(np.abs(pull).max()) if pull.size else 0.0,
        conflict_by_chance=limit.conflict,
        none=probability["none"],
        outside=probability["outside"],
        outside_acts=candidates.inside.get("outside", 0.0),
        most_acts=max(acts(candidates, families, n) for n in candidates.inside if n != "outside"),
        undetectable=sum(probability[n] for n in faint),
        none_in_set="none" in set95,
        effects=len(best.effects),
        widens=best.widens,
        explains=explains(best),
        acts=acts(candidates, families, named),
        absorbed=absorbed.get(named, 0.0),
        re_tuned=probability["none"] + probability.get(COEFFICIENT_ERROR, 0.0),
        idle=bool(off),
        turns_beside=beside,
        leeway=named in leeway,
        sure=len(sure),
        form=problem.form is not None,
        moved=bool(candidates.stand),
        of_motion=not sure and any(acts(candidates, families, n) >= NAMING_PROBABILITY for n in like),
        covered=all_within and bool(best.effects) and set(best.effects) == {*covered, *no_cause},
        others_covered=together and bool(sure) and set(best.effects) == {*sure, *covered},
        over_motion=over_motion,
        runs_refute=runs is not None and runs.refuted,
        runs_disagree=runs is not None and runs.disagree,
    )
    along = tuple(
        n for n in confounded if candidates.evidence.get(n, -np.inf) > gain - LISTED_BESIDE_EVIDENCE
    )
    follows = any(c.fit.chi2 < FOLLOWS_DATA_CHI2 for c in (none, *candidates.refits))
    names = Named(
        best.effects, sure, confounded, along, set95, faint, problem.form is not None, like, unnamed,
        tuple(s.effect for s in candidates.stand),
    )  # fmt: skip
    return Grounds(facts, names, before.channel, best.fit.chi2**0.5, follows, runs)


def _reads(problem: DiagnosisProblem, name: str, left: Localisation | None) -> bool:
    """Whether a free signal is left most in a channel that an effect of a sensor changes."""
    effect = problem.model.effects[name]
    own = {*effect.sensor, *(c for group in effect.sensor_delay.values() for c in group)}
    return left is not None and bool(own & set(SENSORS.get(left.places[0].channel, ())))


def _of_sensors(problem: DiagnosisProblem, best: RefittedHypothesis, sensors: Kinematics) -> bool:
    """Whether a hypothesis has effects of sensors alone, none of which kinematics tells."""
    ports = {problem.model.effects[n].port for n in best.effects}
    return ports == {"sensor"} and not sensors.told & set(best.effects)


def _no_cause(
    problem: DiagnosisProblem,
    best: RefittedHypothesis,
    off: Collection[str],
    table: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """Effects of several that are none where the runs ask for a form: those without a size, and what a planar
    model leaves out. The list of a vehicle that rolls reads as a gyro that is slow.
    """
    if problem.form is None or best.widens or len(best.effects) < 2:
        return ()
    return tuple(
        n for n in best.effects if n in off or given_by_roll(problem, problem.model.effects[n], table)
    )


def _of_the_vehicle(problem: DiagnosisProblem, candidates: HypothesisComparison) -> tuple[str, ...]:
    """Effects of no sensor that alone gain more than chance allows, best first."""
    least = candidates.none.log_evidence + candidates.thresholds.named
    alone = (c for c in candidates.refits if len(c.effects) == 1 and not c.widens and c.log_evidence > least)
    return tuple(
        c.effects[0]
        for c in sorted(alone, key=lambda c: -c.log_evidence)
        if problem.model.effects[c.effects[0]].port != "sensor"
    )


def undetectable(candidates: HypothesisComparison) -> tuple[str, ...]:
    """Effects that these runs would hardly show at their usual size, and do not speak for.

    Their probability is about what it was before the data. As an explanation they are no other than "none":
    what is not there to be seen cannot be told from what is too small to be. Where there surely is a gap none
    of them explains it.
    """
    if candidates.probabilities["none"] < GAP_IS_SURE_BELOW:
        return ()
    return tuple(
        n
        for n, d in zip(candidates.ambiguity.names, candidates.ambiguity.detect, strict=True)
        if d < UNDETECTABLE_NONCENTRALITY and candidates.evidence.get(n, 0.0) <= BARE_MENTION
    )


def like_a_form(candidates: HypothesisComparison, best: RefittedHypothesis, model: Model) -> tuple[str, ...]:
    """Of several effects, those that depend on the motion alone and may be part of a form.

    One that explains everything by itself is a cause. Beside another it is what any simulator lacks of any
    vehicle: a force that depends on the motion, of which it is one shape; unless the runs ask for such a
    force and the shape is more probable than the general one by as much as a name asks for, even odds before.
    """
    if len(best.effects) < 2 or candidates.form_instead < np.log(1 / NAMING_PROBABILITY - 1):
        return ()
    # one that pushes aside on a straight course is no shape of a form: with one it is not even tried
    return tuple(n for n in best.effects if model.effects[n].as_form == "also")


def simplest(candidates: HypothesisComparison) -> RefittedHypothesis:
    """Best explanation; several effects only where they are worth it over the best single one, as far as the
    error of the equations lets evidence tell.
    """
    best = candidates.best
    alone = [c for c in candidates.refits if len(c.effects) == 1]
    if len(best.effects) < 2 or not alone:
        return best
    gain: dict[tuple[str, ...], float] = {}
    for c in candidates.refits:
        key = tuple(sorted(c.effects))
        gain[key] = max(gain.get(key, -np.inf), c.log_evidence - candidates.none.log_evidence)
    worth = told(gain, candidates.error)
    single = max(alone, key=lambda c: worth[c.effects])
    lag = worth[tuple(sorted(best.effects))] - worth[single.effects]
    return single if lag < candidates.thresholds.named else best


def _absorbed(problem: DiagnosisProblem, candidates: HypothesisComparison) -> dict[str, float]:
    """Effect -> share of its trace the coefficients absorb.

    Known as built, coefficients do not change by themselves: what they could imitate is a change.
    """
    names = candidates.ambiguity.names
    share = np.zeros(len(names)) if problem.as_built else candidates.ambiguity.absorbed
    return {n: float(a) for n, a in zip(names, share, strict=True)}


def acts(candidates: HypothesisComparison, families: Mapping[str, str], name: str) -> float:
    """Probability that an effect of a name's family acts, alone or with others."""
    family = families.get(name, name)
    return sum(p for n, p in candidates.inside.items() if families.get(n, n) == family)


def _part(candidates: HypothesisComparison, best: RefittedHypothesis, names: Collection[str]) -> float:
    """Log evidence that is lost without some of several effects, as far as the refits tell."""
    less = [
        c.log_evidence
        for c in candidates.refits
        if set(c.effects) < set(best.effects) and not set(names) & set(c.effects)
    ]
    return best.log_evidence - max(less, default=candidates.none.log_evidence)


def _covered(
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    best: RefittedHypothesis,
    sensors: Kinematics,
) -> tuple[tuple[str, ...], bool]:
    """Effects of the best that are not larger than what the model form may leave, and whether all of them
    together are not.

    The equations surely lack something. Beside the effect that explains most, another must be worth more
    than the form itself to be told from what it leaves. Of causes that can stand for each other each is
    worth little beside the rest, and all of them much. A resonance leaves nothing that lasts. Gains are
    compared as they are, and by how far the runs agree about effect and form. What sensors say by kinematics
    alone holds whatever the equations lack, and so does a coefficient that certainly is another.
    """
    if problem.form is None:
        return (), True
    part = {n: _part(candidates, best, {n}) for n in best.effects}
    first = max(part, key=lambda n: part[n], default="")
    held = {s.effect for s in candidates.off if s.certain > ADD_EVIDENCE}
    within = tuple(
        n
        for n in best.effects
        if n not in sensors.told | held
        and _small(problem, candidates, best, {n}, FORM_LEAVES if n == first else FORM_LEAVES_BESIDE)
    )
    return within, not within or _small(problem, candidates, best, within, FORM_LEAVES)


def _small(
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    best: RefittedHypothesis,
    names: Collection[str],
    share: float,
) -> bool:
    """Whether some effects of the best together gain less than a share of what the form is worth, as it is
    and by how far the runs agree about either."""
    excess = excess_where_apart(best.fit.equations, len(problem.coefficients.names))
    of_form = form_excess(problem, best)
    axes = frozenset().union(*(axes_of(problem, n) for n in names))
    # what a resonance leaves comes and goes with its period, as does what an actuator late or slow does
    swings = any(remembers(problem.model.effects[n]) for n in names)
    form = lost_without_form(problem, best, axes, resonance=swings)
    gain = _part(candidates, best, names)
    return gain < share * form and gain / excess < share * form / of_form
