"""A position or heading that stands still while the rest of the log says that the vehicle moves.

Asks in a `Draft` whose channels and axes are decided. Does not: take a vehicle at rest, a track along one
axis or a slow sensor that is held for one that froze.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesid.model.units import scale
from bayesid.trials.correction import EARTH_RADIUS
from bayesid.trials.importing.agreement import common_run
from bayesid.trials.importing.converting import Recording, resolve
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.roles import ROLES
from bayesid.trials.trial import Floats, Run

LEAST, SHORTEST = 8, 2.0  # readings and seconds of a stretch
HELD = 10.0  # times the usual time between two values of the column
AWAY = 0.3  # share of the way made meanwhile that leads along the axis of the column
STEPS = 20.0  # way made meanwhile, in usual steps of the column
BRIEF = 0.02  # share of the recording below which a held reading is remarked upon, not asked about
TURNED = 0.35  # rad turned meanwhile that show a vehicle in motion, or a heading that stands


@dataclass(frozen=True)
class _Stretch:
    start: float
    end: float
    usual: float  # step of the column outside
    share: float  # of the recording


def ask_standing_still(draft: Draft) -> None:
    """A question per column, about its longest stretch; a remark where that is brief, as a held fix is."""
    looks: dict[int, Run | None] = {}  # a recording is converted once, and only where a column stands
    for role in ("latitude", "longitude", "north", "east", "x", "y", "heading", "psi"):
        if not draft.has(role):
            continue
        worst: tuple[float, float, str] | None = None
        for k, recording in enumerate(draft.recordings):
            for one in _stretches(draft, role, recording):
                if k not in looks:
                    looks[k] = common_run(draft.map, recording)
                words = _motion(draft, role, looks[k], one)
                if words and (worst is None or one.end - one.start > worst[0]):
                    log = recording.logs[resolve(draft.map, role)[0]]
                    place = f"in {Path(log.path).name} " if draft.recordings[1:] else ""
                    when = f"{place}from {one.start:.1f} to {one.end:.1f} s while {words}"
                    worst = one.end - one.start, one.share, when
        if worst is None:
            continue
        said = f"{draft.column(role)} ({role}) stands still {worst[2]}"
        if worst[1] < BRIEF:
            draft.remark(said)
        else:
            draft.ask(
                0,
                f"{said}: cut that time out by `window`, leave the column out, or delete this question to "
                "keep it",
            )


def _stretches(draft: Draft, role: str, recording: Recording) -> list[_Stretch]:
    label, name = resolve(draft.map, role)
    log = recording.logs.get(label)
    series = None if log is None else log.by_name.get(name)
    if series is None:
        return []
    good = np.isfinite(series.values) & np.isfinite(series.t)
    t, x = series.t[good] + recording.shift[label], series.values[good]
    if x.size < 4 * LEAST:
        return []
    edges = np.flatnonzero(np.concatenate(([True], np.diff(x) != 0.0, [True])))
    first, last = edges[:-1], edges[1:] - 1
    until = np.minimum(edges[1:], x.size - 1)
    lasts = t[until] - t[first]
    step = np.abs(np.diff(x[first]))
    usual_time = float(np.median(lasts[:-1])) if lasts.size > 1 else 0.0
    usual_step = float(np.median(step)) if step.size else 0.0
    long = (last - first >= LEAST) & (t[last] - t[first] >= max(SHORTEST, HELD * usual_time))
    whole = float(t[-1] - t[0])
    return [
        _Stretch(float(t[a]), float(t[b]), usual_step, float(t[b] - t[a]) / whole)
        for a, b in zip(first[long], last[long], strict=True)
    ]


def _motion(draft: Draft, role: str, look: Run | None, one: _Stretch) -> str:
    """What shows that the column should have moved, in words; empty where nothing does."""
    if look is None:
        return ""
    inside = (look.t >= one.start) & (look.t <= one.end)
    if inside.sum() < 4:
        return ""
    t, psi = look.t[inside], _part(look, "psi", inside)
    if role in ("heading", "psi"):
        rate = _part(look, "r", inside)
        if rate is None or not np.isfinite(rate).any():
            return ""
        turned = float(np.ptp(_integral(t, np.nan_to_num(rate))))
        return f"the yaw rate turns the vehicle by {np.degrees(turned):.0f} deg" if turned > TURNED else ""
    speed = _part(look, "u", inside)
    if speed is None or not np.isfinite(speed).any():
        turning = psi is not None and float(np.nanmax(psi) - np.nanmin(psi)) > TURNED
        driven = any(
            float(np.mean(np.abs(v[inside]) > 0.0)) > 0.5
            for k, v in {**look.commands, **look.measured_inputs}.items()
            if k in ("n", "n_cmd")
        )
        if not (turning or driven):
            return ""
        speed = np.full(t.shape, _track_speed(look))
    speed = np.abs(np.nan_to_num(speed))
    way = float(_integral(t, speed)[-1])
    if not way > 0.0 or psi is None or not np.isfinite(psi).any():
        return ""
    psi = np.interp(t, t[np.isfinite(psi)], psi[np.isfinite(psi)])
    along = np.cos(psi) if _north(draft, role) else np.sin(psi)
    gone = float(np.ptp(_integral(t, speed * along)))
    if gone < AWAY * way or gone < STEPS * one.usual * _metres(draft, role):
        return ""
    return f"the vehicle goes {gone:.3g} m that way by heading and speed"


def _metres(draft: Draft, role: str) -> float:
    """Metres in one unit of a column of position."""
    unit = draft.map.channels[role].unit or ROLES[role].bare
    return scale(unit, ROLES[role].unit, role) * (EARTH_RADIUS if role.endswith("tude") else 1.0)


def _north(draft: Draft, role: str) -> bool:
    if role in ("x", "y"):
        return (role == "x") != (draft.map.world == "enu")
    return role in ("latitude", "north")


def _part(look: Run, name: str, inside: np.ndarray) -> Floats | None:
    values = look.data.get(name)
    return None if values is None else values[inside]


def _integral(t: Floats, rate: Floats) -> Floats:
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))))


def _track_speed(look: Run) -> float:
    """Median speed of the track where it moves, m/s; over half a second or more, so that noise is small."""
    if not {"x", "y"} <= set(look.data):
        return 0.0
    good = np.isfinite(look.data["x"]) & np.isfinite(look.data["y"])
    t, x, y = look.t[good], look.data["x"][good], look.data["y"][good]
    if t.size < 4:
        return 0.0
    knots = np.unique(np.searchsorted(t, np.arange(t[0], t[-1], max(5.0, 3 * float(np.median(np.diff(t)))))))
    way, time = np.hypot(np.diff(x[knots]), np.diff(y[knots])), np.diff(t[knots])
    speeds = way[time > 0] / time[time > 0]
    moving = speeds[speeds > 0.0]
    return float(np.median(moving)) if moving.size else 0.0
