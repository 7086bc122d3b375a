"""A Parquet file, as pandas, polars or Arrow write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.trials.importing.raw import RawLog, Request, SourceOptions
from bayesid.trials.importing.tables import Columns, channels_of, choose_time


def read_parquet(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """Columns of numbers and times; units from the metadata of a field where it has them."""
    import pyarrow.parquet as pq
    import pyarrow.types as kinds

    file = pq.ParquetFile(path)
    schema = file.schema_arrow
    data: dict[str, np.ndarray] = {}
    units: dict[str, str | None] = {}
    wanted = None
    if request.wanted is not None and options.time:
        wanted = [n for n in schema.names if n in request.wanted or n in options.time]
    stride = 1
    if request.most is not None:
        stride = max(1, -(-file.metadata.num_rows // (2 * request.most)))
    parts: dict[str, list[np.ndarray]] = {}
    for batch in file.iter_batches(batch_size=100_000, columns=wanted):
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            kind = column.type
            if kinds.is_timestamp(kind):
                values = column.cast("timestamp[ns]", safe=False).to_numpy(zero_copy_only=False)
            elif kinds.is_integer(kind) and column.null_count == 0:
                values = column.to_numpy(zero_copy_only=False)
            elif kinds.is_integer(kind) or kinds.is_floating(kind) or kinds.is_boolean(kind):
                values = column.cast("float64", safe=False).to_numpy(zero_copy_only=False)
            elif kinds.is_string(kind) or kinds.is_large_string(kind):
                values = np.array([v or "" for v in column.to_pylist()], dtype=object)
            else:
                continue
            parts.setdefault(name, []).append(values[::stride])
    for field in schema:
        if field.name not in parts:
            continue
        data[field.name] = np.concatenate(parts.pop(field.name))
        stated = (field.metadata or {}).get(b"unit") or (field.metadata or {}).get(b"units")
        units[field.name] = stated.decode("utf-8", "replace") if stated else None
    columns = Columns(data, units)
    choice = choose_time(columns, options, str(path))
    channels, start, words = channels_of(columns, choice, request, str(path))
    return RawLog(
        str(path), "parquet", "", tuple(channels), start, words,
        time_names=choice.names, time_unit=choice.unit, doubts=choice.doubts, thinned=stride,
    )  # fmt: skip
