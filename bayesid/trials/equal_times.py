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

    Parameters
    ----------
    t : (n,) times; a step back is left as it is, and the last rows are as far apart as those before them
    """
    if t.size < 2:
        return t
    first = np.flatnonzero(np.concatenate(([True], np.diff(t) != 0)))
    count = np.diff(np.append(first, t.size))
    length = np.empty(first.size)
    length[:-1] = np.maximum(np.diff(t[first]), 0.0)
    length[-1] = 0.0
    if first.size > 1 and count[-1] > 1:
        usual = length[:-1] / count[:-1]
        length[-1] = count[-1] * float(np.median(usual[usual > 0])) if (usual > 0).any() else 0.0
    rank = np.arange(t.size) - np.repeat(first, count)
    # a gap is no place for rows: none is farther from the one before than twice the usual step
    each = length / count
    usual_step = float(np.median(np.repeat(each, count)))
    each = np.where(each > 2.0 * usual_step, usual_step, each)
    return np.asarray(t + rank * np.repeat(each, count), dtype=np.float64)


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
