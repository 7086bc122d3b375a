"""Probability of every hypothesis from its evidence and stated priors.

Priors (design note A4): 0.5 none, 0.4 shared by the catalogue, 0.1 outside it. Thresholds and words are the
verdict's business.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnose.bank import Score, testable
from bayesid.diagnose.candidate import COEFFICIENT_ERROR, Candidate, explains
from bayesid.diagnose.problem import Problem
from bayesid.diagnose.where import Where

PRIOR_NONE, PRIOR_CATALOGUE, PRIOR_OUTSIDE = 0.5, 0.4, 0.1
# Share of what lies outside that looks like an effect of the catalogue rather than like any generic signal: a
# drag that grows in a step is not a loss of thrust, and yet more like it than like a free force. The
# catalogue's effects share it as they share their own prior.
ALIKE = 0.5
# Chance that an effect acts in another form than the catalogue's.
FORM = 0.25
# Nats from which a remainder shows, and the smallest part of what it explains that another form leaves.
SEEN, CLOSEST = 3.0, 1e-3
# Nats a free signal may be better alone than with an effect that has nothing to do beside it.
ROOM = 10.0


def evidences(
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
    refitted = {c.effects[0]: over_none(c, none, where) for c in refits if len(c.effects) == 1}
    sound = [over_none(c, none, where) for c in refits if len(c.effects) == 1 and explains(c)]
    floor = min(sound) if sound else max(refitted.values(), default=0.0)
    top = max((s.gain for s in scores), default=0.0)
    for score in scores:
        # the screen's distance from its best holds where no refit explains the data
        out[score.name] = refitted.get(
            score.name, min(score.gain, floor if sound else floor - top + score.gain)
        )
    for effect in problem.model.kernel.effects:
        out.setdefault(effect.name, 0.0 if testable(problem, effect) else -np.inf)
    prefix = f"{COEFFICIENT_ERROR}:"
    wide = {n: refitted.get(prefix + n, min(v, floor if refitted else v)) for n, v in wide.items()}
    out[COEFFICIENT_ERROR] = float(logsumexp(list(wide.values())) - np.log(max(len(wide), 1)))
    out["outside"] = where.outside - zero(none, where)
    return out


def zero(none: Candidate, where: Where) -> float:
    """Log evidence of no effect: the better of its two linearisations."""
    return max(none.log_evidence, where.base)


def over_none(candidate: Candidate, none: Candidate, where: Where) -> float:
    """Log evidence of a refit over no effect.

    The worse linearisation of no effect must not speak for a refit that itself leaves the data unexplained:
    that one is measured against the better.
    """
    return candidate.log_evidence - (none.log_evidence if explains(candidate) else zero(none, where))


@dataclass(frozen=True)
class Weights:
    """Posterior of all hypotheses.

    Attributes
    ----------
    shared : name -> probability, the mass of several effects at once shared by them; sums to 1
    inside : name -> probability that it acts, alone or with others
    """

    shared: dict[str, float]
    inside: dict[str, float]


@dataclass(frozen=True)
class Left:
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


def probabilities(
    evidence: dict[str, float],
    refits: Sequence[Candidate],
    none: Candidate,
    where: Where,
    excess: float = 1.0,
    left: Left | None = None,
    places: Mapping[str, Collection[str]] | None = None,
) -> Weights:
    """Posterior probability of none, every catalogue name, coefficient_error and outside.

    Every further effect pays the catalogue's prior again.

    Parameters
    ----------
    excess : how much the runs disagree about the best explanation, chi-square over its degrees of freedom. A
        form that is not quite right says that there is a gap, but not in all its nats which cause: what a
        cause lags behind the best is divided by it (quasi-likelihood; Wedderburn 1974).
    left : what the best explanation leaves, if this was asked
    places : effect -> where it can act. What a second effect mends where the first acts may be the first in
        another form.
    """
    left, places = left or Left(), places or {}
    names = [n for n in evidence if n != "outside"]
    each = float(np.log(PRIOR_CATALOGUE / len(names)))
    gain: dict[tuple[str, ...], float] = {(n,): evidence[n] for n in (*names, "outside")}
    for c in refits:
        if len(c.effects) > 1:
            key = tuple(sorted(c.effects))
            gain[key] = max(gain.get(key, -np.inf), over_none(c, none, where))
    more = {tuple(sorted(k)): float(v) for k, v in left.rest.items()}
    # With an effect beside it that has nothing to do, a free signal explains what it does alone, but for the
    # room such an effect has; the rest comes from the two linearisations. A signal that gains nothing beside
    # the effect explains nothing the effect does not.
    sound = {tuple(sorted(c.effects)) for c in refits if explains(c)} & set(more)
    # What is like no effect is not explained by one to more than half. Where no refit follows the data, the
    # share tells what is left, and two linearisations need not be compared.
    near = left.share < 0.5 and bool(more) and not sound
    alone = dict(gain)
    if near:
        lift = max(gain[("outside",)] - max(gain[k] + more[k] for k in more), 0.0)
        gain |= {k: gain[k] + lift for k in more}
        gain[("outside",)] = -np.inf
    elif sound:
        most = max(gain[k] + min(max(more[k], 0.0), left.kept) for k in sound) + ROOM
        gain[("outside",)] = min(gain[("outside",)], most)
    top = max([*gain.values(), *(gain[k] + v for k, v in more.items())])

    def tempered(value: float) -> float:
        return top - (top - value) / max(excess, 1.0)

    joint: dict[tuple[str, ...], float] = {("none",): float(np.log(PRIOR_NONE))}

    def add(key: tuple[str, ...], mass: float) -> None:
        joint[key] = float(np.logaddexp(joint.get(key, -np.inf), mass))

    add(("outside",), tempered(gain[("outside",)]) + float(np.log((1.0 - ALIKE) * PRIOR_OUTSIDE)))
    alike = float(np.log(ALIKE * PRIOR_OUTSIDE / PRIOR_CATALOGUE))
    for key, value in gain.items():
        if key == ("outside",):
            continue
        prior = len(key) * each
        close = _closeness(value)
        add(key, tempered(value) + prior + (_log(1.0 - FORM * (1.0 - close)) if key in more else 0.0))
        for name in key:
            others = tuple(n for n in key if n != name)
            part = alone[key] - max([v for k, v in alone.items() if set(k) == set(others)], default=0.0)
            add((*others, "outside"), tempered(value) + prior + alike + _log(_likeness(part)))
            mended = sum(FORM / _near(n, places) for n in others if _meet(n, name, places))
            if mended:
                add(others, tempered(value) + prior - each + _log(mended * _likeness(part)))
            if left.shows and key in more:
                share = left.share if near else max(more[key], SEEN) / max(part, SEEN)
                odds = _stranger(share) * (1.0 - _closeness(part))
                add((*others, "outside"), tempered(value + more[key]) + prior + alike + _log(odds))
        if key in more:
            # an effect has another form; what explains less than half of the gap is a part of something else
            part_of = not near and value < 0.5 * gain[("outside",)]
            visible = tempered(value + more[key]) + prior + _log(FORM * (1.0 - close))
            add(("outside",) if part_of else key, visible)
    total = logsumexp(list(joint.values()))
    shared = dict.fromkeys([*names, "outside", "none"], 0.0)
    inside = dict.fromkeys(shared, 0.0)
    for key, value in joint.items():
        mass = float(np.exp(value - total))
        mends = excess > 1.0 or (key in more and key not in sound)
        for n, portion in zip(key, _shares(key, evidence, mends), strict=True):
            shared[n] += mass * portion
            inside[n] += mass
    return Weights(shared, inside)


def _log(chance: float) -> float:
    return float(np.log(chance)) if chance > 0.0 else -np.inf


def _closeness(explained: float) -> float:
    """Chance that the named cause in another form leaves nothing that shows.

    What it leaves is of unknown size, from a thousandth of what the named one explains to all of it, every
    magnitude as probable.
    """
    return float(np.clip(1.0 + np.log(SEEN / max(explained, SEEN)) / np.log(1.0 / CLOSEST), 0.0, 1.0))


def _likeness(explained: float) -> float:
    """Chance that a cause only like the one named leaves nothing that shows.

    Other causes are as like it as the effects of the catalogue are like each other: of 2250 signatures on
    free-running trials the nearest other family leaves less than 1 % of 5, less than 10 % of 19, less than
    30 % of 30 in a hundred (`Ambiguity.margin` over what one shows). The square root of the share leans to
    the careful side of that: it takes more of them for near.
    """
    return float(np.sqrt(SEEN / max(explained, SEEN)))


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
    x = float(np.clip(share, CLOSEST, 1.0))
    return float((0.45**2 * x**0.45 + 5.0 * 0.55 * x**5) * np.log(1.0 / CLOSEST))


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


def _shares(key: tuple[str, ...], evidence: dict[str, float], mends: bool) -> list[float]:
    """How several effects share their mass: alike, or by what each says alone where the runs disagree or the
    data stay unexplained.

    Then some of them are likely there to mend the form of another.
    """
    if len(key) == 1 or not mends:
        return [1.0 / len(key)] * len(key)
    weight = [max(evidence.get(n, 0.0), 0.0) + 1.0 for n in key]
    return [w / sum(weight) for w in weight]
