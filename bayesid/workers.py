"""Worker processes that end with their parent and leave stopping to it.

Takes a count. Ctrl-C reaches every process of a terminal: here only the parent hears it. A worker that is
killed is one error in words; what was finished before is for the caller to have kept.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection

from bayesid.errors import BayesidError


class WorkerError(BayesidError):
    """A worker process ended without an answer."""

    exit_code = 1


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Pool of `count` fresh processes; leaving it by an exception ends them at once.

    Raises
    ------
    WorkerError
        a worker was killed or ran out of memory
    """
    before = set(multiprocessing.active_children())
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    pool = ProcessPoolExecutor(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker
    )
    try:
        with _interrupts_held():  # workers inherit this, so that none hears Ctrl-C while it starts
            for _ in range(count):
                pool.submit(int)
        yield pool
    except BrokenProcessPool:
        time.sleep(0.2)  # where a signal to all processes was the cause, it reaches this one as a stop
        _end(pool, before)
        raise WorkerError(
            f"one of {count} worker processes was killed, or the memory ran out; what was finished before is "
            "kept: run the same command again, with fewer --jobs if memory is short"
        ) from None
    except BaseException:
        _end(pool, before)
        raise
    pool.shutdown()


def _end(pool: ProcessPoolExecutor, before: set[multiprocessing.process.BaseProcess]) -> None:
    pool.shutdown(wait=False, cancel_futures=True)
    for child in set(multiprocessing.active_children()) - before:
        child.terminate()


@contextmanager
def _interrupts_held() -> Iterator[None]:
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)


def _begin_worker() -> None:
    """In a worker: leave Ctrl-C to the parent, and end when the parent does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
