"""What SIGINT (Ctrl-C) and SIGTERM do: one sentence and exit code 128 + signal, whatever is at work.

A library may turn a stop into an error of its own, or swallow it: the stop is remembered and wins.

Loads nothing but the standard library, so that it listens before anything else is imported.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import NoReturn

STOPPED = "stopped before it was done"
KEPT = (
    "; --out holds what was written until then, if anything: the same command goes on from there "
    "(sample with --resume)"
)
TIDY = 2.0  # s at most for giving back what other processes share
# s in which a stop unwinds; after them a library has swallowed it (an `except` of everything, a callback or a
# destructor, where Python drops it), and the process ends where it is: files are written whole or not at all
GRACE = 10.0
_asked: int | None = None
_at_work: list[threading.Thread] = []  # held, since a thread that ends is listed no more while it tidies up


class Stopped(KeyboardInterrupt):
    """The user or the system asked for an end; unwinds like Ctrl-C."""


def listen() -> None:
    """From now on both signals end the work in good order; for the main thread of the command line."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _on_signal)


def text() -> str:
    """What is said of a stop: where a folder was named for the results, that it is kept."""
    named = any(word.split("=")[0] in ("--out", "-o") for word in sys.argv[1:])
    return STOPPED + (KEPT if named else "")


def code() -> int:
    """Exit code of what was asked for: 143 after SIGTERM, 130 otherwise."""
    return 128 + (_asked or signal.SIGINT)


def asked() -> bool:
    """Whether an end was asked for: whatever goes wrong after it, a library made of the stop."""
    return _asked is not None


def leave(status: int) -> NoReturn:
    """End the process; after a stop at once, so that threads and workers at work are not waited for."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _at_once)
    if _asked is not None:
        _end(status)
    sys.exit(status)


def _on_signal(number: int, frame: FrameType | None) -> None:
    global _asked, _at_work
    _asked, _at_work = number, threading.enumerate()
    threading.excepthook = _nothing  # a thread whose workers were ended has no error of its own to tell
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, _at_once)
    if _importing(frame):  # an interrupted import surfaces as any error, or as none; nothing is half done yet
        _at_once(number, frame)
    late = threading.Timer(GRACE, _at_once, (number, None))
    late.daemon = True
    with suppress(RuntimeError):  # no thread is to be had: the stop unwinds without a watch
        late.start()
    raise Stopped


def _at_once(number: int, frame: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, f"bayesid: {text()}\n".encode())
    _end(128 + number)


def _end(status: int) -> NoReturn:
    # A module may be half imported: what it lacks yet has nothing to give back.
    getattr(sys.modules.get("bayesid.lock"), "release_all", _nothing)()
    if "multiprocessing.resource_tracker" in sys.modules:
        for child in getattr(sys.modules.get("multiprocessing"), "active_children", tuple)():
            child.terminate()
        # Semaphores go back, else their tracker warns after the last word. Within an import this may hang.
        tidy = threading.Thread(target=atexit._run_exitfuncs, daemon=True)
        tidy.start()
        last = time.monotonic() + TIDY
        # a thread of a pool may be giving back one of them at this moment
        for thread in (tidy, *filter(_of_a_pool, _at_work)):
            with suppress(RuntimeError):  # one that has not begun yet holds nothing
                thread.join(max(0.0, last - time.monotonic()))
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, RuntimeError):
            stream.flush()
    os._exit(status)


def _of_a_pool(thread: threading.Thread) -> bool:
    kind = type(thread).__module__
    pool = kind.startswith("concurrent.futures") or thread.name.startswith("QueueFeederThread")
    return pool and thread is not threading.current_thread()


def _nothing(*_: object) -> None:
    """Stands in for what is not there yet, or has nothing to say."""


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
