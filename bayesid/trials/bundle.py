"""A folder on disk becomes a `Trial`: trial.toml is read, checked and every run it names is assembled.

Takes the folder or trial.toml, and optionally another folder where the logs are kept.
Does not: read the vehicle file, or anything outside the two folders.
"""

from __future__ import annotations

import os
import shlex
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.errors import TrialError, raise_all
from bayesid.model.channels import channel
from bayesid.trials.assemble import assemble
from bayesid.trials.correction import apply, without_effect
from bayesid.trials.health import check_run, check_runs
from bayesid.trials.paths import safe_path
from bayesid.trials.stated import RunEntry, Stated
from bayesid.trials.table import BadTableError, CsvTable, parse_table, read_bytes
from bayesid.trials.trial import Run, Trial
from bayesid.trials.window import window
from bayesid.words import decimal_comma

BUILTIN = Path(__file__).parent / "builtin"


def load_trial(path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None) -> Trial:
    """Read a trial bundle.

    Parameters
    ----------
    path : folder of the bundle or its trial.toml, or the name of a built-in bundle ("example")
    data : folder that holds the logs where they are kept outside the bundle; a run's `file` is looked up
        there, and in the subfolder of the bundle's name

    Returns
    -------
    Trial                      SI, rudder port-positive, angles unwrapped; what looked odd is in `warnings`

    Raises
    ------
    TrialError                 once, with every problem of trial.toml and of all its files
    """
    path = Path(path)
    try:
        path = _builtin(path)
        toml = path if path.suffix == ".toml" or path.is_file() else path / "trial.toml"
        if not toml.exists():
            raise TrialError(
                f"{toml}: does not exist; a trial is a folder with a trial.toml, or the name of a built-in "
                f"one ({', '.join(builtin_trials())}); `bayesid trial import LOG... --out NEW` makes one of "
                "logs"
            )
        raw = read_bytes(toml, limit=2**20)
    except BadTableError as error:
        raise_all(TrialError, str(toml), error.problems)
    except (OSError, RuntimeError, ValueError) as error:
        raise TrialError(f"{str(path)[:200]!r}: cannot be read: {error}") from None
    return _load(raw, toml, None if data is None else Path(data))


def builtin_trials() -> tuple[str, ...]:
    """Names of the bundles that come with the package."""
    return tuple(sorted(p.parent.name for p in BUILTIN.glob("*/trial.toml")))


def _builtin(path: Path) -> Path:
    """Folder of a built-in bundle where the path is its bare name and no bundle of that name lies here."""
    here = path.is_file() or (path / "trial.toml").exists()
    return BUILTIN / path if not here and str(path) in builtin_trials() else path


def _load(raw: bytes, toml: Path, data: Path | None) -> Trial:
    try:
        tree = tomllib.loads(raw.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise TrialError(f"{toml}: is not UTF-8 text (byte {error.start})") from None
    except (tomllib.TOMLDecodeError, ValueError) as error:
        if toml.suffix.lower() != ".toml":
            raise TrialError(
                f"{toml}: is no trial.toml; `bayesid trial import {shlex.quote(str(toml))} --out NEW` makes "
                "a bundle of a log"
            ) from None
        raise TrialError(f"{toml}: is not valid TOML: {error}{decimal_comma(raw, error)}") from None
    except RecursionError:
        raise TrialError(f"{toml}: is not valid TOML: nested too deeply") from None
    stated = Stated(tree)
    folder = toml.parent
    vehicle = _vehicle(stated, folder)
    _some_are_there(stated, folder, data, str(toml))
    seen: dict[Path, str] = {}

    def table_of(entry: RunEntry) -> CsvTable:
        found = _find(entry.file, folder, data, stated.data_hint)
        if found in seen:
            raise BadTableError([f"is the same file as {seen[found]}"])
        seen[found] = entry.file
        return parse_table(read_bytes(found))

    return make_trial(stated, stated.runs, table_of, folder, vehicle, str(toml))


def make_trial(
    stated: Stated,
    entries: Sequence[RunEntry],
    table_of: Callable[[RunEntry], CsvTable],
    folder: Path,
    vehicle: str,
    source: str,
) -> Trial:
    """A trial from what is stated and a table per run.

    Parameters
    ----------
    table_of : reads the table of a run; may raise BadTableError
    vehicle : reference kept in the trial
    source : what an error names as the place

    Raises
    ------
    TrialError                 once, with every problem
    """
    runs: list[Run] = []
    logged: list[Run] = []
    problems = stated.problems
    warnings = stated.warnings
    for entry in entries:
        try:
            with np.errstate(all="ignore"):
                table = table_of(entry)
                run = assemble(table, stated.reading, entry.name, entry.manoeuvre, entry.role, entry.notes)
                if entry.window is not None:
                    run = replace(window(run, *entry.window), began=None)  # a run of its own
                logged.append(run)
                run = apply(stated.correction, run)
                notices = check_run(run)
        except BadTableError as error:
            problems += [f"{entry.file}: {problem}" for problem in error.problems]
            continue
        except TrialError as error:
            problems.append(str(error))
            continue
        run = replace(run, warnings=run.warnings + tuple(notices))
        warnings += [f"{entry.file}: {text}" for text in run.warnings]
        runs.append(run)
    if len(logged) == len(entries):  # a run that cannot be read may log what is missed
        problems += without_effect(stated.correction, logged)
    if problems:
        raise_all(TrialError, source, problems)
    if not any(run.role == "identify" for run in runs):
        warnings.append('no run has the role "identify"; there is nothing to fit')
    with np.errstate(all="ignore"):
        warnings += check_runs(runs)
    dof = stated.dof or (6 if any(_vertical(run) for run in runs) else 3)
    return Trial(
        name=stated.name or folder.resolve().name,
        folder=folder,
        vehicle_ref=vehicle,
        dof=dof,
        runs=tuple(runs),
        noise=stated.noise,
        environment=stated.environment,
        measured_point=stated.measured_point,
        rudder_positive=stated.reading.rudder_positive,
        attribution=stated.attribution,
        warnings=tuple(warnings),
    )


def _vertical(run: Run) -> bool:
    names = (*run.data, *run.commands, *run.measured_inputs)
    return any(channel(name).vertical for name in names)


def _some_are_there(stated: Stated, folder: Path, data: Path | None, source: str) -> None:
    """Refuse a bundle of several runs of which no log is to be found: one sentence instead of one per run."""
    if len(stated.runs) < 2:
        return
    said = []
    for entry in stated.runs:
        try:
            _find(entry.file, folder, data, stated.data_hint)
            return
        except BadTableError as error:
            said += error.problems
    if len(set(said)) == 1:
        stated.problems.append(f"each of its {len(stated.runs)} logs, {stated.runs[0].file} first, {said[0]}")
        raise_all(TrialError, source, stated.problems)


def _find(name: str, folder: Path, data: Path | None, hint: str) -> Path:
    roots = [folder] if data is None else [data, data / folder.resolve().name, folder]
    found = [safe_path(root, name) for root in roots]
    for place in found:
        try:
            if place.exists():
                return place
        except OSError as error:
            raise BadTableError([f"cannot be read: {error.strerror}"]) from None
    if data is not None:
        raise BadTableError([f"does not exist in {data} or in the bundle"])
    kept = f"; the logs of this trial are kept elsewhere: pass data=FOLDER (--data). {hint}" if hint else ""
    raise BadTableError([f"does not exist in {folder}{kept}"])


def _vehicle(stated: Stated, folder: Path) -> str:
    name = stated.vehicle
    if not name:
        stated.warnings.append("trial.toml names no vehicle; a fit will need one")
        return ""
    try:
        found = safe_path(folder, name)
    except BadTableError as error:
        stated.problems += [f"vehicle {name[:80]!r} {problem}" for problem in error.problems]
        return ""
    if found.is_file():
        return str(folder / name)
    if name.endswith(".toml"):
        stated.problems.append(f"vehicle {name!r} does not exist in {folder}")
    return name
