"""Files: written as a whole or not at all, read up to a size only, and results as plain JSON.

Takes text, bytes or nested results (dataclasses, arrays, paths). Keeps machine traces (folders) out of JSON.
Does not choose file names or know what is in a file.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import stat
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from datetime import date, datetime
from enum import Enum
from pathlib import Path
from typing import Any


def write_atomic(path: str | os.PathLike[str], content: str | bytes) -> Path:
    """Replace a file as a whole: readers see the old content or the new, never a part.

    Parameters
    ----------
    path : file to write; missing parent folders are made
    content : text (stored as UTF-8 with newline line ends) or bytes

    Raises
    ------
    OSError
        folder not writable or disk full; the old file is then untouched and no temporary file is left
    """
    target = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:  # a full disk tells no name
        _removed(temporary)
        raise OSError(error.errno, error.strerror, str(target)) from None
    except BaseException:
        _removed(temporary)
        raise
    return target


def _removed(temporary: str) -> None:
    with suppress(OSError):
        os.unlink(temporary)


class UnreadableError(Exception):
    """A file that is none, or larger than it may be; the text says which."""


def read_regular(path: str | os.PathLike[str], limit: int) -> bytes:
    """Content of a regular file no larger than `limit` bytes; a pipe or a device is never waited for.

    Raises
    ------
    UnreadableError
        anything else; the text goes on after the name of the file
    """
    try:
        _check_regular(os.stat(path), limit)
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with open(handle, "rb") as file:
            _check_regular(os.fstat(handle), limit)
            content = file.read(limit + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UnreadableError(f"cannot be read: {reason}") from None
    if len(content) > limit:
        raise UnreadableError(f"is larger than {limit / 2**20:.3g} MB")
    return content


def _check_regular(info: os.stat_result, limit: int) -> None:
    if not stat.S_ISREG(info.st_mode):
        raise UnreadableError("is not a regular file")
    if info.st_size > limit:
        size, allowed = info.st_size / 2**20, limit / 2**20
        raise UnreadableError(f"is {size:.3g} MB, the limit is {allowed:.3g} MB; thin it out or split it")


def read_lines(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """All complete lines of a log, [] if there is none; stops at the first broken one."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return []
    found = []
    for line in text.splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            break
        if not isinstance(entry, dict):
            break
        found.append(entry)
    return found


def write_json(path: str | os.PathLike[str], data: Any) -> Path:
    """Store results as strict JSON, atomically; see `to_plain` for what becomes of them."""
    return write_atomic(path, json_text(data) + "\n")


def json_text(data: Any) -> str:
    """Results as strict JSON text (no NaN literals), indented, lists of numbers on one line."""
    return _layout(to_plain(data), "")


def to_plain(value: Any) -> Any:
    """Results as JSON types.

    Arrays become lists, frozen dataclasses and mappings objects, a path its last part (a folder says where a
    computer keeps things, not what was done), NaN null and infinity the text "inf" or "-inf". The working and
    home folder are cut out of texts.

    Raises
    ------
    TypeError
        for a value that has no JSON form, naming its type
    """
    if value is None or (isinstance(value, bool | int) and not isinstance(value, Enum)):
        return value
    if isinstance(value, str):
        return _without_folders(str(value))
    if isinstance(value, float):
        return _plain_float(float(value))
    if isinstance(value, Enum):
        return to_plain(value.value)
    if isinstance(value, os.PathLike):
        return Path(value).name
    if isinstance(value, datetime | date):
        return value.isoformat()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {_key(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted((to_plain(item) for item in value), key=str)
    if isinstance(value, list | tuple):
        return [to_plain(item) for item in value]
    if hasattr(value, "tolist"):  # numpy arrays and scalars, without importing numpy for plain data
        return to_plain(value.tolist())
    raise TypeError(f"{type(value).__name__} has no JSON form; convert it before it is stored")


def _plain_float(value: float) -> float | str | None:
    if math.isnan(value):
        return None
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return value


def _layout(plain: Any, indent: str) -> str:
    """Indented JSON in which a list of scalars stays on one line, so that a series does not fill pages."""
    inner = indent + "  "
    if isinstance(plain, dict) and plain:
        keys = {key: json.dumps(key, ensure_ascii=False) for key in plain}
        items = [f"{inner}{keys[key]}: {_layout(plain[key], inner)}" for key in plain]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(plain, list) and any(isinstance(item, dict | list) for item in plain):
        return "[\n" + ",\n".join(inner + _layout(item, inner) for item in plain) + f"\n{indent}]"
    return json.dumps(plain, ensure_ascii=False, allow_nan=False)


def _key(key: Any) -> str:
    plain = to_plain(key)
    return plain if isinstance(plain, str) else json.dumps(plain)


def _without_folders(text: str) -> str:
    if "/" not in text and "\\" not in text:
        return text
    for folder, short in ((os.getcwd(), "."), (os.path.expanduser("~"), "~")):
        if len(folder) > 1:
            text = text.replace(folder, short)
    return text


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
