"""A CSV file as numbers: header texts, a matrix with NaN for missing, and the file row of each sample.

Takes the bytes of a file, however it was exported: comma, semicolon or tab, BOM, CRLF, quotes, decimal comma.
Does not: know channels or units. All problems of a file are found in one pass and named by row.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bayesid.files import UnreadableError, read_regular
from bayesid.trials.trial import Floats

MAX_BYTES = 256 * 1024 * 1024
MAX_COLUMNS = 1000
SHOWN = 5  # problems of one kind that are spelled out
_MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "--"})


@dataclass(frozen=True)
class CsvTable:
    """names (m), values (n, m), rows (n,): row of the file, header = first row that counts.

    text : column -> (row, problem) of each entry that is not a number; such entries are NaN in `values`"""

    names: tuple[str, ...]
    values: Floats
    rows: np.ndarray
    warnings: tuple[str, ...] = ()
    text: Mapping[int, list[tuple[int, str]]] = field(default_factory=dict)


class BadTableError(Exception):
    """Carries every problem found in one file."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


def read_bytes(path: Path, limit: int = MAX_BYTES) -> bytes:
    """Content of a regular file no larger than `limit`; BadTableError otherwise."""
    try:
        return read_regular(path, limit)
    except UnreadableError as error:
        raise BadTableError([str(error)]) from None


def summed(found: list[tuple[int, str]], kind: str) -> list[str]:
    """At most SHOWN problems of one kind with their rows, and how many more there are."""
    lines = [f"row {row}: {text}" for row, text in found[:SHOWN]]
    if len(found) > SHOWN:
        lines.append(f"{len(found) - SHOWN} more rows with {kind}, the last is row {found[-1][0]}")
    return lines


def parse_table(raw: bytes) -> CsvTable:
    """Read the bytes of one CSV file.

    Returns
    -------
    Table

    Raises
    ------
    BadTableError              with every problem, rows counted from 1 = first line of the file
    """
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise BadTableError(["is UTF-16 text; export it as UTF-8"])
    raw = raw.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in raw:
        raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not raw.strip():
        raise BadTableError(["is empty"])
    nul = raw.find(b"\0")
    if nul >= 0:
        row = raw.count(b"\n", 0, nul) + 1
        raise BadTableError([f"row {row}: holds NUL bytes; the file is binary or was cut off by a crash"])

    start, row = 0, 1
    while True:  # blank and comment lines before the header
        end = raw.find(b"\n", start)
        end = len(raw) if end < 0 else end
        line = raw[start:end].strip()
        if line and not line.startswith(b"#"):
            break
        if end == len(raw):
            raise BadTableError(["holds comments only"])
        start, row = end + 1, row + 1
    if end - start > 100_000:
        raise BadTableError([f"row {row}: the header is {end - start} bytes long; is this a text table?"])
    names, delimiter = _header(line)
    if len(names) > MAX_COLUMNS:
        raise BadTableError([f"row {row}: {len(names)} columns; the limit is {MAX_COLUMNS}"])
    body = raw[end + 1 :]
    if not body.strip():
        raise BadTableError([f"holds a header ({', '.join(names)[:60]}) but no samples"])
    if all(_is_number(name) for name in names):
        raise BadTableError(
            [f"row {row}: numbers where the header should be; write t[s],x[m],y[m],... above"]
        )
    notes: list[str] = []
    if delimiter != b",":
        if b"," in body and b"." not in body:
            body = body.replace(b",", b".")
            notes.append("decimal commas read as points")
        body = body.replace(b",", b"?").replace(delimiter, b",")
    values = _fast(body, len(names))
    if values is not None:
        return CsvTable(tuple(names), values, np.arange(row + 1, row + 1 + len(values)), tuple(notes))
    values, rows, text = _slow(body, names, row + 1)
    return CsvTable(tuple(names), values, rows, tuple(notes), text)


def _header(line: bytes) -> tuple[list[str], bytes]:
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    delimiter = max((b",", b";", b"\t"), key=lambda mark: line.count(mark))
    try:
        names = next(csv.reader([text], delimiter=delimiter.decode(), skipinitialspace=True))
    except (csv.Error, StopIteration):
        names = text.split(delimiter.decode())
    names = [name.strip() for name in names]
    while len(names) > 1 and not names[-1]:
        names.pop()
    return names, delimiter


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _fast(body: bytes, width: int) -> Floats | None:
    """Numpy's C reader, 0.4 ms for 60 kB; None where the file needs the patient reader.

    np.loadtxt skips blank lines, so row numbers hold only without them."""
    body = body.strip(b"\n ")
    if b"\n\n" in body or b'"' in body or b"\n\t" in body or b"\n " in body:
        return None
    if b",," in body or b",\n" in body or b"\n," in body or body[:1] == b"," or body[-1:] == b",":
        body = body.replace(b",,", b",nan,").replace(b",,", b",nan,")
        body = body.replace(b",\n", b",nan\n").replace(b"\n,", b"\nnan,")
        body = (b"nan" if body[:1] == b"," else b"") + body + (b"nan" if body[-1:] == b"," else b"")
    try:
        values = np.loadtxt(io.BytesIO(body), delimiter=",", comments=None, ndmin=2, dtype=float)
    except ValueError:
        return None
    if values.shape[1] == width + 1 and np.isnan(values[:, -1]).all():
        values = values[:, :-1]  # every row ends with a comma
    return values if values.shape[1] == width and len(values) == body.count(b"\n") + 1 else None


def _slow(
    body: bytes, names: list[str], first: int
) -> tuple[Floats, np.ndarray, dict[int, list[tuple[int, str]]]]:
    """Row by row, so that every problem gets its row; skips blank rows."""
    width = len(names)
    ragged: list[tuple[int, str]] = []
    text: dict[int, list[tuple[int, str]]] = {}
    values: list[list[float]] = []
    rows: list[int] = []
    lines = body.decode("latin-1").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    for row, line in enumerate(lines, first):
        if not line.strip():
            continue
        fields = _split(line)
        if len(fields) == width + 1 and not fields[-1].strip():
            fields.pop()
        if len(fields) != width:
            cut = "; the log seems cut off here, delete the row" if row == first + len(lines) - 1 else ""
            ragged.append((row, f"{len(fields)} fields instead of {width}{cut}"))
            continue
        numbers = []
        for k, item in enumerate(fields):
            value = _number(item)
            if value is None:
                text.setdefault(k, []).append((row, f"{names[k]!r} is {item.strip()[:30]!r}, not a number"))
                value = np.nan
            numbers.append(value)
        values.append(numbers)
        rows.append(row)
    if ragged:
        used = [entry for found in text.values() for entry in found]
        raise BadTableError(summed(ragged, "a wrong number of fields") + summed(sorted(used), "text"))
    return np.array(values, dtype=float).reshape(-1, width), np.array(rows, dtype=int), text


def _split(line: str) -> list[str]:
    if '"' in line:
        try:
            return next(csv.reader([line]))
        except (csv.Error, StopIteration):
            pass
    return line.split(",")


def _number(item: str) -> float | None:
    item = item.strip().strip('"').strip()
    if item.lower() in _MISSING:
        return float("nan")
    if "_" in item:
        return None
    try:
        return float(item)
    except ValueError:
        return None
