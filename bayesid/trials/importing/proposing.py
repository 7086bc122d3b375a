"""A map for logs nobody has described: read, named, decided, cut into runs; what is doubtful is asked.

Takes the files; gives a `Proposal`. Does not: import anything; a map with questions is to be edited first.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.errors import BayesidError
from bayesid.model.channels import TURNED
from bayesid.model.units import UnitError, scale
from bayesid.trials.importing.agreement import common_run, rudder_t
from bayesid.trials.importing.arranging import arrange, sources_of
from bayesid.trials.importing.assumed_units import ask_assumed_units, unknown_unit
from bayesid.trials.importing.clock_agreement import ask_apart
from bayesid.trials.importing.codes import leave_codes_out
from bayesid.trials.importing.converting import Recording, resolve
from bayesid.trials.importing.deciding import decide
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.joining import one_clock
from bayesid.trials.importing.log_map import ChannelMap, LogMap
from bayesid.trials.importing.lost_cells import ask_lost_cells
from bayesid.trials.importing.named_actuators import Steering, all_of_one_kind, named_guess
from bayesid.trials.importing.names import WITH_ORDER, guess_role, in_bundle_format
from bayesid.trials.importing.planes import ask_planes, series_of
from bayesid.trials.importing.raw import ImportLogError, RawChannel, RawLog, Request
from bayesid.trials.importing.readers import read_log
from bayesid.trials.importing.resting import UPRIGHT, drop_constant
from bayesid.trials.importing.roles import QUATERNION, ROLES
from bayesid.trials.importing.run_list import list_runs
from bayesid.trials.importing.stamps import ask_stamps
from bayesid.trials.importing.standing_still import ask_standing_still
from bayesid.trials.importing.unit_words import split_unit
from bayesid.trials.trial import Floats, Run
from bayesid.trials.write import toml_text
from bayesid.words import and_list, counted, first_few

LOOK = 100_000  # samples per series a proposal looks at
GENERIC = ("value", "data", "val")  # names that say nothing; that of the file is taken
FIRST = -1  # weight of a question before all others
FEWEST_SAMPLES = 10  # of the longest series, below which no column is told
BY_NAME = 1.0  # score of a series whose name, or the last words of it, tell its role
NO_STEERING = Steering()
LARGE = 1_000_000  # samples beyond which a step is proposed
_TEXT_WORLD = re.compile(r"\b(ned|enu|nwu)\b", re.IGNORECASE)


@dataclass(frozen=True)
class Proposal:
    """map with its questions, most important first; remarks: what was taken for granted; unused: series not
    read; looks: recording files -> the common run a picture is drawn from."""

    map: LogMap
    remarks: tuple[str, ...]
    unused: tuple[str, ...]
    looks: dict[tuple[str, ...], Run]


def propose(
    sources: Sequence[Path],
    vehicle: str = "",
    name: str = "",
    steering: Steering = NO_STEERING,
    pitches: float | None = None,
) -> Proposal:
    """A map guessed from names, units and kinematics.

    Parameters
    ----------
    steering : what the vehicle is steered by where that is no rudder; its columns are asked for, and series
        are read by the actuators in their names
    pitches : of a vehicle with stern planes, as `planes.pitches`

    Raises
    ------
    ImportLogError             a file cannot be read, or two have one name
    """
    names = [p.name for p in sources]
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise ImportLogError(
            f"two files are called {twice[0]!r}; rename one, the map tells files by their names"
        )
    logs = {p.name: read_log(p, request=Request(most=LOOK)) for p in sources}
    labels, groups, doubts = arrange(logs)
    recordings = []
    for files in groups:
        try:
            recordings.append(one_clock({labels[f]: logs[f] for f in files}, {}))
        except ImportLogError as error:
            raise ImportLogError(f"{error}; write a map with that line") from None
    found = LogMap(name=name, vehicle=vehicle, sources=sources_of(logs, labels))
    draft = Draft(found, recordings)
    for weight, text in doubts:
        draft.ask(weight, text)
    unused = draft.unused = _name(draft, recordings, steering)
    leave_codes_out(draft)
    drop_constant(draft)
    _needs(draft, recordings, unused, steering.inputs)
    _declared_axes(draft, logs)
    if ask_apart(draft):
        pass  # nothing that kinematics says of such a recording is about the channels
    elif draft.map.channels:
        decide(draft)
        ask_planes(draft, series_of(recordings, unused), pitches)
        ask_standing_still(draft)
        ask_stamps(draft)
        _ask_time(draft, logs)
    ask_assumed_units(draft)
    runs, looks = list_runs(draft, groups, steering)
    step = _step(logs)
    if step is not None:
        draft.remark(
            f"the log is long; step = {step:g} keeps one sample per channel and {step:g} s (commands: "
            f"every change)"
        )
    for log in logs.values():
        for text in log.notices:
            draft.remark(f"{Path(log.path).name}: {text}")
    ask_lost_cells(draft)
    asked = sorted(draft.asked, key=lambda item: item[0])
    if _longest(recordings) < FEWEST_SAMPLES:  # the rest is of columns that so few samples do not tell
        asked = asked[:1]
    questions = tuple(text for _, text in asked)
    if not any(role in UPRIGHT for role in draft.map.channels) and not draft.has("qw"):
        draft.map = replace(draft.map, dof=3)
    draft.map = replace(draft.map, world=draft.map.world or "ned", body=draft.map.body or "frd")
    found = replace(draft.map, questions=questions, runs=tuple(runs), step=step)
    if not vehicle:
        draft.remark(
            'no vehicle is named; write vehicle = "remus100", or a file beside the map '
            "(`bayesid vehicle list`)"
        )
    return Proposal(found, tuple(draft.remarks), tuple(unused), looks)


def _name(draft: Draft, recordings: list[Recording], steering: Steering) -> list[str]:
    """Channels by name; the series no role was found for."""
    best: dict[str, list[tuple[float, str, RawChannel, bool | None]]] = {}
    unused: list[str] = []
    first: dict[str, RawLog] = {}
    for recording in recordings:
        for label, log in recording.logs.items():
            if label not in first or len(log.channels) > len(first[label].channels):
                first[label] = log
    own = {label for label, log in first.items() if in_bundle_format(log.by_name)}
    if own == set(first):
        draft.axes_stated = draft.body_stated = True
        draft.map = replace(draft.map, world="ned", body="frd")
    for label, log in first.items():
        for channel in log.channels:
            good = np.isfinite(channel.values)
            known = replace(channel, name=label) if channel.name.lower() in GENERIC else channel
            guess = guess_role(known, label in own) if good.sum() > 3 else None
            if good.sum() > 3 and label not in own:
                guess = named_guess(known, steering) or guess
            if guess is None:
                unused.append(_full(label, channel.name, len(first)))
                continue
            role = guess.role
            if role in WITH_ORDER or role in steering.inputs:
                ordered = guess.ordered
                if ordered is None:
                    its = [r.logs[label].by_name.get(channel.name) for r in recordings if label in r.logs]
                    ordered = _in_steps([c for c in its if c is not None])
                role = f"{role}_cmd" if ordered and guess.score < 3.0 else role
            best.setdefault(role, []).append((guess.score, label, channel, guess.ordered))
    _of_all_alike(draft, best, unused, steering, len(first))
    _one_attitude(best)
    favoured = _favoured(best)
    channels: dict[str, ChannelMap] = {}
    passed: dict[tuple[str, str], list[str]] = {}
    for role, found in best.items():
        found.sort(
            key=lambda item: (
                -round(item[0], 2),
                item[2].name.rpartition(".")[0] != favoured,
                item[1] != favoured,
            )
        )
        score, label, channel, ordered = found[0]
        full = _full(label, channel.name, len(first))
        unit = channel.unit or (None if role in QUATERNION else _unit_in_name(channel.name, role))
        channels[role] = ChannelMap(full, unit)
        draft.stated[role] = unit is not None or role in QUATERNION
        for other in found[1:]:
            unused.append(_full(other[1], other[2].name, len(first)))
        rivals = [o for o in found[1:] if o[0] > score - 0.3]
        if rivals and score < 3.0:
            shown = ", ".join(repr(o[2].name) for o in rivals[:3])
            twins = _of_two_shafts(channel, rivals[0][2]) if role.partition("_")[0] == "n" else ""
            draft.ask(3, f"{role} is read from {channel.name!r}; {shown} would fit as well{twins}")
        elif rivals:
            pair = (_topic(channel.name).split(".")[0], _topic(rivals[0][2].name).split(".")[0])
            passed.setdefault(pair, []).append(role)
        if role.split("_cmd")[0] in (*WITH_ORDER, *steering.inputs) and ordered is None and score < 3.0:
            everywhere = [r.logs[label].by_name.get(channel.name) for r in recordings if label in r.logs]
            moves = _how_it_moves(role, np.concatenate([c.values for c in everywhere if c is not None]))
            draft.remark(f"{channel.name!r} is read as {role}, {moves}")
        if score < 1.0:
            beside = [other.name for other in first[label].channels if other is not channel]
            word = unknown_unit(channel, beside)
            if not rivals or word is not None:  # of several that fit it is asked already
                draft.by_part[full] = word
    named = [entry.source for entry in channels.values()]
    for (taken, other_topic), roles in passed.items():
        draft.remark(f"{', '.join(roles)} are read from {taken}, not from {other_topic}")
    if channels.keys() >= {"latitude", "longitude"} and {"x", "y"} & set(channels):
        draft.remark("latitude and longitude are left out: local positions are there")
        for role in ("latitude", "longitude", "height"):
            channels.pop(role, None)
    for pair in (("north", "east"), ("latitude", "longitude"), ("x", "y")):
        if len(set(pair) & set(channels)) == 1:
            lone = (set(pair) & set(channels)).pop()
            channels.pop(lone)
    if {"north", "east"} <= set(channels):
        for role in ("x", "y", "latitude", "longitude"):
            channels.pop(role, None)
    if "height" in channels and "depth" in channels:
        channels.pop("height")
    source = channels["u"].source.lower() if "u" in channels else ""
    if re.search("speed|velocity|geschw", source) and not re.search("surge|forward|long|ahead|fwd", source):
        shown = repr(channels["u"].source)
        if "v" not in channels and {"north", "x", "latitude"} & set(channels):
            channels.pop("u")
            draft.remark(
                f"speed {shown} is left out: ahead, along the track or through the water, its name does "
                f"not say"
            )
        elif not re.search(r"\b[xu]\b", source):
            draft.remark(
                f"speed {shown} is taken as u, along the hull and over ground, which its name does not say; "
                "along the track it is speed_over_ground, through the water u_water"
            )
    for role in ("speed_over_ground", "course"):
        if role in channels and {"north", "x", "latitude"} & set(channels):
            draft.remark(
                f"{role} ({channels.pop(role).source!r}) is left out: the position that is read tells "
                "the motion over ground"
            )
    draft.map = replace(draft.map, channels=channels)
    read = {entry.source for entry in channels.values()}
    return unused + [name for name in named if name not in read]


def _of_all_alike(
    draft: Draft,
    best: dict[str, list[tuple[float, str, RawChannel, bool | None]]],
    unused: list[str],
    steering: Steering,
    count: int,
) -> None:
    """A rudder or propeller the vehicle does not have: one order of it is that of all its own ones alike."""
    for role in [r for r in best if r.removesuffix("_cmd") in steering.absent]:
        found = best.pop(role)
        free = [name for name in all_of_one_kind(role, steering) if f"{name}_cmd" not in best]
        if role.endswith("_cmd") and len(found) == 1 and free:
            best.update({f"{name}_cmd": list(found) for name in free})
            if len(free) > 1:
                draft.remark(f"{found[0][2].name!r} is read as the order of {and_list(free)} alike")
        else:
            unused += [_full(label, channel.name, count) for _, label, channel, _ in found]


def _of_two_shafts(one: RawChannel, other: RawChannel) -> str:
    """What to do of two shaft speeds where the vehicle has one propeller: a map reads a channel from one
    series."""
    apart = ""
    if one.values.shape == other.values.shape:
        both = np.isfinite(one.values) & np.isfinite(other.values)
        level = float(np.sqrt(np.mean(one.values[both] ** 2))) if both.any() else 0.0
        if level > 0.0:
            rms = float(np.sqrt(np.mean((one.values - other.values)[both] ** 2)))
            apart = f"they differ by {100.0 * rms / level:.2g} % (rms); "
    return (
        f" ({apart}of two shafts that turn alike, either; of two that do not, write a column of their mean "
        "into the log, or give the vehicle both by [actuators.NAME])"
    )


def _how_it_moves(role: str, values: Floats) -> str:
    good = values[np.isfinite(values)]
    if not good.size or float(np.ptp(good)) == 0.0:
        return f"ordered: it stays at {good[0]:.4g}" if good.size else "ordered: it holds nothing"
    return "ordered: it moves in steps" if role.endswith("_cmd") else "measured: it moves smoothly"


def _unit_in_name(name: str, role: str) -> str | None:
    """The unit at the end of a topic's field, if it is one of that role."""
    unit = split_unit(re.split(r"[./]", name)[-1])[1]
    try:
        return unit if unit and scale(unit, ROLES[role].unit, name) else None
    except UnitError:
        return unit if unit in ("%", "us_pwm") else None


def _full(label: str, name: str, count: int) -> str:
    return f"{label}:{name}" if count > 1 else name


def _one_attitude(best: dict[str, list[tuple[float, str, RawChannel, bool | None]]]) -> None:
    """Heading before yaw before quaternion; a quaternion only as a whole and of one topic."""
    if not set(QUATERNION) <= set(best):
        for q in QUATERNION:
            best.pop(q, None)
    if "heading" in best or "psi" in best:
        top = max((max(s for s, *_ in best[k]) for k in ("heading", "psi") if k in best), default=0.0)
        if top >= 1.0 or "qw" not in best:
            for q in QUATERNION:
                best.pop(q, None)
    if "heading" in best and "psi" in best:
        best.pop("psi")


def _favoured(best: dict[str, list[tuple[float, str, RawChannel, bool | None]]]) -> str:
    """The topic or file with most of the roles: series of one estimate belong together."""
    count: dict[str, int] = {}
    for found in best.values():
        for _, label, channel, _ in found:
            for key in {_topic(channel.name), label}:
                count[key] = count.get(key, 0) + 1
    return max(count, key=lambda k: count[k]) if count else ""


def _topic(name: str) -> str:
    return name.rpartition(".")[0]


def _in_steps(channels: Sequence[RawChannel]) -> bool:
    """True if most samples repeat the one before, where the series moves at all."""
    moving = [c.values[np.isfinite(c.values)] for c in channels]
    moving = [x for x in moving if x.size > 10 and float(np.ptp(x)) > 0]
    return all(float(np.mean(np.diff(x) == 0.0)) > 0.5 for x in moving)


_WORD = re.compile(r"[a-z]+|[0-9]+")
# words of a series that is no angle of an actuator, of one that steers, and of one that may be any angle
_OF_THRUST = frozenset({"throttle", "thrust", "rpm", "motor", "pwm", "power"})
_STEERS = frozenset({"steer", "steering", "azimuth", "nozzle", "rudder", "helm", "tiller"})
_OF_ANGLES = _STEERS | {"angle"}


def _needs(draft: Draft, recordings: list[Recording], unused: list[str], inputs: Sequence[str]) -> None:
    """What a bundle cannot do without, asked for where it was not found."""
    longest = _longest(recordings)
    if longest < FEWEST_SAMPLES:
        logs = [log for recording in recordings for log in recording.logs.values()]
        names = first_few([repr(Path(log.path).name) for log in logs], 3)
        draft.ask(
            FIRST,
            f"no column of {names} has more than {counted(longest, 'sample')}: too few to be a run or to "
            f"tell what a column is (at least {FEWEST_SAMPLES}); give longer logs",
        )
        return
    spare = f" (series not used: {first_few(map(repr, unused), 8)})" if unused else ""
    velocities = draft.has("u", "v") or draft.has("u_water", "v_water") or draft.has("v_north", "v_east")
    if not (
        draft.has("x", "y") or draft.has("north", "east") or draft.has("latitude", "longitude") or velocities
    ):
        draft.ask(0, f"no position found; add x, y or latitude, longitude to [channels]{spare}")
    if not (draft.has("heading") or draft.has("psi") or draft.has("qw") or draft.has("r")):
        draft.ask(0, f"no heading found; add heading, psi or qw, qx, qy, qz to [channels]{spare}")
    if inputs:
        lacking = [n for n in inputs if not draft.has(f"{n}_cmd") and not draft.has(n)]
        if lacking:
            lines = ", ".join(lines_of_inputs(lacking, unused))
            others = spare if "..." in lines else ""
            draft.ask(0, f"what steers this vehicle is not read; to [channels] belong {lines}{others}")
    elif not (draft.has("delta_r") or draft.has("delta_r_cmd")):
        hint = _likely_rudder(draft, recordings, unused)
        draft.ask(
            0,
            f"no rudder found; add delta_r_cmd (ordered) or delta_r (measured) to [channels]{hint or spare}",
        )
    if not (draft.has("n") or draft.has("n_cmd") or inputs):
        draft.remark(
            "no propeller speed found (n_cmd or n); a vehicle with a propeller is then held at the "
            "rpm_ref of its file"
        )


def _longest(recordings: Sequence[Recording]) -> int:
    """Samples of the longest series."""
    logs = [log for recording in recordings for log in recording.logs.values()]
    return max((c.t.size for log in logs for c in log.channels), default=0)


def lines_of_inputs(inputs: Sequence[str], unused: Sequence[str]) -> list[str]:
    """Line of [channels] per input: `n_3_cmd = "Thruster 3 (rpm)"`, where one series alone has its name and
    none of the words of the other kind; one steering series may turn all azimuths or nozzles."""
    series = [(text, set(_WORD.findall(text.lower()))) for text in unused]
    out = []
    for name in inputs:
        own = set(_WORD.findall(name.partition("_")[2].lower()))
        turned = name.partition("_")[0] in TURNED
        against = _OF_THRUST if turned else _OF_ANGLES
        like = [text for text, words in series if own <= words and not against & words]
        if name.startswith(("azimuth_", "nozzle_")) and not like:  # one gear may turn them all
            like = [text for text, words in series if _STEERS & words and not against & words]
        out.append(f"{name}_cmd = {_line_of(like[0], turned) if len(like) == 1 else '...'}")
    return out


def _line_of(series: str, turned: bool) -> str:
    """A series as that of an angle or of revolutions; a throttle in percent asks for those at full."""
    if turned or split_unit(series)[1] != "%":
        return toml_text(series)
    return (
        f'{{ from = {toml_text(series)}, scale = ..., unit = "rpm" }} (scale: rpm at full throttle over 100)'
    )


def _likely_rudder(draft: Draft, recordings: list[Recording], unused: list[str]) -> str:
    best, most = "", 6.0
    for name in unused[:200]:
        if _is_another(draft, recordings[0], name):
            continue
        channels = {**draft.map.channels, "delta_r": ChannelMap(name, "deg", scale=1.0)}
        try:
            t = rudder_t(replace(draft.map, channels=channels), recordings[0])
        except (BayesidError, ValueError, np.linalg.LinAlgError):
            continue
        if t is not None and abs(t) > most:
            best, most = name, abs(t)
    return (
        f"; {best!r} moves before the turns as a rudder does (by {most:.0f} standard errors): state its "
        "unit, or scale and offset"
        if best
        else ""
    )


def _is_another(draft: Draft, recording: Recording, name: str) -> bool:
    """Whether a series is by its name something other than an angle of a rudder, as a course, which moves
    with the turns too."""
    probe = replace(draft.map, channels={"delta_r": ChannelMap(name)})
    label, column = resolve(probe, "delta_r")
    channel = recording.logs[label].by_name.get(column) if label in recording.logs else None
    guess = None if channel is None else guess_role(channel)
    return guess is not None and guess.score >= BY_NAME and guess.role not in WITH_ORDER


def _declared_axes(draft: Draft, logs: dict[str, RawLog]) -> None:
    worlds = {log.world for log in logs.values() if log.world}
    if worlds:
        first = next(log for log in logs.values() if log.world)
        draft.axes_stated = draft.body_stated = True
        draft.map = replace(draft.map, world=first.world, body=first.body)
        for log in logs.values():
            for text in log.doubts if log.world else ():
                draft.ask(1, text)
        return
    if draft.axes_stated:
        return
    words = " ".join([*(log.text for log in logs.values()), *(c.source for c in draft.map.channels.values())])
    said = {w.lower() for w in _TEXT_WORLD.findall(words.replace("_", " "))}
    if len(said) == 1:
        world = said.pop()
        draft.axes_stated = True
        draft.map = replace(draft.map, world=world)
        draft.remark(f"axes {world}, as a name or a comment of the log says")


def _ask_time(draft: Draft, logs: dict[str, RawLog]) -> None:
    for log in logs.values():
        for text in log.doubts if not log.world else ():
            if "states no unit" not in text or any("times as long" in t for _, t in draft.asked):
                draft.ask(1, f"{Path(log.path).name}: {text}")
            else:
                run = common_run(draft.map, draft.liveliest)
                if run is None or not {"u", "x"} <= set(run.data):
                    draft.ask(1, f"{Path(log.path).name}: {text}")


def _step(logs: dict[str, RawLog]) -> float | None:
    """A step for logs of more than a million samples: a tenth of a second or what leaves half a million."""
    longest = max(logs.values(), key=lambda log: max(c.t.size * log.thinned for c in log.channels))
    channel = max(longest.channels, key=lambda c: c.t.size)
    rows, span = channel.t.size * longest.thinned, float(channel.t[-1] - channel.t[0])
    if rows < LARGE or not span > 0:
        return None
    wanted = max(span / 5e5, 0.1)
    return float(next(s for s in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 1e9) if s >= wanted * 0.999))
