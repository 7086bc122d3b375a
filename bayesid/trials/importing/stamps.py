"""Time stamps of a log that are not those of its readings: rounded, set back, out of order, with gaps.

Asks and remarks in a `Draft`. Does not: change stamps, but for the proposal to spread rounded ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.trials.assemble import ROUNDED, SET_BACK
from bayesid.trials.equal_times import rows_behind
from bayesid.trials.health import uneven_steps
from bayesid.trials.importing.agreement import held
from bayesid.trials.importing.converting import Recording, convert, resolve
from bayesid.trials.importing.cutting import BETWEEN_RUNS, BETWEEN_STEPS
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.raw import RawLog
from bayesid.trials.trial import Floats

GAP, SHORTEST = 10.0, 2.0  # times the usual step, and seconds
# Of the usual difference between successive readings; never more than an angle that is no noise of a rudder.
BEYOND_NOISE, NO_NOISE = 6.0, np.radians(1.0)


@dataclass(frozen=True)
class Stamps:
    """What the stamps of a log, in the order of its rows, are like.

    equal : share of rows that repeat the stamp before; late : rows behind an earlier one, singly
    set_back : (time before [s], step back [s]) of every place from which on the clock runs behind
    gaps : (start [s], length [s]); usual : median step that is not zero [s]
    uneven : 15th and 85th per cent of the steps [s] where they jitter, else None
    """

    equal: float
    late: int
    set_back: tuple[tuple[float, float], ...]
    gaps: tuple[tuple[float, float], ...]
    usual: float
    uneven: tuple[float, float] | None


def look_at(t: Floats) -> Stamps | None:
    """Stamps of rows in the order of the file; None for too few of them."""
    t = t[np.isfinite(t)]
    if t.size < 10:
        return None
    step = np.diff(t)
    usual = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
    top = np.maximum.accumulate(t)
    first, last = rows_behind(t)
    long = [(a, b) for a, b in zip(first, last, strict=True) if b - a >= SET_BACK]
    late = int(sum(b - a for a, b in zip(first, last, strict=True) if b - a < SET_BACK))
    wide = np.flatnonzero(step > max(GAP * usual, SHORTEST))
    return Stamps(
        float(np.mean(step == 0.0)),
        late,
        tuple((float(t[a - 1]), float(top[a] - t[a])) for a, _ in long),
        tuple((float(t[k]), float(step[k])) for k in wide),
        usual,
        uneven_steps(step[step > 0]),
    )


def ask_stamps(draft: Draft) -> None:
    """Questions and remarks about the stamps of every log."""
    for recording in draft.recordings:
        for label, log in recording.logs.items():
            channel = max(log.channels, key=lambda c: c.t.size, default=None)
            found = None if channel is None else look_at(channel.t)
            if found is not None:
                _say(draft, label, log, found)
                _ask_gaps(draft, recording, label, log, found)


def _say(draft: Draft, label: str, log: RawLog, found: Stamps) -> None:
    name = Path(log.path).name
    if found.set_back:
        at, back = max(found.set_back, key=lambda item: item[1])
        more = f" ({len(found.set_back)} times; the largest step)" if len(found.set_back) > 1 else ""
        draft.ask(
            0,
            f"the clock of {name} is set back by {back:.3g} s after {at:.1f} s{more}: rows are sorted by "
            "time, which mixes what was before and after; correct the file, or cut that time out by `window`",
        )
    if found.equal > ROUNDED:
        each = 1.0 / (1.0 - found.equal)
        sources = dict(draft.map.sources)
        options = replace(sources[label].options, spread=True)
        sources[label] = replace(sources[label], options=options)
        draft.map = replace(draft.map, sources=sources)
        draft.ask(
            1,
            f"stamps of {name} are rounded: about {each:.1f} rows have one stamp, {found.usual:.3g} s apart; "
            f"spread = true in [sources.{label}] spreads rows evenly until the next stamp, right within "
            f"{found.usual:.3g} s; better give the stamps with more digits",
        )
    elif found.equal > 0.0:
        draft.remark(f"{name}: {found.equal:.1%} of the rows repeat a stamp; the last of each is read")
    if found.late:
        rows = "1 row is" if found.late == 1 else f"{found.late} rows are"
        draft.remark(f"{name}: {rows} out of order and sorted by time")
    if found.uneven is not None and found.equal <= ROUNDED:
        low, high = found.uneven
        draft.remark(
            f"{name}: the time between rows varies, 15 % below {low:.2g} s and 15 % above {high:.2g} s "
            f"(usually {found.usual:.2g} s); stamps of writing are late by as much"
        )


def _unsteadiness(values: Floats) -> float:
    """Difference of two readings of a rudder that noise or rounding may make [rad]: one step of a rounded
    one, several of the usual steps of another."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    moved = steps[steps > 0.0]
    if not moved.size:
        return 1e-9
    return float(min(max(BEYOND_NOISE * np.median(steps), 1.01 * moved.min()), NO_NOISE))


def _ask_gaps(draft: Draft, recording: Recording, label: str, log: RawLog, found: Stamps) -> None:
    name = Path(log.path).name
    alone = len(recording.logs) == 1 and (draft.has("delta_r") or draft.has("delta_r_cmd"))
    between = max(BETWEEN_RUNS, BETWEEN_STEPS * found.usual)
    apart = [g for g in found.gaps if alone and g[1] >= between]  # runs are cut there
    if apart:
        times = f"{len(apart)} times" if len(apart) > 1 else f"after {apart[0][0]:.0f} s"
        seconds = f"{min(g[1] for g in apart):.0f} s or more" if len(apart) > 1 else f"{apart[0][1]:.0f} s"
        draft.remark(f"{name} pauses {times} for {seconds}: another run begins after each pause")
    gaps = [g for g in found.gaps if g not in apart]
    if not gaps:
        return
    at, length = max(gaps, key=lambda item: item[1])
    count = f"{len(gaps)} gaps, the longest" if len(gaps) > 1 else "a gap"
    words = f"{name} has {count} of {length:.3g} s after {at:.1f} s"
    role = next((r for r in ("delta_r_cmd", "delta_r") if draft.has(r)), None)
    series = convert(draft.map, recording)[0] if role is not None else {}
    if role is not None and role in series and resolve(draft.map, role)[0] == label:
        own = series[role]
        start = at + recording.shift[label]
        before, behind = held(own, np.array([start])), held(own, np.array([start + length]))
        inside = (own[0] > start) & (own[0] < start + length)
        if not inside.any() and abs(float(before[0] - behind[0])) > _unsteadiness(own[1]):
            draft.ask(
                1,
                f"{words}, and the rudder is another after it: what was ordered meanwhile is not known; cut "
                "that time out by `window`, or delete this question to hold the order before",
            )
            return
    draft.remark(words)
