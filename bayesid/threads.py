"""Threads: one for linear algebra, whose matrices are small here, and several over the runs of a trial.

Takes functions. Gives them with BLAS held to one thread while they run, whatever the process has set (on two
busy cores a fit of five runs takes 1.3 s of processor time so, and 5 s with a thread per core, which wait for
one another), or what one gives for many things, several at a time where a caller has allowed it
(`several_threads`). Results come in order and are the same numbers: nothing is shared between two runs but
what is locked.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")

_pool: ContextVar[ThreadPoolExecutor | None] = ContextVar("pool", default=None)


def one_blas_thread(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with one thread for linear algebra; the process has its own setting back afterwards."""

    @wraps(function)
    def held(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return held


def processors() -> int:
    """Processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def several_threads(count: int) -> Iterator[None]:
    """`each` takes so many things at a time; it does one after the other with a count of one."""
    if count < 2:
        yield
        return
    with ThreadPoolExecutor(count, thread_name_prefix="run") as pool:
        before = _pool.set(pool)
        try:
            yield
        finally:
            _pool.reset(before)


def each(function: Callable[..., R], *items: Iterable[object]) -> list[R]:
    """What a function gives for each of some things (or pairs, ...), in their order.

    The function may be called in several threads at once (`several_threads`); what it calls in turn runs one
    after the other. The first exception, in order, is raised once all have ended.
    """
    pool, calls = _pool.get(), list(zip(*items, strict=True))
    if pool is None or len(calls) < 2:
        return [function(*call) for call in calls]
    contexts = [copy_context() for _ in calls]
    for context in contexts:
        context.run(_pool.set, None)  # a task that waits for others of its own pool may wait for ever
    waiting = [
        pool.submit(context.run, function, *call) for context, call in zip(contexts, calls, strict=True)
    ]
    try:
        errors = [future.exception() for future in waiting]
    except BaseException:  # Ctrl-C: what has not begun need not run before it ends
        for future in waiting:
            future.cancel()
        raise
    for error in errors:
        if error is not None:
            raise error
    return [future.result() for future in waiting]
