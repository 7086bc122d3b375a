"""Stern planes of a vehicle that has some: the column that may be theirs, and to which side they pitch it.

Works on a `Draft` whose units are decided. Does not: read a series; `proposing` has done that by names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bayesid.model.vehicles.orders import has_planes
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.trials.consistency import check_rudder
from bayesid.trials.importing.agreement import common_run
from bayesid.trials.importing.converting import Recording
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.names import OTHER, guess_role
from bayesid.trials.importing.raw import RawChannel
from bayesid.trials.importing.tables import plain
from bayesid.words import first_few

SURE_T = 5.0  # t of the pitch that follows the planes, from which their side is told
LARGE, PITCHED = 10.0, 5.0  # deg: planes held so far pitch a vehicle under way by more than that
MOST = 12  # recordings looked at
SURE_CLIMB = 0.7  # correlation of depth and pitch from which one of both has the other sign
PARTS = 12  # of a record: over each of them the height gained is compared
_FIN = re.compile(
    r"\b(fins?|(stern|bow|hydro|dive|diving)? ?planes?|elevators?|flaps?|control surfaces?|rudders?)\b"
)
_ANGLES = (None, "deg", "rad", "gon", "%", "us_pwm")
_VERTICAL = ("theta", "q", "w", "z", "depth")


def pitches(ship: Vehicle) -> float | None:
    """Sign of the pitch that a positive stern plane gives, bow up positive; 0 if the file does not say, None
    of a vehicle without stern planes of the name `delta_s`."""
    if not has_planes(ship) or not any(name.endswith("ds") for name in ship.coef):
        return None
    moment = sum(v for name, v in ship.coef.items() if re.fullmatch(r"M_u*\|?u?\|?ds", name))
    return float(np.sign(moment))


def ask_planes(draft: Draft, unused: Mapping[str, RawChannel], side: float | None) -> None:
    """Asks for a column of fins that no name places, for planes that are not there, and for their sign.

    Parameters
    ----------
    unused : series not read -> one of its recordings
    side : as `pitches` gives it
    """
    if side is None:
        return
    planes = next((r for r in ("delta_s_cmd", "delta_s") if draft.has(r)), None)
    like = [name for name, channel in unused.items() if _like_a_fin(draft, channel)]
    shown = first_few(map(repr, like), 4)
    if like and planes is None:
        draft.ask(
            0,
            f"{shown} may be the order or the angle of a fin, and none is read as the stern planes, which "
            "this vehicle has; is it theirs? then add delta_s_cmd (ordered) or delta_s (measured) to "
            "[channels]",
        )
    elif like:
        draft.ask(
            1,
            f"{shown} may be the order or the angle of a fin and is not read; what is it? add it to "
            "[channels]",
        )
    elif planes is None and not {"delta_s", "delta_s_cmd"} & set(draft.resting) and _dives(draft):
        draft.ask(
            1,
            "no stern planes found, which this vehicle has, and the log pitches; add delta_s_cmd (ordered) "
            "or delta_s (measured) to [channels], or delete this where they stay at 0",
        )
    if planes is not None:
        _side(draft, planes, side)
    bow = next((r for r in ("delta_b_cmd", "delta_b") if draft.has(r)), None)
    if bow is not None and draft.raw(bow).size and np.ptp(draft.raw(bow)) > 0.0:
        draft.remark(
            f"{bow} {draft.column(bow)} is taken with its sign: nothing here tests that of bow planes"
        )


def _like_a_fin(draft: Draft, channel: RawChannel) -> bool:
    words = plain(channel.name.replace("/", " ").replace(".", " "))
    if channel.unit not in _ANGLES or not _FIN.search(words) or OTHER.search(words):
        return False
    guess = guess_role(channel)  # of two series of one role, one is read and the other told elsewhere
    return guess is None or not (draft.has(guess.role) or draft.has(f"{guess.role}_cmd"))


def calm_as_degrees(draft: Draft, role: str, top: float) -> bool:
    """Whether stern planes that reach `top` are degrees: as radians they would have pitched the vehicle."""
    if role.removesuffix("_cmd") != "delta_s" or math.degrees(top) < LARGE or not draft.has("theta"):
        return False
    return not _dives(draft)


def _dives(draft: Draft) -> bool:
    """Whether the pitch follows more than noise and trim: by `PITCHED` within a recording."""
    for recording in draft.recordings[:MOST]:
        run = common_run(draft.map, recording)
        theta = np.zeros(0) if run is None else run.data.get("theta", np.zeros(0))
        theta = theta[np.isfinite(theta)]
        if theta.size > 20 and float(np.ptp(np.quantile(theta, (0.02, 0.98)))) > math.radians(PITCHED):
            return True
    return False


def _side(draft: Draft, role: str, side: float) -> None:
    values = [t for t in (_pitch_t(draft.map, r) for r in draft.recordings[:MOST]) if t is not None]
    if not values:  # planes that hardly move
        return
    pooled = sum(values) / math.sqrt(len(values))
    if _pitch_is_turned(draft):
        pooled = -pooled  # what the planes do by a pitch of the right sign
    name = draft.column(role)
    if abs(pooled) < SURE_T:
        draft.remark(
            f"{role} {name} is taken with its sign: nothing tells surely whether positive planes raise the "
            f"bow ({abs(pooled):.1f} standard errors; {SURE_T:g} are enough)"
        )
        return
    way = "raises" if pooled > 0 else "lowers"
    if side and np.sign(pooled) != side:
        other = "lowers" if pooled > 0 else "raises"
        both = [r for r in ("delta_s_cmd", "delta_s") if draft.has(r)]
        draft.ask(
            0,
            f"positive {name} {way} the bow, as the pitch tells by {abs(pooled):.0f} standard errors, and "
            f"positive delta_s of this vehicle {other} it (M_ds); does the log count the planes the other "
            f"way round? then write `scale = -1` in the line of {' and '.join(both)} in the map",
        )
    else:
        draft.remark(
            f"positive {name} {way} the bow, as the pitch tells by {abs(pooled):.0f} standard errors"
            + (", and as the vehicle has it" if side else "")
        )


def _pitch_is_turned(draft: Draft) -> bool:
    """Asks for the sign of a pitch that is bow up where the vehicle dives, or of the depth; whether the pitch
    is turned, then."""
    values = [c for c in (_climb(draft.map, r) for r in draft.recordings[:MOST]) if c is not None]
    if not values or np.mean(values) > -SURE_CLIMB:
        return False
    turned = draft.has("depth") and draft.map.channels["depth"].scale < 0
    mends = [f"{_turn(draft, 'theta')}, if pitch is counted bow down"]
    mends += [_turn(draft, "depth" if draft.has("depth") else "z")]
    first, second = reversed(mends) if turned else mends
    draft.ask(
        0,
        f"the depth grows where the pitch {draft.column('theta')} has the bow up (correlation "
        f"{-np.mean(values):.2f}); which has the other sign? {first}; or {second}",
    )
    return not turned


def _turn(draft: Draft, role: str) -> str:
    """How a map turns the sign of a channel."""
    scale = draft.map.channels[role].scale if draft.has(role) else 1.0
    return f"write `scale = {-scale:g}` in the line of {role} in the map"


def _climb(found: LogMap, recording: Recording) -> float | None:
    """Correlation of the height gained, over a share of the record, with what pitch and speed make of it;
    None where the vehicle hardly pitches or the depth is not there."""
    run = common_run(found, recording)
    if run is None or not {"theta", "z"} <= set(run.data):
        return None
    theta, z = run.data["theta"], run.data["z"]
    speed = run.data.get("u", np.ones_like(theta))
    seen = np.isfinite(theta) & np.isfinite(z) & np.isfinite(speed)
    if seen.sum() < 20 or float(np.ptp(np.quantile(theta[seen], (0.02, 0.98)))) < math.radians(PITCHED):
        return None
    t, theta, z, speed = run.t[seen], theta[seen], z[seen], speed[seen]
    climbed = np.concatenate([[0.0], np.cumsum(np.diff(t) * (speed * np.sin(theta))[:-1])])
    apart = max(5, theta.size // PARTS)
    gained, foretold = -(z[apart:] - z[:-apart]), climbed[apart:] - climbed[:-apart]
    if not (np.std(gained) > 0 and np.std(foretold) > 0):
        return None
    return float(np.corrcoef(gained, foretold)[0, 1])


def _pitch_t(found: LogMap, recording: Recording) -> float | None:
    """t value of the pitch that follows the stern planes; positive if positive planes raise the bow."""
    run = common_run(found, recording)
    planes = None if run is None else run.input("delta_s")
    if run is None or planes is None or "theta" not in run.data:
        return None
    data = {"psi": run.data["theta"]} | {k: run.data[k] for k in ("u",) if k in run.data}
    turned = replace(run, data=data, commands={"delta_r_cmd": planes}, measured_inputs={})
    check = check_rudder(turned, restored=True)
    return None if check is None else check.t_value


def series_of(recordings: Sequence[Recording], names: Sequence[str]) -> dict[str, RawChannel]:
    """Series by the names a map has for them, as a recording holds them."""
    found: dict[str, RawChannel] = {}
    for recording in recordings:
        for label, log in recording.logs.items():
            for channel in log.channels:
                for name in (f"{label}:{channel.name}", channel.name):
                    if name in names:
                        found.setdefault(name, channel)
    return found
