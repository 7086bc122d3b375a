"""Mistakes that have a size: another north, a clock that is fast, a channel that is late or dead.

Takes runs weighed as they are. The size is estimated from the runs, then the mistake is weighed as every
other; what its size could have been is paid for in its prior.
Does not: name latencies, biases and scales of the catalogue of effects.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bayesid.errors import BayesidError
from bayesid.trials.correction import Correction, apply
from bayesid.trials.kinematics.blocks import joined
from bayesid.trials.kinematics.evidence import weigh
from bayesid.trials.kinematics.relations import NEEDS, relations
from bayesid.trials.mistakes.judge import FOLLOWS, SOME_RUNS, Base, Weighed, weigh_one
from bayesid.trials.mistakes.table import COMMON, RARE, USUAL, Mistake
from bayesid.trials.mistakes.travel import travel_time
from bayesid.trials.trial import Floats, Run
from bayesid.trials.window import window
from bayesid.words import and_list

LARGEST_BIAS = math.radians(30.0)  # of heading_bias in the catalogue: what is larger is another north
# Clock: scales of instruments are nought but for one log in twenty, then of the catalogue's usual size
CLOCK_PRIOR, NO_SCALE, FAINT, USUAL_SCALE, LARGE_SCALE = COMMON, 0.95, 0.003, 0.025, 0.1
LARGEST_CLOCK, LEAST_CLOCK = 0.35, 0.01
CLOCKED, UNCLEAR = ("track", "yaw", "depth", "pitch", "roll"), 0.2
CLOCK_FLOOR = 0.001  # to which scales are known at best
# Delays tried, in L/U; shorter ones are the catalogue's latency
DELAYS = (4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)
# Heading and yaw rate have no latency in the catalogue: shorter ones too, from one sample on [L/U]
SHORT_DELAYS, SHORTLY_LATE = (0.5, 1.0, 2.0, 3.0), ("psi", "r")
LATE = {"u, v": ("u", "v", "w"), "psi": ("psi",), "r": ("r",), "x, y": ("x", "y")}
# Channels of which a relation compares single readings, at the ends of blocks; others are integrated
READ_AT_ENDS = {"track": {"x", "y"}, "yaw": {"psi"}}
BETTER = 0.8  # residual after over before: a delay that is there is worth more than noise
LONGEST_SHARE = 0.2  # of a run
DEAD_TURN = 0.3  # rad turned while a rate or heading stands still
JUMP = 20.0  # a step over the median one, from which on it is looked at
AT_END = 2  # readings at either end of a run among which a jump is not told from an outlier
SURE = 40.0  # nats of a column that never changes while another says it must, as one frozen at most


def sized(base: Sequence[Base]) -> list[Weighed]:
    """Hypotheses of all kinds with a size, weighed."""
    found = [_north(base), _clock(base), *_dead(base), *_late(base), *_jumps(base)]
    return [one for one in found if one is not None]


def _north(base: Sequence[Base]) -> Weighed | None:
    """Heading and position count from different norths."""
    total, power = 0j, 0.0
    for one in base:
        data = one.run.data
        if not {"x", "y", "psi"} <= set(data):
            continue
        good = np.isfinite(data["x"]) & np.isfinite(data["y"]) & np.isfinite(data["psi"])
        at = np.flatnonzero(good)[:: max(1, int(good.sum()) // 60)]
        if at.size < 5:
            continue
        moved = np.diff(data["x"][at] + 1j * data["y"][at])
        ahead = np.exp(0.5j * (data["psi"][at][1:] + data["psi"][at][:-1]))
        total += complex(np.sum(moved * np.conj(ahead)))
        power += float(np.sum(np.abs(moved)))
    if not power > 0 or abs(total) < 0.7 * power:
        return None
    angle = float(np.angle(total))
    if abs(angle) < LARGEST_BIAS:
        return None
    degrees = math.degrees(angle)
    says = f"heading and position count from different norths, {degrees:.0f} degrees apart"
    correction = Correction(offset={"psi": angle})
    prior = USUAL + math.log(0.02 / (2 * math.pi))
    return weigh_one(base, Mistake("north of heading and position", says, correction, prior))


def _clock(base: Sequence[Base]) -> Weighed | None:
    """Every relation that integrates a rate over time asks for one and the same factor on the time."""
    pooled = {}
    for key in CLOCKED:
        held = [one.held[key] for one in base if key in one.held and one.held[key].level < UNCLEAR]
        if held:
            pooled[key] = _pooled(*np.array([h.estimate["scale"] for h in held]).T)
    if not {"track", "yaw"} <= set(pooled):
        return None
    value, sd = np.array(list(pooled.values())).T
    precision = float(np.sum(sd**-2))
    both = float(np.sum(value / sd**2)) / precision
    if not LEAST_CLOCK < abs(both) < LARGEST_CLOCK:
        return None
    # an error of a clock is as likely in every decade and of either sign, an instrument's scale is its own
    each = -0.5 * ((value - both) / sd) ** 2 - np.log(sd * math.sqrt(2 * math.pi))
    nats = float(each.sum()) + 0.5 * math.log(2 * math.pi / precision)
    nats -= math.log(2.0 * abs(both) * math.log(LARGEST_CLOCK / LEAST_CLOCK))
    nats -= sum(scale_by_itself(float(v), float(s)) for v, s in zip(value, sd, strict=True))
    odds = np.full(len(base), nats / len(base))
    scale = 1.0 + both
    word = "fast" if scale < 1 else "slow"
    says = f"the clock is {abs(1 / scale - 1):.1%} {word}"
    correction = Correction(time_scale=scale)
    levels = {"track": np.array([[one.held["track"].level] * 2 if "track" in one.held else [np.nan] * 2
                                 for one in base])}  # fmt: skip
    return Weighed(Mistake("clock", says, correction, CLOCK_PRIOR), odds, dict.fromkeys(pooled, odds), levels)


def _pooled(values: Floats, sd: Floats) -> tuple[float, float]:
    """Mean over runs and its sd, not below what runs scatter by."""
    weight = 1.0 / (sd**2 + CLOCK_FLOOR**2)
    mean = float(np.sum(weight * values) / weight.sum())
    chi2 = float(np.sum(weight * (values - mean) ** 2)) / max(1, values.size - 1)
    return mean, math.sqrt(max(1.0, chi2) / float(weight.sum()) + CLOCK_FLOOR**2)


def scale_by_itself(value: float, sd: float) -> float:
    """Log density of the scale of one instrument."""
    parts = ((NO_SCALE, FAINT), (0.7 * (1 - NO_SCALE), USUAL_SCALE), (0.3 * (1 - NO_SCALE), LARGE_SCALE))
    density = sum(
        share * math.exp(-0.5 * value**2 / (s**2 + sd**2)) / math.sqrt(2 * math.pi * (s**2 + sd**2))
        for share, s in parts
    )
    return math.log(max(density, 1e-300))


def _dead(base: Sequence[Base]) -> list[Weighed | None]:
    """Columns that never change while others say they must, and those that do so in the same runs together:
    one that is dead makes another no less so, and alone they would be rivals of each other.

    A run in which a column lives speaks against its being dead there: it is kept."""
    out: list[Weighed | None] = []
    alike: dict[tuple[float, ...], list[str]] = {}
    for name in ("psi", "r", "u", "v", "x", "y", "theta", "q", "delta_r"):
        logged = [one for one in base if _values(one.run, name) is not None]
        still = np.array([_still(one.run, name) for one in base])
        if not logged or not still.any():
            continue
        moved = still & np.array([_must_move(one.run, name) for one in base])
        if not moved.any():
            continue
        rudder = name == "delta_r"
        if rudder and not all(_still(one.run, name) for one in logged):
            continue  # runs with the rudder amidships there are
        word = "the rudder" if rudder else name
        says = f"{word} never changes although the vehicle moves: a dead column"
        correction = None if rudder else Correction(drop=(name,))
        lives = ~still & np.array([_values(one.run, name) is not None for one in base])
        odds = np.where(moved, SURE, np.where(lives, -SURE, 0.0))
        mistake = Mistake(f"dead {name}", says, correction, COMMON, (name,))
        out.append(Weighed(mistake, odds, {"size": odds}))
        if not rudder:
            alike.setdefault(tuple(odds.tolist()), []).append(name)
    for each, names in alike.items():
        if len(names) > 1:
            odds = len(names) * np.array(each)
            says = f"{and_list(names)} never change although the vehicle moves: dead columns"
            prior = COMMON * len(names)
            mistake = Mistake(f"dead {', '.join(names)}", says, Correction(drop=tuple(names)), prior)
            out.append(Weighed(mistake, odds, {"size": odds}))
    return out


def _values(run: Run, name: str) -> Floats | None:
    return run.input(name) if name.startswith("delta") else run.data.get(name)


def _still(run: Run, name: str) -> bool:
    values = _values(run, name)
    if values is None:
        return False
    good = values[np.isfinite(values)]
    return good.size >= 10 and float(np.ptp(good)) == 0.0


def _must_move(run: Run, name: str) -> bool:
    """Whether another channel says that this one changes."""
    data = run.data

    def turned(key: str) -> float:
        return float(np.nanmax(data[key]) - np.nanmin(data[key])) if key in data else 0.0

    def swung(key: str) -> float:
        if key not in data:
            return 0.0
        angle = np.cumsum(np.nan_to_num(data[key][:-1]) * np.diff(run.t))
        return float(np.ptp(angle)) if angle.size else 0.0

    far = 0.0
    if {"x", "y"} <= set(data):
        far = max(turned("x"), turned("y"))
    if name == "psi":
        return swung("r") > DEAD_TURN
    if name == "r":
        return turned("psi") > DEAD_TURN
    if name == "delta_r":
        return _weaves(run)
    if name in ("u", "v"):  # exactly constant: no measured or simulated speed is, in a turn
        return turned("psi") > DEAD_TURN and (name == "v" or turned("r") > 0 or far > 0)
    if name in ("x", "y"):
        return far > 0 and turned("psi") > DEAD_TURN
    return (swung("q") if name == "theta" else turned("theta")) > DEAD_TURN


def _weaves(run: Run) -> bool:
    """Whether the heading swings to and fro, or turns by more than half a circle, with nothing ordered."""
    psi = run.data.get("psi")
    if psi is None:
        return False
    good = psi[np.isfinite(psi)]
    if good.size < 10:
        return False
    return float(np.ptp(good)) > math.pi or _reversals(good, math.radians(10.0)) >= 3


def _reversals(values: Floats, least: float) -> int:
    """How often a series turns round by more than `least`."""
    count, low, high, way = 0, values[0], values[0], 0
    for value in values:
        low, high = min(low, value), max(high, value)
        if way <= 0 and value - low > least:
            count, way, high = count + (way < 0), 1, value
        elif way >= 0 and high - value > least:
            count, way, low = count + (way > 0), -1, value
        if way > 0:
            low = max(low, high - 2 * least)
        elif way < 0:
            high = min(high, low + 2 * least)
    return count


def _late(base: Sequence[Base]) -> list[Weighed | None]:
    """A group of channels logged late, or early, by more than the catalogue's latency."""
    return [_late_group(base, word, names) for word, names in LATE.items()]


def _late_group(base: Sequence[Base], word: str, names: tuple[str, ...]) -> Weighed | None:
    touched = [k for k, needs in NEEDS.items() if k in ("track", "yaw") and set(names) & set(needs)]
    unit = travel_time(base)
    logged = [bool(set(names) & set(one.run.data)) and any(k in one.held for k in touched) for one in base]
    if unit is None or not any(logged):
        return None
    # whole steps: between two readings interpolation would take noise off, which speaks for any delay
    step = max(float(np.median(np.diff(one.run.t))) for one in base)
    tried = (*(SHORT_DELAYS if word in SHORTLY_LATE else ()), *DELAYS)
    whole = {round(d * unit / step) for d in tried} - {0}
    coarse = [s * step * k for k in sorted(whole) for s in (1.0, -1.0)]
    if not coarse:
        return None
    odds, levels, blocks = _weigh_delays(base, logged, names, touched, coarse)
    best = int(np.argmax(odds.sum(axis=1)))
    if not odds[best].sum() > SOME_RUNS + _by_chance(blocks[best].sum(), len(coarse)):
        return None
    fine, factors = coarse, (np.geomspace(0.7, 1.4, 9), np.linspace(0.92, 1.08, 9))
    for factor in factors:
        near = {round(fine[best] * f / step) for f in factor} - {0}
        fine = [step * k for k in sorted(near)]
        odds, levels, blocks = _weigh_delays(base, logged, names, touched, fine)
        best = int(np.argmax(odds.sum(axis=1)))
    if word in SHORTLY_LATE:
        left = _left_of_delay(base, names, fine[best])
        at = {fine[best], step * (round((fine[best] + left) / step) or round(fine[best] / step))}
        fine = sorted(at, key=lambda d: d == fine[best])  # the one nearer to what is left first
        odds, levels, blocks = _weigh_delays(base, logged, names, touched, fine)
        best = 0 if odds[0].sum() > SOME_RUNS + _by_chance(blocks[0].sum(), len(coarse)) else len(fine) - 1
    told = (odds[best] > 0) & np.isfinite(levels[best]).all(axis=1)
    # the runs that speak for it, by more than the best of as many delays would there by chance
    if not odds[best][told].sum() > SOME_RUNS + _by_chance(blocks[best][told].sum(), len(coarse)):
        return None
    if not told.any() or not np.median(levels[best][told, 1] / levels[best][told, 0]) < BETTER:
        return None
    delay = fine[best]
    says = f"{word} {'are' if ',' in word else 'is'} {abs(delay):.2g} s {'late' if delay > 0 else 'early'}"
    prior = RARE - math.log(len(coarse))
    mistake = Mistake(f"{word} late", says, Correction(late=dict.fromkeys(names, delay)), prior)
    return Weighed(mistake, odds[best], {"track": odds[best]}, {"track": levels[best]})


def _left_of_delay(base: Sequence[Base], names: tuple[str, ...], delay: float) -> float:
    """By how much more heading or yaw rate is late than a delay, by what the two then say of each other [s].

    Evidence of neighbouring delays differs by the noise of the readings at the ends of blocks, where a small
    rest is taken as a latency: that is estimated with all of them. A heading that is late turns later than
    its rate says, a rate that is late earlier than the heading.
    """
    sign = -1.0 if names == ("psi",) else 1.0
    found = []
    for one in base:
        if "yaw" not in one.held:
            continue
        fixed = apply(Correction(late=dict.fromkeys(names, delay)), one.run)
        if (yaw := relations(fixed, travel=one.travel, only=("yaw",)).get("yaw")) is not None:
            found.append(weigh(yaw).estimate["late"])
    if not found:
        return 0.0
    late, sd = np.array(found).T
    return sign * float(np.sum(late / sd**2) / np.sum(sd**-2))


def _weigh_delays(
    base: Sequence[Base],
    logged: Sequence[bool],
    names: tuple[str, ...],
    touched: Sequence[str],
    delays: list[float],
) -> tuple[Floats, Floats, Floats]:
    """Log odds (delays, runs), levels (delays, runs, 2) and blocks whose ends a delay moves (delays, runs),
    all over the readings every delay leaves."""
    odds = np.zeros((len(delays), len(base)))
    levels = np.full((len(delays), len(base), 2), np.nan)
    blocks = np.zeros(odds.shape)
    for i, one in enumerate(base):
        usable = [j for j, d in enumerate(delays) if abs(d) <= LONGEST_SHARE * one.run.duration]
        if not logged[i] or not usable:
            continue
        margin = max(abs(delays[j]) for j in usable)
        inner = (one.run.t[0] + margin, one.run.t[-1] - margin)
        try:
            was = {
                k: weigh(r)
                for k, r in relations(window(one.run, *inner), travel=one.travel, only=touched).items()
            }
        except BayesidError:
            continue
        for j in usable:
            fixed = window(apply(Correction(late=dict.fromkeys(names, delays[j])), one.run), *inner)
            for k, relation in relations(fixed, travel=one.travel, only=touched).items():
                if k in touched and k in was:
                    held = weigh(relation)
                    if min(held.level, was[k].level) <= FOLLOWS:
                        gain = held.log_evidence - was[k].log_evidence
                        if k == "track":
                            gain = min(
                                gain, _most_told(one.run, delays[j], relation.response.size, held.level)
                            )
                        odds[j, i] += gain
                        levels[j, i] = was[k].level, held.level
                        blocks[j, i] += relation.response.size * bool(READ_AT_ENDS[k] & set(names))
    return odds, levels, blocks


def _most_told(run: Run, delay: float, readings: int, level: float) -> float:
    """The most log evidence n readings of the track can have of a delay, by what it moves [nats].

    A delay moves a displacement by as much as the velocity over ground differs across it: by nothing on a
    straight run, where a better fit with it is one to other noise. `level` is the residual over the size.
    """
    psi, known = joined(run.t, run.data["psi"])
    speed = np.ones(run.t.size)
    for name in ("u", "u_water"):
        if name in run.data:
            speed, read = joined(run.t, run.data[name])
            known = known & read
            break
    if known.sum() < 2:
        return 0.0
    velocity = (speed * np.exp(1j * psi))[known]
    t = run.t[known]
    before = np.interp(t - delay, t, velocity.real) + 1j * np.interp(t - delay, t, velocity.imag)
    moved = float(np.sum(np.abs(velocity - before) ** 2) / max(float(np.sum(np.abs(velocity) ** 2)), 1e-300))
    return 0.5 * readings * math.log1p(moved / level**2)


def _by_chance(blocks: float, tried: int) -> float:
    """Log odds that the best of some delays has by chance where none is there: each compares other readings.

    Residuals of n blocks of noise have a log evidence of -n/2 log s^2, that of two draws of it differs by
    sqrt(n), and the largest of m such is about sqrt(2 log m) of it.
    """
    return math.sqrt(2.0 * blocks * math.log(max(tried, 2)))


def _jumps(base: Sequence[Base]) -> list[Weighed | None]:
    """A place from which on the track, or the heading, is offset: files merged, or a fix lost and found."""
    out: list[Weighed | None] = []
    for _i, one in enumerate(base):
        if (jump := _track_jump(one)) is not None:
            when, size = jump
            correction = Correction(
                offset={"x": -size.real, "y": -size.imag},
                from_time={"x": when, "y": when},
                runs=(one.run.name,),
            )
            says = (
                f"x and y jump by {abs(size):.3g} m at t = {when:.6g} s of {one.run.name}; where a fix ended "
                "dead reckoning there, the positions before it measure nothing (`leave_out` of [corrections])"
            )
            out.append(
                weigh_one(base, Mistake("jump of x, y", says, correction, RARE - math.log(one.run.n_samples)))
            )
        if (turn := _heading_jump(one)) is not None:
            when, angle = turn
            correction = Correction(offset={"psi": -angle}, from_time={"psi": when}, runs=(one.run.name,))
            degrees = math.degrees(angle)
            says = f"the heading jumps by {degrees:.0f} degrees at t = {when:.6g} s of {one.run.name}"
            out.append(
                weigh_one(base, Mistake("jump of psi", says, correction, RARE - math.log(one.run.n_samples)))
            )
    return out


def _track_jump(one: Base) -> tuple[float, complex] | None:
    """Time and size of the step of the track that dead reckoning contradicts most."""
    data = one.run.data
    if not {"x", "y", "psi", "u"} <= set(data):
        return None
    good = np.flatnonzero(np.isfinite(data["x"] + data["y"] + data["psi"] + data["u"]))
    if good.size < 20:
        return None
    t, psi = one.run.t[good], data["psi"][good]
    velocity = (data["u"][good] + 1j * np.nan_to_num(data["v"][good] if "v" in data else 0.0)) * np.exp(
        1j * psi
    )
    step = np.diff(data["x"][good] + 1j * data["y"][good]) - 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t)
    return _largest(t, step)


def _heading_jump(one: Base) -> tuple[float, float] | None:
    data = one.run.data
    if not {"psi", "r"} <= set(data):
        return None
    good = np.flatnonzero(np.isfinite(data["psi"] + data["r"]))
    if good.size < 20:
        return None
    t, rate = one.run.t[good], data["r"][good]
    found = _largest(t, np.diff(data["psi"][good]) - 0.5 * (rate[1:] + rate[:-1]) * np.diff(t))
    if found is None:
        return None
    when, turn = found[0], found[1].real
    k = int(np.searchsorted(t, when)) - 1
    # a fin that goes over between two readings: the rate was anywhere among those around
    around = rate[max(k - 1, 0) : k + 3]
    return None if abs(turn) < 0.5 * float(np.ptp(around)) * (t[k + 1] - t[k]) else (when, turn)


def _largest(t: Floats, step: np.ndarray) -> tuple[float, complex] | None:
    """A step many times the others, with none of the opposite sign beside it as an outlier has."""
    size = np.abs(step)
    k = int(np.argmax(size))
    if not size[k] > JUMP * max(float(np.median(size)), 1e-12):
        return None
    if not AT_END <= k < size.size - AT_END:
        return None
    beside = [step[j] for j in (k - 1, k + 1) if 0 <= j < step.size]
    if any(abs(b + step[k]) < 0.5 * size[k] for b in beside):
        return None
    return float(t[k + 1]), complex(step[k])
