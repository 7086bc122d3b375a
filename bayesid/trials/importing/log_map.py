"""The map: what the series of raw logs are. Read from and written to `map.toml`, checked value by value.

Does not: open logs. A map with questions left is refused by `joining`.
"""

from __future__ import annotations

import difflib
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bayesid.errors import raise_all
from bayesid.files import UnreadableError, read_regular
from bayesid.trials.correction import Correction, read_correction
from bayesid.trials.importing.clocks import CLOCKS, UNIT_SECONDS
from bayesid.trials.importing.names import role_of_name
from bayesid.trials.importing.raw import ImportLogError, SourceOptions
from bayesid.trials.importing.roles import BODIES, ROLES, WORLDS
from bayesid.trials.trial import ROLES as RUN_ROLES

_KEYS = (
    "format", "name", "questions", "vehicle", "dof", "world", "body", "rudder_positive", "origin", "step",
    "attribution", "measured_point", "sources", "channels", "corrections", "noise", "environment", "runs",
)  # fmt: skip
_SOURCE_KEYS = (
    "files",
    "columns",
    "time",
    "clock",
    "time_unit",
    "start",
    "clock_offset",
    "spread",
    "world",
    "body",
)
LARGEST = sys.float_info.max
_CHANNEL_KEYS = ("from", "unit", "scale", "offset", "missing")
_RUN_KEYS = ("name", "files", "window", "manoeuvre", "role", "notes")


@dataclass(frozen=True)
class SourceMap:
    """Files of one structure: patterns of their names, how to read them, their axes where they differ."""

    files: tuple[str, ...]
    options: SourceOptions = field(default_factory=SourceOptions)
    world: str | None = None
    body: str | None = None


@dataclass(frozen=True)
class ChannelMap:
    """A role is `scale` times the number in the file plus `offset`, in `unit`; `missing`: numbers in the file
    that stand for no reading."""

    source: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    missing: tuple[float, ...] = ()


@dataclass(frozen=True)
class RunMap:
    """A run: its files, and [start, end] in seconds from the first sample of them."""

    name: str
    files: tuple[str, ...]
    window: tuple[float, float] | None = None
    manoeuvre: str = ""
    role: str = "identify"
    notes: str = ""


@dataclass(frozen=True)
class LogMap:
    """All that is known of a set of logs; origin in degrees, degrees, metres; corrections: as in trial.toml,
    None where the map has no such table."""

    name: str = ""
    vehicle: str = ""
    questions: tuple[str, ...] = ()
    dof: int | None = None
    world: str | None = None
    body: str | None = None
    rudder_positive: str = "port"
    origin: tuple[float, float, float] | None = None
    step: float | None = None
    attribution: str = ""
    measured_point: tuple[float, float, float] | None = None
    sources: Mapping[str, SourceMap] = field(default_factory=dict)
    channels: Mapping[str, ChannelMap] = field(default_factory=dict)
    corrections: Correction | None = None
    noise: Mapping[str, float] = field(default_factory=dict)
    environment: Mapping[str, float] = field(default_factory=dict)
    runs: tuple[RunMap, ...] = ()


def read_map(path: Path) -> LogMap:
    """The map in a TOML file.

    Raises
    ------
    ImportLogError             with every problem of the file
    """
    try:
        tree = tomllib.loads(read_regular(path, 2**22).decode("utf-8-sig"))
    except UnreadableError as error:
        raise ImportLogError(f"{path}: {error}") from None
    except (ValueError, RecursionError) as error:  # of tomllib, of decoding, of an integer without end
        raise ImportLogError(f"{path}: is not valid TOML: {error}") from None
    return map_from(tree, str(path))


def map_from(tree: dict[str, Any], where: str) -> LogMap:
    """The map of a parsed TOML tree."""
    reader = _Reader()
    found = reader.read(tree)
    if reader.problems:
        raise_all(ImportLogError, where, reader.problems)
    return found


def _is_number(value: Any) -> bool:
    """Whether it is a finite number that a float holds."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


class _Reader:
    """Collects every problem."""

    def __init__(self) -> None:
        self.problems: list[str] = []

    def known(self, table: Mapping[str, Any], keys: tuple[str, ...], place: str) -> None:
        for key in table:
            if key not in keys:
                near = difflib.get_close_matches(str(key)[:40], keys, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else f"; one of {', '.join(keys)}"
                self.problems.append(f"{place}{key!r} is not known{hint}")

    def text(self, table: Mapping[str, Any], key: str, place: str, default: str = "") -> str:
        value = table.get(key, default)
        if not isinstance(value, str):
            self.problems.append(f"{place}{key} must be text, not {str(value)[:40]}")
            return default
        return value

    def choice(
        self, table: Mapping[str, Any], key: str, allowed: tuple[Any, ...], place: str, default: Any
    ) -> Any:
        value = table.get(key, default)
        if value is not default and value not in allowed:
            self.problems.append(f"{place}{key} is {value!r}; one of {', '.join(map(str, allowed))}")
            return default
        return value

    def yes(self, table: Mapping[str, Any], key: str, place: str) -> bool:
        value = table.get(key, False)
        if not isinstance(value, bool):
            self.problems.append(f"{place}{key} must be true or false")
        return value is True

    def number(self, table: Mapping[str, Any], key: str, place: str, default: Any) -> Any:
        value = table.get(key, default)
        if value is default:
            return default
        if not _is_number(value):
            self.problems.append(f"{place}{key} is {str(value)[:40]}; a number is needed")
            return default
        return float(value)

    def numbers(self, table: Mapping[str, Any], key: str, count: int, place: str) -> Any:
        if key not in table:
            return None
        value = table[key]
        good = isinstance(value, list) and len(value) == count
        if not good or not all(_is_number(v) for v in value):
            self.problems.append(f"{place}{key} must be {count} numbers")
            return None
        return tuple(float(v) for v in value)

    def some_numbers(self, table: Mapping[str, Any], key: str, place: str) -> tuple[float, ...]:
        value = table.get(key, [])
        value = value if isinstance(value, list) else [value]
        if not all(_is_number(v) for v in value):
            self.problems.append(f"{place}{key} must be a number or a list of numbers")
            return ()
        return tuple(float(v) for v in value)

    def texts(self, table: Mapping[str, Any], key: str, place: str) -> tuple[str, ...]:
        value = table.get(key, [])
        value = [value] if isinstance(value, str) else value
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            self.problems.append(f"{place}{key} must be text or a list of texts")
            return ()
        return tuple(value)

    def table(self, tree: Mapping[str, Any], key: str) -> Mapping[str, Any]:
        value = tree.get(key, {})
        if not isinstance(value, dict):
            self.problems.append(f"[{key}] must be a table")
            return {}
        return value

    def read(self, tree: dict[str, Any]) -> LogMap:
        self.known(tree, _KEYS, "")
        if tree.get("format") != 1:
            said = f"format is {tree['format']!r}" if "format" in tree else "states no format"
            self.problems.append(f"{said}; this program reads format = 1")
        sources = {k: self.source(k, v) for k, v in self.table(tree, "sources").items()}
        if not sources:
            self.problems.append('names no source; add [sources.log] with files = ["..."]')
        channels = {}
        for key, value in self.table(tree, "channels").items():
            found = self.channel(key, value, tuple(sources))
            if found is not None:
                channels[key] = found
        runs = tree.get("runs", [])
        if not isinstance(runs, list):
            self.problems.append("runs must be written as [[runs]] tables")
            runs = []
        step = self.number(tree, "step", "", None)
        if step is not None and step <= 0.0:
            self.problems.append(f"step is {step:g}; seconds above zero")
        return LogMap(
            name=self.text(tree, "name", ""),
            vehicle=self.text(tree, "vehicle", ""),
            questions=self.texts(tree, "questions", ""),
            dof=self.choice(tree, "dof", (3, 6), "", None),
            world=self.choice(tree, "world", WORLDS, "", None),
            body=self.choice(tree, "body", BODIES, "", None),
            rudder_positive=self.choice(tree, "rudder_positive", ("port", "starboard"), "", "port"),
            origin=self.numbers(tree, "origin", 3, ""),
            step=step,
            attribution=self.text(tree, "attribution", ""),
            measured_point=self.numbers(tree, "measured_point", 3, ""),
            sources=sources,
            channels=channels,
            corrections=self.corrections(tree),
            noise=dict(self.table(tree, "noise")),
            environment=dict(self.table(tree, "environment")),
            runs=tuple(self.run(k, v) for k, v in enumerate(runs, 1)),
        )

    def corrections(self, tree: Mapping[str, Any]) -> Correction | None:
        return read_correction(tree["corrections"], self.problems) if "corrections" in tree else None

    def source(self, label: str, table: Any) -> SourceMap:
        place = f"[sources.{label}] "
        if not isinstance(table, dict):
            self.problems.append(f"{place}must be a table")
            return SourceMap(())
        self.known(table, _SOURCE_KEYS, place)
        files = self.texts(table, "files", place)
        if not files:
            self.problems.append(f'{place}has no files = ["..."]')
        start: Any = table.get("start")
        if start is not None:
            start = self.utc(start, place)
        options = SourceOptions(
            columns=self.texts(table, "columns", place),
            time=self.texts(table, "time", place),
            clock=self.choice(table, "clock", CLOCKS, place, None),
            time_unit=self.choice(table, "time_unit", tuple(UNIT_SECONDS), place, None),
            start=start,
            offset=self.number(table, "clock_offset", place, 0.0),
            spread=self.yes(table, "spread", place),
        )
        return SourceMap(
            files,
            options,
            self.choice(table, "world", WORLDS, place, None),
            self.choice(table, "body", BODIES, place, None),
        )

    def utc(self, value: Any, place: str) -> float | None:
        from datetime import UTC, datetime

        if isinstance(value, str):
            try:
                value = datetime.fromisoformat(value)
            except ValueError:
                self.problems.append(
                    f"{place}start is {value[:40]!r}; a UTC time such as 2024-05-01T10:00:00Z is needed"
                )
                return None
        if isinstance(value, datetime):
            return (value if value.tzinfo else value.replace(tzinfo=UTC)).timestamp()
        return self.number({"start": value}, "start", place, None)

    def channel(self, role: str, table: Any, labels: tuple[str, ...]) -> ChannelMap | None:
        place = f"[channels] {role}: "
        if role not in ROLES:
            meant = role_of_name(role[:40])
            near = [meant] if meant else difflib.get_close_matches(role[:40], ROLES, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"one of {', '.join(ROLES)}"
            self.problems.append(f"{place}no such channel; {hint}")
            return None
        table = {"from": table} if isinstance(table, str) else table
        if not isinstance(table, dict) or not isinstance(table.get("from"), str):
            self.problems.append(f'{place}must say from = "column"')
            return None
        self.known(table, _CHANNEL_KEYS, place)
        head, mark, _ = table["from"].partition(":")
        if len(labels) > 1 and not (mark and head in labels):
            said = table["from"]
            self.problems.append(
                f'{place}from = {said!r} must say which source: "LABEL:column" (labels: {", ".join(labels)})'
            )
        unit = table.get("unit")
        if unit is not None and not isinstance(unit, str):
            self.problems.append(f"{place}unit must be text")
            unit = None
        return ChannelMap(
            table["from"],
            unit,
            self.number(table, "scale", place, 1.0),
            self.number(table, "offset", place, 0.0),
            self.some_numbers(table, "missing", place),
        )

    def run(self, k: int, table: Any) -> RunMap:
        place = f"run {k}: "
        if not isinstance(table, dict):
            self.problems.append(f"{place}must be a table")
            return RunMap("", ())
        self.known(table, _RUN_KEYS, place)
        window = self.numbers(table, "window", 2, place)
        if window is not None and not window[0] < window[1]:
            self.problems.append(f"{place}window must be [start, end], start first")
        files = self.texts(table, "files", place)
        if not files:
            self.problems.append(f'{place}has no files = ["..."]')
        return RunMap(
            self.text(table, "name", place) or f"run{k:02d}", files, window, self.text(table,
                "manoeuvre", place),
            self.choice(table, "role", RUN_ROLES, place, "identify"), self.text(table, "notes", place),
        )  # fmt: skip
