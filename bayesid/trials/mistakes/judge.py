"""Which mistake of the table a log holds, by the evidence of its own kinematics.

Takes runs. Every hypothesis is the log corrected; relations between its channels are weighed with and without
the correction, in the density of the readings as logged, and summed over runs. No cut-off but the probability
at which a mistake is named.
Does not: know a vehicle but its size; what needs one is decided in `bayesid.diagnosis.input`.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from scipy.special import logsumexp

from bayesid.trials.correction import Correction, apply
from bayesid.trials.handedness import UNKNOWN, Handedness
from bayesid.trials.kinematics.evidence import Held, weigh
from bayesid.trials.kinematics.relations import NEEDS, relations
from bayesid.trials.mistakes.finding import BY_VEHICLE, InputCheck, InputFinding
from bayesid.trials.mistakes.plausible import implausible
from bayesid.trials.mistakes.signs import SIGNS, sign_evidence
from bayesid.trials.mistakes.table import Mistake, mistakes_of
from bayesid.trials.noise import rough_noise, spikes
from bayesid.trials.rudder_sides import other_side
from bayesid.trials.trial import Floats, Run

NAMED_AT = 0.95  # probability that the log is wrong from which the most probable mistake is named
FOLLOWS = 0.3  # residual over size a corrected relation may keep: it has to hold, not only to hold better
SAMPLES = 3000  # of a run that are read: blocks average over them
SOME_RUNS = 5.0  # nats by which some runs must speak against the others
IMPLAUSIBLE = 12.0  # nats for a channel whose size no vehicle reaches
NEVER = -1e4  # log odds of a correction that makes a channel implausible
ALSO = 4.0  # nats within which another mistake is not told from the one named
ANOTHER = 20.0  # nats another mistake must bring beside one: a mend is not exact, and leaves traces
RULED_OUT = 25.0  # nats behind the best, from which on the behaviour is not asked
MOST = 3  # mistakes named beside one another


class Behaviour(Protocol):
    """Somebody who knows more than kinematics: log likelihood of a run, and what channels matter."""

    @property
    def needs(self) -> Mapping[str, frozenset[str]]: ...

    @property
    def mistakes(self) -> Sequence[Mistake]: ...

    def __call__(self, run: Run) -> Mapping[str, float]: ...


@dataclass(frozen=True, eq=False)
class Base:
    """A run as it is: relations, log evidence of signs, implausible channels, what the behaviour says."""

    run: Run
    held: Mapping[str, Held]
    signs: Mapping[str, float]
    odd: frozenset[str]
    travel: float | None
    seen: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Weighed:
    """One hypothesis: log odds against the log as it is, per run and by what tells it.

    Attributes
    ----------
    odds : (runs,) [nats]
    gain : what tells it -> (runs,) [nats]
    levels : relation -> (runs, 2) residual over size before and after; NaN where there is none
    """

    mistake: Mistake
    odds: Floats
    gain: Mapping[str, Floats]
    levels: Mapping[str, Floats] = field(default_factory=dict)

    def told_by(self, runs: np.ndarray) -> tuple[str, ...]:
        """What tells it in some runs, the most first."""
        sums = {k: float(v[runs].sum()) for k, v in self.gain.items()}
        return tuple(sorted((k for k in sums if sums[k] > 1.0), key=lambda k: -sums[k]))

    def level(self, runs: np.ndarray) -> tuple[float, float]:
        """Residual before and after of the relation that tells most; zeros where no relation does."""
        key = next((k for k in self.told_by(runs) if k in self.levels), None)
        if key is None:
            return 0.0, 0.0
        pairs = self.levels[key][runs]
        pairs = pairs[np.isfinite(pairs).all(axis=1)]
        if not pairs.size:
            return 0.0, 0.0
        before, after = np.median(pairs, axis=0)
        return float(before), float(after)


def check_input(
    runs: Sequence[Run],
    travel: float | None = None,
    behaviour: Behaviour | None = None,
    fin_rates: Mapping[str, float] | None = None,
    known: Handedness = UNKNOWN,
) -> InputCheck:
    """What kinematics finds wrong in the runs, one mistake at a time until nothing more is found.

    Parameters
    ----------
    travel : time in which the vehicle travels its length [s], where it is known: lever arms and latencies
        are measured by it
    behaviour : asked about mistakes that kinematics leaves open
    fin_rates : fin -> largest rate [rad/s], inf where it is not known
    known : what tells a log from its mirror image
    """
    from bayesid.trials.mistakes.along_track import along_track
    from bayesid.trials.mistakes.contrary import contrary
    from bayesid.trials.mistakes.frozen import frozen
    from bayesid.trials.mistakes.late_run import late_runs
    from bayesid.trials.mistakes.lost_bottom import lost_bottom
    from bayesid.trials.mistakes.mirror import mirrored
    from bayesid.trials.mistakes.orders import ordered
    from bayesid.trials.mistakes.sides import sides
    from bayesid.trials.mistakes.sized import sized

    kept = [_without_spikes(_thinned(run)) for run in runs]
    found: list[InputFinding] = []
    first = base = [base_of(run, travel, behaviour) for run in kept]
    for k in range(MOST):
        own = () if behaviour is None else behaviour.mistakes
        asked = distinct((*mistakes_of(known), *own), {name for run in kept for name in _logged(run)})
        every = [*weighed(base, asked), *mirrored(base, known), *sized(base)]
        every += [*ordered(base, fin_rates), *frozen(base), *contrary(base), *along_track(base)]
        late = late_runs(base)
        every += [*lost_bottom(base), *(() if late.withheld else sides(base)), *late.told]
        if behaviour is not None:
            every = _with_behaviour(every, base, behaviour)
        one = named(every, [run.name for run in kept], ANOTHER * k)
        if one is None or one.name in {f.name for f in found}:
            break
        found.append(one)
        if one.correction is None:
            break
        kept = [apply(one.correction, run) for run in kept]
        base = [base_of(run, travel, behaviour) for run in kept]
    mended = not found or found[-1].correction is not None
    spoilt = frozenset() if mended else frozenset(found[-1].channels)
    return InputCheck(tuple(found), _in_order(first), _unseen(first), noisy=too_noisy(base, spoilt))


def distinct(mistakes: Iterable[Mistake], logged: Container[str]) -> list[Mistake]:
    """Those that differ on the channels logged: where only the heading is, all angles in degrees is it.

    The first of several stays, with the prior of all.
    """
    kept: dict[tuple[str, ...], Mistake] = {}
    for m in mistakes:
        key: tuple[str, ...] = (m.name,)
        if m.correction is not None:
            scale = {k: v for k, v in m.correction.scale.items() if k in logged}
            key = replace(m.correction, scale=dict(sorted(scale.items()))).lines(15) or key
        if key in kept:
            both = float(np.logaddexp(kept[key].log_prior, m.log_prior))
            kept[key] = replace(kept[key], log_prior=both)
        else:
            kept[key] = m
    return list(kept.values())


def _logged(run: Run) -> Iterator[str]:
    for group in run.GROUPS:
        if group != "extra":
            yield from getattr(run, group)


def base_of(run: Run, travel: float | None = None, behaviour: Behaviour | None = None) -> Base:
    """A run weighed as it is."""
    held = {k: weigh(r) for k, r in relations(run, travel=travel).items()}
    return Base(run, held, sign_evidence(run), implausible(run), travel, behaviour(run) if behaviour else {})


def _with_behaviour(found: list[Weighed], base: Sequence[Base], behaviour: Behaviour) -> list[Weighed]:
    """Hypotheses with what the behaviour says of the corrected runs, where kinematics does not rule them out.

    No log density is above that of a log as expected, so that what a mend can win is what the log as it is
    has lost: a mistake for which that is too little is not asked about.
    """
    scores = [w.mistake.log_prior + float(w.odds.sum()) for w in found]
    top = max([0.0, *scores])
    out = []
    for w, score in zip(found, scores, strict=True):
        correction = w.mistake.correction
        keys = [
            k
            for k, needs in behaviour.needs.items()
            if correction is not None and correction.channels & needs
        ]
        lost = -sum(one.seen[k] for one in base for k in keys if k in one.seen)
        fins = frozenset[str]() if correction is None else _exchanged_fins(correction)
        if (
            correction is None
            or not _all_move(fins, base)
            or score < top - RULED_OUT
            or not keys
            or score + lost < -ALSO
        ):
            out.append(w)
            continue
        odds, gain = w.odds.copy(), {k: v.copy() for k, v in w.gain.items()}
        for i, one in enumerate(base):
            if one.seen and correction.of(one.run):
                said, seen = behaviour(apply(correction, one.run)), one.seen
                if fins:  # one that rests in the place of one that moves is as expected
                    said, seen = (dict.fromkeys(keys, 0.0) | dict(each) for each in (said, seen))
                for k in keys:
                    if k in said and k in seen:
                        key = BY_VEHICLE + k
                        gain.setdefault(key, np.zeros(len(base)))[i] += said[k] - seen[k]
                        odds[i] += said[k] - seen[k]
        out.append(replace(w, odds=odds, gain=gain))
    return out


def _exchanged_fins(correction: Correction) -> frozenset[str]:
    names = (name for pair in correction.exchange for name in pair)
    return frozenset(name.removesuffix("_cmd") for name in names if name.startswith("delta"))


def _all_move(fins: Iterable[str], base: Sequence[Base]) -> bool:
    """Whether every fin moves in some run: one that never does has nothing to tell, and exchanged it would
    excuse the other."""
    inputs = [[one.run.input(fin) for one in base] for fin in fins]
    return all(any(x is not None and np.ptp(x) > 0.0 for x in each) for each in inputs)


def weighed(base: Sequence[Base], mistakes: Sequence[Mistake]) -> list[Weighed]:
    """Every mistake on which at least one run speaks."""
    found = (weigh_one(base, mistake) for mistake in mistakes)
    return [one for one in found if one is not None]


def named(found: Sequence[Weighed], names: Sequence[str], less: float = 0.0) -> InputFinding | None:
    """The most probable mistake, where it is sure enough and its relations then hold.

    Parameters
    ----------
    less : taken off the log prior of every mistake [nats]
    """
    ready: list[tuple[Weighed, float, np.ndarray, bool]] = []
    everywhere = np.ones(len(names), dtype=bool)
    for w in found:
        whole = float(w.odds.sum())
        speak = w.odds > 1.0
        some = float((w.odds[speak] - 1.0).sum()) - SOME_RUNS
        part = some > whole + SOME_RUNS and not speak.all()
        chosen = speak if part else everywhere
        if (part and not speak.any()) or not w.told_by(chosen) or w.level(chosen)[1] > FOLLOWS:
            continue
        ready.append((w, w.mistake.log_prior - less + (some if part else whole), chosen, part))
    if not ready:
        return None
    log_odds = np.array([0.0] + [score for _, score, _, _ in ready])
    probability = np.exp(log_odds - logsumexp(log_odds))
    sure = 1.0 - float(probability[0])
    if sure < NAMED_AT:
        return None
    best = int(np.argmax(probability[1:]))
    (w, score, chosen, part), own = ready[best], float(probability[1 + best])
    near = [k for k, (other, s, *_) in enumerate(ready) if other is not w and s > score - ALSO]
    also = tuple(ready[k][0].mistake.name for k in near)
    together = own + float(probability[1:][near].sum()) if near else 0.0
    correction = w.mistake.correction
    own_runs = () if correction is None else correction.names_runs or correction.runs
    concerned = own_runs or tuple(n for n, keep in zip(names, chosen, strict=True) if keep)
    whole_trial = not part and (not own_runs or len(own_runs) == len(names))
    if correction is not None and part and not own_runs:
        correction = replace(correction, runs=concerned)
    before, after = w.level(chosen)
    return InputFinding(
        w.mistake.name, w.mistake.says, w.mistake.channels, concerned, whole_trial, own,
        w.told_by(chosen), before, after, correction, also, together, score - _of_vehicle(w, chosen),
    )  # fmt: skip


def _of_vehicle(w: Weighed, runs: np.ndarray) -> float:
    """What the behaviour of the vehicle says of a mistake in some runs [nats]."""
    return sum(float(v[runs].sum()) for k, v in w.gain.items() if k.startswith(BY_VEHICLE))


def weigh_one(base: Sequence[Base], mistake: Mistake) -> Weighed | None:
    """Log odds of one mistake with a correction; None where no run speaks on it."""
    correction = mistake.correction
    if correction is None:
        return None
    touched = [k for k, needs in NEEDS.items() if correction.channels & set(needs)]
    turned = [k for k, needs in SIGNS.items() if correction.channels & needs]
    fins = _exchanged_fins(correction)
    odds, speaks = np.zeros(len(base)), False
    gain: dict[str, Floats] = {}
    levels: dict[str, Floats] = {}

    def add(key: str, i: int, nats: float) -> None:
        nonlocal speaks
        gain.setdefault(key, np.zeros(len(base)))[i] += nats
        odds[i] += nats
        speaks = True

    for i, one in enumerate(base):
        there = {"t", *one.run.data, *one.run.commands, *one.run.measured_inputs}
        if not correction.of(one.run) or not correction.channels & there:
            continue
        speaks = speaks or bool(one.seen)
        fixed = apply(correction, one.run)
        odd = implausible(fixed, correction.channels, one.odd)
        if odd - one.odd:
            add("size", i, NEVER)
            continue
        if one.odd - odd:
            add("size", i, IMPLAUSIBLE * len(one.odd - odd))
        now = (
            relations(fixed, mistake.factors, one.travel, touched)
            if any(k in one.held for k in touched)
            else {}
        )
        for k in touched:
            if k not in one.held or k not in now:
                continue
            held, was = weigh(now[k]), one.held[k]
            if min(held.level, was.level) > FOLLOWS:
                continue  # a relation that holds in neither says nothing of either
            add(k, i, held.log_evidence - was.log_evidence)
            levels.setdefault(k, np.full((len(base), 2), np.nan))[i] = was.level, held.level
        if turned and (fins or any(k in one.signs for k in turned)):
            signs, was_signs = sign_evidence(fixed, turned), one.signs
            if fins:  # what rests in the place of what moves tells no sign
                signs, was_signs = (dict.fromkeys(turned, 0.0) | dict(each) for each in (signs, was_signs))
            for k in turned:
                if k in signs and k in was_signs:
                    add(k, i, signs[k] - was_signs[k])
    return Weighed(mistake, odds, gain, levels) if speaks else None


def _thinned(run: Run) -> Run:
    """Every so many samples of a long run; one with empty cells is read whole, slow channels stay in step."""
    stride = run.n_samples // SAMPLES
    if stride < 2 or any(np.isnan(values).any() for values in run.data.values()):
        return run
    groups: dict[str, Any] = {g: {k: v[::stride] for k, v in getattr(run, g).items()} for g in run.GROUPS}
    return replace(run, t=run.t[::stride], **groups)


def _without_spikes(run: Run) -> Run:
    """A run without its lone outliers: residuals are taken as white, and a few outliers at the ends of blocks
    outweigh all others, so that a delay which happens to miss them passed for one that is there.

    Readings are counted as evenly spaced, also where some are missing: what lies on a line with the readings
    on one side of a gap is no outlier.
    """
    data = {name: values.copy() for name, values in run.data.items()}
    for values in data.values():
        sigma = rough_noise(run.t, values)
        if np.isfinite(sigma):
            read = np.flatnonzero(np.isfinite(values))
            values[read[spikes(np.arange(float(read.size)), values[read], sigma)]] = np.nan
    return replace(run, data=data)


_MEANS = {
    "track": "track against speed and heading", "course": "course against heading",
    "yaw": "heading against yaw rate",
    "depth": "depth against speed and pitch", "pitch": "pitch against pitch rate",
    "roll": "roll against roll rate",
}  # fmt: skip


def _levels(base: Sequence[Base], key: str) -> list[float]:
    return [one.held[key].level for one in base if key in one.held]


def _in_order(base: Sequence[Base]) -> tuple[str, ...]:
    good = []
    for key, words in _MEANS.items():
        levels = _levels(base, key)
        if levels and float(np.median(levels)) < FOLLOWS:
            good.append(words)
    rudder = sum(one.signs.get("rudder", 0.0) - one.signs.get("rudder against", 0.0) for one in base)
    if rudder > SOME_RUNS and not other_side([one.run for one in base]):
        good.append("sign of the rudder")
    if base and not any(one.odd for one in base):
        good.append("size of all channels")
    return tuple(good)


def _unseen(base: Sequence[Base]) -> tuple[str, ...]:
    there = {key for one in base for key in one.held}
    lacks = []
    if not there & {"track", "course"}:
        lacks.append("the track against speed and heading")
    if "yaw" not in there:
        lacks.append("heading against yaw rate")
    return tuple(lacks)


def too_noisy(base: Sequence[Base], spoilt: frozenset[str]) -> tuple[str, ...]:
    """Relations that are not in order and that no mistake explains: their residual is not small in most runs.

    Parameters
    ----------
    base : runs after the mends of the mistakes found
    spoilt : channels of a mistake that has no mend
    """
    out = []
    for key, words in _MEANS.items():
        levels = _levels(base, key)
        if not levels or float(np.median(levels)) < FOLLOWS or spoilt & set(NEEDS[key]):
            continue
        count = sum(level >= FOLLOWS for level in levels)
        where = "" if count == len(levels) else f" in {count} of {len(levels)} runs"
        out.append(f"{words}{where}")
    return tuple(out)
