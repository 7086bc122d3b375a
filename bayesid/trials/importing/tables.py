"""Columns of one length become a log: the time columns are found, the rest are channels.

Shared by the readers of CSV, Parquet, MAT and NetCDF files. Does not: read files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.trials.importing import clocks
from bayesid.trials.importing.raw import ImportLogError, RawChannel, Request, SourceOptions
from bayesid.trials.importing.thinning import Thinning
from bayesid.trials.importing.unit_words import plain_unit, split_unit
from bayesid.words import first_few

_TIME = re.compile(
    r"(t|time|times|timestamp|time ?stamp|stamp|utc|date ?time|datetime|epoch|secs?|seconds|zeit|"
    r"elapsed( ?time)?|sim ?time|gps ?time|unix( ?time| ?stamp| ?timestamp)?|"
    r"log ?time|uhrzeit|temps|utc ?time|time ?utc|index time|tow|time of week|"
    r"posix ?time|clock|ros ?time|time ?us|time ?ms|time ?ns|time ?boot|t ?(abs|rel))"
)
_DATE = re.compile(r"(date|datum|day|utc date|gps date)")
_WEEK = re.compile(r"(gps )?(week|wk|week ?no|gps ?week)")


@dataclass
class Columns:
    """name -> (n,) numbers, datetimes or texts of one table, with what the file says about them."""

    data: dict[str, np.ndarray]
    units: Mapping[str, str | None] = field(default_factory=dict)
    roles: Mapping[str, str] = field(default_factory=dict)
    lost: Mapping[str, int] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)

    def unit(self, name: str) -> str | None:
        found = self.units.get(name)
        return found if found is not None else split_unit(name)[1]


@dataclass(frozen=True)
class TimeChoice:
    """Which columns hold the time and how it is to be read."""

    names: tuple[str, ...]
    clock: str
    unit: str
    doubts: tuple[str, ...] = ()


def plain(name: str) -> str:
    """Lower-case words of a name, without unit and camel case."""
    head, unit = split_unit(name)
    again, twice = split_unit(head)
    head = again if twice is not None and twice == unit else head  # latitude_deg (deg)
    head = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", head)
    return " ".join(re.findall(r"[a-zäöüßåæø]+|\d+|[δψφθ]", head.lower()))


def choose_time(columns: Columns, options: SourceOptions, where: str) -> TimeChoice:
    """The time columns: those of the options, else found by name and values.

    Raises
    ------
    ImportLogError             no column can be the time
    """
    data = columns.data
    if options.time:
        absent = [name for name in options.time if name not in data]
        if absent:
            raise ImportLogError(f"{where}: has no time column {absent[0]!r}; it has {_some(data)}")
        names = options.time
    else:
        names = _find_time(columns)
        if not names:
            raise ImportLogError(
                f'{where}: no column can be the time; name it in the map: [sources.LABEL] time = "..." '
                f"(columns: {_some(data)})"
            )
    first = data[names[0]]
    unit, since = _since(options.time_unit or columns.unit(names[-1]))
    doubts: list[str] = []
    if options.clock:
        return TimeChoice(names, options.clock, unit or "s")
    if since == "1970" and first.dtype.kind not in "MOUS":
        return TimeChoice(names, "unix", unit or "s")
    if first.dtype.kind == "M":
        return TimeChoice(names, "date", "s")
    if first.dtype.kind in "OUS":
        texts = [str(v) for v in first[:50] if str(v).strip() not in ("", "nan")]
        if clocks.is_time_of_day(texts) and len(names) == 1:
            return TimeChoice(names, "time_of_day", "s")
        if clocks.ambiguous_day(first):
            doubts.append(
                f"{names[0]!r} holds dates such as {first[0]!s}, read as month/day; if it is day/month, "
                f"give the "
                "file in ISO dates; runs within one day are not affected"
            )
        return TimeChoice(names, "date", "s", tuple(doubts[:0]))
    if len(names) == 2 and _WEEK.fullmatch(plain(names[0])):
        return TimeChoice(names, "gps_week", unit or _tow_unit(data[names[1]]))
    clock, unit, doubt = clocks.guess_clock(first.astype(float), unit)
    if clock == "unix" and "gps" in plain(names[0]) and "utc" not in plain(names[0]):
        doubts.append(
            f'{names[0]!r} is read as UTC seconds since 1970; GPS seconds since 1980 would be clock = "gps"'
        )
        doubts = doubts[:0] if not _gps_likely(first, unit) else doubts
    if doubt == "unit":
        doubts.append(
            f"time {names[0]!r} states no unit and is read as {unit}; say time_unit if it is another"
        )
    return TimeChoice(names, clock, unit, tuple(doubts))


def _since(unit: str | None) -> tuple[str | None, str | None]:
    """("s", "1970") of "seconds since 01/01/1970"; the unit as it is otherwise."""
    found = re.fullmatch(r"\s*(\w+)\s+since\s+(.*)", unit or "")
    if found is None:
        return unit, None
    year = re.search(r"\b(\d{4})\b", found[2])
    return plain_unit(found[1]) or found[1], year[1] if year else None


def _gps_likely(values: np.ndarray, unit: str) -> bool:
    return float(np.nanmedian(values)) * clocks.UNIT_SECONDS[unit] < 1.4e9


def _tow_unit(values: np.ndarray) -> str:
    return "ms" if float(np.nanmax(values)) > 604800.0 else "s"


def _find_time(columns: Columns) -> tuple[str, ...]:
    data = columns.data
    by_role = [n for n, role in columns.roles.items() if role == "t" and n in data]
    if by_role:
        return (by_role[0],)
    words = {name: plain(name) for name in data}
    weeks = [n for n, w in words.items() if _WEEK.fullmatch(w)]
    named = [n for n, w in words.items() if _TIME.fullmatch(w)]
    named += [
        n for n, w in words.items() if n not in named and re.search(r"\b(time|timestamp|utc|stamp)\b", w)
    ]
    if weeks and named:
        tow = next((n for n in named if re.search("tow|week|sec|ms|time", words[n])), named[0])
        return (weeks[0], tow)
    texts = {n for n, v in data.items() if v.dtype.kind in "OUS"}
    dates = [n for n in texts if _DATE.fullmatch(words[n])]
    of_day = [n for n in named if n in texts and clocks.is_time_of_day([str(v) for v in data[n][:50]])]
    if dates and of_day:
        return (dates[0], of_day[0])
    for name in [*named, *dates]:
        if data[name].dtype.kind == "M" or name in texts or _rises(data[name]):
            return (name,)
    # whatever its name in whatever language, a column of nothing but dates or times of day is when
    when = [n for n in texts if _all_times([str(v) for v in data[n][:50]])]
    if len(when) == 1:
        return (when[0],)
    first = next((n for n in data if n not in texts), None)
    if first is not None and _rises(data[first]) and np.size(data[first]) > 2:
        steps = np.diff(data[first].astype(float))
        if np.nanmax(steps) < 1.5 * np.nanmin(steps) + 1e-9 and words[first] in ("", "column 1", "x", "0"):
            return (first,)
    return ()


def _all_times(texts: list[str]) -> bool:
    return clocks.is_date_text(texts) or clocks.is_time_of_day(texts)


def _rises(values: np.ndarray) -> bool:
    if values.dtype.kind not in "iuf":
        return values.dtype.kind == "M"
    good = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    return good.size > 1 and float(np.mean(np.diff(good.astype(float)) >= 0)) > 0.9


def stamps_of(data: Mapping[str, np.ndarray], choice: TimeChoice) -> clocks.Stamps:
    """Stamps of a table or of a part of one."""
    first = data[choice.names[0]]
    if choice.clock == "gps_week":
        return clocks.from_week(first, data[choice.names[1]], choice.unit)
    if first.dtype.kind == "M":
        return clocks.from_datetimes(first)
    if first.dtype.kind in "OUS":
        if choice.clock == "time_of_day":
            return clocks.Stamps(clocks.parse_times_of_day(first), None, "time of day")
        texts = first
        if len(choice.names) == 2:
            texts = np.array(
                [f"{a} {b}" for a, b in zip(first, data[choice.names[1]], strict=True)], dtype=object
            )
        return clocks.from_datetimes(clocks.parse_dates(texts))
    return clocks.from_numbers(first, choice.clock, choice.unit)


def channels_of(
    columns: Columns, choice: TimeChoice, request: Request, where: str
) -> tuple[list[RawChannel], float | None, str]:
    """(channels, UTC of t = 0, words) of a table; rows without a time are left out."""
    stamps = stamps_of(columns.data, choice)
    t = stamps.t
    keep = np.isfinite(t)
    if not keep.any():
        raise ImportLogError(f"{where}: no cell of {choice.names[0]!r} is a time")
    rows = np.flatnonzero(keep)
    read = {
        name: values[rows].astype(float)
        for name, values in columns.data.items()
        if name not in choice.names and request.wants(name) and values.dtype.kind in "iufb"
    }
    if request.step is not None:
        kept, read = Thinning(request).keep(t[rows], read)
        rows = rows[kept]
    if request.most is not None and rows.size > request.most:
        stride = int(np.ceil(rows.size / request.most))
        rows, read = rows[::stride], {name: values[::stride] for name, values in read.items()}
    found = [
        RawChannel(
            name=name,
            t=t[rows],
            values=values,
            unit=columns.unit(name),
            role=columns.roles.get(name),
            place=columns.places.get(name, f"column {name!r}"),
            lost=columns.lost.get(name, 0),
        )
        for name, values in read.items()
    ]
    return found, stamps.start, stamps.words


def _some(names: Mapping[str, object], most: int = 12) -> str:
    return first_few(map(repr, names), most)
