"""Do the clocks of several logs agree: track with heading, yaw rate with heading, turn with rudder?

Asks in a `Draft`; a clock is never changed here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from bayesid.trials.importing.agreement import lag_of, speed_fit, track_misfit
from bayesid.trials.importing.converting import Recording, Series, convert, resolve
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.rudder_clock import (
    FOLLOWS,
    left_without,
    rivals_of,
    rudder_shifts,
    sides_apart,
)
from bayesid.words import first_few

MOST = 12  # recordings whose turns are held against the rudder


def ask_apart(draft: Draft) -> bool:
    """Files of one recording whose times do not overlap; True where it asks."""
    for recording in draft.recordings:
        spans = {}
        for label, log in recording.logs.items():
            ts = [c.t for c in log.channels if c.t.size]
            if recording.start is not None and ts:
                zero = recording.start + recording.shift[label]
                spans[label] = zero + min(float(t[0]) for t in ts), zero + max(float(t[-1]) for t in ts)
        if len(spans) < 2:
            continue
        late, early = max(spans, key=lambda k: spans[k][0]), min(spans, key=lambda k: spans[k][1])
        if spans[late][0] > spans[early][1]:
            told = [f"{Path(recording.logs[k].path).name} ({_when(spans[k][0])})" for k in (early, late)]
            draft.ask(
                0,
                f"{told[0]} and {told[1]} do not overlap in time: is one clock local time, or are day and "
                "month exchanged? set clock_offset in [sources.*], or give ISO dates",
            )
            return True
    return False


def _when(utc: float) -> str:
    return f"{datetime.fromtimestamp(utc, UTC):%d %B %Y %H:%M:%S}"


def check_clocks(draft: Draft) -> None:
    """Relative clocks of several files, and clocks that kinematics contradict, that of the rudder apart."""
    for recording in draft.recordings[:3]:
        if len(recording.logs) > 1 and recording.start is None:
            labels = ", ".join(recording.logs)
            draft.ask(
                0,
                f"{labels} have relative time; are they from one clock? if not, give one a clock_offset [s]",
            )
    recording = draft.liveliest
    if len(recording.logs) < 2:
        return
    series, _, _ = convert(draft.map, recording)
    if "psi" not in series:
        return
    label = {role: resolve(draft.map, role)[0] for role in draft.map.channels}
    heading = next(r for r in ("heading", "psi", "qw") if r in label)
    rate = _rate_of(series)
    if rate is None:
        return
    if "r" in label and label["r"] != label[heading]:
        _say_lag(draft, lag_of(rate, series["r"]), label["r"], "yaw rate", 0.3)
    place = next((r for r in ("latitude", "north", "x") if r in label), None)
    if place is not None and label[place] != label[heading]:
        track = _best_shift(draft.told, recording, label[place])
        if track is not None:
            draft.ask(
                0,
                f"track and heading agree best with the clock of {label[place]} shifted by {track:+.0f} s "
                f"(GPS and UTC differ by 18 s); set clock_offset in [sources.{label[place]}]",
            )


def check_rudder_clock(draft: Draft) -> None:
    """Whether the turns follow the rudder on another clock; `late` of the draft are the shifts that do.

    A clock is that of all runs of its files: they are taken together.
    """
    if len(draft.liveliest.logs) < 2:
        return
    label = {role: resolve(draft.map, role)[0] for role in draft.map.channels}
    heading = next((r for r in ("heading", "psi", "qw") if r in label), None)
    rudder = next((r for r in ("delta_r_cmd", "delta_r") if r in label), None)
    if heading is None or rudder is None or label[rudder] == label[heading]:
        return
    pairs, files = [], []
    for recording in draft.recordings[:MOST]:
        series, _, _ = convert(draft.map, recording)
        rate = series.get("r") or _rate_of(series)
        if rudder in series and rate is not None and rate[0].size and series[rudder][0].size:
            pairs.append((series[rudder], rate))
            files.append(Path(recording.logs[label[rudder]].path).name)
    if not pairs:
        return
    found = rudder_shifts(pairs)
    if not found or found[0].left > FOLLOWS:
        draft.ask(
            3,
            f"nothing tells whether the clock of {label[rudder]} is that of {label[heading]}: no turn "
            f"follows the rudder plainly",
        )
        return
    best = found[0]
    as_it_is = left_without(pairs)
    apart, sides = sides_apart(pairs)
    if apart < 0.8 * best.left and len({*sides} - {0}) > 1:  # it explains more than any clock does
        _ask_sides(draft, label[rudder], rudder, [files[k] for k in range(len(sides)) if sides[k] < 0],
                   [files[k] for k in range(len(sides)) if sides[k] > 0], (apart, best.left))  # fmt: skip
        return
    if best.left < 0.8 * as_it_is and not best.is_lag:
        draft.late = [best, *rivals_of(found)]
        _ask_rudder_clock(draft, label[rudder], as_it_is)


def _ask_sides(
    draft: Draft,
    label: str,
    rudder: str,
    to_port: list[str],
    to_starboard: list[str],
    left: tuple[float, float],
) -> None:
    draft.ask(
        0,
        f"positive {draft.column(rudder)} turns to starboard in {first_few(to_starboard, 4)} and to port in "
        f"{first_few(to_port, 4)} ({100 * left[0]:.2g} % of the turns unexplained; with one side, and any "
        f"shift of the clock of {label}, at least {100 * left[1]:.2g} %): were some logged with the other "
        "sign? a map has one `rudder_positive`; turn the sign in those files, or import them apart",
    )


def _ask_rudder_clock(draft: Draft, label: str, as_it_is: float) -> None:
    best, *rivals = draft.late
    if not rivals:
        draft.ask(
            0,
            f"the turns follow the rudder best with the clock of {label} shifted by {best.seconds:+.0f} s "
            f"({100 * best.left:.2g} % of them unexplained, as it is {100 * as_it_is:.2g} %), and positive "
            f"rudder then turns to {best.turns_to}; set clock_offset in [sources.{label}]",
        )
        return
    told = [f"{s.seconds:+.0f} s (to {s.turns_to}, {100 * s.left:.2g} %)" for s in (best, *rivals[:3])]
    draft.ask(
        0,
        f"the turns follow the rudder about as well with the clock of {label} shifted by "
        f"{', '.join(told[:-1])} or {told[-1]} (side "
        f"to which positive rudder then turns, share of the turns unexplained; as it is "
        f"{100 * as_it_is:.2g} %): "
        "what repeats itself, as a zig-zag, tells neither. Find the clock otherwise, as by a run that begins "
        f"at rest or a turn; then set clock_offset in [sources.{label}] and rudder_positive",
    )


def _rate_of(series: Mapping[str, Series]) -> Series | None:
    """Yaw rate of a heading, of pieces of a second in which no reading is missing."""
    t, psi = series.get("psi", (np.zeros(0), np.zeros(0)))
    good = np.isfinite(psi)
    t, psi = t[good], np.unwrap(psi[good])
    if t.size < 12:
        return None
    step = max(1, int(0.5 / max(1e-3, float(np.median(np.diff(t))))))
    if t.size < 4 * step + 10:
        return None
    span = t[2 * step :] - t[: -2 * step]
    whole = span < 2.0 * float(np.median(span))
    return t[step:-step][whole], ((psi[2 * step :] - psi[: -2 * step]) / span)[whole]


def _shifted(recording: Recording, label: str, by: float) -> Recording:
    return replace(recording, shift={**recording.shift, label: recording.shift[label] + by})


def _best_shift(found: LogMap, recording: Recording, label: str) -> float | None:
    """Shift of a clock at which track and heading, with the speed where there is one, agree much better."""

    def misfit(by: float) -> float:
        its = _shifted(recording, label, by) if by else recording
        if {"u", "v"} <= set(found.channels):
            with_speed = speed_fit(found, its)
            return 1.0 if with_speed is None else with_speed[1]
        return track_misfit(found, its)[0]

    now = misfit(0.0)
    tried = {by: misfit(by) for by in (*np.arange(-40.0, -0.5, 1.0), *np.arange(1.0, 40.5, 1.0))}
    best = min(tried, key=lambda k: tried[k])
    # without the sway speed the sideslip in turns makes the course late by up to a vehicle length of travel
    least = 0.5 if {"u", "v"} <= set(found.channels) else 2.5
    return float(best) if tried[best] < 0.5 * now and now > 1e-4 and abs(best) > least else None


def _say_lag(draft: Draft, lag: tuple[float, float] | None, label: str, what: str, least: float) -> None:
    if lag is not None and abs(lag[0]) > least and lag[1] > 0.02:
        draft.ask(
            0,
            f"{what} of {label} is {lag[0]:+.2f} s late against the heading; set clock_offset = "
            f"{-lag[0]:.2f} in [sources.{label}]",
        )
