"""One CSV table becomes one run: columns found, units converted, time checked, holes treated and named.

Takes a `CsvTable` and what trial.toml says about columns and signs.
Does not: judge whether the numbers make sense together (`health`, `consistency`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bayesid.model.channels import Channel, channel, is_channel
from bayesid.model.units import UnitError, scale
from bayesid.trials.equal_times import merge_equal_times, rows_behind, spread_equal_times
from bayesid.trials.table import BadTableError, CsvTable, summed
from bayesid.trials.trial import Floats, Run

ABSURD = 1e12  # no channel reaches this; larger numbers are sentinels or garbage
TIME_REPAIRS = ("none", "sort", "spread")
SET_BACK = 3  # rows in a row behind one before them: a clock that was set, not a row that came late
ROUNDED = 0.2  # share of rows that repeat a time, from which the stamps are taken for rounded
_HEADER = re.compile(r"([^\[\]()]*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))?")


@dataclass(frozen=True)
class Reading:
    """What trial.toml says about how to read the files."""

    columns: Mapping[str, str] = field(default_factory=dict)  # canonical name[unit] -> column in the file
    rudder_positive: str = "port"
    time_repair: str = "none"


def split_header(text: str) -> tuple[str, str | None]:
    """`psi[deg]` or `psi (deg)` -> ("psi", "deg"); the unit is None where no brackets are given."""
    found = _HEADER.fullmatch(text.strip())
    if found is None:
        return text, None
    unit = found[2] if found[2] is not None else found[3]
    return found[1].strip(), None if unit is None else unit.strip()


def assemble(table: CsvTable, reading: Reading, name: str, manoeuvre: str, role: str, notes: str = "") -> Run:
    """Build a run.

    Raises
    ------
    BadTableError              every problem of columns, units and time at once
    """
    problems: list[str] = []
    notices = list(table.warnings)
    where = _locate(table.names, reading.columns, problems, notices)
    values = {}
    for row, (column, factor) in where.items():
        values[row.name] = table.values[:, column] * factor
    used = {column for column, _ in where.values()}
    extra = {
        text or f"column {k + 1}": table.values[:, k].copy()
        for k, text in enumerate(table.names)
        if k not in used and k not in table.text
    }
    for k, found in table.text.items():
        if k in used:
            problems += summed(found, f"text in {table.names[k]!r}")
        else:
            notices.append(f"column {table.names[k]!r} holds text and is left out")
    rows = table.rows
    if "t" in values:
        values, extra = _in_order(values, extra, rows, reading.time_repair, problems, notices)
    if problems:
        raise BadTableError(problems)
    t = values.pop("t")
    for key in list(values):
        _drop_absurd(key, values, notices)
    if reading.rudder_positive == "starboard":
        for key in list(values):
            if channel(key).rudder:
                values[key] = -values[key]
    known_from: dict[str, float] = {}
    groups: dict[str, dict[str, Floats]] = {kind: {} for kind in ("pose", "velocity", *_FILLED, "propulsion")}
    for key, array in values.items():
        row = channel(key)
        if row.circular and row.kind != "command":  # which way an order goes is the vehicle's affair
            array = unwrap(array)
        if row.kind in _FILLED:
            if row.kind != "environment" and np.isnan(array[0]):
                known_from[key] = float(t[np.argmax(np.isfinite(array))])
            array = _fill(t, array, row, notices)
        groups[row.kind][key] = array
    spare = [text for k, text in enumerate(table.names) if k not in used]
    problems += _missing(values, spare, {row.name: table.names[column] for row, (column, _) in where.items()})
    if problems:
        raise BadTableError(problems)
    return Run(
        name=name,
        manoeuvre=manoeuvre,
        role=role,
        t=t,
        data=groups["pose"] | groups["velocity"],
        commands=groups["command"],
        measured_inputs=groups["actuator"],
        exogenous=groups["environment"],
        propulsion=groups["propulsion"],
        extra=extra,
        notes=notes,
        warnings=tuple(notices),
        known_from=known_from,
    )


_FILLED = ("command", "actuator", "environment")


def _locate(
    names: tuple[str, ...], columns: Mapping[str, str], problems: list[str], notices: list[str]
) -> dict[Channel, tuple[int, float]]:
    """Channel -> (column, factor to the inside unit). A mapped column wins over one of the same name."""
    heads = [split_header(text) for text in names]
    wanted: dict[str, tuple[int, str | None]] = {}
    taken: set[int] = set()
    for key, text in columns.items():
        target, unit = split_header(key)
        hits = [k for k, name in enumerate(names) if name == text.strip()]
        hits = hits or [k for k, (head, _) in enumerate(heads) if head == text.strip()]
        if len(hits) > 1:
            problems.append(f"column {text!r} of [columns] occurs {len(hits)} times in the header")
        elif hits:
            wanted[target] = (hits[0], unit if unit is not None else heads[hits[0]][1])
            taken.add(hits[0])
        elif target not in {head for head, _ in heads}:
            notices.append(f"has no column {text!r} for {target} of [columns]")
    for k, (head, unit) in enumerate(heads):
        if (
            not is_channel(head)
            or k in taken
            or head in {split_header(key)[0] for key in columns} & set(wanted)
        ):
            continue
        if head in wanted:
            problems.append(f"{head} is given by two columns, {names[wanted[head][0]]!r} and {names[k]!r}")
            continue
        wanted[head] = (k, unit)
    duplicates = {text for text in names if text and names.count(text) > 1}
    problems += [
        f"column {text!r} occurs twice" for text in sorted(duplicates) if split_header(text)[0] not in wanted
    ]
    found: dict[Channel, tuple[int, float]] = {}
    bare = []
    for name, (k, unit) in wanted.items():
        row = channel(name)
        if not unit:
            bare.append(f"{name} as [{row.unit}]")
            unit = row.unit
        try:
            found[row] = (k, scale(unit, row.unit, f"column {names[k]!r}"))
        except UnitError as error:
            problems.append(str(error))
    if bare:
        notices.append(f"no unit in the header, read {', '.join(bare)}; write name[unit]")
    if "t" not in wanted:
        near = next((text for text in names if text.lower().startswith(("time", "t ", "t("))), None)
        hint = f'; is it {near!r}? map it: [columns] "t[s]" = {near!r}' if near else ""
        problems.append(f"no time column t[s]{hint}")
    return found


def _in_order(
    values: dict[str, Floats],
    extra: dict[str, Floats],
    rows: np.ndarray,
    repair: str,
    problems: list[str],
    notices: list[str],
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Channels and unnamed columns with one row per time in ascending order, where time allows or asks it."""
    t = values["t"]
    bad = ~(np.abs(t) < ABSURD)
    if bad.any():
        found = [(int(row), "t is missing or not a number of seconds") for row in rows[bad]]
        problems += summed(found, "such a time")
        return values, extra
    step = np.diff(t)
    if t.size < 2:
        problems.append("holds one sample only")
    if (step > 0).all():
        return values, extra
    if repair == "sort":
        return _sorted(values, extra, problems, notices)
    if repair == "spread" and (step >= 0).all():
        notices.append(f"rows of one time spread until the next: {int((step == 0).sum())} were equal")
        return {**values, "t": spread_equal_times(t)}, extra
    ways = [
        (
            int(rows[k + 1]),
            f"time {'goes back' if step[k] < 0 else 'repeats'} ({t[k + 1]:.10g} s after {t[k]:.10g} s)",
        )
        for k in np.flatnonzero(step <= 0)
    ]
    problems += summed(ways, "time that does not increase")
    problems += _how_time_fails(t)
    problems.append(
        'clean the log, or say time_repair = "sort" in trial.toml to sort it; rows of equal time are then '
        "merged where they do not contradict each other, and dropped where they do"
    )
    return values, extra


def _how_time_fails(t: Floats) -> list[str]:
    """What repeated times or a step back look like, and the repair that is right for them."""
    step = np.diff(t)
    if (step >= 0).all() and float(np.mean(step == 0)) > ROUNDED:
        usual = float(np.median(step[step > 0])) if (step > 0).any() else 0.0
        each = 1.0 / (1.0 - float(np.mean(step == 0)))
        return [
            f"about {each:.1f} rows have one time, {usual:.3g} s apart: the stamps are rounded; log them "
            'with more digits, or say time_repair = "spread" in trial.toml, right within that'
        ]
    first, last = rows_behind(t)
    if first.size and int(np.max(last - first)) >= SET_BACK:
        k = int(first[np.argmax(last - first)])
        return [
            f"the clock is set back by {t[k - 1] - t[k]:.3g} s after {t[k - 1]:.6g} s and runs on from "
            "there: make two files of it; sorting would mix what was before and after"
        ]
    return []


def _sorted(
    values: dict[str, Floats], extra: dict[str, Floats], problems: list[str], notices: list[str]
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    t = values["t"]
    if np.unique(t).size < 2:
        problems.append("holds one distinct time only")
        return values, extra
    order = np.argsort(t, kind="stable")
    # beyond ABSURD is no reading, and must not contradict one
    columns = {(k, True): np.where(np.abs(v) < ABSURD, v, np.nan)[order] for k, v in values.items()}
    columns |= {(k, False): v[order] for k, v in extra.items()}
    found = merge_equal_times(t[order], columns, {key for key in columns if key[1]})
    remarks = [f"sorted by time: it went back {int((np.diff(t) < 0).sum())} times"]
    if found.merged:
        remarks.append(f"{found.merged} rows of equal time merged with the first, no reading lost")
    if found.dropped:
        lost = {name: n for (name, _), n in found.lost.items() if name != "t"}
        each = ", ".join(f"{n} of {name}" for name, n in lost.items())
        remarks.append(
            f"{found.dropped} rows that contradict another of equal time dropped, with "
            f"{sum(lost.values())} readings ({each})"
        )
    notices.append("; ".join(remarks))
    read, other = ({k: v for (k, is_read), v in found.columns.items() if is_read is r} for r in (True, False))
    return read, other


def _drop_absurd(name: str, values: dict[str, Floats], notices: list[str]) -> None:
    array = values[name]
    bad = ~(np.abs(array) < ABSURD) & ~np.isnan(array)
    if bad.any():
        notices.append(f"{name}: {int(bad.sum())} values are infinite or beyond 1e12; treated as missing")
        array = np.where(bad, np.nan, array)
        values[name] = array
    if np.isnan(array).all():
        notices.append(f"{name}: no values; treated as not logged")
        del values[name]


OUTSIDE = 0.05  # share of readings beyond one turn that no wrapped angle has


def unwrap(angle: Floats) -> Floats:
    """Continuous angle, rad, whatever wrap was logged; NaN stay NaN, steps across them go the short way.

    One that spans more than a turn was not wrapped where it was logged and stays as it is: in degrees read as
    radians every step of a fast turn would be lost otherwise.
    """
    good = np.isfinite(angle)
    if good.any() and float(np.mean(np.abs(angle[good] - np.median(angle[good])) > 2.01 * np.pi)) > OUTSIDE:
        return angle
    if good.all():
        if (np.abs(np.diff(angle)) <= np.pi).all():
            return angle
        return np.unwrap(angle)
    out = angle.copy()
    out[good] = np.unwrap(angle[good])
    return out


def _fill(t: Floats, array: Floats, row: Channel, notices: list[str]) -> Floats:
    """Inputs must be known at all times: commands are held, measured ones interpolated."""
    good = np.isfinite(array)
    if good.all():
        return array
    share = 100.0 * (1.0 - good.mean())
    if row.kind == "command":
        last = np.maximum.accumulate(np.where(good, np.arange(t.size), -1))
        last[last < 0] = int(np.argmax(good))
        notices.append(f"{row.name}: {share:.1f} % missing; last command held")
        return array[last]
    notices.append(f"{row.name}: {share:.1f} % missing; interpolated")
    return np.interp(t, t[good], array[good])


def _missing(values: Mapping[str, Floats], spare: Sequence[str], read: Mapping[str, str]) -> list[str]:
    """What the program cannot do without.

    Parameters
    ----------
    spare : columns no channel was read from
    read : channel -> the column it was read from
    """
    has = set(values)
    problems = []
    left = [text for text in spare if text and not is_channel(split_header(text)[0])][:6]
    unused = f"; unused columns: {', '.join(map(repr, left))}" if left else ""

    def lacks(what: str, *targets: str) -> None:
        empty = [f"{read[name]!r}, read as {name}," for name in targets if name in read]
        if empty:
            problems.append(f"{what} is missing: column {' and '.join(empty)} holds no value")
            return
        target = targets[0]
        unit = {"m": "m", "rad": "deg"}[channel(target).unit]
        problems.append(f'{what} is missing; log it or map it: [columns] "{target}[{unit}]" = "..."{unused}')

    if not {"x", "y"} <= has and not {"u", "v"} <= has and not {"u_water", "v_water"} <= has:
        absent = sorted({"x", "y"} - has)
        lacks(f"position {' and '.join(absent)} (and no velocity u, v to stand in for it)", *absent)
    if "psi" not in has and "r" not in has:
        lacks("heading psi (and no yaw rate r to stand in for it)", "psi")
    if not {name for name in has if channel(name).kind in ("command", "actuator")} - {"n", "n_cmd"}:
        lacks("thrusters (n_port_cmd, ...), or a rudder angle, delta_r_cmd or delta_r,", "delta_r_cmd")
    return problems
