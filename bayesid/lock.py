"""One command at a time writes into a folder: a lock file that tells process, host, command and start.

Takes a folder. A lock whose process has ended is taken over; that of a living process, or of another host, is
an error. Does not wait, and does not keep readers out.
"""

from __future__ import annotations

import atexit
import json
import os
import socket
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bayesid.errors import BayesidError

try:
    import fcntl
except ImportError:  # not on Windows; process and host in the file must do
    fcntl = None  # type: ignore[assignment]

LOCK = ".bayesid.lock"


class LockError(BayesidError):
    """Another command writes into the folder."""


class _Lock:
    """A lock this process holds, and how often."""

    def __init__(self, file: Path, handle: int, made: bool, command: str) -> None:
        self.file, self.handle, self.made, self.count, self.owner = file, handle, made, 1, os.getpid()
        self.command = command

    def release(self) -> None:
        if self.owner == os.getpid():  # a forked child is not the holder
            with suppress(OSError):
                self.file.unlink()
            if self.made:
                with suppress(OSError):  # a folder made for nothing goes again; one with results stays
                    self.file.parent.rmdir()
        with suppress(OSError):
            os.close(self.handle)


_held: dict[Path, _Lock] = {}


def lock(folder: str | os.PathLike[str], command: str) -> str | None:
    """Take the lock of a folder, which is made if missing; `release` or `release_all` gives it back.

    Parameters
    ----------
    command : told to whoever finds the folder locked

    Returns
    -------
    A sentence about the lock of an ended process that was taken over, None otherwise.

    Raises
    ------
    LockError
        a living process, or one of another host, holds it
    OSError
        the folder cannot be made or written
    """
    place = Path(folder).resolve()
    if place in _held:
        _held[place].count += 1
        return None
    made = not place.exists()
    place.mkdir(parents=True, exist_ok=True)
    file = place / LOCK
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        try:
            free = _system_lock(handle)
            before = _read(handle)
            if free is False or (before is not None and _may_live(before, proof=free is True)):
                raise LockError(_busy(place, before))
            if not _same_file(handle, file):  # its holder removed it in between
                os.close(handle)
                continue
            _write(handle, command)
        except BaseException:
            os.close(handle)
            raise
        _held[place] = _Lock(file, handle, made, command)
        return None if before is None else _ended(place, before)


def lock_or_exit(folder: str | os.PathLike[str], script: str) -> None:
    """`lock` for a script: a folder in use ends it with one sentence and exit code 2; freed at its end."""
    try:
        remark = lock(folder, f"python {script}")
    except LockError as error:
        print(f"bayesid: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    atexit.register(release, folder)
    if remark is not None:
        print(f"note: {remark}", file=sys.stderr)


def holder(folder: str | os.PathLike[str]) -> str | None:
    """The command under which this process holds a folder; None where it does not."""
    held = _held.get(Path(folder).resolve())
    return None if held is None or held.owner != os.getpid() else held.command


def left_behind(folder: str | os.PathLike[str]) -> str | None:
    """The command of an ended process whose lock still lies in a folder; None where there is none.

    Reads only: the lock stays for whoever takes it over.
    """
    place = Path(folder).resolve()
    if place in _held:
        return None
    try:
        handle = os.open(place / LOCK, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return None
    try:
        free, before = _system_lock(handle), _read(handle)
    finally:
        os.close(handle)  # gives the system's lock back
    if free is False or before is None or _may_live(before, proof=free is True):
        return None
    return str(before["command"])


def release(folder: str | os.PathLike[str]) -> None:
    """Give a lock back; nothing happens where there is none."""
    place = Path(folder).resolve()
    held = _held.get(place)
    if held is not None:
        held.count -= 1
        if held.count <= 0:
            _held.pop(place).release()


def release_all() -> None:
    """Give every lock of this process back."""
    while _held:
        _held.popitem()[1].release()


def _system_lock(handle: int) -> bool | None:
    """Whether the system lends its own lock of the file, which falls with the process, however that ends;
    None where it has none."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without such locks
        return None
    return True


def _same_file(handle: int, file: Path) -> bool:
    try:
        there, mine = os.stat(file), os.fstat(handle)
    except OSError:
        return False
    return (there.st_dev, there.st_ino) == (mine.st_dev, mine.st_ino)


def _read(handle: int) -> dict[str, Any] | None:
    os.lseek(handle, 0, os.SEEK_SET)
    try:
        found = json.loads(os.read(handle, 4096))
        return {"pid": int(found["pid"]), **{k: str(found[k]) for k in ("host", "command", "since", "born")}}
    except (ValueError, KeyError, TypeError):  # empty or torn: whoever began to write it did not get far
        return None


def _write(handle: int, command: str) -> None:
    owner = {
        "pid": os.getpid(), "host": socket.gethostname(), "command": command, "born": _born(os.getpid()),
        "since": datetime.now(UTC).replace(microsecond=0).isoformat().replace("+00:00", "Z"),
    }  # fmt: skip
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, json.dumps(owner).encode())


def _born(pid: int) -> str:
    """Start of a process in ticks of the system, so that a number used again is not taken for its first."""
    words = _status(pid)
    return words[19] if len(words) > 19 else ""


def _status(pid: int) -> list[str]:
    """State, parent, ... of a process as the system tells them; empty where it does not."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
        return status.rsplit(")", 1)[1].split()
    except (OSError, IndexError):
        return []


def _may_live(holder: dict[str, Any], proof: bool) -> bool:
    """Whether the holder may still be at work; one of another host cannot be asked.

    Parameters
    ----------
    proof : the system lent its lock, which no process of this host holds then
    """
    if holder["host"] != socket.gethostname():
        return True
    if proof or _status(holder["pid"])[:1] == ["Z"]:  # ended, and its parent has not asked how
        return False
    if os.name != "posix":
        return True
    try:
        os.kill(holder["pid"], 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    now = _born(holder["pid"])
    return not (now and holder["born"]) or now == holder["born"]


def _who(holder: dict[str, Any]) -> str:
    return f"`{holder['command']}` (process {holder['pid']} on {holder['host']}, since {holder['since']})"


def _busy(place: Path, holder: dict[str, Any] | None) -> str:
    if holder is None:
        return f"{place.name}: another command has just begun to write there; choose another folder"
    if holder["host"] != socket.gethostname() or os.name != "posix":
        return (
            f"{place.name}: {_who(holder)} writes there, and whether it still runs cannot be seen from here; "
            f"choose another folder, or delete {place.name}/{LOCK} if it has ended"
        )
    return f"{place.name}: {_who(holder)} writes there; wait until it has ended, or choose another folder"


def _ended(place: Path, holder: dict[str, Any]) -> str:
    return f"{place.name}: {_who(holder)} ended without giving its lock back; the lock is taken over"
