"""Compiled parts that cannot be read are compiled anew; those that cannot be kept are used all the same; and
one process compiles what several need.

Takes a printed module. numba writes its compiled parts without flushing them to the disk: after a power cut
it meets an empty file and stops with an error of pickle; on a full disk it stops as it saves. Processes that
start together would each compile the same function, a minute of each for a ship by MMG.
"""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core.caching import FunctionCache

try:
    import fcntl
except ImportError:  # not on Windows, where each process compiles for itself
    fcntl = None  # type: ignore[assignment]

_DAMAGED = (pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, AttributeError, ImportError)
# After so long [s] whoever compiles is taken to be stopped, and the function is compiled here too.
_LONGEST_WAIT, _LOOK_AGAIN = 600.0, 0.1


class _Forgiving(FunctionCache):
    """numba's cache of one function; a damaged file is as good as none, and another process that compiles
    the function is waited for."""

    def __init__(self, py_func: Any) -> None:
        super().__init__(py_func)
        self._turn = _Turn(Path(self.cache_path) / f"{py_func.__module__}.{py_func.__qualname__}.lock")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._kept(sig, target_context)
        if found is None and self._turn.take():
            found = self._kept(sig, target_context)
            if found is not None:
                self._turn.give()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)

    def in_turn(self, compile_: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """`compile` of the function, after which the turn is given, whether it came to an end or not."""

        def compiled(sig: Any) -> Any:
            try:
                return compile_(sig)
            finally:
                self._turn.give()

        return compiled

    def _kept(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (*_DAMAGED, OSError):
            with suppress(OSError):
                self.flush()
            return None


class _Turn:
    """The turn to compile one function, which one process of a machine has at a time; it ends with it."""

    def __init__(self, file: Path) -> None:
        self._file, self._handle = file, -1

    def take(self) -> bool:
        """Wait for the turn; whether another process had it, or ended, so that the cache is worth a look."""
        if fcntl is None or self._handle >= 0:
            return False
        try:
            self._handle = os.open(self._file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        except OSError:  # a cache that cannot be written is nobody's
            return False
        until = time.monotonic() + _LONGEST_WAIT
        while time.monotonic() < until:
            try:
                fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return True
            except BlockingIOError:
                time.sleep(_LOOK_AGAIN)
            except OSError:  # no locks on this disk
                break
        self.give()
        return True

    def give(self) -> None:
        """End the turn."""
        if self._handle >= 0:
            with suppress(OSError):
                fcntl.flock(self._handle, fcntl.LOCK_UN)  # a forked child has the handle too
            with suppress(OSError):
                os.close(self._handle)
            self._handle = -1


def forgive(module: ModuleType) -> None:
    """Let the functions of a printed module survive a damaged cache, and be compiled by one process alone;
    without effect where numba does not cache this way."""
    for function in vars(module).values():
        if type(getattr(function, "_cache", None)) is FunctionCache:
            function._cache = _Forgiving(function.py_func)
            function.compile = function._cache.in_turn(function.compile)
