"""Whether two folders hold the same results.

Takes two folders and patterns of files. Gives the names of those that differ by more than times.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# Numbers that say when and how fast, not what.
STAMPS = frozenset({"seconds", "shares", "clock", "cpu_seconds", "wall_seconds", "started", "sealed", "stamp",
                    "made", "created", "time", "seal"})  # fmt: skip
# The same in a report in words.
TOOK = re.compile(r"^Written .*$|Processor time: \d+ s", re.MULTILINE)


def different(one: Path, other: Path, files: Sequence[str]) -> list[str]:
    """Names of files, of patterns, that differ by more than stamps."""
    out = []
    for pattern in files:
        names = sorted(p.relative_to(one) for p in one.glob(pattern))
        if not names:
            out.append(f"{pattern}: not written")
        out += [f"{n}: differs" for n in names if _content(one / n) != _content(other / n)]
    return out


def _content(path: Path) -> Any:
    if not path.exists():
        return None
    if path.suffix == ".json":
        return _bare(json.loads(path.read_text(encoding="utf-8")))
    if path.suffix in (".npz", ".nc", ".h5"):
        return _arrays(path)
    if path.suffix == ".md":
        return TOOK.sub("", path.read_text("utf-8"))
    return path.read_bytes()


def _bare(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _bare(v) for k, v in value.items() if k not in STAMPS}
    return [_bare(v) for v in value] if isinstance(value, list) else value


def _arrays(path: Path) -> dict[str, bytes]:
    import h5py
    import numpy as np

    if path.suffix == ".npz":
        with np.load(path) as kept:
            return {n: kept[n].tobytes() for n in kept.files}
    found: dict[str, bytes] = {}

    def take(name: str, kept: Any) -> None:
        if hasattr(kept, "dtype"):
            values = kept[()]
            # of texts an array holds addresses
            found[name] = repr(values.tolist()).encode() if values.dtype == object else values.tobytes()

    with h5py.File(path) as file:
        file.visititems(take)
    return found
