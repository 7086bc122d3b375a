"""A trial becomes a folder again: trial.toml and one CSV per run, so that reading gives the same trial.

Takes a `Trial`; writes SI and radians, rudder port-positive, shortest decimals that read back exactly.
Does not: write into a folder that already holds another trial, unless told to.
"""

from __future__ import annotations

import re
import shutil
import tomllib
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from bayesid.errors import TrialError
from bayesid.model.channels import CHANNELS, channel, is_channel
from bayesid.trials.correction import Correction
from bayesid.trials.paths import safe_path
from bayesid.trials.schema import write_schema
from bayesid.trials.table import BadTableError
from bayesid.trials.trial import Floats, Run, Trial

LONGEST_STEM = 200  # bytes; file systems take names of 255
_ORDER = {row.name: k for k, row in enumerate(CHANNELS)}


def write_trial(trial: Trial, folder: str | Path, overwrite: bool = False, schema: bool = True) -> Path:
    """Write a bundle; a vehicle file the trial refers to is copied into it.

    Parameters
    ----------
    schema : write trial.schema.json beside and name it in the first line, for editors

    Returns
    -------
    Path                       of trial.toml

    Raises
    ------
    TrialError                 the folder holds a trial.toml and `overwrite` is not set, or cannot be written
    """
    folder = Path(folder)
    target = folder / "trial.toml"
    if not overwrite:
        refuse_trial(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        vehicle = trial.vehicle_ref
        if vehicle and Path(vehicle).is_file():
            copy_vehicle(Path(vehicle), folder)
            vehicle = "vehicle.toml"
        files = file_names(run.name for run in trial.runs)
        for run, file in zip(trial.runs, files, strict=True):
            (folder / file).write_text(run_csv(run), encoding="utf-8", newline="\n")
        head = write_schema(folder) if schema else ""
        target.write_text(head + _toml(trial, vehicle, files), encoding="utf-8", newline="\n")
    except OSError as error:
        raise TrialError(f"{folder}: cannot be written: {error.strerror}") from None
    return target


def refuse_trial(folder: Path) -> None:
    """Nothing where a folder holds no trial.

    Raises
    ------
    TrialError                 it holds one
    """
    if (folder / "trial.toml").exists():
        raise TrialError(f"{folder}: holds a trial already; choose another folder or delete it")


def copy_vehicle(vehicle: Path, folder: Path) -> None:
    """The vehicle file and, where its prior names one, the covariance file beside it."""
    files = {vehicle: folder / "vehicle.toml"}
    try:
        tree = tomllib.loads(vehicle.read_text(encoding="utf-8-sig"))
        name = tree["prior"]["covariance"]
        files[safe_path(vehicle.parent, name)] = safe_path(folder, name)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, BadTableError):
        pass  # no such file is named, or the vehicle is not one: its own reader will say so
    for source, target in files.items():
        if source.is_file() and not (target.exists() and target.samefile(source)):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def run_csv(run: Run) -> str:
    """The run as CSV text, header `name[unit]`, inside units; missing samples are empty."""
    series: dict[str, Floats] = {}
    for group in ("data", "commands", "measured_inputs", "exogenous", "propulsion"):
        series |= getattr(run, group)
    for name, first in run.known_from.items():
        if name in series:
            series[name] = np.where(run.t < first, np.nan, series[name])
    names = ["t", *sorted(series, key=_ORDER.__getitem__)]
    header = [f"{name}[{channel(name).unit}]" for name in names]
    columns = [run.t, *(series[name] for name in names[1:])]
    for text, values in run.extra.items():
        if is_channel(text.split("[")[0].strip()) or not text:
            text = f"extra {text}"
        text = " ".join(text.split())
        header.append('"' + text.replace('"', '""') + '"' if re.search(r'[,";]', text) else text)
        columns.append(values)
    cells = [["" if np.isnan(value) else repr(value) for value in column.tolist()] for column in columns]
    lines = [",".join(header), *(",".join(row) for row in zip(*cells, strict=True))]
    return "\n".join(lines) + "\n"


def file_names(runs: Iterable[str]) -> list[str]:
    """A file for each run, told apart where capitals are not; a bundle takes the names of its runs from it.

    Letters of any script stay.
    """
    names: list[str] = []
    for run in runs:
        stem = file_stem(run) or "run"
        name, k = f"{stem}.csv", 2
        while name.lower() in {other.lower() for other in names}:
            name, k = f"{stem}_{k}.csv", k + 1
        names.append(name)
    return names


def file_stem(text: str) -> str:
    """Letters, digits, points and hyphens of a text, the rest as underlines; empty where none is left."""
    stem = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFC", text)).strip("._")[:100]
    return stem.encode()[:LONGEST_STEM].decode(errors="ignore")


def _toml(trial: Trial, vehicle: str, files: list[str]) -> str:
    lines = ["format = 1", f"name = {toml_text(trial.name)}"]
    if vehicle:
        lines.append(f"vehicle = {toml_text(vehicle)}")
    lines.append(f"dof = {trial.dof}")
    if any(trial.measured_point):
        lines.append(f"measured_point = [{', '.join(repr(float(v)) for v in trial.measured_point)}]")
    if trial.attribution:
        lines.append(f"attribution = {toml_text(trial.attribution)}")
    if trial.noise:
        lines += ["", "[noise]", *(f"{name} = {float(sigma)!r}" for name, sigma in trial.noise.items())]
    if trial.environment is not None:
        lines += ["", "[environment]"]
        for key in ("force_rms", "nav_drift"):
            value = getattr(trial.environment, key)
            if value is not None:
                lines.append(f"{key} = {float(value)!r}")
    for run, file in zip(trial.runs, files, strict=True):
        lines += ["", "[[runs]]", f"file = {toml_text(file)}", f"manoeuvre = {toml_text(run.manoeuvre)}"]
        lines.append(f'role = "{run.role}"')
        notes = "; ".join(text for text in (run.notes, *run.provenance) if text)
        if notes:
            lines.append(f"notes = {toml_text(notes)}")
    lines += _orders_that_act_before(trial, files)
    return "\n".join(lines) + "\n"


def _orders_that_act_before(trial: Trial, files: Sequence[str]) -> list[str]:
    """The table of corrections that says so, of some runs or of all."""
    told = [run for run in trial.runs if run.acts_before]
    if not told:
        return []
    late = dict(told[0].acts_before)
    if any(run.acts_before != late for run in told):
        raise TrialError(f"{trial.name}: orders that act at other times in other runs cannot be written")
    named = tuple(Path(file).stem for run, file in zip(trial.runs, files, strict=True) if run.acts_before)
    concerned = () if len(told) == len(trial.runs) else named
    return ["", "[corrections]", *Correction(late=late, runs=concerned).lines(digits=17)]


def toml_text(value: str) -> str:
    """A TOML basic string."""
    out = []
    for char in value:
        if char in '"\\':
            out.append("\\" + char)
        elif ord(char) < 32 or ord(char) == 127:
            out.append(f"\\u{ord(char):04x}")
        else:
            out.append(char)
    return '"' + "".join(out) + '"'
