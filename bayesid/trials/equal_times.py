"""Rows of a log with one and the same time: merged where they do not contradict each other, else dropped.

Takes columns already sorted by time. Gives one row per time and how much was lost.
Does not: know channels or units.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from bayesid.trials.trial import Floats

Name = TypeVar("Name")


@dataclass(frozen=True)
class Merged(Generic[Name]):
    """One row per time.

    Attributes
    ----------
    columns : name -> (m,) values; in a merged row the first reading of each column
    merged, dropped : rows that went into another one, and rows that contradict it and are left out
    lost : column -> readings left out with the dropped rows
    """

    columns: dict[Name, Floats]
    merged: int
    dropped: int
    lost: dict[Name, int]


def spread_equal_times(t: Floats) -> Floats:
    """Rows of one stamp spread evenly until the next stamp, as of a clock that was rounded down.

    A log may begin and end between two stamps: its first rows are counted back from the next stamp at the
    usual step, its last ones forward at it.

    Parameters
    ----------
    t : (n,) times; a step back is left as it is
    """
    if t.size < 2:
        return t
    first = np.flatnonzero(np.concatenate(([True], np.diff(t) != 0)))
    if first.size < 2:
        return t
    count = np.diff(np.append(first, t.size))
    length = np.maximum(np.diff(t[first]), 0.0)
    each = length / count[:-1]
    whole = slice(1, None) if first.size > 2 else slice(None)
    usual = float(np.median(np.repeat(each[whole], count[:-1][whole])))
    # a gap is no place for rows: none is farther from the one before than twice the usual step
    each = np.append(np.where(each > 2.0 * usual, usual, each), usual)
    late = min(float(length[0]), float(np.median(length[whole]))) - count[0] * usual
    rank = np.arange(t.size) - np.repeat(first, count)
    out = t + rank * np.repeat(each, count)
    if late > 0.0:
        out[: count[0]] = t[0] + late + usual * rank[: count[0]]
    return np.asarray(out, dtype=np.float64)


def rows_behind(t: Floats) -> tuple[np.ndarray, np.ndarray]:
    """(first row, row after the last) of each stretch of rows that lie before an earlier row."""
    behind = np.concatenate(([0], (t < np.maximum.accumulate(t)).astype(int), [0]))
    return np.flatnonzero(np.diff(behind) == 1), np.flatnonzero(np.diff(behind) == -1)


def merge_equal_times(t: Floats, columns: Mapping[Name, Floats], judged: Set[Name]) -> Merged[Name]:
    """One row per time.

    Parameters
    ----------
    t : (n,) times in ascending order
    columns : name -> (n,) readings, NaN where there is none
    judged : columns in which two different readings are a contradiction. Of the others (a counter, the name
        of a source) the first reading is kept.
    """
    first = np.flatnonzero(np.concatenate(([True], np.diff(t) > 0)))
    row = np.repeat(np.arange(first.size), np.diff(np.append(first, t.size)))
    rank = np.arange(t.size) - first[row]
    out = {name: values[first].copy() for name, values in columns.items()}
    lost: dict[Name, int] = {}
    merged = dropped = 0
    order = np.argsort(rank, kind="stable")
    for more in np.split(order, np.cumsum(np.bincount(rank)))[1:-1]:
        at = row[more]
        clash = np.zeros(more.size, dtype=bool)
        for name in judged & set(columns):
            new, old = columns[name][more], out[name][at]
            clash |= np.isfinite(new) & np.isfinite(old) & (new != old)
        for name, values in columns.items():
            take = ~clash & ~np.isfinite(out[name][at])
            out[name][at[take]] = values[more[take]]
            gone = int(np.isfinite(values[more[clash]]).sum())
            if gone and name in judged:
                lost[name] = lost.get(name, 0) + gone
        merged, dropped = merged + int((~clash).sum()), dropped + int(clash.sum())
    return Merged(out, merged, dropped, lost)
