"""Runs of the recordings of a draft, cut by their commands, named and given a role.

Takes a `Draft` whose channels are decided. Does not: decide channels.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from bayesid.model.channels import ACTUATOR_NAMES
from bayesid.model.vehicles.orders import gathered_by
from bayesid.trials.importing.agreement import common_run
from bayesid.trials.importing.converting import convert
from bayesid.trials.importing.cutting import (
    NEUTRAL,
    SHORTEST,
    Piece,
    between_runs,
    classify,
    cut,
    cut_at_pauses,
)
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import RunMap
from bayesid.trials.importing.named_actuators import Steering
from bayesid.trials.importing.seen_motion import (
    COURSE_BY_THRUSTER,
    STOPPED,
    STRAIGHT,
    UNSTEERED,
    motion_words,
)
from bayesid.trials.trial import Floats, Run
from bayesid.trials.window import window
from bayesid.words import first_few

AFTER = 0.25  # of a turn, for which its rudder stays amidships after it in a pull-out
# Of a change of depth: how far a depth that is kept may be off; of a run: how long it is kept at least
SETTLED, LEAST_STAY = 0.1, 0.15
HELD_OUT = re.compile(r"(?<![a-z])(hold|held)[ _-]?out(?![a-z])", re.IGNORECASE)  # in names of files
# rad; the rudder that stands for thrusters at their largest order, those of one side astern
OPPOSITE = np.radians(60.0)
SHORT_LOG = 900.0  # s; four or more logs, or parts of one between pauses, shorter than this are a run each


def list_runs(
    draft: Draft, groups: list[tuple[str, ...]], steering: Steering
) -> tuple[list[RunMap], dict[tuple[str, ...], Run]]:
    """Runs cut by their commands, one after the other; the last is kept for judging where there are three."""
    together, turning = steering.together, steering.turning
    runs: list[RunMap] = []
    looks: dict[tuple[str, ...], Run] = {}
    used: set[str] = set()
    for files, recording in zip(groups, draft.recordings, strict=True):
        look = common_run(draft.map, recording) if draft.map.channels else None
        stem = re.sub(r"[^\w-]+", "_", files[0].partition(".")[0])
        if look is None:
            runs.append(RunMap(_fresh(stem, used), files))
            continue
        look = replace(
            look,
            commands=gathered_by(together, look.commands),
            measured_inputs=gathered_by(together, look.measured_inputs, ""),
        )
        looks[files] = look
        series, _, _ = convert(draft.map, recording)
        zero = min(float(t[0]) for t, _ in series.values() if t.size)
        before = len(runs)
        for words, its in _found_in(look, turning, many=len(groups) > 3):
            if its is None:
                runs.append(RunMap(_fresh(stem, used), files, None, words))
                continue
            name = re.sub(r"\W+", "_", words) or stem
            numbered = f"{len(runs) + 1:02d}_{name}"
            rounded = (round(its[0] - zero, 2), round(its[1] - zero, 2))
            runs.append(RunMap(_fresh(numbered, used), files, rounded, words))
        if len(runs) == before:
            runs.append(RunMap(_fresh(stem, used), files))
    named = {k for k, run in enumerate(runs) if any(HELD_OUT.search(file) for file in run.files)}
    if named and len(named) < len(runs):
        runs = [replace(run, role="holdout") if k in named else run for k, run in enumerate(runs)]
        names = first_few([run.name for run in runs if run.role == "holdout"], 4)
        verb = "is" if len(named) == 1 else "are"
        draft.remark(
            f"{names} {verb} held out to judge by, as the names of the files say; `role` of the runs in the "
            "map chooses others"
        )
    elif len(runs) >= 3:
        last = max((k for k, run in enumerate(runs) if run.manoeuvre not in UNSTEERED), default=len(runs) - 1)
        runs[last] = replace(runs[last], role="holdout")
        later = any(run.manoeuvre not in (STRAIGHT, "") for run in runs[last + 1 :])
        by = "its thrusters steer" if steering.turning else "a rudder or plane steers"
        which = f" that {by}" if later else " that is not straight"
        why = "" if runs[last].manoeuvre in UNSTEERED else which
        draft.remark(
            f"{runs[last].name} is held out to judge by, as the last run{why}; `role` of the runs in the map "
            "chooses another"
        )
    return runs, looks


def _found_in(
    look: Run, turning: Mapping[str, float], many: bool
) -> list[tuple[str, tuple[float, float] | None]]:
    """(words, begin and end [s]) of the runs of a log; None where it is one run as it is.

    Parameters
    ----------
    many : whether it is one of many, of which a short one is a run; as one of many stretches between pauses
    """
    stretches = _between_pauses(look)
    if len(stretches) <= 3:
        return _cut(look, turning, many)
    found: list[tuple[str, tuple[float, float] | None]] = []
    for one in stretches:
        pieces = _pieces(one, turning)
        if one.duration >= SHORTEST and (not pieces or any(p.kind != "rest" for p in pieces)):
            whole = (float(one.t[0]), float(one.t[-1]))
            found += [(words, its or whole) for words, its in _cut(one, turning, many=True)]
    return found


def _between_pauses(look: Run) -> list[Run]:
    pauses = np.flatnonzero(between_runs(look.t))
    edges = [0, *(pauses + 1), look.t.size]
    return [
        window(look, float(look.t[first]), float(look.t[end - 1]))
        for first, end in pairwise(edges)
        if end - first > 1
    ]


def _cut(look: Run, turning: Mapping[str, float], many: bool) -> list[tuple[str, tuple[float, float] | None]]:
    pieces = _pieces(look, turning)
    moving = [p for p in pieces if p.kind != "rest"]
    whole = (len(moving) <= 1 and len(pieces) <= 2) or (many and look.duration < SHORT_LOG)
    if not whole or (moving and between_runs(look.t).any()):
        words_of = [motion_words(look, p.start, p.end) if p.words == STRAIGHT else p.words for p in moving]
        return [(words, (p.start, p.end)) for words, p in zip(words_of, moving, strict=True)]
    main = min(moving, key=lambda p: -_rank(p), default=None)
    words = "" if main is None else main.words
    if main is not None and words == STRAIGHT:
        words = _as_a_whole(look, turning)
        words = motion_words(look) if words == STRAIGHT else words
    elif main is not None and main.kind == "turn" and _pulled_out(look, main, pieces):
        words += " and pull-out"
    return [(words, None)]


def _rank(piece: Piece) -> float:
    return (piece.end - piece.start) * (0.1 if piece.kind == "straight" else 1.0)


def _pulled_out(look: Run, turn: Piece, pieces: list[Piece]) -> bool:
    """Whether the vehicle runs on with its rudder amidships for as long as a quarter of its turn."""
    if any(p.kind != "straight" and p.end > turn.end for p in pieces):
        return False
    return float(look.t[-1]) - turn.end > AFTER * (turn.end - turn.start)


def _fresh(name: str, used: set[str]) -> str:
    out, k = name, 2
    while out in used:
        out, k = f"{name}_{k}", k + 1
    used.add(out)
    return out


def _rudder(look: Run) -> Floats | None:
    """The rudder of a run, finite throughout, the liveliest of several; None where it has none."""
    rudder = look.commands.get("delta_r_cmd", look.measured_inputs.get("delta_r"))
    if rudder is None:
        named = (f"delta_{name}" for name in ACTUATOR_NAMES)
        each = [look.commands.get(f"{one}_cmd", look.measured_inputs.get(one)) for one in named]
        rudder = max((v for v in each if v is not None), key=lambda v: float(np.ptp(v)), default=None)
    return None if rudder is None or not np.isfinite(rudder).all() else rudder


def _thrust_as_rudder(look: Run, turning: Mapping[str, float]) -> Floats | None:
    """What thrusters steer, as the angle of a rudder [rad]; None where not all of them have an order."""
    each = [look.commands.get(f"{one}_cmd", look.measured_inputs.get(one)) for one in turning]
    known = [v for v in each if v is not None and np.isfinite(v).all()]
    top = max((float(np.max(np.abs(v))) for v in known), default=0.0)
    if not known or len(known) < len(turning) or top == 0.0:
        return None
    sides = list(turning.values())
    return (
        OPPOSITE
        / (top * len(known))
        * sum((s * v for s, v in zip(sides, known, strict=True)), 0.0 * known[0])
    )


def _steered_by(look: Run, turning: Mapping[str, float]) -> tuple[Floats | None, bool]:
    """(rudder or what stands for it, whether that is of thrusters)."""
    rudder = _rudder(look)
    return (rudder, False) if rudder is not None else (_thrust_as_rudder(look, turning), True)


def _of_thrusters(words: str, psi: Floats | None) -> str:
    """Words of what thrusters steer: their orders are no angles, and those that hold a course go straight."""
    held = psi is not None and np.isfinite(psi).any() and np.nanmax(psi) - np.nanmin(psi) < COURSE_BY_THRUSTER
    if held and words in ("random orders", "steered"):
        return STRAIGHT
    return re.sub(r" \d+(/\d+)?$", "", words)


def _as_a_whole(look: Run, turning: Mapping[str, float]) -> str:
    """What the orders of a run are, of which only straight pieces are long enough: turns may be brief, and
    planes are no matter of a course."""
    rudder, by_thrusters = _steered_by(look, turning)
    words = "straight" if rudder is None else classify(look.t, rudder, look.data.get("psi"))[1]
    words = _of_thrusters(words, look.data.get("psi")) if by_thrusters else words
    return _in_the_vertical(look) or words if words == "straight" else words


def _in_the_vertical(look: Run) -> str:
    """What the stern planes do, as words; empty where they hold still or do nothing that has a name."""
    planes = look.commands.get("delta_s_cmd", look.measured_inputs.get("delta_s"))
    if planes is None or not np.isfinite(planes).all():
        return ""
    kind, words = classify(look.t, planes, look.data.get("theta"))
    if kind == "zigzag":
        return f"vertical {words}"
    if kind == "straight" and float(np.ptp(planes)) < 2.0 * NEUTRAL:
        return ""
    return _depth_changed(look) or ("" if kind == "straight" else "stern plane orders")


def _depth_changed(look: Run) -> str:
    """By how much deeper or shallower than at first a vehicle runs longest, as words; empty where it stays
    nowhere near the furthest it goes from there."""
    z = look.data.get("z", np.zeros(0))
    z = z[np.isfinite(z)]
    if z.size < 200:
        return ""
    at_first = z[: z.size // 50 + 10]
    off = z - float(np.median(at_first))
    furthest, spread = float(np.max(np.abs(off))), float(np.std(at_first))
    levels = [float(np.median(part)) for part in np.array_split(off, 20)]
    away = [level for level in levels if abs(level) > max(0.5 * furthest, spread / SETTLED)]
    stays = [off[np.abs(off - level) < SETTLED * abs(level)] for level in away]
    longest = max(stays, key=len, default=off[:0])
    return f"depth change {abs(np.median(longest)):.2g} m" if longest.size > LEAST_STAY * off.size else ""


def _pieces(look: Run, turning: Mapping[str, float]) -> list[Piece]:
    rudder, by_thrusters = _steered_by(look, turning)
    if rudder is None:
        return cut_at_pauses(look.t)
    speed = _speed(look)
    if by_thrusters and speed is not None:
        # turned on the spot is no rest: it is one where the thrusters stand still as well
        orders = [look.commands.get(f"{one}_cmd", look.measured_inputs.get(one)) for one in turning]
        work = np.max(np.abs(np.array(orders, dtype=float)), axis=0)
        speed = np.where(work > STOPPED * np.max(work), np.nanmax(np.abs(speed)), speed)
    psi = look.data.get("psi")
    pieces = cut(look.t, rudder, psi, speed)
    if not by_thrusters:
        return pieces
    spans = [(look.t >= p.start) & (look.t <= p.end) for p in pieces]
    return [
        replace(p, words=_of_thrusters(p.words, None if psi is None else psi[own]))
        for p, own in zip(pieces, spans, strict=True)
    ]


def _speed(look: Run) -> Floats | None:
    """Speed ahead, of the track where none is logged [m/s]; None without either."""
    speed = look.data.get("u")
    if speed is None and {"x", "y"} <= set(look.data):
        x, y = look.data["x"], look.data["y"]
        good = np.isfinite(x) & np.isfinite(y)
        if good.sum() > 20:
            x, y = (np.interp(look.t, look.t[good], v[good]) for v in (x, y))
            wide = max(1, int(5.0 / float(np.median(np.diff(look.t)))))
            speed = np.full(look.t.shape, np.nan)
            gone = np.hypot(x[wide:] - x[:-wide], y[wide:] - y[:-wide]) / (look.t[wide:] - look.t[:-wide])
            if gone.size:
                speed = np.interp(look.t, 0.5 * (look.t[wide:] + look.t[:-wide]), gone)
    return speed
