"""A log as its file holds it: named channels with their own time stamps, units if stated, and where each is
from.

Every reader gives this and nothing else. Does not: know bayesid's channels, axes or units.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.errors import BayesidError
from bayesid.trials.trial import Floats


class ImportLogError(BayesidError):
    """A raw log or its map cannot be read; the text names the file and the next move."""


@dataclass(frozen=True)
class SourceOptions:
    """What a map says about how to read a file; None or empty where the file is to be asked.

    columns : names of the columns of a table without a header
    time : column or columns (date and time of day, week and seconds) of the time stamps
    clock : kind of clock, one of `clocks.CLOCKS`
    time_unit : unit of the stamps
    start : UTC of stamp zero, seconds since 1970, where the file has relative time only
    offset : added to every stamp of this source, s
    spread : rows of one stamp are spread evenly until the next
    """

    columns: tuple[str, ...] = ()
    time: tuple[str, ...] = ()
    clock: str | None = None
    time_unit: str | None = None
    start: float | None = None
    offset: float = 0.0
    spread: bool = False


@dataclass(frozen=True)
class Request:
    """How much of a file is wanted.

    wanted : channels to read; None for all
    most : samples of a channel kept at most, spread evenly; None for all
    step : at most one sample per so many seconds, s
    switching : channels of which every change is kept whatever `step` says
    """

    wanted: frozenset[str] | None = None
    most: int | None = None
    step: float | None = None
    switching: frozenset[str] = frozenset()

    def wants(self, name: str) -> bool:
        return self.wanted is None or name in self.wanted


@dataclass(frozen=True)
class RawChannel:
    """One series.

    name : as in the file, unique there
    t, values : (n,) seconds from the zero of the log, and numbers in `unit`; NaN where a cell holds none
    unit : as written, None if not stated
    role : what it is by definition of the format (`roles.ROLES`), None if only its name tells
    place : column, topic and field, variable
    lost : cells that hold no number although they are not empty
    """

    name: str
    t: Floats
    values: Floats
    unit: str | None = None
    role: str | None = None
    place: str = ""
    lost: int = 0


@dataclass(frozen=True)
class RawLog:
    """One file.

    label : short name of files of this structure
    start : UTC of t = 0, seconds since 1970; None for a relative clock
    clock : how the stamps were read, in words
    world, body : axes by definition of the format ("ned"/"enu", "frd"/"flu"), None if it has none
    time_names : columns used as time
    doubts : questions about the time stamps
    others : names of channels that were not asked for, where one that was is not there
    """

    path: str
    format: str
    digest: str
    channels: tuple[RawChannel, ...]
    start: float | None = None
    clock: str = "relative"
    world: str | None = None
    body: str | None = None
    time_names: tuple[str, ...] = ()
    time_unit: str | None = None
    doubts: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()
    text: str = ""
    label: str = ""
    thinned: int = 1
    named: bool = True
    others: tuple[str, ...] = ()
    by_name: Mapping[str, RawChannel] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "by_name", {c.name: c for c in self.channels})


def thin_rows(t: Floats, switching: Iterable[Floats], step: float) -> np.ndarray:
    """Rows to keep for one sample per `step`, and every row at which one of `switching` changes; of channels
    that are all read in every row (others: `thinning`)."""
    bins = np.floor(np.nan_to_num(t) / step + 1e-9).astype(np.int64)
    keep = np.empty(t.shape, dtype=bool)
    keep[0] = True
    keep[1:] = bins[1:] != bins[:-1]
    for values in switching:
        change = values[1:] != values[:-1]
        keep[1:] |= change & np.isfinite(values[1:])
    return keep
