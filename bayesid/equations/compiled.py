"""Compiled parts that cannot be read are compiled anew; those that cannot be kept are used all the same.

Takes a printed module. numba writes its compiled parts without flushing them to the disk: after a power cut
it meets an empty file and stops with an error of pickle; on a full disk it stops as it saves.
"""

from __future__ import annotations

import pickle
from contextlib import suppress
from types import ModuleType
from typing import Any

from numba.core.caching import FunctionCache

_DAMAGED = (pickle.UnpicklingError, EOFError, ValueError, TypeError, KeyError, AttributeError, ImportError)


class _Forgiving(FunctionCache):
    """numba's cache of one function; a damaged file is as good as none."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (*_DAMAGED, OSError):
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with suppress(OSError):
            super().save_overload(sig, data)


def forgive(module: ModuleType) -> None:
    """Let the functions of a printed module survive a damaged cache; without effect where numba does not
    cache this way."""
    for function in vars(module).values():
        if type(getattr(function, "_cache", None)) is FunctionCache:
            function._cache = _Forgiving(function.py_func)
