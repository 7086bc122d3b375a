"""What of a log's handedness is known apart from its numbers, which are the same in a mirror.

Takes the folder of a bundle. Does not: look at readings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Handedness:
    """geographic: positions come from latitude and longitude, which nobody counts the other way; side_stated:
    the side of a positive rudder was stated, not taken from the turns."""

    geographic: bool = False
    side_stated: bool = False


UNKNOWN = Handedness()


def handedness(folder: Path) -> Handedness:
    """As the provenance of an import says; a bundle without one states the side itself."""
    if not (folder / "trial.toml").is_file():
        return UNKNOWN
    try:
        said = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return Handedness(side_stated=True)
    if not isinstance(said, Mapping):
        return Handedness(side_stated=True)
    return Handedness(said.get("origin") is not None, said.get("rudder_side_in_header") is True)
