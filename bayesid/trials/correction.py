"""What is done to a log whose numbers are not what their header says: the table [corrections] of trial.toml.

Takes the parsed table, or values; gives a `Correction` that turns a `Run` into the corrected one and writes
itself as lines of trial.toml.
Does not: find out what is wrong (`bayesid.trials.mistakes`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from bayesid.model.channels import channel, is_channel, nearest_hint
from bayesid.trials.kinematics.blocks import joined
from bayesid.trials.left_out import LeftOut, read_left_out
from bayesid.trials.trial import Floats, Run
from bayesid.trials.true_wind import READINGS, TRUE, true_wind

EARTH_RADIUS = 6_371_000.0  # m, mean
_GROUP = {
    "pose": "data", "velocity": "data", "command": "commands", "actuator": "measured_inputs",
    "propulsion": "propulsion", "environment": "exogenous",
}  # fmt: skip
CORRECTED = "corrected:"  # begins the provenance of a run that corrections were applied to
# Part of a step by which rows may lie off it, and part of the rows that may not.
UNEVEN, MOSTLY = 0.1, 0.9
SAME_ROW = 1e-6  # of a usual step: times so near to each other are one
TEXTS = {"heading_from": ("north", "east"), "velocity_axes": ("body", "earth"), "wind": READINGS}
WIND = frozenset({"wind_speed", "wind_from"})
MOTION = frozenset({"x", "y", "psi", "u", "v"})  # of which the true wind is made of an apparent one


@dataclass(frozen=True)
class Correction:
    """Corrections in the order they are applied.

    Attributes
    ----------
    drop : channels that are not to be read
    skip_repeats : channels of which a reading equal to the one before is an empty cell
    leave_out : readings that are empty cells, each of one run between two times
    rename : channel -> what it really is, e.g. {"u": "u_water"}
    geographic : x and y hold latitude and longitude in degrees
    exchange : pairs of channels whose columns are exchanged
    scale : channel -> factor on the logged number, e.g. -1 for a sign, 0.514444 for knots read as m/s
    heading_from : "east" where psi counts from east towards north
    velocity_axes : "earth" where u and v are the velocities north and east
    offset : channel -> added, SI
    from_time : channel -> seconds of the log from which on `offset` holds; the whole run where not stated
    late : channel -> seconds by which it was logged late
    time_scale : true seconds per second of the log
    wind : how wind_speed and wind_from were read: "true" and from north, "from the bow", "apparent" (past the
        moving vehicle, from the bow) or "apparent by compass"
    runs : names of the runs concerned; all where empty
    """

    drop: tuple[str, ...] = ()
    skip_repeats: tuple[str, ...] = ()
    leave_out: tuple[LeftOut, ...] = ()
    rename: Mapping[str, str] = field(default_factory=dict)
    geographic: bool = False
    exchange: tuple[tuple[str, str], ...] = ()
    scale: Mapping[str, float] = field(default_factory=dict)
    heading_from: str = "north"
    velocity_axes: str = "body"
    offset: Mapping[str, float] = field(default_factory=dict)
    from_time: Mapping[str, float] = field(default_factory=dict)
    late: Mapping[str, float] = field(default_factory=dict)
    time_scale: float = 1.0
    wind: str = TRUE
    runs: tuple[str, ...] = ()

    @property
    def channels(self) -> frozenset[str]:
        """Channels that come out different; "t" stands for all."""
        out = {
            *self.drop,
            *self.skip_repeats,
            *(name for one in self.leave_out for name in one.channels),
            *self.rename,
            *self.rename.values(),
            *self.scale,
            *self.offset,
            *self.late,
        }
        out |= {name for pair in self.exchange for name in pair}
        out |= {"x", "y"} if self.geographic else set()
        out |= {"psi"} if self.heading_from == "east" else set()
        out |= {"u", "v"} if self.velocity_axes == "earth" else set()
        out |= WIND if self.wind != TRUE else set()
        return frozenset(out | ({"t"} if self.time_scale != 1.0 else set()))

    def of(self, run: Run) -> bool:
        """Whether the run is concerned."""
        own = self.names_runs
        return run.name in own if own else not self.runs or run.name in self.runs

    @property
    def names_runs(self) -> tuple[str, ...]:
        """Runs that its entries name one by one; none where it does more than leave readings out."""
        if self != Correction(leave_out=self.leave_out):
            return ()
        return tuple(dict.fromkeys(one.run for one in self.leave_out))

    def lines(self, digits: int = 6) -> tuple[str, ...]:
        """The table of trial.toml without its header."""
        off = Correction()
        return tuple(
            f"{item.name} = {_toml(getattr(self, item.name), digits)}"
            for item in fields(self)
            if getattr(self, item.name) != getattr(off, item.name)
        )


def apply(correction: Correction, run: Run) -> Run:
    """The run as it should have been logged."""
    if not correction.of(run) or not correction.channels:
        return run
    series = {k: v for group in run.GROUPS if group != "extra" for k, v in getattr(run, group).items()}
    for name in correction.drop:
        series.pop(name, None)
    for name in correction.skip_repeats:
        if name in run.data:
            series[name] = _without_repeats(series[name])
    for one in correction.leave_out:
        if one.run == run.name:
            series = one.emptied(run.t, series)
    series = {correction.rename.get(k, k): v for k, v in series.items()}
    if correction.geographic and {"x", "y"} <= set(series):
        series["x"], series["y"] = _metres(series["x"], series["y"])
    for a, b in correction.exchange:
        if a in series and b in series:
            series[a], series[b] = series[b], series[a]
    for name, factor in correction.scale.items():
        if name in series:
            series[name] = series[name] * factor
            if channel(name).circular and channel(name).kind != "command" and abs(factor) != 1.0:
                series[name] = _unwrapped(series[name])
    if correction.heading_from == "east" and "psi" in series:
        series["psi"] = math.pi / 2 - series["psi"]
    if correction.velocity_axes == "earth" and {"u", "v", "psi"} <= set(series):
        # beside faster or slower channels, velocities stand where no heading was read
        psi, known = joined(run.t, _unwrapped(series["psi"]))
        body = (series["u"] + 1j * series["v"]) * np.exp(-1j * np.where(known, psi, np.nan))
        series["u"], series["v"] = body.real.copy(), body.imag.copy()
    for name, value in correction.offset.items():
        if name in series:
            since = correction.from_time.get(name, -math.inf)
            series[name] = np.where(run.t >= since, series[name] + value, series[name])
    for name, delay in correction.late.items():
        if name in series and channel(name).kind != "command":
            series[name] = _earlier(run.t, series[name], delay, channel(name).kind)
    sooner = _sooner(correction, run, series)
    for name, (whole, _) in sooner.items():
        series[name] = _rows_up(run.t, series[name], whole)
    t, began, known_from = run.t, run.began, _known_from(correction, run, sooner)
    if correction.time_scale != 1.0:
        t = t[0] + (t - t[0]) * correction.time_scale
        began = None if began is None else float(t[0] + (began - t[0]) * correction.time_scale)
        known_from = {k: float(t[0] + (at - t[0]) * correction.time_scale) for k, at in known_from.items()}
    if correction.wind != TRUE and set(series) >= WIND:
        speed, come = true_wind(correction.wind, t, series, run.name)
        series["wind_speed"], series["wind_from"] = speed, _unwrapped(come)
    groups: dict[str, Any] = {group: {} for group in set(_GROUP.values())}
    for name, values in series.items():
        groups[_GROUP[channel(name).kind]][name] = values
    note = f"{CORRECTED} " + "; ".join(correction.lines())
    provenance = (*run.provenance, note)
    before = {name: correction.time_scale * s for name, (_, s) in sooner.items() if s}
    return replace(
        run, t=t, began=began, known_from=known_from, acts_before=before, provenance=provenance, **groups
    )


def _known_from(
    correction: Correction, run: Run, sooner: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """When inputs are first known [s], by the names and on the clock that the correction gives them; those of
    orders move with their rows."""
    known = _renamed(correction, run.known_from)
    moved = dict(correction.late) | {name: whole for name, (whole, _) in sooner.items()}
    return {name: at - moved.get(name, 0.0) for name, at in known.items()}


def _sooner(correction: Correction, run: Run, series: Mapping[str, Floats]) -> dict[str, tuple[float, float]]:
    """Order -> time [s] by which it acts before its rows, known and `late` together: by what its rows move,
    and the rest, which is less than one.

    Rows that are not even move to where they act, which is half a row late in the mean.
    """
    total = _renamed(correction, run.acts_before)
    for name, late in correction.late.items():
        total[name] = total.get(name, 0.0) + late
    steps = np.diff(run.t) if run.n_samples > 1 else np.array([math.inf])
    step = float(np.median(steps))
    even = math.isfinite(step) and np.mean(np.abs(steps - step) < UNEVEN * step) > MOSTLY
    out = {}
    for name, time in total.items():
        if name not in series or channel(name).kind != "command":
            continue
        if even:
            whole = step * math.floor(time / step + SAME_ROW)
            rest = time - whole
        else:
            whole, rest = (0.0, time) if abs(time) < step else (time, 0.5 * step)
        out[name] = whole, 0.0 if abs(rest) < SAME_ROW * step else rest
    return out


def _rows_up(t: Floats, values: Floats, whole: float) -> Floats:
    """An order at the rows from which it holds, those so much later than each."""
    if not whole:
        return values
    near = UNEVEN * float(np.median(np.diff(t)))  # stamps jitter
    at = np.searchsorted(t, t + whole + near, side="right") - 1
    return np.asarray(values[np.clip(at, 0, t.size - 1)])


def _renamed(correction: Correction, known: Mapping[str, float]) -> dict[str, float]:
    """Numbers by channel, by the names that the correction gives the channels."""
    known = {correction.rename.get(k, k): at for k, at in known.items() if k not in correction.drop}
    for a, b in correction.exchange:
        pair = {b: known.pop(a, None), a: known.pop(b, None)}
        known |= {name: at for name, at in pair.items() if at is not None}
    return known


def join(corrections: Sequence[Correction]) -> Correction | None:
    """One table in place of several; None where it would say something else than one after the other.

    Factors on one channel are multiplied and offsets added. Tables of other runs cannot be joined, nor two
    that change one channel under different keys: a table has its own order.
    """
    first, *others = corrections
    out = first
    for one in others:
        mine, its = (
            {item.name for item in fields(c) if getattr(c, item.name) != getattr(Correction(), item.name)}
            for c in (out, one)
        )
        both, shared = mine & its - {"runs"}, out.channels & one.channels
        timed = {"time_scale"} & (mine ^ its) and {"late", "from_time", "leave_out"} & (mine | its)
        added = {"scale", "offset", "time_scale", "leave_out"}
        if out.runs != one.runs or timed or (shared and not both <= added):
            return None
        if shared and mine - {"runs"} != its - {"runs"}:
            return None
        if shared and len(both) > 1:
            return None
        if _turned(out, one) or _turned(one, out):
            return None
        if out.wind != TRUE and one.channels & {*MOTION, "t"}:  # in one table the wind comes last
            return None
        values: dict[str, Any] = {name: getattr(one, name) for name in its - mine}
        for name in both:
            a, b = getattr(out, name), getattr(one, name)
            if isinstance(a, Mapping):
                same = a.keys() & b.keys()
                twice = {k: a[k] * b[k] if name == "scale" else a[k] + b[k] for k in same}
                values[name] = {**a, **b, **twice}
            elif isinstance(a, tuple):
                values[name] = a + b
            elif name == "time_scale":
                values[name] = a * b
        out = replace(out, **values)
    return out


def _turned(axes: Correction, heading: Correction) -> bool:
    """Whether one turns u and v by a heading that the other changes before, in one table."""
    early = {*heading.drop, *heading.skip_repeats, *heading.rename, *heading.rename.values(), *heading.scale}
    early |= {name for pair in heading.exchange for name in pair}
    early |= {name for one in heading.leave_out for name in one.channels}
    early |= {"psi"} if heading.heading_from == "east" else set()
    return axes.velocity_axes == "earth" and "psi" in early


def without_effect(correction: Correction, runs: Sequence[Run]) -> list[str]:
    """Entries of a correction that change nothing, as no run logs any of their channels: a sentence each.

    A mend names all channels that may be concerned, so one that is not logged beside others is no error.

    Parameters
    ----------
    runs : as logged, before any correction
    """
    concerned = [run for run in runs if correction.of(run)]
    logged = {k for run in concerned for g in run.GROUPS if g != "extra" for k in getattr(run, g)}
    # entries after `rename` and `exchange` may speak of what these give
    later = logged - set(correction.drop) | set(correction.rename.values())
    asked: list[tuple[str, Iterable[str], set[str]]] = [
        ("drop", correction.drop, logged),
        ("skip_repeats", correction.skip_repeats, logged),
        ("rename", correction.rename, logged),
        ("exchange", (name for pair in correction.exchange for name in pair), later),
        ("scale", correction.scale, later),
        ("offset", correction.offset, later),
        ("late", correction.late, later),
        ("heading_from", ("psi",) if correction.heading_from == "east" else (), later),
        ("velocity_axes", ("u", "v", "psi") if correction.velocity_axes == "earth" else (), later),
        ("wind", WIND if correction.wind != TRUE else (), later),
        ("geographic", ("x", "y") if correction.geographic else (), later),
    ]
    there = ", ".join(sorted(logged)) or "no channel"
    out = [
        f"[corrections] {entry} changes nothing: no run logs {', '.join(named)}; they hold {there}"
        for entry, names, have in asked
        if (named := sorted(names)) and not have & set(named)
    ]
    series = {
        run.name: {k: (run.t, v) for g in run.GROUPS if g != "extra" for k, v in getattr(run, g).items()}
        for run in runs
    }
    out += [
        f"[corrections] leave_out changes nothing in {one.run}: runs = {list(correction.runs)} leaves it out"
        for one in correction.leave_out
        if correction.runs and one.run in series and one.run not in correction.runs
    ]
    out += [
        f"[corrections] leave_out changes nothing: {why}"
        for one in correction.leave_out
        if (why := one.without_effect(series))
    ]
    unknown = [name for name in correction.runs if name not in {run.name for run in runs}]
    if unknown:
        known = ", ".join(run.name for run in runs)
        return [f"[corrections] runs: there is no run {', '.join(unknown)}; there are {known}"]
    return out


def _without_repeats(values: Floats) -> Floats:
    good = np.flatnonzero(np.isfinite(values))
    out = values.copy()
    out[good[1:][np.diff(values[good]) == 0.0]] = np.nan
    return out


def _metres(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
    """North and east of the first fix, on a sphere: 1e-3 of the distance from what an ellipsoid gives."""
    if not np.isfinite(latitude).any():
        return latitude, longitude
    first = int(np.argmax(np.isfinite(latitude) & np.isfinite(longitude)))
    degree = EARTH_RADIUS * math.pi / 180.0
    east = degree * math.cos(math.radians(float(latitude[first]))) * (longitude - longitude[first])
    return degree * (latitude - latitude[first]), east


def _unwrapped(angle: Floats) -> Floats:
    good = np.isfinite(angle)
    out = angle.copy()
    out[good] = np.unwrap(angle[good])
    return out


def _earlier(t: Floats, values: Floats, delay: float, kind: str) -> Floats:
    """What was logged `delay` later; NaN where the log had ended, the nearest value for inputs."""
    at = t + delay
    good = np.isfinite(values)
    if good.sum() < 2:
        return values
    out = np.interp(at, t[good], values[good])
    if kind in ("pose", "velocity", "propulsion"):
        holes = np.interp(at, t, (~good).astype(float)) > 0.5 if not good.all() else np.zeros(t.shape, bool)
        out = np.where(holes | (at < t[0]) | (at > t[-1]), np.nan, out)
    return out


def _toml(value: Any, digits: int = 6) -> str:
    if isinstance(value, LeftOut):
        return value.toml()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{k} = {_toml(v, digits)}" for k, v in value.items()) + " }"
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(v, digits) for v in value) + "]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.{digits}g}"


def read_correction(table: Any, problems: list[str]) -> Correction:
    """The table [corrections], checked value by value; what is wrong goes to `problems`."""
    if not isinstance(table, dict):
        problems.append("[corrections] must be a table")
        return Correction()
    known = {item.name for item in fields(Correction)}
    values: dict[str, Any] = {}
    for key, given in table.items():
        if key not in known:
            problems.append(f"[corrections] {key!r} is not known; one of {', '.join(sorted(known))}")
        elif (value := _checked(key, given, problems)) is not None:
            values[key] = value
    return Correction(**values)


def _checked(key: str, given: Any, problems: list[str]) -> Any:
    place = f"[corrections] {key}"

    def name(text: Any) -> bool:
        if isinstance(text, str) and is_channel(text) and text != "t":
            return True
        problems.append(f"{place}: {str(text)[:40]!r} is no channel{nearest_hint(str(text))}")
        return False

    def number(value: Any, where: str) -> bool:
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            return True
        problems.append(f"{where} is {str(value)[:40]!r}; a number is needed")
        return False

    if key in ("scale", "offset", "late", "from_time"):
        if not isinstance(given, dict):
            problems.append(f"{place} must be a table of channels, e.g. {key} = {{ u = 1.0 }}")
            return None
        good = [name(k) and number(v, f"{place} of {k}") for k, v in given.items()]
        if key == "scale" and any(v == 0 for v in given.values()):
            problems.append(f"{place}: a factor of zero leaves nothing; drop = [...] leaves a channel out")
            return None
        return {k: float(v) for k, v in given.items()} if all(good) else None
    if key == "rename":
        ok = isinstance(given, dict) and all(name(k) and name(v) for k, v in given.items())
        if not isinstance(given, dict):
            problems.append(f'{place} must be a table, e.g. rename = {{ u = "u_water" }}')
        return dict(given) if ok else None
    if key == "leave_out":
        return read_left_out(given, place, problems)
    if key in ("drop", "skip_repeats", "runs"):
        if not isinstance(given, list) or not all(isinstance(v, str) for v in given):
            problems.append(f"{place} must be a list of names")
            return None
        return tuple(given) if key == "runs" or all(name(v) for v in given) else None
    if key == "exchange":
        pairs = isinstance(given, list) and all(isinstance(p, list) and len(p) == 2 for p in given)
        if not pairs:
            problems.append(f'{place} must be a list of pairs, e.g. exchange = [["x", "y"]]')
            return None
        return tuple((a, b) for a, b in given) if all(name(v) for p in given for v in p) else None
    if key in TEXTS:
        if given in TEXTS[key]:
            return given
        problems.append(f"{place} is {str(given)[:40]!r}; one of {', '.join(TEXTS[key])}")
        return None
    if key == "geographic":
        if isinstance(given, bool):
            return given
        problems.append(f"{place} must be true or false")
        return None
    if number(given, place) and given > 0:
        return float(given)
    if isinstance(given, int | float) and given <= 0:
        problems.append(f"{place} must be above zero")
    return None
