"""A text table of any dialect: comma, semicolon, tab, bar or blanks; decimal comma; units in brackets or a
row of their own; comments, a preamble, a byte-order mark; with or without a header.

Read in parts, so that memory holds what is kept and not the file.
"""

from __future__ import annotations

import csv
import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.trials.importing import clocks
from bayesid.trials.importing.raw import ImportLogError, RawChannel, RawLog, Request, SourceOptions
from bayesid.trials.importing.tables import Columns, choose_time, stamps_of
from bayesid.trials.importing.thinning import Thinning
from bayesid.trials.importing.unit_words import is_unit, plain_unit, split_unit
from bayesid.words import counted

PART = 100_000  # rows read at a time
HEAD = 256 * 1024  # bytes the dialect is found in
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
_HOLE = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "+nan", "-nan", "1.#qnan", "nat"}
)
_COMMENT = ("#", "%", "//", "!", "*")


@dataclass(frozen=True)
class Dialect:
    """How a text table is written; skip: lines before the first sample."""

    encoding: str
    delimiter: str
    decimal: str
    skip: int
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    named: bool
    preamble: str
    comment: str | None


def read_text(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """The table; see `SourceOptions` for what a map may say about it."""
    dialect = find_dialect(path, options)
    _refuse_cut_rows(path, dialect)
    stride = 1
    if request.most is not None:
        stride = max(1, int(_rows(path, dialect) / request.most))
    parts = _Parts(path, dialect, options, request, stride)
    for frame in _frames(path, dialect, parts.columns):
        parts.add(frame)
    return parts.log()


def find_dialect(path: Path, options: SourceOptions) -> Dialect:
    """The dialect, from the first lines.

    Raises
    ------
    ImportLogError             the file is binary or holds no table of numbers
    """
    with open(path, "rb") as file:
        raw = file.read(HEAD)
    encoding = "utf-8-sig" if raw[:3] == b"\xef\xbb\xbf" else "utf-8"
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif raw.count(b"\0"):
        raise ImportLogError(f"{path}: holds NUL bytes; it is binary, or was cut off by a crash")
    try:
        text = raw.decode(encoding, "strict")
    except UnicodeDecodeError as error:
        if error.start > len(raw) - 4:
            text = raw.decode(encoding, "ignore")
        else:
            encoding = "latin-1"
            text = raw.decode(encoding)
    lines = text.splitlines()
    if len(raw) == HEAD:
        lines = lines[:-1]
    best = max(
        ((_score(lines, mark), -k, mark) for k, mark in enumerate((",", ";", "\t", "|", r"\s+"))),
        key=lambda item: item[:2],
    )
    if best[0][0] < 1:
        if best[0][1] < 2 or len(lines) > 1 + sum(not line.strip() for line in lines):
            raise ImportLogError(
                f"{path}: holds no table of numbers (first line: {(lines or [''])[0][:60]!r})"
            )
        raise ImportLogError(f"{path}: holds a header but no samples")
    delimiter = best[2]
    width, first = _body(lines, delimiter)
    decimal = "."
    if delimiter != ",":
        cells = [c for line in lines[first : first + 200] for c in _cells(line, delimiter)]
        if any("," in c for c in cells) and not any("." in c and _NUMBER.fullmatch(c) for c in cells):
            decimal = ","
    head = [(k, line) for k, line in enumerate(lines[:first]) if line.strip()]
    named, units, names = _header(head, delimiter, width)
    if options.columns:
        if len(options.columns) != width:
            raise ImportLogError(
                f"{path}: the map names {len(options.columns)} columns, the table has {width}"
            )
        names, named = list(options.columns), True
        units = [split_unit(n)[1] for n in names]
    names = _unique(names)
    comment = next((c for c in _COMMENT[:2] if any(line.startswith(c) for line in lines[first:])), None)
    return Dialect(
        encoding,
        delimiter,
        decimal,
        first,
        tuple(names),
        tuple(units),
        named,
        "\n".join(t for _, t in head),
        comment,
    )


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == r"\s+":
        return line.split()
    if '"' in line:
        try:
            return [c.strip() for c in next(csv.reader([line], delimiter=delimiter))]
        except (csv.Error, StopIteration):
            pass
    return [c.strip() for c in line.split(delimiter)]


def _is_sample(cells: list[str]) -> bool:
    numbers = sum(bool(_NUMBER.fullmatch(c)) for c in cells)
    holes = sum(c.lower() in _HOLE for c in cells)
    dated = any(clocks.is_date_text([c]) or clocks.is_time_of_day([c]) for c in cells)
    return numbers >= 1 and (
        numbers + holes >= 0.5 * len(cells) or (dated and numbers + holes >= 0.3 * len(cells))
    )


def _score(lines: list[str], delimiter: str) -> tuple[float, int]:
    """(lines that are samples of the commonest width, each by its share of numbers; that width)."""
    widths: dict[int, float] = {}
    for line in lines[-300:]:
        cells = _cells(line, delimiter)
        if len(cells) > 1 and _is_sample(cells):
            good = sum(bool(_NUMBER.fullmatch(c)) or c.lower() in _HOLE or _whole(c) for c in cells)
            widths[len(cells)] = widths.get(len(cells), 0.0) + good / len(cells)
    if not widths:
        return 0.0, max((len(_cells(line, delimiter)) for line in lines[:5]), default=0)
    width = max(widths, key=lambda w: (widths[w], w))
    return widths[width] + min(width, 99) / 100.0, width


def _whole(cell: str) -> bool:
    """A cell that is a word or a date rather than two cells of another dialect."""
    return not any(mark in cell for mark in ";\t|,") and bool(
        re.search("[A-Za-z:]", cell) or clocks.is_date_text([cell])
    )


def _body(lines: list[str], delimiter: str) -> tuple[int, int]:
    """(number of columns, first line of samples)."""
    width = _score(lines, delimiter)[1]
    for k, line in enumerate(lines):
        if line.startswith(_COMMENT[:3]):
            continue
        cells = _cells(line, delimiter)
        if len(cells) in (width, width + 1) and _is_sample(cells):
            return width, k
    return width, 0


def _header(
    head: list[tuple[int, str]], delimiter: str, width: int
) -> tuple[bool, list[str | None], list[str]]:
    """(is there a header, unit of each column, name of each column)."""
    rows = []
    for _, line in head[-4:]:
        bare = line.strip()
        for mark in _COMMENT[:3]:
            bare = bare.removeprefix(mark).strip() if bare.startswith(mark) else bare
        rows.append(_cells(bare, delimiter) if delimiter != r"\s+" else bare.split())
    fitting = [r for r in rows if width <= len(r) <= width + 1 and any(c for c in r)]
    units: list[str | None] = [None] * width
    if fitting and all(is_unit(c) for c in fitting[-1][:width]) and len(fitting) > 1:
        units = [plain_unit(c.strip("[]()<>")) for c in fitting[-1][:width]]
        fitting = fitting[:-1]
    if not fitting:
        return False, [None] * width, [f"column {k + 1}" for k in range(width)]
    names = [c or f"column {k + 1}" for k, c in enumerate(fitting[-1][:width])]
    units = [u if u is not None else split_unit(n)[1] for u, n in zip(units, names, strict=True)]
    return True, units, names


def _unique(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return out


def _refuse_cut_rows(path: Path, dialect: Dialect) -> None:
    """Rows that a carriage return cuts in two, which would be read as two rows with cells missing.

    One at the end of a row, as of an old Mac, or doubled, cuts nothing.
    """
    if dialect.encoding == "utf-16":
        return
    width, cut = len(dialect.names), []
    with open(path, "rb") as file:
        for number, line in enumerate(file, 1):
            bare = line.rstrip(b"\r\n")
            if b"\r" not in bare or number <= dialect.skip:
                continue
            parts = [part for part in bare.decode(dialect.encoding, "replace").split("\r") if part.strip()]
            cells = [len(_cells(part, dialect.delimiter)) for part in parts]
            if len(parts) > 1 and min(cells) < width and line.endswith(b"\n"):
                cut.append((number, parts[0]))
    if cut:
        number, before = cut[0]
        more = f", and {counted(len(cut) - 1, 'more row')}" if cut[1:] else ""
        raise ImportLogError(
            f"{path}: row {number} is cut in two by a stray carriage return (CR) after {before[-12:]!r}{more}"
            f"; remove it: tr -d '\\r' < {shlex.quote(str(path))} > mended.csv"
        )


def _rows(path: Path, dialect: Dialect) -> float:
    with open(path, "rb") as file:
        raw = file.read(HEAD)
    return os.path.getsize(path) / max(1.0, len(raw) / max(1, raw.count(b"\n") - dialect.skip))


def _frames(path: Path, dialect: Dialect, wanted: Any) -> Iterator[Any]:
    import pandas

    names: list[str] = list(dialect.names)
    reader = pandas.read_csv(
        path, sep=dialect.delimiter, decimal=dialect.decimal, header=None, names=names, index_col=False,
        usecols=wanted, skiprows=dialect.skip, encoding=dialect.encoding, encoding_errors="replace",
        chunksize=PART, on_bad_lines="skip", comment=dialect.comment, skipinitialspace=True, engine="c",
        na_values=["", "-", "--", "null", "none", "None", "1.#QNAN", "NaT"], low_memory=True,
    )  # fmt: skip
    with reader:
        yield from reader


def _texts(series: Any) -> Any:
    """Cells as words, "" where there is none: pandas from 3 on leaves such a cell a number."""
    return series.astype(object).where(series.notna(), "").astype(str).str.strip()


class _Parts:
    """Rows kept so far."""

    def __init__(
        self, path: Path, dialect: Dialect, options: SourceOptions, request: Request, stride: int
    ) -> None:
        self.path, self.dialect, self.options, self.request, self.stride = (
            path,
            dialect,
            options,
            request,
            stride,
        )
        self.columns: list[str] | None = None
        if request.wanted is not None and options.time:
            self.columns = [n for n in dialect.names if n in request.wanted or n in options.time]
            if not set(options.time) <= set(dialect.names):
                self.columns = None  # choose_time says what is missing
        self.kept: dict[str, list[np.ndarray]] = {}
        self.times: list[np.ndarray] = []
        self.start: float | None = None
        self.lost: dict[str, int] = {}
        self.choice: Any = None
        self.words = ""
        self.rows = 0
        self.thinning = Thinning(request)
        self.dropped = 0

    def add(self, frame: Any) -> None:
        data: dict[str, np.ndarray] = {}
        for name in frame.columns:
            data[str(name)] = self._numbers(str(name), frame[name])
        self.rows += len(frame)
        if self.choice is None:
            units = dict(zip(self.dialect.names, self.dialect.units, strict=True))
            self.choice = choose_time(Columns(data, units), self.options, str(self.path))
        for name in self.choice.names:  # a date in a later part must be read as in the first
            if data[name].dtype.kind == "f" and frame[name].dtype.kind not in "iuf":
                data[name] = _texts(frame[name]).to_numpy(dtype=object)
        rows = np.arange(0, len(frame), self.stride)
        stamps = stamps_of({n: data[n][rows] for n in self.choice.names}, self.choice)
        t = stamps.t
        if stamps.start is not None:
            self.start = stamps.start if self.start is None else self.start
            t = t + (stamps.start - self.start)
        self.words = self.words or stamps.words
        good = np.isfinite(t)
        self.dropped += int((~good).sum())
        rows, t = rows[good], t[good]
        read = {
            name: values[rows].astype(float)
            for name, values in data.items()
            if name not in self.choice.names and self.request.wants(name) and values.dtype.kind in "iuf"
        }
        if self.request.step is not None and t.size:
            kept, read = self.thinning.keep(t, read)
            t = t[kept]
        self.times.append(t)
        for name, values in read.items():
            self.kept.setdefault(name, []).append(values)

    def _numbers(self, name: str, series: Any) -> np.ndarray:
        import pandas

        if series.dtype.kind in "iub":
            values = series.to_numpy()
            return (
                values if values.dtype.kind in "iu" and name in self._time_names() else values.astype(float)
            )
        if series.dtype.kind == "f":
            return series.to_numpy()
        texts = _texts(series)
        if self.choice is not None and name in self.choice.names:
            return texts.to_numpy(dtype=object)
        some = [t for t in texts.iloc[:50] if t.lower() not in _HOLE]
        if self.choice is None and (clocks.is_date_text(some) or clocks.is_time_of_day(some)):
            return texts.to_numpy(dtype=object)
        if self.dialect.decimal == ",":
            texts = texts.str.replace(",", ".", regex=False)
        texts = texts.str.replace(r"(?<=\d)[dD](?=[+-]?\d)", "e", regex=True)
        values = pandas.to_numeric(texts, errors="coerce").to_numpy(dtype=float)
        lost = np.isnan(values) & ~texts.str.lower().isin(_HOLE).to_numpy() & ~series.isna().to_numpy()
        self.lost[name] = self.lost.get(name, 0) + int(lost.sum())
        if len(values) and lost.sum() > 0.5 * len(values):
            return texts.to_numpy(dtype=object)
        return values

    def _time_names(self) -> tuple[str, ...]:
        if self.choice is not None:
            return self.choice.names
        return self.options.time or self.dialect.names

    def log(self) -> RawLog:
        if self.choice is None or not self.times:
            raise ImportLogError(f"{self.path}: holds a header but no samples")
        t = np.concatenate(self.times)
        if t.size == 0:
            raise ImportLogError(f"{self.path}: no cell of {self.choice.names[0]!r} is a time")
        units = dict(zip(self.dialect.names, self.dialect.units, strict=True))
        channels = []
        for name, parts in self.kept.items():
            values = np.concatenate(parts)
            if values.size == t.size:
                channels.append(
                    RawChannel(name, t, values, units[name], None, f"column {name!r}", self.lost.get(name, 0))
                )
        notices = []
        if self.dropped:
            notices.append(f"{self.dropped} rows without a readable time are left out")
        if self.dialect.decimal == ",":
            notices.append("decimal commas read as points")
        return RawLog(
            str(self.path), "csv", "", tuple(channels), self.start, self.words,
            time_names=self.choice.names, time_unit=self.choice.unit, doubts=self.choice.doubts,
            notices=tuple(notices), text=self.dialect.preamble, thinned=self.stride, named=self.dialect.named,
        )  # fmt: skip
