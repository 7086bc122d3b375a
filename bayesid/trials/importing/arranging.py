"""Which files have one structure, and which belong together on time.

Takes logs; gives labels, groups of files and what of a map they determine. Does not: look at series.
"""

from __future__ import annotations

import re

from bayesid.trials.importing.log_map import SourceMap
from bayesid.trials.importing.raw import ImportLogError, RawLog, SourceOptions


def arrange(logs: dict[str, RawLog]) -> tuple[dict[str, str], list[tuple[str, ...]], list[tuple[int, str]]]:
    """(label of each file, files of each recording, doubts).

    Files of one structure have one label; files of different structure belong together on time."""
    structure: dict[tuple[str, frozenset[str]], list[str]] = {}
    for name, log in sorted(logs.items(), key=lambda item: -len(item[1].channels)):
        series = frozenset(c.name for c in log.channels)
        alike = (k for k in structure if k[0] == log.format and len(k[1] & series) > 0.6 * len(k[1] | series))
        structure.setdefault(next(alike, (log.format, series)), []).append(name)
    labels: dict[str, str] = {}
    taken: set[str] = set()
    listed = [part for files in structure.values() for part in _apart(files, logs)]
    for files in listed:
        label = _label(files, len(listed) == 1)
        while label in taken:
            label += "_"
        taken.add(label)
        labels |= dict.fromkeys(files, label)
    kinds = [sorted(files) for files in listed]
    if len(kinds) == 1:
        return labels, [(f,) for f in kinds[0]], []
    if all(len(files) == 1 for files in kinds):
        return labels, [tuple(files[0] for files in kinds)], []
    if len({len(files) for files in kinds}) == 1:
        groups = [tuple(group) for group in zip(*kinds, strict=True)]
        if _told_by_time(groups, logs):
            return labels, groups, []
        together = "; ".join(" with ".join(g) for g in groups[:3])
        return labels, groups, [(1, f"files are paired by name ({together}); check `files` of the runs")]
    raise ImportLogError(
        f"which of these {len(logs)} files belong together is not clear "
        f"({', '.join(str(len(k)) for k in kinds)} of each "
        "structure); import one recording at a time"
    )


def _apart(files: list[str], logs: dict[str, RawLog]) -> list[list[str]]:
    """Files of one structure that run at the same time are different things (rudder.csv and shaft.csv, each
    of time and value): one list per stem of their names."""
    stems: dict[str, list[str]] = {}
    for name in files:
        stems.setdefault(re.sub(r"[\W\d_]+$", "", name.partition(".")[0]).lower(), []).append(name)
    if len(stems) < 2 or len({len(its) for its in stems.values()}) != 1:
        return [files]
    spans = {}
    for name in files:
        log = logs[name]
        ts = [c.t for c in log.channels if c.t.size]
        if log.start is None or not ts:
            return [files]
        spans[name] = (log.start + min(t[0] for t in ts), log.start + max(t[-1] for t in ts))
    first, second = (its[0] for its in list(stems.values())[:2])
    (a, b), (c, d) = spans[first], spans[second]
    shared = min(b, d) - max(a, c)
    return list(stems.values()) if shared > 0.5 * max(b - a, d - c) > 0.0 else [files]


def _told_by_time(groups: list[tuple[str, ...]], logs: dict[str, RawLog]) -> bool:
    """True if the clocks say which files belong together.

    Spans overlap within a group and nowhere else."""
    spans: list[list[tuple[float, float]]] = []
    for group in groups:
        its = [logs[name] for name in group]
        if any(log.start is None for log in its):
            return False
        ends = [(log.start or 0.0, [c.t for c in log.channels if c.t.size]) for log in its]
        spans.append([(s + min(t[0] for t in ts), s + max(t[-1] for t in ts)) for s, ts in ends])
    for k, group_spans in enumerate(spans):
        shared = min(e for _, e in group_spans) - max(s for s, _ in group_spans)
        if shared < 0.8 * max(e - s for s, e in group_spans):
            return False
        for other in spans[k + 1 :]:
            if any(s < e2 and s2 < e for s, e in group_spans for s2, e2 in other):
                return False
    return True


def _label(files: list[str], alone: bool) -> str:
    if alone and len(files) > 1:
        return "log"
    stem = re.sub(r"\W+", "_", files[0].partition(".")[0]).strip("_")
    if len(files) > 1:
        stem = re.sub(r"[\d_]+$", "", stem) or stem
    return stem or "log"


def sources_of(logs: dict[str, RawLog], labels: dict[str, str]) -> dict[str, SourceMap]:
    out: dict[str, SourceMap] = {}
    for name, label in labels.items():
        log = logs[name]
        clock = log.clock.split(" ")[0].rstrip(",") if log.clock else None
        options = SourceOptions(
            time=log.time_names,
            clock=clock
            if clock in ("relative", "unix", "gps", "gps_week", "date", "datenum") and log.time_names
            else None,
            time_unit=log.time_unit
            if log.time_unit and clock in ("relative", "unix", "gps", "datenum")
            else None,
        )
        before = out.get(label)
        out[label] = SourceMap(
            (*(before.files if before else ()), name), before.options if before else options
        )
    return out
