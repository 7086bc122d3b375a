"""What lies in a folder: logs, a bundle, a map, a vehicle file, a data sheet, a simulator's parameters.

Takes a folder. Gives `Found`. Does not: read a file further than its first part.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bayesid.files import UnreadableError, read_regular
from bayesid.model.vehicles.new import KEYS
from bayesid.trials.importing.raw import ImportLogError, SourceOptions
from bayesid.trials.importing.readers import format_of
from bayesid.trials.importing.readers.text import find_dialect

LOGS = frozenset(
    {".csv", ".txt", ".tsv", ".dat", ".asc", ".log", ".parquet", ".pq", ".mat", ".nc", ".nc4", ".cdf", ".bag",
     ".db3", ".mcap", ".bin", ".tlog", ".ulg"}
)  # fmt: skip
SIMULATORS = frozenset({".sdf", ".urdf", ".xacro", ".scn"})
LARGEST_TOML = 1_000_000  # bytes


@dataclass(frozen=True)
class Found:
    """skipped: (file, why it is no log); damaged: (TOML file, why it cannot be read); vehicles: their files
    nearest to the top."""

    logs: tuple[Path, ...]
    skipped: tuple[tuple[Path, str], ...]
    damaged: tuple[tuple[Path, str], ...]
    bundle: Path | None
    map: Path | None
    vehicles: tuple[Path, ...]
    sheet: Path | None
    simulator: tuple[Path, ...]


def look_into(folder: Path, leave_out: Path | None = None) -> Found:
    """What a folder and the folders below it hold; a single log stands for itself.

    Parameters
    ----------
    leave_out : folder of results, which is not looked into
    """
    files = [folder] if folder.is_file() else list(_files(folder, leave_out))
    logs, skipped = [], []
    for path in files:
        if path.is_dir() or path.suffix.lower() in LOGS:
            why = _no_log(path)
            if why is None:
                logs.append(path)
            else:
                skipped.append((path, why))
    trees, damaged = {}, []
    for path in files:
        if path.suffix.lower() == ".toml":
            tree = _toml(path)
            if isinstance(tree, str):
                damaged.append((path, tree))
            elif tree:
                trees[path] = tree

    def first(*keys: str) -> Path | None:
        return next((p for p, tree in trees.items() if set(keys) <= set(tree)), None)

    return Found(
        tuple(logs),
        tuple(skipped),
        tuple(damaged),
        next((p.parent for p in trees if p.name == "trial.toml"), None),
        first("channels", "sources"),
        _nearest([p for p, tree in trees.items() if {"vehicle", "coef"} <= set(tree)]),
        next((p for p, tree in trees.items() if len(set(tree) & set(KEYS)) >= 3), None),
        tuple(p for p in files if p.suffix.lower() in SIMULATORS),
    )


def _nearest(paths: list[Path]) -> tuple[Path, ...]:
    """Those with the fewest folders above them: what a fit wrote lies below the file that it was given."""
    least = min((len(p.parts) for p in paths), default=0)
    return tuple(p for p in paths if len(p.parts) == least)


def _files(folder: Path, leave_out: Path | None) -> Iterator[Path]:
    """Files in order of name; a folder that is a ROS 2 bag stands for itself."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or (leave_out is not None and path == leave_out):
            continue
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            yield from _files(path, leave_out)
        else:
            yield path


def _no_log(path: Path) -> str | None:
    try:
        if format_of(path) == "csv":
            find_dialect(path, SourceOptions())
    except ImportLogError as error:
        return str(error).removeprefix(f"{path}: ")
    return None


def _toml(path: Path) -> dict[str, object] | str:
    """What the file holds, or why it cannot be read."""
    try:
        return tomllib.loads(read_regular(path, LARGEST_TOML).decode("utf-8-sig"))
    except UnreadableError as error:
        return str(error)
    except (ValueError, RecursionError) as error:
        return f"not valid TOML: {error}"
