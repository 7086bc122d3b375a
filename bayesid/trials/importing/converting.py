"""Series of a recording as bayesid's channels: units, axes, attitudes, local metres, body velocities.

Takes a `LogMap` and a `Recording`. Does not: read files, or bring series to common times.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bayesid.errors import raise_all
from bayesid.model.units import UnitError, scale
from bayesid.trials.assemble import unwrap
from bayesid.trials.importing import axes, geodesy
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.names import role_of_name
from bayesid.trials.importing.raw import ImportLogError, RawLog
from bayesid.trials.importing.roles import QUATERNION, ROLES
from bayesid.trials.importing.shares import in_words, taken_as_it_is
from bayesid.trials.importing.unit_words import split_unit
from bayesid.trials.trial import Floats

Series = tuple[Floats, Floats]  # times, values
ALIKE = 0.6  # share of letters from which a series of another name may be meant


@dataclass(frozen=True)
class Origin:
    """Where a channel came from: source series, conversion in words, cells lost."""

    series: tuple[str, ...]
    conversion: str
    readings: int
    lost: int


@dataclass
class Recording:
    """Logs of one set of files on one clock; `zero` is the UTC of its t = 0."""

    logs: dict[str, RawLog]
    shift: dict[str, float]
    start: float | None
    notices: list[str] = field(default_factory=list)


def resolve(found: LogMap, role: str) -> tuple[str, str]:
    """(label, column) of a channel of the map."""
    source = found.channels[role].source
    head, mark, tail = source.partition(":")
    if mark and head in found.sources:
        return head, tail
    return next(iter(found.sources)), source


def convert(
    found: LogMap, recording: Recording, origin: tuple[float, float, float] | None = None
) -> tuple[dict[str, Series], dict[str, Origin], tuple[float, float, float] | None]:
    """Channels of bayesid of a recording, SI, on its clock.

    Returns
    -------
    (series, where each is from, origin of latitude and longitude in degrees and metres)

    Raises
    ------
    ImportLogError             with every series that is missing and every unit that does not fit
    """
    raw: dict[str, Series] = {}
    origins: dict[str, Origin] = {}
    labels: dict[str, str] = {}
    problems: list[str] = []
    taken: dict[str, set[str]] = defaultdict(set)
    for label, name in (resolve(found, role) for role in found.channels):
        taken[label].add(name)
    for role, entry in found.channels.items():
        label, name = resolve(found, role)
        if label not in recording.logs:
            continue
        log = recording.logs[label]
        series = log.by_name.get(name)
        near = _near(name, role, log, taken[label]) if series is None else ""
        if series is None and len(found.sources[label].files) > 1:
            recording.notices.append(f"{Path(log.path).name} has no {name!r} for {role}{near}")
            continue
        if series is None:
            problems.append(f"{Path(log.path).name}: has no series {name!r} for {role}{near}")
            continue
        row = ROLES[role]
        unit = entry.unit if entry.unit is not None else (series.unit or row.bare)
        try:
            factor = scale(unit, row.unit, f"{name!r}") if row.unit else 1.0
        except UnitError as error:
            problems.append(in_words(role, name, entry, unit) or str(error))
            continue
        said = taken_as_it_is(role, name, entry, series.unit)
        if said is not None and said not in recording.notices:
            recording.notices.append(said)
        read = series.values
        gone: np.ndarray = np.zeros(0, dtype=bool)
        if entry.missing:  # a code may have been kept in 32 bits
            gone = np.asarray(np.isclose(read[:, None], entry.missing, rtol=1e-6, atol=0.0).any(axis=1))
        read = np.where(gone, np.nan, read) if gone.any() else read
        values = read if entry.scale == 1.0 and entry.offset == 0.0 else entry.scale * read + entry.offset
        if factor != 1.0:
            values = values * factor
        good = np.isfinite(series.t)
        raw[role] = (series.t[good] + recording.shift[label], values[good])
        labels[role] = label
        words = [f"[{unit}]"] if row.unit else []
        if entry.scale != 1.0:
            words.append(f"times {entry.scale:g}")
        if entry.offset != 0.0:
            words.append(f"plus {entry.offset:g}")
        if gone.any():
            words.append(f"{int(gone.sum())} of a code for no reading left out")
        origins[role] = Origin(
            (f"{label}:{name}",), ", ".join(words), int(np.isfinite(values).sum()), series.lost
        )
    if problems:
        raise_all(ImportLogError, "map", problems)

    def world(role: str) -> str:
        label = labels[role]
        return found.sources[label].world or found.world or recording.logs[label].world or "ned"

    def body(role: str) -> str:
        label = labels[role]
        return found.sources[label].body or found.body or recording.logs[label].body or "frd"

    out: dict[str, Series] = {}
    notes: dict[str, Origin] = {}

    def give(name: str, series: Series, words: str, *roles: str) -> None:
        out[name] = series
        its = [origins[r] for r in roles]
        said = "; ".join(w for w in (*(o.conversion for o in its[:1]), words) if w)
        notes[name] = Origin(
            tuple(s for o in its for s in o.series),
            said,
            int(np.isfinite(series[1]).sum()),
            max(o.lost for o in its),
        )

    _attitude(raw, world, body, give)
    origin = _position(raw, world, give, origin or found.origin)
    for role, one in raw.items():
        if role in ("x", "y", "z", "psi", "phi", "theta") or role not in _OWN:
            continue
        said = "" if body(role) == "frd" or axes.body_of(role, np.ones(1), "flu")[0] > 0 else "flu to frd"
        give(role, (one[0], axes.body_of(role, one[1], body(role))), said, role)
    _velocity(raw, out, give)
    used = {one for its in notes.values() for one in its.series}
    for role, why in _UNUSED.items():
        if role in raw and not used & set(origins[role].series):
            text = f"{role} ({resolve(found, role)[1]!r}) is not used: {why}"
            if text not in recording.notices:
                recording.notices.append(text)
    return out, notes, origin


_OVER_GROUND = "u and v are made of speed over ground and course only with a heading, without u and position"
_NORTH_EAST = "u and v are made of v_north and v_east only with a heading and without u"
_UNUSED = {
    "speed_over_ground": _OVER_GROUND, "course": _OVER_GROUND, "v_north": _NORTH_EAST, "v_east": _NORTH_EAST,
    "speed_through_water": "u_water is named too",
}  # fmt: skip
_OWN = frozenset(name for name, row in ROLES.items() if row.bare and name not in (
    "latitude", "longitude", "height", "depth", "north", "east", "heading", "v_north", "v_east", "v_down",
    "speed_over_ground", "course", "speed_through_water",
))  # fmt: skip


def _near(name: str, role: str, log: RawLog, taken: Collection[str]) -> str:
    """The series that was meant: one whose name tells the same role, else spelt alike without its unit; none
    that is another channel of the map.
    """
    import difflib

    bare = {split_unit(other)[0].lower(): other for other in (*log.others, *log.by_name)}
    free = {word: other for word, other in bare.items() if other not in taken}
    same = [other for word, other in free.items() if role_of_name(word) == role]
    alike = difflib.get_close_matches(split_unit(name)[0].lower(), free, n=1, cutoff=ALIKE)
    near = [*same[:1], *(free[word] for word in alike)]
    return f"; did you mean {near[0]!r}?" if near else f"; it has {', '.join(list(bare.values())[:8])}"


def at_times(series: Series, t: Floats, angle: bool = False) -> Floats:
    """Values of a series at other times, between its readings; NaN outside them."""
    good = np.isfinite(series[1])
    if good.sum() < 2:
        return np.full(t.shape, np.nan)
    own, values = series[0][good], series[1][good]
    order = np.argsort(own, kind="stable")
    own, values = own[order], values[order]
    return np.interp(t, own, unwrap(values) if angle else values, left=np.nan, right=np.nan)


def _attitude(raw, world, body, give) -> None:  # type: ignore[no-untyped-def]
    if "heading" in raw:
        give("psi", raw["heading"], "", "heading")
    elif "psi" in raw:
        axis = world("psi")
        words = "" if axis == "ned" else f"{axis} to ned"
        give("psi", (raw["psi"][0], axes.heading_of(raw["psi"][1], axis)), words, "psi")
    for name in ("phi", "theta"):
        if name in raw:
            words = "flu to frd" if name == "theta" and body(name) == "flu" else ""
            give(name, (raw[name][0], axes.body_of(name, raw[name][1], body(name))), words, name)
    if set(QUATERNION) <= set(raw):
        t = raw["qw"][0]
        parts = [raw[q][1] if raw[q][0].shape == t.shape else at_times(raw[q], t) for q in QUATERNION]
        roll, pitch, yaw = axes.euler(*parts)
        words = f"Euler angle of a quaternion, {world('qw')}, {body('qw')}"
        for name, values in (
            ("psi", axes.heading_of(yaw, world("qw"))),
            ("theta", axes.body_of("theta", pitch, body("qw"))),
            ("phi", roll),
        ):
            level = (
                name != "psi" and float(np.nanmax(np.abs(values), initial=0.0)) < 1e-9
            )  # a planar estimate
            if name not in raw and not level and not (name == "psi" and "heading" in raw):
                give(name, (t, values), words, *QUATERNION)


def _position(raw, world, give, origin):  # type: ignore[no-untyped-def]
    if (
        {"latitude", "longitude"} <= set(raw)
        and not {"north", "east"} & set(raw)
        and not {"x", "y"} & set(raw)
    ):
        t, lat = raw["latitude"]
        lon = raw["longitude"][1] if raw["longitude"][0].shape == t.shape else at_times(raw["longitude"], t)
        lat, lon = (
            np.where((lat == 0.0) & (lon == 0.0), np.nan, lat),
            np.where((lat == 0.0) & (lon == 0.0), np.nan, lon),
        )
        height = at_times(raw["height"], t) if "height" in raw and "depth" not in raw else np.zeros_like(lat)
        good = np.flatnonzero(np.isfinite(lat) & np.isfinite(lon))
        if good.size and origin is None:
            k = good[0]
            tall = height[np.isfinite(height)]
            origin = (
                float(np.degrees(lat[k])),
                float(np.degrees(lon[k])),
                float(tall[0]) if tall.size else 0.0,
            )
        if origin is not None:
            zero = (np.radians(origin[0]), np.radians(origin[1]), origin[2])
            level = np.where(np.isfinite(height), height, origin[2])
            north, east, _ = geodesy.local_metres(lat, lon, level, zero)
            words = f"local metres from {origin[0]:.8f} deg, {origin[1]:.8f} deg (WGS84)"
            give("x", (t, north), words, "latitude", "longitude")
            give("y", (t, east), words, "latitude", "longitude")
    for name, role in (("x", "north"), ("y", "east")):
        if role in raw:
            give(name, raw[role], "", role)
    if "x" in raw and "y" in raw:
        axis = world("x")
        local = axes.position_of({"x": raw["x"][1], "y": raw["y"][1]}, axis)
        words = "" if axis == "ned" else f"{axis} to ned"
        for name in ("x", "y"):
            own = {"enu": {"x": "y", "y": "x"}}.get(axis, {}).get(name, name)
            give(name, (raw[own][0], local[name]), words, own)
    if "depth" in raw:
        give("z", raw["depth"], "", "depth")
    elif "z" in raw:
        axis = world("z")
        give(
            "z",
            (raw["z"][0], raw["z"][1] if axis == "ned" else -raw["z"][1]),
            "" if axis == "ned" else "up to down",
            "z",
        )
    return origin


def _velocity(raw, out, give) -> None:  # type: ignore[no-untyped-def]
    if {"v_north", "v_east"} <= set(raw) and "psi" in out and "u" not in raw:
        t, north = raw["v_north"]
        east = raw["v_east"][1] if raw["v_east"][0].shape == t.shape else at_times(raw["v_east"], t)
        psi = at_times(out["psi"], t, angle=True)
        if {"phi", "theta"} <= set(out) and "v_down" in raw:
            phi, theta = (np.nan_to_num(at_times(out[k], t)) for k in ("phi", "theta"))
            down = at_times(raw["v_down"], t)
        else:
            phi = theta = down = np.zeros_like(t)
        ahead, side = north * np.cos(psi) + east * np.sin(psi), east * np.cos(psi) - north * np.sin(psi)
        tilted = ahead * np.sin(theta) + down * np.cos(theta)
        words = "turned from north and east by the heading"
        give("u", (t, ahead * np.cos(theta) - down * np.sin(theta)), words, "v_north", "v_east")
        give("v", (t, side * np.cos(phi) + tilted * np.sin(phi)), words, "v_north", "v_east")
        if "v_down" in raw and "z" in out:
            give("w", (t, tilted * np.cos(phi) - side * np.sin(phi)), words, "v_north", "v_east", "v_down")
    elif {"speed_over_ground", "course"} <= set(raw) and "psi" in out and "u" not in raw and "x" not in out:
        t, speed = raw["speed_over_ground"]
        drift = at_times(raw["course"], t, angle=True) - at_times(out["psi"], t, angle=True)
        words = "speed turned from course to heading"
        give("u", (t, speed * np.cos(drift)), words, "speed_over_ground", "course")
        give("v", (t, speed * np.sin(drift)), words, "speed_over_ground", "course")
    if "speed_through_water" in raw and "u_water" not in raw:
        give("u_water", raw["speed_through_water"], "", "speed_through_water")
