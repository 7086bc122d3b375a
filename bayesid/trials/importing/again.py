"""An import carried out again in its own folder, by the map that lies there and was corrected.

Takes the joined runs. The new bundle is made and read in a folder aside before anything is replaced; what
goes wrong on the way leaves the old one as it was. Only tables and lists of the earlier import are replaced,
by the digests it kept, and the vehicle where the map names the file of another; what was edited since is put
aside under another name, and [corrections] written into it by hand are kept where the map has none.
Does not touch the map or anything else in the folder.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesid.errors import TrialError
from bayesid.trials.correction import Correction, read_correction
from bayesid.trials.importing.bundle_out import check_bundle, refuse_logs, write_bundle
from bayesid.trials.importing.joining import Joined
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.raw import ImportLogError
from bayesid.trials.importing.readers import digest_of

TRIAL, PROVENANCE, MAP = "trial.toml", "provenance.json", "map.toml"
_KEPT = (
    "\nIts [corrections] are those of trial.toml as it is, since the map has none; an empty table "
    "[corrections] in the map leaves them out."
)
LISTS = (TRIAL, PROVENANCE, "trial.schema.json")


@dataclass(frozen=True)
class Replaced:
    """What became of the earlier import.

    Attributes
    ----------
    tables : written, under new names or in place of earlier ones
    removed : tables of the earlier import that no run is made of any more
    aside : (file that was edited since, name under which it is kept)
    left : tables of the earlier import that are no run any more and may have been edited
    vehicle : files of another vehicle, which the map names
    results : folders inside with results of the earlier trial
    kept : lines of [corrections] that the earlier trial.toml had by hand, kept as the map has no such table
    lost : those that are not kept, as the map has a table of its own
    """

    tables: tuple[str, ...]
    removed: tuple[str, ...]
    aside: tuple[tuple[str, str], ...]
    left: tuple[str, ...]
    vehicle: tuple[str, ...]
    results: tuple[str, ...]
    kept: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()


def may_import_again(folder: Path, map_file: Path | None) -> bool:
    """Whether the map is the folder's own and the trial in it came from an import."""
    own = map_file is not None and map_file.resolve() == (folder / MAP).resolve()
    return own and _before(folder) is not None


def import_again(
    found: LogMap,
    runs: Sequence[Joined],
    origin: tuple[float, float, float] | None,
    folder: Path,
    map_file: Path,
) -> Replaced:
    """Replace the trial of an earlier import.

    Raises
    ------
    ImportLogError
        a table would go over a file that no import wrote or over a log, or something cannot be written
    TrialError
        the new bundle cannot be read
    """
    before = _before(folder)
    if before is None:
        raise ImportLogError(f"{folder}: holds no trial that an import wrote")
    own = _corrections_by_hand(folder, before)
    keep = own if found.corrections is None else None
    with tempfile.TemporaryDirectory(dir=folder, prefix=".import_") as place:
        new = Path(place) / folder.resolve().name
        write_bundle(found, runs, origin, new, map_file, correction=keep)
        try:
            check_bundle(new)
        except TrialError as error:
            of_it = "" if keep is None else _KEPT
            raise TrialError(str(error).replace(str(new), str(folder)) + of_it) from None
        tables = tuple(row["file"] for row in _read(new / PROVENANCE)["runs"])
        earlier, digests = {row["file"] for row in before["runs"]}, before.get("written", {})
        for name in tables:
            if name not in earlier and (folder / name).exists():
                raise ImportLogError(
                    f"{folder / name}: is there and no import wrote it, while a run of the map has its name; "
                    f"rename the run or the file"
                )
        # a table that no run is made of any more goes as well
        refuse_logs(runs, sorted(earlier | set(tables)), folder)
        vehicle = _another_vehicle(folder, new, tables)
        changed = [
            name for name in (TRIAL, *tables, *vehicle)
            if (folder / name).exists() and digests.get(name) != (digest := digest_of(folder / name))
            and digest != digest_of(new / name)
        ]  # fmt: skip
        gone = sorted(name for name in earlier - set(tables) if (folder / name).exists())
        removed = tuple(name for name in gone if digests.get(name) == digest_of(folder / name))
        aside = tuple((name, _free_name(folder, name, tables)) for name in changed)
        _exchange(folder, new, Path(place) / "before", (*tables, *LISTS, *vehicle), removed, dict(aside))
    results = tuple(sorted(p.parent.name for p in folder.glob("*/results.json")))
    left = tuple(name for name in gone if name not in removed)
    hand = () if own is None or own == found.corrections else own.lines(digits=15)
    kept, lost = (hand, ()) if keep is not None else ((), hand)
    return Replaced(tables, removed, aside, left, vehicle, results, kept, lost)


def corrected_channels(folder: Path, names: Iterable[str]) -> tuple[str, ...]:
    """Names of the channels of a bundle after its [corrections] have dropped and renamed some."""
    table = tomllib.loads((folder / TRIAL).read_text(encoding="utf-8-sig")).get("corrections", {})
    found = read_correction(table, []) if isinstance(table, dict) else Correction()
    return tuple(found.rename.get(n, n) for n in names if n not in found.drop)


def _corrections_by_hand(folder: Path, before: dict[str, Any]) -> Correction | None:
    """[corrections] of trial.toml that are not those of the map it was imported by; None where there are none
    or they cannot be read."""
    try:
        table = tomllib.loads((folder / TRIAL).read_text(encoding="utf-8-sig")).get("corrections", {})
    except (OSError, ValueError, RecursionError):
        return None
    problems: list[str] = []
    found = read_correction(table, problems)
    lines = list(found.lines(digits=15))
    return None if problems or not lines or lines == before.get("corrections_of_map", []) else found


def _before(folder: Path) -> dict[str, Any] | None:
    """provenance.json of the import that made a folder; None where there is none."""
    try:
        found = _read(folder / PROVENANCE)
        named = all(
            isinstance(row["file"], str) and Path(row["file"]).name == row["file"] for row in found["runs"]
        )
        told = isinstance(found.get("written", {}), dict) and "origin" in found
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return found if named and told and (folder / TRIAL).is_file() else None


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _another_vehicle(folder: Path, new: Path, tables: Sequence[str]) -> tuple[str, ...]:
    """Files of the vehicle that are not in the folder as the new bundle has them."""
    own = {*tables, *LISTS, MAP}
    found = (path.relative_to(new).as_posix() for path in sorted(new.rglob("*")) if path.is_file())
    return tuple(
        name for name in found if name not in own
        and not ((folder / name).is_file() and digest_of(folder / name) == digest_of(new / name))
    )  # fmt: skip


def _free_name(folder: Path, name: str, tables: Sequence[str]) -> str:
    stem, dot, suffix = name.rpartition(".")
    number, taken = 1, {table.lower() for table in tables}
    while (folder / (free := f"{stem}.replaced{number}{dot}{suffix}")).exists() or free.lower() in taken:
        number += 1
    return free


def _exchange(
    folder: Path, new: Path, old: Path, names: Sequence[str], removed: Sequence[str], aside: dict[str, str]
) -> None:
    """New files in place of old ones; where anything fails, all as it was."""
    old.mkdir()
    moved: list[str] = []
    try:
        for name in names:
            for place in (folder, old):
                (place / name).parent.mkdir(parents=True, exist_ok=True)
        for name in (*names, *removed):
            if (folder / name).exists():
                moved.append(name)
                os.replace(folder / name, old / name)
        for name in names:
            os.replace(new / name, folder / name)
        for name, kept in aside.items():
            shutil.copyfile(old / name, folder / kept)
    except BaseException as error:
        for name in names:
            if not (new / name).exists():
                (folder / name).unlink(missing_ok=True)
        for name in aside.values():
            (folder / name).unlink(missing_ok=True)
        for name in moved:
            if (old / name).exists():
                os.replace(old / name, folder / name)
        if isinstance(error, OSError):
            raise ImportLogError(
                f"{folder}: cannot be written ({error.strerror}); nothing was replaced"
            ) from None
        raise
