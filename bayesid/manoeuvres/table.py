"""Command tables as CSV files: `t[s],delta_r_cmd[deg],n_cmd[rpm]`, one row per change or per sample.

Takes: a path; row k holds until row k+1, a missing value repeats the one above it.
Does not: read measured channels as commands unless there is no command column of that name.
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.errors import ManoeuvreError, raise_all
from bayesid.files import UnreadableError, read_regular
from bayesid.manoeuvres.core import KNOWN, OpenLoop
from bayesid.model.channels import COMMANDS, channel

# Few units can stand over a command, and every start of the command line would pay for a unit library.
UNITS = {
    "t": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180, "mrad": 1e-3},
    "n": {"rpm": 1.0, "1/min": 1.0, "rps": 60.0, "1/s": 60.0, "hz": 60.0, "rad/s": 30 / math.pi},
    "share": {"-": 1.0, "1": 1.0, "%": 0.01},
}
_KIND = {"s": "t", "rad": "angle", "rpm": "n", "-": "share"}  # by the unit of a channel inside
HEADER = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\[\s*([^\]]*?)\s*\])?\s*$")
MAX_SHOWN = 8
MOST_ROWS = 5_000_000
MAX_BYTES = 64 * 2**20  # a command every 10 ms for three hours takes a third of it


def read_table(path: str | Path, rudder_positive: str = "port") -> OpenLoop:
    """Commands from a CSV file.

    Parameters
    ----------
    path : file with a header `name[unit]`; t and at least one of delta_r_cmd, delta_s_cmd, delta_b_cmd, n_cmd
        (or delta_r, delta_s, delta_b, n, read as commands). Other columns are listed and ignored. Every
        column needs its unit.
    rudder_positive : "port", or "starboard" for a log with the other sign

    Returns
    -------
    OpenLoop    time counted as in the file; parameters name the file and the ignored columns

    Raises
    ------
    ManoeuvreError    all problems of the file at once
    """
    path = Path(path)
    if rudder_positive not in ("port", "starboard"):
        raise ManoeuvreError(f"rudder_positive is {rudder_positive!r}; say 'port' or 'starboard'")
    try:
        text = read_regular(path, MAX_BYTES).decode("utf-8-sig")
        rows = [
            (n, row) for n, row in enumerate(csv.reader(text.splitlines()), 1) if any(c.strip() for c in row)
        ]
    except UnreadableError as err:
        raise ManoeuvreError(f"{path}: {err}; check the path") from None
    except UnicodeDecodeError as err:
        raise ManoeuvreError(
            f"{path}: byte {err.start} is not UTF-8 text; save the table as plain CSV"
        ) from None
    except (csv.Error, ValueError) as err:
        raise ManoeuvreError(f"{path}: not a CSV table ({err})") from None
    if len(rows) < 3:
        raise ManoeuvreError(
            f"{path}: {max(len(rows) - 1, 0)} rows below the header; at least two are needed"
        )
    columns, ignored, problems = _columns(rows[0][1])
    if problems:
        raise_all(ManoeuvreError, str(path), problems)
    values = {}
    for name, (index, factor) in columns.items():
        column, bad = _numbers(rows[1:], name, index)
        problems += bad
        with np.errstate(over="ignore"):
            values[name] = column * factor
    if problems:
        hidden = len(problems) - MAX_SHOWN
        raise_all(
            ManoeuvreError,
            str(path),
            problems[:MAX_SHOWN] + ([f"and {hidden} more of the same kind"] if hidden > 0 else []),
        )
    t = values.pop("t")
    if rudder_positive == "starboard" and "delta_r_cmd" in values:
        values["delta_r_cmd"] = -values["delta_r_cmd"]
    try:
        return OpenLoop(path.stem, t, values, {"file": path.name, "ignored": tuple(ignored)})
    except ManoeuvreError as err:
        raise ManoeuvreError(f"{path}: {err}") from None


def _columns(header: list[str]) -> tuple[dict[str, tuple[int, float]], list[str], list[str]]:
    """Where each command stands and what turns it into SI."""
    found: dict[str, tuple[int, float]] = {}
    measured: dict[str, tuple[int, float]] = {}
    ignored, problems, seen = [], [], set()
    for index, title in enumerate(header):
        match = HEADER.match(title)
        name = match[1] if match else title.strip()
        command = name if name in COMMANDS or name == "t" else f"{name}_cmd"
        if not match or (command not in COMMANDS and command != "t"):
            ignored.append(title.strip())
            continue
        if name in seen:
            problems.append(f"column {name} appears twice; keep one")
            continue
        seen.add(name)
        kind = _KIND[channel(command).unit]
        unit = match[2]
        factor = UNITS[kind].get((unit or "").lower())
        if factor is None:
            what = "no unit" if not unit else f"unit {unit!r}"
            problems.append(
                f"column {name} has {what}; write {name}[{next(iter(UNITS[kind]))}] "
                f"or one of {', '.join(UNITS[kind])}"
            )
        else:
            (found if command == name else measured)[command] = (index, factor)
    for command, place in measured.items():
        if command in found:
            ignored.append(command.removesuffix("_cmd"))
        else:
            found[command] = place
    if "t" not in found and "t" not in seen:
        problems.append("no column t[s]")
    if not problems and len(found) < 2:
        problems.append(f"no command column; name at least one of {KNOWN}, with its unit in brackets")
    return found, ignored, problems


def _numbers(rows: list[tuple[int, list[str]]], name: str, index: int) -> tuple[np.ndarray, list[str]]:
    out, problems, last = np.empty(len(rows)), [], math.nan
    for k, (line, row) in enumerate(rows):
        cell = row[index].strip() if index < len(row) else ""
        try:
            value = float(cell) if cell else math.nan
        except ValueError:
            problems.append(f"line {line}: {name} is {cell[:40]!r}, not a number")
            value = 0.0
        if math.isinf(value):
            problems.append(f"line {line}: {name} is infinite")
        if math.isnan(value):
            if name == "t" or k == 0:
                problems.append(f"line {line}: {name} is missing; only a command below the first row may be")
                value = 0.0
            value = last if name != "t" and k else value
        out[k] = last = value
    return out, problems


def with_rows_every(manoeuvre: OpenLoop, dt: float) -> OpenLoop:
    """The commands with rows every dt [s] too, at which they are held; their own rows stay."""
    if not (math.isfinite(dt) and dt > 0.0):
        raise ManoeuvreError(f"dt = {dt:g} s: a step is a positive number")
    own = manoeuvre.t
    count = manoeuvre.duration / dt
    if count > MOST_ROWS:
        raise ManoeuvreError(f"dt = {dt:g} s: {count:.3g} rows of {manoeuvre.name}; take a longer step")
    t = own[0] + dt * np.arange(math.floor(count + 1e-9) + 1)
    near = own[np.clip(np.searchsorted(own, t - 1e-6 * dt), 0, own.size - 1)]
    t = np.union1d(np.where(np.abs(near - t) < 1e-6 * dt, near, t), own)
    row = np.searchsorted(own, t, side="right") - 1
    return replace(manoeuvre, t=t, commands={name: v[row] for name, v in manoeuvre.commands.items()})


def write_table(manoeuvre: OpenLoop, path: str | Path, angle_unit: str = "deg") -> Path:
    """Write commands so that `read_table` gives them back; rows that change nothing are left out.

    The last row is kept: it ends the run. Angles in deg lose at most one unit in the last place.
    """
    names = [c for c in COMMANDS if c in manoeuvre.commands]
    shown = {"angle": angle_unit, "n": "rpm", "share": "-"}
    units = [shown[_KIND[channel(c).unit]] for c in names]
    table = np.column_stack([manoeuvre.commands[c] for c in names])
    keep = np.r_[True, np.any(np.diff(table, axis=0) != 0, axis=1)]
    keep[-1] = True
    path = Path(path)
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(["t[s]"] + [f"{c}[{unit}]" for c, unit in zip(names, units, strict=True)])
        scale = np.array([UNITS["angle"][unit] if unit == angle_unit else 1.0 for unit in units])
        for time, row in zip(manoeuvre.t[keep], table[keep] / scale, strict=True):
            out.writerow([repr(float(time)), *(repr(float(v)) for v in row)])
    return path
