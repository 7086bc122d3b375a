"""Which file a name in a bundle means, and that it is in the bundle.

Takes a folder and a name written by someone else.
Does not: open anything.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from bayesid.trials.table import BadTableError

LONGEST_NAME = 255  # bytes, of every common file system


def safe_path(folder: Path, name: str) -> Path:
    """Resolved path of a file inside a folder.

    Raises
    ------
    BadTableError              absolute path, a way out of the folder (also by a link), or a loop of links
    """
    parts = PurePosixPath(name.replace("\\", "/")).parts
    long = any(len(part.encode("utf-8", "replace")) > LONGEST_NAME for part in parts)
    if not name.strip() or "\0" in name or len(name) > 1000 or long:
        raise BadTableError(["is not a file name"])
    if name.startswith(("/", "\\")) or ".." in parts or (len(name) > 1 and name[1] == ":"):
        raise BadTableError(["points outside the bundle; give a path relative to trial.toml"])
    try:
        root = folder.resolve()
        found = (root / Path(*parts)).resolve()
        if not found.is_relative_to(root):
            raise BadTableError(["is a link to a place outside the bundle; copy the file instead"])
        return found
    except (OSError, RuntimeError, ValueError) as error:
        raise BadTableError([f"cannot be followed ({error})"]) from None
