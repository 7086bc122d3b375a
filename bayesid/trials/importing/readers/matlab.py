"""MAT files: version 5 by scipy, version 7.3 (HDF5) by h5py. Structs become names with points, matrices
columns.

Does not: read tables, timetables or objects of MATLAB (export them with `table2struct`, or as CSV or
Parquet).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.trials.importing.raw import ImportLogError, RawChannel, RawLog, Request, SourceOptions
from bayesid.trials.importing.tables import Columns, TimeChoice, channels_of, choose_time
from bayesid.trials.importing.unit_words import split_unit

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
            if not isinstance(item, h5py.Dataset) or name.startswith("#") or item.dtype.kind not in "iuf":
                return
            if item.attrs.get("MATLAB_class", b"") != b"char":
                found.update(_columns_of(name.replace("/", "."), np.asarray(item).T))

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
        raise ImportLogError(
            f"{path}: holds no numeric vectors; tables of MATLAB are saved with table2struct"
        )
    channels: list[RawChannel] = []
    notices: list[str] = []
    start: float | None = None
    words, unit = "", None
    names: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    groups: dict[tuple[str, int], dict[str, np.ndarray]] = {}
    for name, array in found.items():
        groups.setdefault((name.rpartition(".")[0], array.size), {})[name] = array
    clocks_by_size: dict[int, tuple[TimeChoice, dict[str, np.ndarray]]] = {}
    ordered = sorted(groups.items(), key=lambda item: _time_of(item[1], options, path) is None)
    for (_, size), group in ordered:
        data = dict(group)
        choice = _time_of(data, options, path)
        if choice is None and size in clocks_by_size:
            choice, its = clocks_by_size[size]
            data |= its
        if choice is None:
            if size > 2:
                notices.append(f"no time vector of {size} samples for {', '.join(list(group)[:3])}; left out")
            continue
        clocks_by_size.setdefault(size, (choice, {n: data[n] for n in choice.names}))
        columns = Columns(data, {n: split_unit(n.rpartition(".")[2])[1] for n in data})
        more, start, words = channels_of(columns, choice, request, str(path))
        channels += [c for c in more if c.name in group]
        names, unit, doubts = (*names, *choice.names), choice.unit, choice.doubts
    if not channels:
        choose_time(Columns(found), options, str(path))  # says that there is no time
    return RawLog(
        str(path), kind,
            "", tuple(channels), start, words, time_names=tuple(dict.fromkeys(names)), time_unit=unit,
        doubts=tuple(doubts), notices=tuple(notices), text=text,
    )  # fmt: skip


def _time_of(data: dict[str, np.ndarray], options: SourceOptions, path: Path) -> TimeChoice | None:
    """The time among vectors of one length; a member of a struct goes by its own name."""
    if options.time:
        return choose_time(Columns(data), options, str(path)) if set(options.time) <= set(data) else None
    full = {n.rpartition(".")[2]: n for n in data}
    try:
        found = choose_time(Columns({s: data[n] for s, n in full.items()}), options, str(path))
    except ImportLogError:
        return None
    return replace(found, names=tuple(full[n] for n in found.names))
