"""Joined runs become a trial bundle: a CSV per run, trial.toml, provenance.json and the map itself.

Does not: write into a folder that holds a trial, unless told to.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import TrialError
from bayesid.files import write_atomic
from bayesid.model.channels import CHANNELS, channel
from bayesid.trials.correction import Correction
from bayesid.trials.importing.joining import Joined
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.raw import ImportLogError
from bayesid.trials.importing.readers import digest_of
from bayesid.trials.importing.unit_words import positive_side
from bayesid.trials.schema import write_schema
from bayesid.trials.trial import Trial
from bayesid.trials.write import copy_vehicle, file_names, toml_text

PART = 20_000  # rows turned into text at a time
_ORDER = {row.name: k for k, row in enumerate(CHANNELS)}


def write_bundle(
    found: LogMap,
    runs: Sequence[Joined],
    origin: tuple[float, float, float] | None,
    folder: Path,
    map_file: Path | None,
    overwrite: bool = False,
    correction: Correction | None = None,
) -> Path:
    """Write the bundle.

    Parameters
    ----------
    correction : [corrections] of trial.toml in place of those of the map

    Returns
    -------
    Path                       of trial.toml

    Raises
    ------
    ImportLogError             the folder holds a trial already, a table would go over a log it is made of, or
                               a file of the map does not exist
    """
    target = folder / "trial.toml"
    if target.exists() and not overwrite:
        raise ImportLogError(f"{folder}: holds a trial already; choose another folder or delete it")
    folder.mkdir(parents=True, exist_ok=True)
    vehicle = found.vehicle
    if vehicle.endswith(".toml"):
        beside = (map_file.parent if map_file else Path()) / vehicle
        if not beside.is_file():
            raise ImportLogError(
                f"vehicle {vehicle!r} of the map does not exist beside it; put it there, or "
                "give it by --vehicle"
            )
        copy_vehicle(beside, folder)
        vehicle = "vehicle.toml"
    files = file_names(joined.run.name for joined in runs)
    refuse_logs(runs, files, folder)
    for joined, file in zip(runs, files, strict=True):
        _write_csv(joined, folder / file)
    write_atomic(
        target, write_schema(folder) + trial_toml(found, runs, files, vehicle, correction=correction)
    )
    told = provenance(runs, files, origin)
    told["corrections_of_map"] = [] if found.corrections is None else list(found.corrections.lines(digits=15))
    # by these an import that is carried out again knows what was edited since
    told["written"] = {name: digest_of(folder / name) for name in (target.name, *files)}
    write_atomic(folder / "provenance.json", json.dumps(told, indent=1) + "\n")
    if map_file is not None and map_file.resolve() != (folder / "map.toml").resolve():
        shutil.copyfile(map_file, folder / "map.toml")
    return target


def refuse_logs(runs: Sequence[Joined], files: Sequence[str], folder: Path) -> None:
    """Nothing where none of some files is a log that runs are made of.

    Raises
    ------
    ImportLogError             one is
    """
    logs = {log for joined in runs for log in joined.logs if log.exists()}
    for file in files:
        # by the file and not by what is in it: a table of an import holds what a log of the same format does
        if (folder / file).is_file() and any((folder / file).samefile(log) for log in logs):
            raise ImportLogError(
                f"{folder / file}: is one of the logs, and a run would be written over it; choose another "
                "folder, or another name for the run"
            )


def provenance(
    runs: Sequence[Joined], files: Sequence[str], origin: tuple[float, float, float] | None
) -> dict[str, Any]:
    """Where every channel of every run is from, as plain data."""
    return {
        "format": 1,
        "origin": None
        if origin is None
        else {"latitude_deg": origin[0], "longitude_deg": origin[1], "height_m": origin[2]},
        "rudder_side_in_header": any(
            positive_side(series)
            for joined in runs
            for name in ("delta_r", "delta_r_cmd")
            if name in joined.origins
            for series in joined.origins[name].series
        ),
        "runs": [
            {
                "file": file,
                "sources": dict(joined.digests),
                "start_utc": None
                if joined.start is None
                else datetime.fromtimestamp(joined.start, UTC).isoformat(),
                "window_s": joined.run.window,
                "notices": [*joined.notices, *joined.stamps],
                "channels": {
                    name: {
                        "from": list(joined.origins[name].series),
                        "conversion": joined.origins[name].conversion,
                        "readings": int(np.isfinite(joined.data[name]).sum()),
                        "cells_lost": joined.origins[name].lost,
                    }
                    for name in sorted(joined.data, key=_ORDER.__getitem__)
                },
            }
            for joined, file in zip(runs, files, strict=True)
        ],
    }


def _write_csv(joined: Joined, path: Path) -> None:
    names = sorted(joined.data, key=_ORDER.__getitem__)
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(["t[s]", *(f"{name}[{channel(name).unit}]" for name in names)]) + "\n")
        columns = [joined.t, *(joined.data[name] for name in names)]
        for first in range(0, joined.t.size, PART):
            cells = [
                ["" if value != value else repr(value) for value in column[first : first + PART].tolist()]
                for column in columns
            ]
            file.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))


def trial_toml(
    found: LogMap,
    runs: Sequence[Joined],
    files: Sequence[str],
    vehicle: str,
    columns: Mapping[str, str] | None = None,
    correction: Correction | None = None,
) -> str:
    """Text of a trial.toml.

    Parameters
    ----------
    columns : channel[unit] -> column, where the files are the raw ones; runs then keep their windows
    correction : what is done to their numbers; None for the [corrections] of the map
    """
    lines = [
        "format = 1",
        f"name = {toml_text(found.name or files[0].removesuffix('.csv'))}",
    ]
    if vehicle:
        lines.append(f"vehicle = {toml_text(vehicle)}")
    if found.dof:
        lines.append(f"dof = {found.dof}")
    lines.append(f'rudder_positive = "{found.rudder_positive}"')
    if found.measured_point:
        lines.append(f"measured_point = {list(found.measured_point)}")
    if found.attribution:
        lines.append(f"attribution = {toml_text(found.attribution)}")
    if columns:
        lines += ["", "[columns]", *(f"{toml_text(k)} = {toml_text(v)}" for k, v in columns.items())]
    correction = found.corrections if correction is None else correction
    if correction is not None and correction.lines():
        lines += ["", "[corrections]", *correction.lines(digits=15)]
    for key, table in (("noise", found.noise), ("environment", found.environment)):
        if table:
            lines += ["", f"[{key}]", *(f"{toml_text(k)} = {v!r}" for k, v in table.items())]
    for joined, file in zip(runs, files, strict=True):
        run = joined.run
        window = "" if run.window is None else f", {run.window[0]:g} to {run.window[1]:g} s"
        made = "" if columns else f"imported from {', '.join(run.files)}{window}"
        notes = "; ".join(text for text in (run.notes, made) if text)
        lines += [
            "", "[[runs]]", f"file = {toml_text(file)}", f"manoeuvre = {toml_text(run.manoeuvre)}",
            f'role = "{run.role}"',
        ]  # fmt: skip
        if columns and run.window is not None:
            lines.append(f"window = [{run.window[0]!r}, {run.window[1]!r}]")
        if notes:
            lines.append(f"notes = {toml_text(notes)}")
    return "\n".join(lines) + "\n"


def check_bundle(folder: Path) -> Trial:
    """The bundle as its reader reads it.

    Raises
    ------
    TrialError                 it cannot be read: the map lacks something
    """
    from bayesid.trials.bundle import load_trial

    try:
        return load_trial(folder)
    except TrialError as error:
        raise TrialError(f"{error}\nChange the map and give the command again.") from None
