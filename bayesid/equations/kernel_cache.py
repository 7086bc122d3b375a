"""Where printed kernels are kept: find the folder, refuse one others may write to, write what is missing.

Takes a name and, where nothing sound is kept under it, the text. Gives the path of the module. Kernels run as
code, so a folder or file another user could have written is an error, not a cache miss. Does not print
equations (`generate`) or compile (numba, which keeps its part in `__pycache__` beside the module).
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from bayesid.errors import CacheError

_WRITE, _ENTER = stat.S_IWGRP | stat.S_IWOTH, stat.S_IXGRP | stat.S_IXOTH
_ROOT = 0


def cache_folder() -> Path | None:
    """Folder of the printed kernels: below `BAYESID_CACHE`, else below the user's cache folder; None without
    a home."""
    root = os.environ.get("BAYESID_CACHE") or os.environ.get("XDG_CACHE_HOME")
    if not root and not os.environ.get("HOME") and os.name == "posix":
        return None
    try:
        path = Path(root).expanduser() if root else Path.home() / ".cache"
    except RuntimeError:
        return None
    return path.absolute() / "bayesid" / "kernels"


def stored(name: str, text: Callable[[], str]) -> Path:
    """Path of the module `name`, printed if it is missing or not what was written.

    Parameters
    ----------
    name : of the module; equal names mean equal texts
    text : prints the module

    Returns
    -------
    path of the file; in a folder of this process alone (with a warning) where the cache cannot be written

    Raises
    ------
    CacheError
        where another user may write to the cache or to the file; says which and what to do
    """
    folder = cache_folder()
    if folder is None:
        return _in(_private("there is no home folder"), name, text)
    try:
        _open(folder)
        return _in(folder, name, text)
    except OSError as error:
        return _in(_private(f"{folder} cannot be written ({error.strerror or error})"), name, text)


def is_sound(path: Path) -> bool:
    """Whether a printed module is, byte for byte, what was written."""
    try:
        head, _, body = path.read_bytes().partition(b"\n")
    except FileNotFoundError:
        return False
    return head == _head(body)


def refuse_others(path: Path, sticky: bool = False, uid: int | None = None) -> None:
    """Refuse a file or folder another user may write to.

    Parameters
    ----------
    path : file or folder; a missing one passes
    sticky : let a folder pass in which nobody can replace what is not their own, such as /tmp
    uid : of the user who asks, by default the one of the process

    Raises
    ------
    CacheError
        if its owner is another user (the superuser excepted), or group or others may write to it
    """
    if not hasattr(os, "geteuid"):
        return
    try:
        found = path.stat()
    except FileNotFoundError:
        return
    uid = os.geteuid() if uid is None else uid
    if sticky and found.st_mode & stat.S_ISVTX and found.st_uid in (uid, _ROOT):
        return
    if found.st_uid not in (uid, _ROOT):
        fault = f"it belongs to user {found.st_uid} and you are user {uid}"
    elif found.st_mode & _WRITE:
        fault = f"others may write to it (mode {stat.S_IMODE(found.st_mode):03o})"
    else:
        return
    raise CacheError(
        f"{path}: {fault}; compiled kernels are run from there, so it is not used. Remove it (kernels are "
        "printed again when needed), close it with `chmod go-w`, or set BAYESID_CACHE to a folder of your own"
    )


def _open(folder: Path) -> None:
    """Make the folders, closed to others, or check those that are there."""
    root = folder.parent.parent
    root.mkdir(mode=0o700, parents=True, exist_ok=True)
    if os.environ.get("BAYESID_CACHE"):  # a home is its owner's affair
        refuse_others(root, sticky=True)
    for path in (folder.parent, folder, folder / "__pycache__"):
        path.mkdir(mode=0o700, exist_ok=True)
        refuse_others(path)


def _in(folder: Path, name: str, text: Callable[[], str]) -> Path:
    path = folder / f"{name}.py"
    for one in _files(folder, name):
        refuse_others(one)
    if not is_sound(path):
        _write(path, text())
    return path


def _files(folder: Path, name: str) -> Iterator[Path]:
    """The module and what was compiled from it; nothing where nobody else can enter."""
    if folder.stat().st_mode & _ENTER:
        yield folder / f"{name}.py"
        if (folder / "__pycache__").stat().st_mode & _ENTER:
            yield from (folder / "__pycache__").glob(f"{name}.*")


def _write(path: Path, text: str) -> None:
    """Write whole or not at all.

    The time of the file is drawn from its text: numba and Python tell a stale compiled part by time and size,
    and the same text, printed by two processes or once more, is then compiled once.
    """
    body = text.encode()
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(_head(body) + b"\n" + body)
            stream.flush()
            os.fsync(stream.fileno())
        seconds = 10**9 + int(hashlib.sha256(body).hexdigest()[:7], 16)
        os.utime(temporary, (seconds, seconds))
        os.replace(temporary, path)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):  # a full disk tells no name
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise


def _head(body: bytes) -> bytes:
    return b"# SHA-256 of what follows: " + hashlib.sha256(body).hexdigest().encode()


@lru_cache
def _private(reason: str) -> Path:
    """Folder of this process alone, removed at its end."""
    warnings.warn(
        f"kernels are printed and compiled for this process only: {reason}; set BAYESID_CACHE to a folder "
        "you may write to",
        stacklevel=2,
    )
    folder, process = Path(tempfile.mkdtemp(prefix="bayesid-kernels-")), os.getpid()
    (folder / "__pycache__").mkdir(mode=0o700)

    def remove() -> None:
        if os.getpid() == process:  # not in a process forked off
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder
