"""Probability of every hypothesis from its evidence and stated priors.

Priors: 0.5 none, 0.4 shared by the catalogue, 0.1 outside it. Thresholds and words are the
verdict's business.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import log_ndtr, logsumexp

from bayesid.diagnosis.evidences import over_none
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.cross_validation import log_odds_over_runs
from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.threshold_table import (
    FREE_SIGNAL_SLACK,
    LEAST_REMAINDER_SHARE,
    OTHER_FORM_PROBABILITY,
    PRIOR_CATALOGUE,
    PRIOR_NONE,
    PRIOR_OUTSIDE,
    REMAINDER_EVIDENCE,
    UNLISTED_ALIKE_SHARE,
)


@dataclass(frozen=True)
class HypothesisProbabilities:
    """Posterior of all hypotheses.

    Attributes
    ----------
    shared : name -> probability, the mass of several effects at once shared by them; sums to 1
    inside : name -> probability that it acts, alone or with others
    sets : names that act together, sorted -> probability of exactly these
    """

    shared: dict[str, float]
    inside: dict[str, float]
    sets: dict[tuple[str, ...], float]


@dataclass(frozen=True)
class Remainder:
    """What the best explanation leaves.

    Attributes
    ----------
    rest : what a free force adds to the log evidence of some explanations
    shows : whether something is left: more than the best of all free signals tried gains by chance, or runs
        that disagree; only then does `rest` speak for a cause that is only like the one named
    share : of what a free signal gains without an effect, how much one still gains beside the best
    kept : what the very signal that gained most without an effect still gains beside the best
    """

    rest: Mapping[tuple[str, ...], float] = field(default_factory=dict)
    shows: bool = True
    share: float = 1.0
    kept: float = np.inf


@dataclass(frozen=True)
class FormError:
    """How far evidence between causes holds where the equations lack a force that depends on the motion.

    Attributes
    ----------
    leaves : log evidence that what the model form leaves may be worth: nineteen of twenty times it changes
        the distance of two causes by less [nats]; 0 where no form is needed
    holds : set of causes -> log evidence that it keeps whatever forces of the motion act: of its sensors'
        effects by kinematics, and of an effect that stands for a coefficient certainly off (`StandsFor`)
    sensors : effects of sensors that kinematics may tell
    axes : effect -> axes of the form that may stand for it
    parts : the same as `leaves` of the form in some axes alone
    by_run : set of causes -> (runs,) log density of each run given all others, of refits that follow the data
    costs : set of causes -> log evidence that the sizes it asks for surely cost (`cost_of_sizes`) [nats]
    """

    leaves: float = 0.0
    holds: Mapping[tuple[str, ...], float] = field(default_factory=dict)
    sensors: frozenset[str] = frozenset()
    axes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    parts: Mapping[frozenset[str], float] = field(default_factory=dict)
    by_run: Mapping[tuple[str, ...], np.ndarray] = field(default_factory=dict)
    costs: Mapping[tuple[str, ...], float] = field(default_factory=dict)

    def between(self, one: Collection[str], other: Collection[str] = ()) -> float:
        """What the form may leave between two sets of causes: in the axes of those that are not in both."""
        axes = self.apart(one, other)
        return self.leaves if axes is None else self.parts.get(axes, self.leaves)

    def apart(self, one: Collection[str], other: Collection[str] = ()) -> frozenset[str] | None:
        """Axes of the causes that are in one of two sets only; None where those of one are not known."""
        names = set(one) ^ set(other)
        if not names <= set(self.axes):
            return None
        return frozenset().union(*(self.axes[n] for n in names))

    def sure(self, key: tuple[str, ...], gain: float) -> float | None:
        """What of the gain of a set holds whatever forces act; None where how much is not known."""
        if key not in self.holds and self.sensors & set(key):
            return None
        return float(np.clip(self.holds.get(key, 0.0), 0.0, max(gain, 0.0)))

    def lag(self, distance: float, leaves: float | None = None) -> float:
        """What a distance between two causes is worth: the odds that the error did not make it [nats].

        Normal error, odds of 20 to 1 at `leaves`; never more than the distance itself.
        """
        leaves = self.leaves if leaves is None else leaves
        if leaves <= 0.0 or distance <= 0.0:
            return distance
        return min(distance, -float(log_ndtr(-TWO_SIDED_95 * distance / leaves)) - float(np.log(2.0)))

    def behind(self, distance: float, one: tuple[str, ...], other: tuple[str, ...]) -> float:
        """What one set of causes lags behind another: as much as the error of the equations lets the distance
        tell, and no more than the odds that the runs, weighed anew, would still put it behind [nats].

        What the distance has beyond these runs is told before any of them: by how far coefficients and sizes
        lie from what was stated of them. Where a drag went with a coefficient 5.6 stated deviations off, each
        run given the others was as probable with a thrust that decays, 10 nats behind. What its sizes surely
        cost more than those of the other it lags in any case.
        """
        more = self.costs.get(one, 0.0) - self.costs.get(other, np.inf)
        lag = max(self.lag(distance, self.between(one, other)), min(distance, more))
        mine, theirs = self.by_run.get(one), self.by_run.get(other)
        if self.leaves <= 0.0 or mine is None or theirs is None:
            return lag
        runs = theirs - mine
        stated = max(distance - max(float(runs.sum()), 0.0), 0.0)
        return max(min(lag, max(log_odds_over_runs(runs), 0.0) + stated), min(distance, more))


NO_ERROR = FormError()


@dataclass(frozen=True)
class Row:
    """One way in which the data may have come about.

    Attributes
    ----------
    acts : names that act in it; ("none",) where nothing does
    log_prior, log_likelihood : [nats], the latter up to a constant common to all rows
    reading : what it says, for a table of rows
    """

    acts: tuple[str, ...]
    log_prior: float
    log_likelihood: float
    reading: str


@dataclass(frozen=True)
class Gains:
    """Log evidence of every hypothesis over no effect, made comparable.

    Attributes
    ----------
    held : hypothesis -> log evidence over none, what is outside held to what it may claim
    alone : the same before that
    more : hypothesis -> what a free force adds to it
    near : whether what is left is told by its share rather than by two linearisations
    sound : hypotheses of `more` that follow the data
    excess : divisor of what lags behind `top`
    top : largest of all
    """

    held: Mapping[tuple[str, ...], float]
    alone: Mapping[tuple[str, ...], float]
    more: Mapping[tuple[str, ...], float]
    near: bool
    sound: frozenset[tuple[str, ...]]
    excess: float
    top: float

    def tempered(self, value: float) -> float:
        """Log likelihood of a gain: its distance from the top, divided by how much the runs disagree."""
        return self.top - (self.top - value) / self.excess

    def part(self, key: tuple[str, ...], others: tuple[str, ...]) -> float:
        """What is lost of a hypothesis with only some of its effects left."""
        less = [v for k, v in self.alone.items() if set(k) == set(others)]
        return self.alone[key] - max(less, default=0.0)


OUTSIDE = ("outside",)
# Standard deviations beyond which a normal variable lies once in twenty on the side asked for, or the other.
TWO_SIDED_95 = 1.96


def probabilities(
    evidence: dict[str, float],
    refits: Sequence[RefittedHypothesis],
    none: RefittedHypothesis,
    where: Localisation,
    excess: float = 1.0,
    left: Remainder | None = None,
    places: Mapping[str, Collection[str]] | None = None,
    error: FormError = NO_ERROR,
) -> HypothesisProbabilities:
    """Posterior probability of none, every catalogue name, coefficient_error and outside.

    Every further effect pays the catalogue's prior again.

    Parameters
    ----------
    excess : how much the runs disagree about the best explanation, chi-square over its degrees of freedom. A
        form that is not quite right says that there is a gap, but not in all its nats which cause: what a
        cause lags behind the best is divided by it (quasi-likelihood; Wedderburn 1974). Not beside a form:
        there the runs are asked about every two causes whose refits follow the data (`FormError.behind`).
    left : what the best explanation leaves, if this was asked
    places : effect -> where it can act. What a second effect mends where the first acts may be the first in
        another form.
    error : of the equations, where they lack a form
    """
    left = left or Remainder()
    gains = comparable(evidence, refits, none, where, excess, left, error)
    return weights(rows(gains, evidence, left, places or {}), gains, evidence)


def comparable(
    evidence: Mapping[str, float],
    refits: Sequence[RefittedHypothesis],
    none: RefittedHypothesis,
    where: Localisation,
    excess: float,
    left: Remainder,
    error: FormError = NO_ERROR,
) -> Gains:
    """Log evidence of every hypothesis over none, singles and refitted sets, on one scale."""
    gain: dict[tuple[str, ...], float] = {(n,): v for n, v in evidence.items() if n != "outside"}
    gain[OUTSIDE] = evidence["outside"]
    for c in refits:
        if len(c.effects) > 1:
            key = tuple(sorted(c.effects))
            gain[key] = max(gain.get(key, -np.inf), over_none(c, none, where))
    more = {tuple(sorted(k)): float(v) for k, v in left.rest.items()}
    # With an effect beside it that has nothing to do, a free signal explains what it does alone, but for the
    # room such an effect has; the rest comes from the two linearisations. A signal that gains nothing beside
    # the effect explains nothing the effect does not.
    sound = frozenset(tuple(sorted(c.effects)) for c in refits if explains(c)) & set(more)
    # What is like no effect is not explained by one to more than half. Where no refit follows the data, the
    # share tells what is left, and two linearisations need not be compared.
    near = left.share < 0.5 and bool(more) and not sound
    held = told(gain, error)
    if near:
        lift = max(gain[OUTSIDE] - max(gain[k] + more[k] for k in more), 0.0)
        held |= {k: held[k] + lift for k in more}
        held[OUTSIDE] = -np.inf
    elif sound:
        most = max(gain[k] + min(max(more[k], 0.0), left.kept) for k in sound) + FREE_SIGNAL_SLACK
        held[OUTSIDE] = min(gain[OUTSIDE], most)
    top = max([*held.values(), *(held[k] + v for k, v in more.items())])
    return Gains(held, gain, more, near, sound, 1.0 if error.by_run else max(excess, 1.0), top)


def told(gain: Mapping[tuple[str, ...], float], error: FormError) -> dict[tuple[str, ...], float]:
    """Gains over no effect; what a cause lags behind the best, or behind a better one that has it and more,
    is worth only what the error of the equations leaves of it, and what the runs agree about.

    What holds whatever forces act keeps its own part. A set that explains no more than the form may leave is
    no rival: it stays as far behind as it is. Only what the form leaves in the axes of those causes counts
    that two sets do not share.
    """
    rest: dict[tuple[str, ...], float] = {}
    for key, value in gain.items():
        sure = None if key == OUTSIDE or not np.isfinite(value) else error.sure(key, value)
        if sure is not None:
            rest[key] = value - sure
    worth: dict[tuple[str, ...], float] = {}
    for key in sorted(rest, key=lambda k: -rest[k]):
        if not worth or rest[key] > error.between(key):
            first = next(iter(worth), key)
            better = [k for k in worth if k == first or set(key) < set(k)]
            behind = (worth[k] - error.behind(rest[k] - rest[key], key, k) for k in better)
            worth[key] = min(behind, default=rest[key])
    held = {k: gain[k] - rest[k] + v for k, v in worth.items()}
    # the best stays where it is: nothing explains more than it does
    lift = max(held.values(), default=0.0) - max((gain[k] for k in held), default=0.0)
    return dict(gain) | {k: v - max(lift, 0.0) for k, v in held.items()}


def rows(
    gains: Gains, evidence: Mapping[str, float], left: Remainder, places: Mapping[str, Collection[str]]
) -> tuple[Row, ...]:
    """Every hypothesis as rows of log prior and log likelihood."""
    each = float(np.log(PRIOR_CATALOGUE / sum(n != "outside" for n in evidence)))
    outside = gains.tempered(gains.held[OUTSIDE])
    out = [
        Row(("none",), float(np.log(PRIOR_NONE)), 0.0, "nothing"),
        Row(OUTSIDE, float(np.log((1.0 - UNLISTED_ALIKE_SHARE) * PRIOR_OUTSIDE)), outside, "like no effect"),
    ]
    for key, value in gains.held.items():
        if key != OUTSIDE:
            out += _rows_of(key, value, len(key) * each, each, gains, left, places)
    return tuple(out)


def _rows_of(
    key: tuple[str, ...],
    value: float,
    prior: float,
    each: float,
    gains: Gains,
    left: Remainder,
    places: Mapping[str, Collection[str]],
) -> list[Row]:
    """One set of effects as it stands, in other forms, and with a cause only like one of them instead."""
    likelihood, asked = gains.tempered(value), key in gains.more
    close = _closeness(value)
    alike = prior + float(np.log(UNLISTED_ALIKE_SHARE * PRIOR_OUTSIDE / PRIOR_CATALOGUE))
    form = _log(1.0 - OTHER_FORM_PROBABILITY * (1.0 - close)) if asked else 0.0
    out = [Row(key, prior + form, likelihood, "as the catalogue has it")]
    for name in key:
        others = tuple(n for n in key if n != name)
        part = gains.part(key, others)
        like = (*others, "outside")
        out.append(Row(like, alike + _log(_likeness(part)), likelihood, f"something like {name}"))
        mended = sum(OTHER_FORM_PROBABILITY / _near(n, places) for n in others if _meet(n, name, places))
        if mended:
            chance = prior - each + _log(mended * _likeness(part))
            out.append(Row(others, chance, likelihood, f"in another form, which {name} stands for"))
        if left.shows and asked:
            share = (
                left.share
                if gains.near
                else max(gains.more[key], REMAINDER_EVIDENCE) / max(part, REMAINDER_EVIDENCE)
            )
            odds = _stranger(share) * (1.0 - _closeness(part))
            lifted = gains.tempered(value + gains.more[key])
            out.append(Row(like, alike + _log(odds), lifted, f"something like {name} that leaves a rest"))
    if asked:
        # an effect has another form; what explains less than half of the gap is a part of something else
        part_of = not gains.near and value < 0.5 * gains.held[OUTSIDE]
        lifted = gains.tempered(value + gains.more[key])
        chance = prior + _log(OTHER_FORM_PROBABILITY * (1.0 - close))
        out.append(Row(OUTSIDE if part_of else key, chance, lifted, "in another form that leaves a rest"))
    return out


def weights(rows: Sequence[Row], gains: Gains, evidence: Mapping[str, float]) -> HypothesisProbabilities:
    """Probabilities of all rows by one sum, shared among the names that act in each."""
    value = np.array([r.log_prior + r.log_likelihood for r in rows])
    mass = np.exp(value - logsumexp(value))
    shared = dict.fromkeys([*(n for n in evidence if n != "outside"), "outside", "none"], 0.0)
    inside = dict.fromkeys(shared, 0.0)
    sets: dict[tuple[str, ...], float] = {}
    for row, m in zip(rows, mass, strict=True):
        acts = tuple(sorted(row.acts))
        sets[acts] = sets.get(acts, 0.0) + float(m)
        mends = gains.excess > 1.0 or (row.acts in gains.more and row.acts not in gains.sound)
        for n, portion in zip(row.acts, _shares(row.acts, evidence, mends), strict=True):
            shared[n] += float(m) * portion
            inside[n] += float(m)
    return HypothesisProbabilities(shared, inside, sets)


def _log(chance: float) -> float:
    return float(np.log(chance)) if chance > 0.0 else -np.inf


def _closeness(explained: float) -> float:
    """Chance that the named cause in another form leaves nothing that shows.

    What it leaves is of unknown size, from a thousandth of what the named one explains to all of it, every
    magnitude as probable.
    """
    return float(
        np.clip(
            1.0
            + np.log(REMAINDER_EVIDENCE / max(explained, REMAINDER_EVIDENCE))
            / np.log(1.0 / LEAST_REMAINDER_SHARE),
            0.0,
            1.0,
        )
    )


def _likeness(explained: float) -> float:
    """Chance that a cause only like the one named leaves nothing that shows.

    Other causes are as like it as the effects of the catalogue are like each other: of 2250 signatures on
    free-running trials the nearest other family leaves less than 1 % of 5, less than 10 % of 19, less than
    30 % of 30 in a hundred (`Ambiguity.margin` over what one shows). The square root of the share leans to
    the careful side of that: it takes more of them for near.
    """
    return float(np.sqrt(REMAINDER_EVIDENCE / max(explained, REMAINDER_EVIDENCE)))


def _meet(one: str, other: str, places: Mapping[str, Collection[str]]) -> bool:
    """Whether two effects act in exactly the same places."""
    mine = set(places.get(one, ()))
    return bool(mine) and mine == set(places.get(other, ()))


def _near(name: str, places: Mapping[str, Collection[str]]) -> int:
    """Number of other effects that act where one does: what another form of it may look like."""
    return sum(_meet(name, other, places) for other in places if other != name)


def _stranger(share: float) -> float:
    """How much more a share that is left speaks for a cause only like the named one than for that one in
    another form: ratio of the densities over the logarithm of the share.

    The former leaves less than x in 0.45 x^0.45 + 0.55 x^5 of all cases, within 0.04 of the counts under
    `_likeness`; of the latter every magnitude is as probable.
    """
    x = float(np.clip(share, LEAST_REMAINDER_SHARE, 1.0))
    return float((0.45**2 * x**0.45 + 5.0 * 0.55 * x**5) * np.log(1.0 / LEAST_REMAINDER_SHARE))


def credible_set(
    probability: Mapping[str, float], mass: float = 0.95, silent: Collection[str] = ()
) -> tuple[str, ...]:
    """Smallest set of names that holds the mass, most probable first; `silent` ones count as none."""
    weight = {n: p for n, p in probability.items() if n not in silent}
    weight["none"] = weight.get("none", 0.0) + sum(probability[n] for n in silent)
    out, total = [], 0.0
    for name in sorted(weight, key=lambda n: -weight[n]):
        out.append(name)
        total += weight[name]
        if total >= mass:
            break
    return tuple(out)


def of_causes(
    shared: Mapping[str, float], sets: Mapping[tuple[str, ...], float], like: Collection[str]
) -> dict[str, float]:
    """Masses of all names; what an effect that is a shape of a form has in company goes to its causes.

    Parameters
    ----------
    like : effects that are such shapes
    """
    out = dict(shared)
    for key, mass in sets.items():
        causes = [n for n in key if n not in like]
        for name in set(key) - set(causes) if causes else ():
            given = min(mass / len(key), out[name])
            out[name] -= given
            for cause in causes:
                out[cause] += given / len(causes)
    return out


def several_act(sets: Mapping[tuple[str, ...], float], like: Collection[str]) -> float:
    """Probability that more than one cause acts; shapes of a force the equations lack are none."""
    return sum(p for key, p in sets.items() if len([n for n in key if n not in (*like, "none")]) > 1)


def _shares(key: tuple[str, ...], evidence: Mapping[str, float], mends: bool) -> list[float]:
    """How several effects share their mass: alike, or by what each says alone where the runs disagree or the
    data stay unexplained.

    Then some of them are likely there to mend the form of another.
    """
    if len(key) == 1 or not mends:
        return [1.0 / len(key)] * len(key)
    weight = [max(evidence.get(n, 0.0), 0.0) + 1.0 for n in key]
    return [w / sum(weight) for w in weight]
