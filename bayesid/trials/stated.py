"""What trial.toml says, checked value by value.

Takes the parsed TOML tree; gives `Stated` with every problem and every odd key it holds.
Does not: open files.

Beyond the bundle format these keys are read: `time_repair = "sort"` (sort rows by time and merge those
of equal time), `[corrections]` (what the numbers are where the header is wrong), `attribution` (for reports),
`data_hint` (for the message when logs are kept elsewhere), and per run `notes` and `window = [start, end]` in
seconds of the log.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

from bayesid.model.channels import channel, is_channel, nearest_hint
from bayesid.model.file_keys import FileKey
from bayesid.model.units import UnitError, scale
from bayesid.trials.assemble import TIME_REPAIRS, Reading, split_header
from bayesid.trials.correction import read_correction
from bayesid.trials.trial import ROLES, Environment

MAX_RUNS = 10_000
MISSPELT = 0.85  # likeness from which an unknown key is a known one, misspelt
WORDS_ONLY = ("name", "notes", "manoeuvre", "attribution")  # change no number
#: keys of trial.toml; the reader and the JSON Schema (`schema`) take names, choices and defaults from here
KEYS: dict[str, FileKey] = {
    "format": FileKey("whole", "of the file", required=True, choices=(1,)),
    "name": FileKey("text", "free text", default=""),
    "vehicle": FileKey("text", "a file in the bundle, or the name of a built-in vehicle", default=""),
    "dof": FileKey("whole", "default: 6 if the vertical plane is logged, else 3", choices=(3, 6)),
    "measured_point": FileKey("numbers", "m, point whose position is logged, body axes", length=3),
    "rudder_positive": FileKey(
        "text", "side a positive rudder of the log turns to", choices=("port", "starboard"), default="port"
    ),
    "time_repair": FileKey(
        "text",
        "sort: sort rows by time, merge those of equal time; spread: spread rows of one time until the next",
        choices=TIME_REPAIRS,
        default="none",
    ),
    "attribution": FileKey("text", "whose data these are; printed in reports", default=""),
    "data_hint": FileKey("text", "where the logs are to be had, if not here", default=""),
    "noise": FileKey("table", "one sigma of white sensor noise per channel, SI or channel[unit]"),
    "environment": FileKey("table", "level of process noise, where it is known from elsewhere"),
    "columns": FileKey("table", "channel or channel[unit] = column in the file"),
    "corrections": FileKey("table", "what the numbers are where the header is wrong"),
    "runs": FileKey("table", "one [[runs]] table per file or part of one", required=True),
}
#: keys of [environment]
ENVIRONMENT: dict[str, FileKey] = {
    "force_rms": FileKey("number", "disturbing force over rho/2 L^2 U^2, moments over L^3", low=0.0),
    "nav_drift": FileKey("number", "m, slow drift of the position", low=0.0),
}
#: keys of [[runs]]
RUN_KEYS: dict[str, FileKey] = {
    "file": FileKey("text", "CSV file in the bundle", required=True),
    "manoeuvre": FileKey("text", 'free text, e.g. "zigzag 10/10"', default=""),
    "role": FileKey("text", "holdout: never read by a fit or a choice", choices=ROLES, default="identify"),
    "notes": FileKey("text", "free text", default=""),
    "window": FileKey("numbers", "[start, end] in seconds of the log", length=2),
}


@dataclass(frozen=True)
class RunEntry:
    """One [[runs]] table; `window` in seconds of the log."""

    file: str
    name: str
    manoeuvre: str
    role: str
    notes: str
    window: tuple[float, float] | None


@dataclass
class Stated:
    """What trial.toml says, checked value by value; `problems` collects everything wrong with it."""

    tree: dict[str, Any]
    problems: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        tree = self.tree
        self._unknown(tree, tuple(KEYS), "")
        if tree.get("format") != 1 or isinstance(tree.get("format"), bool):
            said = f"format is {_short(tree['format'])}" if "format" in tree else "states no format"
            self.problems.append(f"{said}; this program reads format = 1")
        self.name = self._text(tree, "name")[:500]
        self.vehicle = self._text(tree, "vehicle")
        self.attribution = self._text(tree, "attribution")
        self.data_hint = self._text(tree, "data_hint")
        self.dof = tree.get("dof")
        if self.dof not in (None, *KEYS["dof"].choices) or isinstance(self.dof, bool | float):
            self.problems.append(f"dof is {_short(self.dof)}; 3 or 6")
            self.dof = None
        self.measured_point = (0.0, 0.0, 0.0)
        if "measured_point" in tree:
            point = _numbers(tree["measured_point"], 3)
            if point is None:
                self.problems.append("measured_point must be three numbers [x, y, z] in metres, body axes")
            else:
                self.measured_point = (point[0], point[1], point[2])
        side, repair = self._choice("rudder_positive"), self._choice("time_repair")
        self.reading = Reading(self._columns(), side, repair)
        self.noise = self._noise()
        self.environment = self._environment()
        self.correction = read_correction(tree.get("corrections", {}), self.problems)
        self.runs = self._runs()
        there = {entry.name for entry in self.runs}
        if lost := [name for name in self.correction.runs if name not in there]:
            self.problems.append(f"[corrections] runs: no run {', '.join(lost)}")

    def _unknown(self, table: dict[str, Any], known: tuple[str, ...], place: str) -> None:
        for key in table:
            if key not in known:
                near = difflib.get_close_matches(key[:40], known, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                if near and near[0] not in table and _misspelt(key, near[0]):
                    self.problems.append(f"{place}{_short(key)} is not known{hint}")
                    continue
                self.warnings.append(f"trial.toml: {place}{_short(key)} is not known and ignored{hint}")

    def _text(self, table: dict[str, Any], key: str, place: str = "", default: str = "") -> str:
        value = table.get(key, default)
        if not isinstance(value, str):
            self.problems.append(f"{place}{key} must be text, not {_short(value)}")
            return default
        return value

    def _choice(self, key: str) -> str:
        allowed, default = KEYS[key].choices, str(KEYS[key].default)
        value = self.tree.get(key, default)
        if value not in allowed:
            self.problems.append(f"{key} is {_short(value)}; one of {', '.join(allowed)}")
            return default
        return str(value)

    def _table(self, key: str) -> dict[str, Any]:
        value = self.tree.get(key, {})
        if not isinstance(value, dict):
            self.problems.append(f"[{key}] must be a table")
            return {}
        return value

    def _columns(self) -> dict[str, str]:
        columns: dict[str, str] = {}
        targets: set[str] = set()
        for key, column in self._table("columns").items():
            name, _ = split_header(key)
            if not is_channel(name):
                self.problems.append(f"[columns] {_short(key)}: no such channel{nearest_hint(name)}")
            elif not isinstance(column, str):
                self.problems.append(f"[columns] {_short(key)} must name a column, not {_short(column)}")
            elif name in targets:
                self.problems.append(f"[columns] {name} is given twice")
            else:
                targets.add(name)
                columns[key] = column
        return columns

    def _noise(self) -> dict[str, float]:
        noise: dict[str, float] = {}
        for key, value in self._table("noise").items():
            name, unit = split_header(key)
            if not is_channel(name) or channel(name).kind in ("time", "command"):
                self.problems.append(f"[noise] {_short(key)} is not a measured channel{nearest_hint(name)}")
                continue
            number = _number(value)
            if number is None or not number > 0.0:
                self.problems.append(
                    f"[noise] {name} is {_short(value)}; one sigma must be a number above zero (SI)"
                )
                continue
            inside = channel(name).unit
            try:
                noise[name] = number * scale(unit or inside, inside, f"[noise] {name}")
            except UnitError as error:
                self.problems.append(str(error))
        return noise

    def _environment(self) -> Environment | None:
        if "environment" not in self.tree:
            return None
        table = self._table("environment")
        known = tuple(ENVIRONMENT)
        self._unknown(table, known, "[environment] ")
        values: dict[str, float | None] = dict.fromkeys(known)
        for key in known:
            if key in table:
                values[key] = _number(table[key])
                number = values[key]
                if number is None or number < 0.0:
                    self.problems.append(
                        f"[environment] {key} is {_short(table[key])}; a number, zero or more"
                    )
        return Environment(values["force_rms"], values["nav_drift"])

    def _runs(self) -> list[RunEntry]:
        tables = self.tree.get("runs", [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            self.problems.append("runs must be written as [[runs]] tables")
            return []
        if not tables:
            self.problems.append('names no runs; add [[runs]] with file = "..." and role = "identify"')
        if len(tables) > MAX_RUNS:
            self.problems.append(f"names {len(tables)} runs; the limit is {MAX_RUNS}")
            return []
        entries = []
        for k, table in enumerate(tables, 1):
            place = f"run {k}: "
            self._unknown(table, tuple(RUN_KEYS), place)
            file = table.get("file")
            if not isinstance(file, str) or not file:
                self.problems.append(f"{place}file = {_short(file)}; the name of a CSV file is needed")
                continue
            role = table.get("role", RUN_KEYS["role"].default)
            if role not in ROLES:
                near = difflib.get_close_matches(str(role)[:20], ROLES, n=1, cutoff=0.3)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                self.problems.append(f"{place}role is {_short(role)}; one of {', '.join(ROLES)}{hint}")
                role = "holdout"
            span = _numbers(table["window"], 2) if "window" in table else None
            if "window" in table and (span is None or not span[0] < span[1]):
                self.problems.append(f"{place}window must be [start, end] in seconds of the log, start first")
                span = None
            stem = PurePosixPath(file.replace("\\", "/")).stem
            entries.append(
                RunEntry(
                    file,
                    stem or file,
                    self._text(table, "manoeuvre", place),
                    role,
                    self._text(table, "notes", place),
                    (span[0], span[1]) if span else None,
                )
            )
        return _unique(entries)


def _unique(entries: list[RunEntry]) -> list[RunEntry]:
    """Files of the same stem in different folders are called by their path."""
    stems = [entry.name for entry in entries]
    return [
        replace(entry, name=str(PurePosixPath(entry.file).with_suffix("")))
        if stems.count(entry.name) > 1
        else entry
        for entry in entries
    ]


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _numbers(value: Any, length: int) -> list[float] | None:
    if not isinstance(value, list) or len(value) != length:
        return None
    numbers = [_number(item) for item in value]
    return None if any(number is None for number in numbers) else [n for n in numbers if n is not None]


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _misspelt(key: str, known: str) -> bool:
    """Whether a key is a known one, misspelt, that changes numbers; a longer one may be meant."""
    like = difflib.SequenceMatcher(None, key[:40], known).ratio()
    return like >= MISSPELT and known not in WORDS_ONLY and not key.startswith(known)
