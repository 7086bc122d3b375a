"""Tasks in worker processes that end with their parent and leave stopping to it.

Takes a function and tasks. Gives results as they come. Ctrl-C reaches every process of a terminal: here only
the parent hears it. Every worker has a pool of its own, so that one that is killed takes nothing but its own
task with it; that task runs again in a fresh worker.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection
from typing import Any, TypeVar

from bayesid.errors import BayesidError
from bayesid.threads import one_blas_thread

T = TypeVar("T")
R = TypeVar("R")
# Workers one task may cost: an accident strikes another task next time, a lack of memory the same one.
MOST_WORKERS = 3
# Where a signal to all processes ended a worker, it reaches this one within this time [s].
SIGNAL_TIME = 0.2


class WorkerError(BayesidError):
    """Worker processes ended without an answer."""

    exit_code = 1


def in_processes(
    work: Callable[[T], R], tasks: Sequence[T], workers: int, until: float | None = None
) -> Iterator[tuple[int, R]]:
    """Positions and results of tasks as they end; leaving by an exception ends the workers at once.

    Raises
    ------
    WorkerError
        one task ended `MOST_WORKERS` workers
    """
    before = set(multiprocessing.active_children())
    waiting, lost = list(range(len(tasks)))[::-1], [0] * len(tasks)
    idle = [_worker() for _ in range(min(workers, len(tasks)))]
    running: dict[Future[R], tuple[int, ProcessPoolExecutor]] = {}
    try:
        while waiting or running:
            while waiting and idle and (until is None or time.monotonic() < until):
                k, pool = waiting.pop(), idle.pop()
                running[_submitted(pool, work, tasks[k])] = k, pool
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                k, pool = running.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    time.sleep(SIGNAL_TIME)
                    pool.shutdown(wait=False)
                    lost[k] += 1
                    if lost[k] >= MOST_WORKERS:
                        raise WorkerError(_words(k, len(tasks))) from None
                    waiting.append(k)
                    idle.append(_worker())
                    continue
                idle.append(pool)
                yield k, result
    except BaseException:
        for _, pool in running.values():
            pool.shutdown(wait=False, cancel_futures=True)
        for pool in idle:
            pool.shutdown(wait=False)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    for pool in idle:
        pool.shutdown()


def _words(k: int, count: int) -> str:
    return (
        f"{MOST_WORKERS} worker processes in turn were killed at task {k + 1} of {count}, or the memory ran "
        "out; what was finished before is kept: run the same command again, with fewer --workers if memory "
        "is short"
    )


def _submitted(pool: ProcessPoolExecutor, work: Callable[[T], R], task: T) -> Future[R]:
    try:
        return pool.submit(once, work, task)
    except BrokenProcessPool as error:  # its process was killed while it had nothing to do
        found: Future[R] = Future()
        found.set_exception(error)
        return found


def once(work: Callable[[Any], Any], task: Any) -> Any:
    """One task with one thread for linear algebra, as everywhere."""
    return one_blas_thread(work)(task)


def _worker() -> ProcessPoolExecutor:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    pool = ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_worker)
    with interrupts_held():  # the worker inherits this, so that it does not hear Ctrl-C while it starts
        pool.submit(int)
    return pool


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Ctrl-C waits, for this process and those it starts."""
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
