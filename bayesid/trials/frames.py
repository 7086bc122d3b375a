"""Tables in memory become a `Trial`, by the same checks as files: pandas DataFrames, or dicts of arrays.

Takes columns named as in a CSV log, `psi[deg]`. Does not read files.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import TrialError
from bayesid.trials.bundle import make_trial
from bayesid.trials.stated import Stated
from bayesid.trials.table import BadTableError, CsvTable
from bayesid.trials.trial import Floats, Trial

SOURCE = "trial from frames"


def trial_from_frames(
    frames: Mapping[str, Any],
    vehicle: str | os.PathLike[str] = "",
    *,
    name: str = "",
    columns: Mapping[str, str] | None = None,
    noise: Mapping[str, float] | None = None,
    manoeuvres: Mapping[str, str] | None = None,
    holdout: Iterable[str] = (),
    rudder_positive: str = "port",
    time_repair: str = "none",
    measured_point: tuple[float, float, float] | None = None,
    dof: int | None = None,
) -> Trial:
    """A trial from tables in memory.

    Parameters
    ----------
    frames : name of the run -> DataFrame, or mapping of columns to (n,) arrays. Columns are named
        `name[unit]`: t[s], x[m], y[m], psi[deg], u[m/s], v[m/s], r[deg/s], delta_r_cmd[deg], n_cmd[rpm], ...
    vehicle : built-in name or vehicle file
    columns : wanted name[unit] -> column of the frames, where names differ
    noise : channel, with a unit if it is not SI ("psi[deg]") -> one sigma of white noise
    manoeuvres : run -> words such as "zigzag 10/10"
    holdout : runs kept for judging
    rudder_positive : "port" or "starboard", as in the tables
    time_repair, measured_point, dof : as in trial.toml

    Returns
    -------
    Trial                      SI, rudder port-positive, angles unwrapped

    Raises
    ------
    TrialError                 once, with every problem of the statements and of all tables
    """
    if not isinstance(frames, Mapping) or not frames:
        raise TrialError(f"{SOURCE}: give a mapping of run names to tables, e.g. {{'run01': frame}}")
    kept = {holdout} if isinstance(holdout, str) else set(holdout)
    named = {str(key) for key in frames}
    problems = [
        f"{word}: no run {key!r}; there are {', '.join(sorted(named))}"
        for word, keys in (("holdout", kept), ("manoeuvres", set(manoeuvres or {})))
        for key in sorted(keys - named)
    ]
    tree: dict[str, Any] = {
        "format": 1, "name": name or "trial", "vehicle": os.fspath(vehicle),
        "rudder_positive": rudder_positive, "time_repair": time_repair,
        "columns": dict(columns or {}), "noise": {k: float(v) for k, v in (noise or {}).items()},
        "runs": [
            {
                "file": key, "role": "holdout" if key in kept else "identify",
                "manoeuvre": (manoeuvres or {}).get(key, ""),
            }
            for key in named
        ],
    }  # fmt: skip
    if measured_point is not None:
        tree["measured_point"] = [float(v) for v in measured_point]
    if dof is not None:
        tree["dof"] = dof
    stated = Stated(tree)
    stated.problems += problems
    by_name = {str(key): frame for key, frame in frames.items()}
    entries = {entry.file: entry for entry in stated.runs}
    ordered = [entries[key] for key in by_name if key in entries]
    return make_trial(
        stated, ordered, lambda entry: _table(by_name[entry.file]), Path(), os.fspath(vehicle), SOURCE
    )


def _table(frame: Any) -> CsvTable:
    """One table; text columns keep their problems, missing cells are NaN.

    Raises
    ------
    BadTableError              not a table, or columns of different lengths
    """
    if not hasattr(frame, "keys"):
        raise BadTableError([f"is {type(frame).__name__}; a DataFrame or a mapping of columns is needed"])
    values: list[Floats] = []
    text: dict[int, list[tuple[int, str]]] = {}
    problems: list[str] = []
    names = [str(key) for key in frame.keys()]  # noqa: SIM118 (a DataFrame iterates otherwise in old pandas)
    for k, key in enumerate(frame.keys()):
        column = np.asarray(frame[key])
        if column.ndim != 1:
            problems.append(f"column {names[k]!r} has shape {column.shape}; one number per sample is needed")
            continue
        if column.dtype.kind in "mM":
            problems.append(f"column {names[k]!r} holds dates; give seconds from any zero as t[s]")
            continue
        numbers = np.full(column.size, np.nan)
        for row, item in enumerate(column) if column.dtype.kind not in "biuf" else ():
            try:
                numbers[row] = np.nan if item is None else float(item)
            except (TypeError, ValueError):
                text.setdefault(k, []).append((row, f"{names[k]!r} is {str(item)[:30]!r}, not a number"))
        values.append(column.astype(float) if column.dtype.kind in "biuf" else numbers)
    lengths = sorted({v.size for v in values})
    if not values and not problems:
        problems.append("has no columns")
    if len(lengths) > 1:
        problems.append(f"has columns of {lengths[0]} to {lengths[-1]} samples; all must have as many")
    elif lengths == [0]:
        problems.append(f"holds columns ({', '.join(names)[:60]}) but no samples")
    if problems:
        raise BadTableError(problems)
    return CsvTable(tuple(names), np.column_stack(values), np.arange(lengths[0]), (), text)
