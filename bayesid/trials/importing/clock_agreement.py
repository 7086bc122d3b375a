"""Do the clocks of several logs agree: track with heading, yaw rate with heading, turn with rudder?

Asks in a `Draft`; a clock is never changed here.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from bayesid.trials.importing.agreement import lag_of, response_shift, speed_fit, track_misfit
from bayesid.trials.importing.converting import Recording, convert, resolve
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap


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
    """Relative clocks of several files, and clocks that kinematics contradict."""
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
    t, psi = series["psi"]
    good = np.isfinite(psi)
    t, psi = t[good], np.unwrap(psi[good])
    step = max(1, int(0.5 / max(1e-3, float(np.median(np.diff(t))))))
    if t.size < 4 * step + 10:
        return
    span = t[2 * step :] - t[: -2 * step]
    rate = (t[step:-step], (psi[2 * step :] - psi[: -2 * step]) / span)
    whole = span < 2.0 * float(np.median(span))
    rate = (rate[0][whole], rate[1][whole])
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
    rudder = next((r for r in ("delta_r_cmd", "delta_r") if r in label), None)
    if rudder is not None and label[rudder] != label[heading]:
        turn = None
        for other in (recording, *draft.recordings):
            its = series if other is recording else convert(draft.map, other)[0]
            turn = turn or (response_shift(its[rudder], its["r"]) if {rudder, "r"} <= set(its) else None)
        if turn is None and "r" not in series:
            turn = response_shift(series[rudder], rate)
        if turn is None:
            draft.ask(
                3,
                f"nothing tells whether the clock of {label[rudder]} is that of {label[heading]}: no turn "
                f"follows the rudder plainly",
            )
        elif turn[2] < 0.8 and (turn[0] < -0.5 or turn[0] > 1.0 + turn[1]):
            draft.ask(
                0,
                f"the turns follow the rudder best with the clock of {label[rudder]} shifted by "
                f"{turn[0]:+.0f} s; set clock_offset in "
                f"[sources.{label[rudder]}]",
            )


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
