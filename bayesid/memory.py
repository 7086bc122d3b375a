"""How much memory there is for this process, and that what it frees goes back.

Gives bytes, or None where the system does not tell.
"""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from pathlib import Path

CGROUP = Path("/sys/fs/cgroup")
UNLIMITED = 2**60
# Arrays from this size on are mapped one by one, and so much is kept at the end of the heap.
LARGE, KEPT = 2**20, 2**24
# numbers of the GNU C library's mallopt, and its variables
_SETTINGS = (("MALLOC_MMAP_THRESHOLD_", -3, LARGE), ("MALLOC_TRIM_THRESHOLD_", -1, KEPT))


def available_memory() -> int | None:
    """Bytes this process may still take: free ones, and those its limits leave."""
    found = [_free(), _of_group(), _of_limit()]
    known = [x for x in found if x is not None]
    return min(known) if known else None


def give_back_freed() -> None:
    """Have freed arrays leave this process and those it starts (GNU C library; elsewhere nothing is done).

    Left to itself the library moves arrays of up to 32 MB into its heap, of which nothing goes back while
    anything small behind them is in use. A variable that is set is kept.
    """
    for name, number, size in _SETTINGS:
        if name in os.environ:
            continue
        with suppress(OSError, AttributeError, TypeError):
            if ctypes.CDLL(None).mallopt(number, size):
                os.environ[name] = str(size)


def taken_memory() -> int:
    """Bytes this process holds; 0 where the system does not tell."""
    with suppress(OSError, ValueError, IndexError, AttributeError):
        return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def _free() -> int | None:
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text("ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    with suppress(OSError, ValueError, AttributeError):
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def _of_group() -> int | None:
    """What a container leaves; the cache of files nobody reads goes as soon as memory is wanted."""
    with suppress(OSError, ValueError):
        most = int((CGROUP / "memory.max").read_text("ascii"))
        taken = int((CGROUP / "memory.current").read_text("ascii")) - _cache_of_group()
        return most - taken if most < UNLIMITED else None
    return None


def _cache_of_group() -> int:
    with suppress(OSError, ValueError, IndexError):
        for line in (CGROUP / "memory.stat").read_text("ascii").splitlines():
            if line.startswith("inactive_file "):
                return int(line.split()[1])
    return 0


def _of_limit() -> int | None:
    """What `ulimit -v` leaves."""
    with suppress(ImportError, OSError, ValueError, IndexError):
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most in (resource.RLIM_INFINITY, -1):
            return None
        taken = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * os.sysconf("SC_PAGE_SIZE")
        return max(most - taken, 0)
    return None
