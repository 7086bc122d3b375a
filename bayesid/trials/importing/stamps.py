"""Time stamps of a log that are not those of its readings: rounded, set back, out of order, with gaps.

Asks and remarks in a `Draft`. Does not: change stamps, but for the proposal to spread rounded ones.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.trials.assemble import ROUNDED
from bayesid.trials.importing.agreement import held
from bayesid.trials.importing.converting import Recording, convert, resolve
from bayesid.trials.importing.cutting import BETWEEN_RUNS, BETWEEN_STEPS
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.raw import RawLog
from bayesid.trials.importing.stamp_words import (
    Stamps,
    columns_of,
    look_into,
    rounded_words,
    set_back_words,
    small_words,
)
from bayesid.trials.trial import Floats

# Of the usual difference between successive readings; never more than an angle that is no noise of a rudder.
BEYOND_NOISE, NO_NOISE = 6.0, np.radians(1.0)


def ask_stamps(draft: Draft) -> None:
    """Questions and remarks about the stamps of every log."""
    for recording in draft.recordings:
        for label, log in recording.logs.items():
            found = look_into(log, columns_of(draft.map, label))
            if found is not None:
                _say(draft, label, log, found)
                _ask_gaps(draft, recording, label, log, found)


def _say(draft: Draft, label: str, log: RawLog, found: Stamps) -> None:
    name = Path(log.path).name
    if found.set_back:
        draft.ask(0, set_back_words(name, found))
    if found.equal > ROUNDED:
        sources = dict(draft.map.sources)
        if not sources[label].options.spread:  # one question for all files of a source
            options = replace(sources[label].options, spread=True)
            sources[label] = replace(sources[label], options=options)
            draft.map = replace(draft.map, sources=sources)
            draft.ask(1, rounded_words(name, label, found, spread=True))
    for text in small_words(name, found):
        draft.remark(text)
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
    alone = len(recording.logs) == 1
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
