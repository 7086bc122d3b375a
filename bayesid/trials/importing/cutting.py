"""A long log cut into runs by its commands: straight, turn, zigzag, spiral, random, rest.

Takes rudder, heading and speed over time. Does not: change data; the windows are a proposal in the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.trials.trial import Floats

_DEG = np.pi / 180.0
NEUTRAL = 1.5 * _DEG  # rudder within this of its middle is amidships
LEAD = 5.0  # s of steady motion kept before the first order
SHORTEST = 20.0  # s; shorter pieces are no run
# rad; a vehicle that turns further before its rudder goes over does not weave about a course: it turns
LONGEST_LEG = np.pi
SERVO = 0.25  # of the time a rudder moves from side to side, in which it is still seen to stand
# Seconds, and times the usual step, without any row, after which a log goes on as another run.
BETWEEN_RUNS, BETWEEN_STEPS = 60.0, 10.0


@dataclass(frozen=True)
class Piece:
    """start, end [s]; kind; words such as "zigzag 20/20"."""

    start: float
    end: float
    kind: str
    words: str


def cut(t: Floats, rudder: Floats, psi: Floats | None, speed: Floats | None) -> list[Piece]:
    """Pieces in order of time; none reaches over a gap between runs.

    Parameters
    ----------
    t : (n,) s, increasing
    rudder : (n,) rad, held or measured; finite
    psi : (n,) rad, continuous, or None
    speed : (n,) m/s or None
    """
    sections = _sections(t)
    if len(sections) > 1:
        return [
            piece
            for s in sections
            for piece in cut(t[s], rudder[s], *(None if v is None else v[s] for v in (psi, speed)))
        ]
    if t.size < 10:
        return []
    away = np.abs(rudder - _middle(rudder)) > max(NEUTRAL, 0.1 * float(np.max(np.abs(rudder))))
    rest = np.zeros(t.shape, dtype=bool)
    if speed is not None:
        smooth = _smooth(t, np.abs(np.nan_to_num(speed)), 5.0)
        top = float(np.percentile(smooth, 90))
        rest = smooth < 0.15 * top if top > 0 else rest
    active = _close(t, away & ~rest, rudder, psi)
    pieces: list[Piece] = []
    for first, last, kind in _spans(active, rest):
        start, end = float(t[first]), float(t[min(last + 1, t.size - 1)])
        if kind == "active":
            before = pieces[-1].start + SHORTEST if pieces else float(t[0])
            start = max(
                float(t[0]), before if pieces and pieces[-1].kind != "rest" else float(t[0]), start - LEAD
            )
            if pieces and pieces[-1].end > start:
                old = pieces.pop()
                if start - old.start >= SHORTEST:
                    pieces.append(Piece(old.start, start, old.kind, old.words))
            its = (t >= start) & (t <= end)
            kind, words = classify(t[its], rudder[its], None if psi is None else psi[its])
        else:
            words = kind
        if end - start >= SHORTEST:
            pieces.append(Piece(start, end, kind, words))
    return _tidy(pieces)


def cut_at_pauses(t: Floats) -> list[Piece]:
    """The stretches between long pauses, of a log without orders that cut it; none where it has no pause."""
    sections = _sections(t)
    whole = [Piece(float(t[s[0]]), float(t[s[-1]]), "section", "") for s in sections if len(sections) > 1]
    return _tidy(whole)


def _sections(t: Floats) -> list[np.ndarray]:
    return np.split(np.arange(t.size), np.flatnonzero(between_runs(t)) + 1)


def between_runs(t: Floats) -> np.ndarray:
    """(n-1,) True where so long nothing is logged that another run follows."""
    step = np.diff(t)
    usual = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    return np.asarray(step >= max(BETWEEN_RUNS, BETWEEN_STEPS * usual))


def classify(t: Floats, rudder: Floats, psi: Floats | None) -> tuple[str, str]:
    """(kind, words) of one stretch of commands."""
    levels, held = _levels(t, rudder)
    big = float(np.max(np.abs(levels))) if levels.size else 0.0
    if big < NEUTRAL:
        # an autopilot holds no order for long; what it steers is straight where it hardly moves the rudder
        steered = np.abs(rudder - np.median(rudder)) if rudder.size else rudder
        moves = rudder.size > 0 and float(np.percentile(steered, 90.0)) > 2.0 * NEUTRAL
        return ("random", "steered") if moves else ("straight", "straight")
    off = np.abs(levels) > 0.3 * big
    signs = np.sign(levels[off])
    size = float(np.median(np.abs(levels[off])))
    turned = 0.0 if psi is None or not np.isfinite(psi).any() else float(np.nanmax(psi) - np.nanmin(psi))
    degrees = round(size / _DEG)
    same = float(np.max(np.abs(np.abs(levels[off]) - size))) < max(0.12 * size, 1.0 * _DEG)
    flips = int(np.sum(signs[1:] != signs[:-1]))
    if flips == 0 and off.sum() <= 2 and (turned > 1.5 * np.pi or (same and _is_held(t, rudder, size))):
        return "turn", f"turning circle {degrees}" if turned > 1.5 * np.pi else f"turn {degrees}"
    legs = _turned_by_leg(rudder, psi, 0.3 * big) if same and flips else []
    if legs and max(legs) > LONGEST_LEG:
        return ("turn", f"turns {degrees}") if np.median(legs) > LONGEST_LEG else ("random", "random orders")
    if same and flips >= 2 and flips == signs.size - 1 and _is_over(t, rudder, size):
        return _zigzag(t, rudder, psi, degrees)
    steps = np.sign(np.diff(levels[held > 0.0]))
    runs = 1 + int(np.sum(steps[1:] * steps[:-1] < 0)) if steps.size else 0
    if levels.size >= 5 and runs <= 3 and float(np.median(held)) > 8.0:
        return "spiral", "spiral"
    return "random", "random orders"


def _turned_by_leg(rudder: Floats, psi: Floats | None, least: float) -> list[float]:
    """By how much the heading turns while the rudder stays on one side by more than `least` [rad]."""
    if psi is None:
        return []
    at = np.flatnonzero((np.abs(rudder) > least) & np.isfinite(psi))
    legs = np.split(psi[at], np.flatnonzero(np.diff(np.sign(rudder[at]))) + 1)
    return [float(np.ptp(leg)) for leg in legs if leg.size]


def _is_held(t: Floats, rudder: Floats, size: float) -> bool:
    """Whether one order stands for most of the stretch, and none beyond it: else it is steered by hand."""
    near = np.abs(np.abs(rudder) - size) < max(0.12 * size, 1.0 * _DEG)
    beyond = np.abs(rudder) > size + max(0.5 * size, 3.0 * _DEG)
    moved = np.flatnonzero(np.abs(rudder) > 0.3 * size)
    return not beyond.any() and bool(np.mean(near[moved[0] :]) > 0.5)


def _is_over(t: Floats, rudder: Floats, size: float) -> bool:
    """Whether a rudder that is put from side to side rests there, or goes there at one rate; one that waves
    as a sine rests for .39 of the time and goes slower and slower."""
    near = np.abs(np.abs(rudder) - size) < max(0.12 * size, 1.0 * _DEG)
    if np.mean(near[np.abs(rudder) > 0.3 * size]) > 0.5:
        return True
    rate = np.abs(np.diff(rudder) / np.diff(t))
    half = np.abs(0.5 * (rudder[1:] + rudder[:-1]))
    # a sine passes 0.7 to 0.85 of its size at 0.71 to 0.53 of its greatest rate
    there = rate[(half > 0.7 * size) & (half < 0.85 * size)]
    return not there.size or bool(np.median(there) > 0.85 * np.percentile(rate, 95))


def _zigzag(t: Floats, rudder: Floats, psi: Floats | None, degrees: int) -> tuple[str, str]:
    """Switching heading: half of what lies between the headings at which either side ends; uneven ones are
    random orders."""
    if psi is None:
        return "zigzag", f"zigzag {degrees}"
    size = degrees * _DEG
    out = np.abs(rudder) > size - max(0.6 * _DEG, 0.04 * size)
    ends = np.flatnonzero(out[:-1] & ~(out[1:] & (rudder[1:] * rudder[:-1] > 0)))  # the rudder leaves a side
    if ends.size < 3 or not np.isfinite(psi).any():
        return "zigzag", f"zigzag {degrees}"
    ends = ends[:-1] if ends.size > 3 else ends
    at = 0.5 * (psi[ends] + psi[np.minimum(ends + 1, psi.size - 1)])
    sides = [at[rudder[ends] * sign > 0] for sign in (1.0, -1.0)]
    if any(not np.isfinite(side).any() for side in sides):
        return "zigzag", f"zigzag {degrees}"
    switch = 0.5 * abs(float(np.nanmedian(sides[0])) - float(np.nanmedian(sides[1])))
    error = float(np.sqrt(np.mean([np.nanvar(side) for side in sides]) / ends.size))
    between = float(np.nanpercentile(np.abs(np.diff(psi)), 95))  # a switch falls anywhere between two samples
    if max(float(np.nanstd(side)) for side in sides) > 0.35 * switch + 1.0 * _DEG + between:
        return "random", "random orders"
    late = _late(t, rudder, psi, ends, size)
    found = _ordered_heading(switch / _DEG, late / _DEG, error / _DEG, degrees)
    if found != degrees:
        low, high = (x / _DEG for x in _bracket(rudder, psi, ends))
        found = _usual_between(low, high, found, degrees)
    return "zigzag", f"zigzag {degrees}/{found}" if found else f"zigzag {degrees}"


def _bracket(rudder: Floats, psi: Floats, ends: np.ndarray) -> tuple[float, float]:
    """Headings between which the switch was ordered [rad]: it falls between two samples, which lie apart
    where the vehicle turns fast, and an order may be logged in the row it begins in or in the next; the
    narrowest that all switches leave."""
    earlier, after = np.maximum(ends - 1, 0), np.minimum(ends + 1, psi.size - 1)
    low = high = 0.0
    for sign in (1.0, -1.0):
        side = rudder[ends] * sign > 0
        before, then = -sign * psi[earlier[side]], -sign * psi[after[side]]
        low, high = low + 0.5 * float(np.nanmax(before)), high + 0.5 * float(np.nanmin(then))
    return low, high


def _usual_between(low: float, high: float, found: int, degrees: int) -> int:
    """The one heading people order within a bracket [deg], `found` where there is none, 0 where there are
    several: the rudder's own degrees and multiples of five."""
    usual = {degrees, *range(5, int(high) + 1, 5)}
    inside = [value for value in usual if low <= value <= high]
    return inside[0] if len(inside) == 1 else 0 if inside else found


def _late(t: Floats, rudder: Floats, psi: Floats, ends: np.ndarray, size: float) -> float:
    """By how much a heading is turned further before a measured rudder is seen to move [rad].

    What it turns in `SERVO` of the time the rudder needs to the other side; an order is there at once.
    """
    turned = []
    for end in ends:
        over = np.flatnonzero(rudder[end:] * np.sign(rudder[end]) < -0.9 * size)
        if over.size and over[0] > 1:
            other = end + int(over[0])
            before = max(int(end) - 1, 0)
            rate = abs(float(psi[end] - psi[before])) / max(float(t[end] - t[before]), 1e-9)
            turned.append(SERVO * float(t[other] - t[end]) * rate)
    kept = [value for value in turned if np.isfinite(value)]  # a heading may be missing where it switches
    return float(np.median(kept)) if kept else 0.0


def _ordered_heading(seen: float, late: float, error: float, degrees: int) -> int:
    """The heading at which the switch was ordered [deg], from the one at which the rudder leaves its side.

    Not above what is seen, and not lower than by `late` or the rounding; there the rudder's own degrees and
    multiples of five, which people order, come before others.
    """
    low, high = seen - max(late, 0.5, error), seen + max(0.5 - late, error, 0.0)
    for usual in (degrees, 5 * int(high // 5)):
        if usual > 0 and low <= usual <= high:
            return usual
    return max(1, int(high // 1))


def _levels(t: Floats, rudder: Floats) -> tuple[Floats, Floats]:
    """Levels the rudder dwells at, and for how long, s; a moving rudder is no level."""
    close = np.abs(np.diff(rudder)) < 0.15 * _DEG
    edges = np.flatnonzero(~close) + 1
    parts = np.split(np.arange(t.size), edges)
    usual = float(np.median(np.diff(t)))
    values: list[float] = []
    held: list[float] = []
    for part in parts:
        length = float(t[part[-1]] - t[part[0]]) + usual
        if part.size >= 2 and length >= 1.0:
            level = float(np.median(rudder[part]))
            if values and abs(level - values[-1]) < 0.5 * _DEG:
                held[-1] += length
            else:
                values.append(level)
                held.append(length)
    return np.array(values), np.array(held)


def _middle(rudder: Floats) -> float:
    near = rudder[np.abs(rudder) < 5.0 * _DEG]
    return (
        float(np.median(near))
        if near.size > 0.1 * rudder.size and abs(float(np.median(near))) < NEUTRAL
        else 0.0
    )


def _smooth(t: Floats, values: Floats, width: float) -> Floats:
    from scipy.ndimage import uniform_filter1d

    return uniform_filter1d(
        values, max(1, int(width / max(1e-9, float(np.median(np.diff(t)))))), mode="nearest"
    )


def _close(t: Floats, on: np.ndarray, rudder: Floats, psi: Floats | None) -> np.ndarray:
    """Stretches amidships that belong to the orders around them count as orders.

    Those shorter than the orders beside them (a turn is no measure: it is as long as it is), and steps
    through zero
    of a staircase."""
    out = on.copy()
    top = float(np.max(np.abs(rudder)))
    edge = np.flatnonzero(np.diff(on.astype(int)))
    for a, b in zip(edge[:-1], edge[1:], strict=True):
        if not on[a] or on[a + 1]:
            continue
        before, after = _order_at(t, rudder, psi, a, -1), _order_at(t, rudder, psi, b + 1, 1)
        stairs = 0.0 < max(abs(before[0]), abs(after[0])) < 0.6 * top
        if t[b] - t[a] < max(0.5 * SHORTEST, 1.5 * min(before[1], after[1])) or stairs:
            out[a : b + 1] = True
    return out


def _order_at(t: Floats, rudder: Floats, psi: Floats | None, k: int, way: int) -> tuple[float, float]:
    """(level, seconds it is held) of the order that holds at row k, looking back or ahead; a turn is held for
    0 s."""
    level, last = float(rudder[k]), k
    while 0 <= last + way < t.size and abs(rudder[last + way] - level) < NEUTRAL:
        last += way
    turned = 0.0 if psi is None else abs(float(psi[last] - psi[k]))
    return level, 0.0 if turned > np.pi else abs(float(t[last] - t[k]))


def _spans(active: np.ndarray, rest: np.ndarray) -> list[tuple[int, int, str]]:
    code = np.where(active, 2, np.where(rest, 1, 0))
    edges = np.concatenate(([0], np.flatnonzero(np.diff(code)) + 1, [code.size]))
    names = {2: "active", 1: "rest", 0: "straight"}
    return [(int(a), int(b) - 1, names[int(code[a])]) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def _tidy(pieces: list[Piece]) -> list[Piece]:
    """A straight lead-in that is too short for a run of its own has been given to the run after it."""
    return [p for p in pieces if p.end - p.start >= SHORTEST]
