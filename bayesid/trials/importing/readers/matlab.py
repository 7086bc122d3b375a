"""MAT files: version 5 by scipy, version 7.3 (HDF5) by h5py. Structs become names with points, matrices columns.

Does not: read tables, timetables or objects of MATLAB (export them with `table2struct`, or as CSV or Parquet).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.trials.importing.raw import ImportLogError, RawChannel, RawLog, Request, SourceOptions
from bayesid.trials.importing.tables import Columns, channels_of, choose_time

WIDEST = 64  # columns of a matrix that are read as channels


def read_mat(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """A file of version 4 to 7.2."""
    from scipy.io import loadmat

    tree = loadmat(path, squeeze_me=False, struct_as_record=False, chars_as_strings=True)
    found: dict[str, np.ndarray] = {}
    texts: list[str] = []
    for name, value in tree.items():
        if not name.startswith("__"):
            for key, array in _flat(name, value, texts):
                found[key] = array
    return _log(path, "mat", found, options, request, "\n".join(texts))


def read_mat73(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """A file of version 7.3; its arrays are stored column by column, so they are turned back."""
    import h5py

    found: dict[str, np.ndarray] = {}
    with h5py.File(path, "r") as file:

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not name.startswith("#") and item.dtype.kind in "iuf":
                if item.attrs.get("MATLAB_class", b"") != b"char":
                    for key, array in _columns_of(name.replace("/", "."), np.asarray(item).T):
                        found[key] = array

        file.visititems(visit)
    return _log(path, "mat73", found, options, request, "")


def _flat(name: str, value: Any, texts: list[str]) -> Iterator[tuple[str, np.ndarray]]:
    fields = getattr(value, "_fieldnames", None)
    if fields:
        for key in fields:
            yield from _flat(f"{name}.{key}", getattr(value, key), texts)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        items = list(value.ravel())
        for k, item in enumerate(items[:100]):
            yield from _flat(name if len(items) == 1 else f"{name}({k + 1})", item, texts)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iufb":
        yield from _columns_of(name, value)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "US":
        texts.append(f"{name}: {' '.join(str(v) for v in value.ravel()[:4])}")


def _columns_of(name: str, array: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    array = np.squeeze(array)
    if array.ndim == 1 and array.size > 1:
        yield name, array
    elif array.ndim == 2:
        if array.shape[0] < array.shape[1]:
            array = array.T
        if array.shape[1] <= WIDEST:
            for k in range(array.shape[1]):
                yield f"{name}(:,{k + 1})", array[:, k]


def _log(
    path: Path, kind: str, found: dict[str, np.ndarray], options: SourceOptions, request: Request, text: str
) -> RawLog:
    """Variables of one length and struct share the time vector found among them."""
    if not found:
        raise ImportLogError(f"{path}: holds no numeric vectors; tables of MATLAB are saved with table2struct")
    channels: list[RawChannel] = []
    notices: list[str] = []
    start, words, names, unit, doubts = None, "", (), None, ()
    groups: dict[tuple[str, int], dict[str, np.ndarray]] = {}
    for name, array in found.items():
        groups.setdefault((name.rpartition(".")[0], array.size), {})[name] = array
    failed: ImportLogError | None = None
    clocks_by_size: dict[int, dict[str, np.ndarray]] = {}
    ordered = sorted(groups.items(), key=lambda item: not _has_time(item[1], options, path))
    for (_, size), group in ordered:
        data = dict(group)
        own = SourceOptions(time=tuple(n for n in options.time if n in data) or options.time, clock=options.clock,
                            time_unit=options.time_unit)  # fmt: skip
        try:
            if not _has_time(data, own, path) and size in clocks_by_size:
                data |= clocks_by_size[size]
                own = SourceOptions(time=tuple(clocks_by_size[size]), clock=options.clock, time_unit=options.time_unit)
            shown = {n: n.rpartition(".")[2] for n in data}
            columns = Columns(data, {n: Columns({}).unit(s) for n, s in shown.items()})
            choice = choose_time(columns, own, str(path))
        except ImportLogError as error:
            failed = failed or error
            if size > 2:
                notices.append(f"no time vector of {size} samples for {', '.join(list(group)[:3])}; left out")
            continue
        clocks_by_size.setdefault(size, {n: data[n] for n in choice.names})
        more, start, words = channels_of(columns, choice, request, str(path))
        channels += [c for c in more if c.name in group]
        names, unit, doubts = (*names, *choice.names), choice.unit, choice.doubts
    if not channels and failed is not None:
        raise failed
    return RawLog(
        str(path), kind, "", tuple(channels), start, words, time_names=tuple(dict.fromkeys(names)), time_unit=unit,
        doubts=tuple(doubts), notices=tuple(notices), text=text,
    )  # fmt: skip


def _has_time(data: dict[str, np.ndarray], options: SourceOptions, path: Path) -> bool:
    if options.time:
        return any(n in data for n in options.time)
    shown = {n.rpartition(".")[2]: v for n, v in data.items()}
    try:
        return bool(choose_time(Columns(shown), SourceOptions(), str(path)).names)
    except ImportLogError:
        return False
