"""Where a trial and a result lie, as a command line takes them, for the commands that a text proposes.

Takes paths as they were given. Gives words of a shell, in capitals what nobody gave. Does not read files.
"""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

UNKNOWN = "BUNDLE"


@dataclass(frozen=True)
class Places:
    """Words for the commands a text proposes.

    Attributes
    ----------
    bundle : of the trial
    folder : of the result; empty where none is written
    data, vehicle, effects : options `--data`, `--vehicle` and `--effects` with their values; empty where they
        were not given
    """

    bundle: str = UNKNOWN
    folder: str = "THIS_FOLDER"
    data: str = ""
    vehicle: str = ""
    effects: str = ""

    @property
    def trial(self) -> str:
        """The bundle, and where its logs are if they are elsewhere."""
        return f"{self.bundle}{self.data}"

    @property
    def fitted(self) -> str:
        """The same with the vehicle that was given beside it."""
        return f"{self.trial}{self.vehicle}"

    def beside(self, name: str) -> str:
        """A folder to propose: that name, or the next free one, in the bundle; FOLDER where none is known."""
        if self.bundle == UNKNOWN:
            return "FOLDER"
        (bundle,) = shlex.split(self.bundle)
        inside = Path(bundle).parent if Path(bundle).is_file() else Path(bundle)
        folder, number = inside / name, 1
        while folder.exists():
            number += 1
            folder = inside / f"{name}_{number}"
        return shlex.quote(os.fspath(folder))

    def written(self, folder: str | os.PathLike[str]) -> Places:
        """The same of a result that is written into a folder."""
        return replace(self, folder=shlex.quote(os.fspath(folder)))


NOWHERE = Places()


def places_of(
    trial: Any,
    folder: str | os.PathLike[str] | None,
    data: str | os.PathLike[str] | None = None,
    vehicle: Any = None,
    effects: str | os.PathLike[str] | None = None,
) -> Places:
    """Places of a result of a trial that was given by its bundle, or is an object and lies nowhere."""
    named = isinstance(vehicle, str | os.PathLike)
    return Places(
        shlex.quote(os.fspath(trial)) if isinstance(trial, str | os.PathLike) else UNKNOWN,
        "" if folder is None else shlex.quote(os.fspath(folder)),
        "" if data is None else f" --data {shlex.quote(os.fspath(data))}",
        f" --vehicle {shlex.quote(os.fspath(vehicle))}" if named else "",
        "" if effects is None else f" --effects {shlex.quote(os.fspath(effects))}",
    )
