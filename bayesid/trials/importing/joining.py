"""A map applied to logs: series found, converted, set on one clock and joined, each at its own rate.

Takes a `LogMap` and the files; gives `Joined` runs in bayesid's channels, SI, forward-starboard-down.
Does not: write anything, or fill holes; a slower channel has empty cells.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.errors import raise_all
from bayesid.model.channels import channel
from bayesid.trials.importing.converting import Origin, Recording, Series, convert, resolve
from bayesid.trials.importing.log_map import LogMap, RunMap
from bayesid.trials.importing.raw import ImportLogError, RawLog, Request
from bayesid.trials.importing.readers import read_log
from bayesid.trials.importing.stamp_words import told_of
from bayesid.trials.trial import Floats
from bayesid.words import counted

SAME_TIME = 1e-6  # s; stamps closer than this are one row


@dataclass(frozen=True)
class Joined:
    """One run: rows in time, NaN where a channel has no reading then.

    start : UTC of t = 0, seconds since 1970, or None
    digests : file name of a log -> digest
    stamps : what is odd about the stamps of the logs, as the proposal of a map says it too
    logs : files it is made of
    """

    run: RunMap
    t: Floats
    data: Mapping[str, Floats]
    origins: Mapping[str, Origin]
    start: float | None
    digests: Mapping[str, str]
    notices: tuple[str, ...] = ()
    stamps: tuple[str, ...] = ()
    logs: tuple[Path, ...] = ()


def files_by_label(found: LogMap, sources: Sequence[Path]) -> dict[str, list[Path]]:
    """Files given on the command line by the label of the map they match.

    Raises
    ------
    ImportLogError             a file matches no source of the map
    """
    out: dict[str, list[Path]] = {label: [] for label in found.sources}
    problems = []
    for path in sources:
        hits = [
            label
            for label, s in found.sources.items()
            if any(fnmatch.fnmatchcase(path.name, p) for p in s.files)
        ]
        if not hits:
            problems.append(f"{path.name} matches no [sources.*] files of the map ({_listed(found)})")
        for label in hits[:1]:
            out[label].append(path)
    if problems:
        raise_all(ImportLogError, "map", problems)
    return out


def _listed(found: LogMap) -> str:
    names = [p for s in found.sources.values() for p in s.files]
    return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")


def runs_of(found: LogMap, sources: Sequence[Path]) -> list[RunMap]:
    """The runs of the map that the files given hold; without any in the map, a run per recording.

    Raises
    ------
    ImportLogError             a run needs files that are not given
    """
    names = {p.name for p in sources}
    if found.runs:
        there = [run for run in found.runs if set(run.files) <= names]
        absent = sorted({f for run in found.runs for f in run.files} - names)
        if not there:
            raise ImportLogError(
                f"none of the runs of the map is in the files given; missing: {', '.join(absent[:6])}"
            )
        partly = [run.name for run in found.runs if set(run.files) & names and run not in there]
        if partly:
            raise ImportLogError(
                f"runs {', '.join(partly[:4])} also need {', '.join(absent[:6])}; give these files too"
            )
        return there
    labelled = {k: v for k, v in files_by_label(found, sources).items() if v}
    if len(labelled) == 1:
        return [RunMap(_stem(p), (p.name,)) for p in next(iter(labelled.values()))]
    if all(len(v) == 1 for v in labelled.values()):
        return [RunMap(_stem(sources[0]), tuple(v[0].name for v in labelled.values()))]
    raise ImportLogError(
        "the map has no [[runs]]; with several files per source they say which files belong together"
    )


def _stem(path: Path) -> str:
    return path.name.partition(".")[0] or path.name


def open_recording(found: LogMap, files: Sequence[str], paths: Mapping[str, Path]) -> Recording:
    """Read what the map needs of the files of one recording and set them on one clock."""
    labels = files_by_label(found, [paths[name] for name in files])
    logs: dict[str, RawLog] = {}
    for label, its in labels.items():
        wanted = {resolve(found, role)[1] for role in found.channels if resolve(found, role)[0] == label}
        switching = {
            resolve(found, role)[1]
            for role in found.channels
            if resolve(found, role)[0] == label and role.endswith("_cmd")
        }
        for path in its:
            request = Request(frozenset(wanted), None, found.step, frozenset(switching))
            logs[label] = _with_others(
                read_log(path, found.sources[label].options, request), wanted, found, label
            )
    return one_clock(logs, {k: found.sources[k].options.offset for k in logs})


def _with_others(log: RawLog, wanted: set[str], found: LogMap, label: str) -> RawLog:
    """The log with the names it has beside, where one that is wanted is not there: it may be misspelt."""
    if wanted <= set(log.by_name):
        return log
    try:
        every = read_log(Path(log.path), found.sources[label].options, Request(None, 2))
    except ImportLogError:  # of a series nobody asked for
        return log
    return replace(log, others=tuple(n for n in every.by_name if n not in log.by_name))


def one_clock(logs: dict[str, RawLog], offsets: Mapping[str, float]) -> Recording:
    """Logs that belong together on one clock.

    Raises
    ------
    ImportLogError             relative and absolute clocks are mixed
    """
    absolute = {k: log.start for k, log in logs.items() if log.start is not None}
    if absolute and len(absolute) < len(logs):
        without = next(k for k in logs if k not in absolute)
        raise ImportLogError(
            f"{logs[without].path}: has relative time while other files have UTC; say its start in the map: "
            f'[sources.{without}] start = "2024-05-01T10:00:00Z"'
        )
    start = min(absolute.values()) if absolute else None
    shift = {k: (absolute[k] - start if start is not None else 0.0) + offsets.get(k, 0.0) for k in logs}
    return Recording(logs, shift, start, [n for log in logs.values() for n in log.notices])


def join(
    series: Mapping[str, Series], window: tuple[float, float] | None
) -> tuple[Floats, dict[str, Floats]]:
    """Rows in time of all series, t from the first of them; NaN where a series has no reading.

    Commands and measured inputs hold into the window from before it.
    """
    first = min(float(t[0]) for t, _ in series.values() if t.size)
    low, high = (-np.inf, np.inf) if window is None else window
    cut: dict[str, Series] = {}
    for name, (t, values) in series.items():
        order = np.argsort(t, kind="stable") if np.any(np.diff(t) < 0) else slice(None)
        t, values = t[order] - first, values[order]
        good = np.isfinite(values)
        inside = good & (t >= low - SAME_TIME) & (t <= high + SAME_TIME)
        if channel(name).kind in ("command", "actuator"):
            before = np.flatnonzero(good & (t < low - SAME_TIME))
            if before.size and not (inside.any() and t[np.argmax(inside)] <= low + SAME_TIME):
                inside[before[-1]] = True
                t = t.copy()
                t[before[-1]] = low
        if inside.any():
            cut[name] = (t[inside], values[inside])
    if not cut:
        return np.empty(0), {}
    every = np.unique(np.concatenate([t for t, _ in cut.values()]))
    rows = every[np.concatenate(([True], np.diff(every) > SAME_TIME))]
    data = {}
    for name, (t, values) in cut.items():
        column = np.full(rows.shape, np.nan)
        at = np.clip(np.searchsorted(rows, t + SAME_TIME, side="right") - 1, 0, rows.size - 1)
        column[at] = values
        data[name] = column
    return rows, data


def apply_map(
    found: LogMap, sources: Sequence[Path]
) -> tuple[list[Joined], tuple[float, float, float] | None]:
    """All runs of a map.

    Returns
    -------
    (runs, origin of latitude and longitude or None)

    Raises
    ------
    ImportLogError             questions are left, or a file, series or unit does not fit
    """
    if found.questions:
        listed = "".join(f"\n  {k}. {q}" for k, q in enumerate(found.questions, 1))
        raise ImportLogError(
            f"{counted(len(found.questions), 'question of the map is', 'questions of the map are')} open; "
            f"edit the map, delete each from `questions` when it is answered, and give the command "
            f"again:{listed}"
        )
    paths = {p.name: p for p in sources}
    out = []
    origin = found.origin
    told: tuple[str, ...] = ()
    kept: tuple[tuple[str, ...], Recording, dict[str, Series], dict[str, Origin]] | None = None
    for run in runs_of(found, sources):
        if kept is None or kept[0] != run.files:
            recording = open_recording(found, run.files, paths)
            series, notes, origin = convert(found, recording, origin)
            if not series:
                raise ImportLogError(f"{', '.join(run.files)}: the map names no channel of these files")
            told = tuple(told_of(found, recording.logs))
            kept = (run.files, recording, series, notes)
        _, recording, series, notes = kept
        t, data = join(series, run.window)
        if t.size < 2:
            raise ImportLogError(f"run {run.name}: its window holds {t.size} samples")
        digests = {Path(log.path).name: log.digest for log in recording.logs.values()}
        logs = tuple(Path(log.path) for log in recording.logs.values())
        notices = tuple(recording.notices)
        out.append(Joined(run, t, data, notes, recording.start, digests, notices, told, logs))
    return out, origin
