"""Tasks on a Dask cluster: one started here for the time of the work, or one that runs already.

Takes a function and tasks. Gives results as they come. Needs the extra `cluster`. Dask runs the task of a
lost worker again by itself; a lost scheduler is one error in words, what was finished before is for the
caller to have kept. For tls:// the certificates are those of Dask's own configuration.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import bayesid
from bayesid.executor.processes import WorkerError, interrupts_held, once

T = TypeVar("T")
R = TypeVar("R")
# A scheduler that answers does so well within this time [s].
CONNECT_TIME = 20.0
# Tasks handed over per worker: the next one is there when one ends.
AHEAD = 2
# How often the number of workers is asked for [s]: a batch system starts them one after another.
COUNT_TIME = 5.0
# Dask's own is 8787 and warns a second cluster on the same machine of it.
ANY_PORT = {"dashboard_address": "127.0.0.1:0"}


def on_cluster(
    work: Callable[[T], R], tasks: Sequence[T], where: str, workers: int, until: float | None = None
) -> Iterator[tuple[int, R]]:
    """Positions and results of tasks as they end.

    Raises
    ------
    WorkerError
        Dask is missing, the cluster is out of reach or has another version of bayesid, or one task ended
        several workers
    """
    try:
        from distributed import as_completed
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise WorkerError(
            f"--executor {where} needs Dask: pip install 'bayesid[cluster]', or use --workers N alone"
        ) from None
    with _client(where, workers) as client:
        room = _Room(client)
        following, number = iter(enumerate(tasks)), {}

        def begin() -> Any:
            """The next task handed over; None after the last."""
            if until is not None and time.monotonic() >= until:
                return None
            pair = next(following, None)
            if pair is None:
                return None
            future = client.submit(_checked, bayesid.__version__, work, pair[1], pure=False)
            number[future.key] = pair[0]
            return future

        first = [f for _ in range(room.now()) if (f := begin()) is not None]
        coming = as_completed(first, raise_errors=False)
        try:
            for future in coming:
                try:
                    result = future.result(timeout=CONNECT_TIME)
                except KilledWorker:
                    k = number[future.key] + 1
                    raise WorkerError(
                        f"several workers of {where} ended at task {k} of {len(tasks)}, or their memory ran "
                        "out; what was finished before is kept"
                    ) from None
                if future.cancelled():
                    raise WorkerError(_gone(where))
                k = number.pop(future.key)
                while len(number) < room.now() and (more := begin()) is not None:
                    coming.add(more)
                yield k, result
        except (OSError, TimeoutError) as error:
            raise WorkerError(f"{_gone(where)} ({error})") from None
        except Exception as error:
            if type(error).__name__ in ("CancelledError", "FutureCancelledError"):
                raise WorkerError(_gone(where)) from None
            raise


def _gone(where: str) -> str:
    return (
        f"the scheduler {where} was lost before all tasks were done; what was finished before is kept: run "
        "the same command again"
    )


class _Room:
    """How many tasks may be handed over at once; workers that join later count."""

    def __init__(self, client: Any) -> None:
        self._client, self._asked, self._count = client, -math.inf, 0

    def now(self) -> int:
        if time.monotonic() - self._asked >= COUNT_TIME:
            self._asked = time.monotonic()
            self._count = AHEAD * max(1, len(self._client.nthreads()))
        return self._count


def _checked(version: str, work: Callable[[T], R], task: T) -> R:
    """One task, on a worker with the same bayesid: one that joined later was not asked at the start."""
    import bayesid as there

    if there.__version__ != version:
        raise WorkerError(_other_version([there.__version__], version))
    return once(work, task)


@contextmanager
def _client(where: str, workers: int) -> Iterator[Any]:
    """Client of a cluster of this machine that ends with the work, or of one that runs."""
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.ERROR)
    if where == "dask":
        with (
            dask.config.set({"distributed.worker.daemon": True}),
            interrupts_held(),
        ):  # workers inherit this: Ctrl-C is the parent's
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1",
                dashboard_address=None, scheduler_kwargs=ANY_PORT, memory_limit=0, silence_logs=logging.ERROR,
            )  # fmt: skip
        with cluster, Client(cluster) as client:
            yield client
        return
    try:
        client = Client(where, timeout=CONNECT_TIME)
    except (OSError, ValueError, TimeoutError) as error:
        raise WorkerError(
            f"no Dask scheduler answers at {where} within {CONNECT_TIME:g} s ({type(error).__name__}); start "
            "one with `dask scheduler` and `dask worker`, or use --executor dask"
        ) from None
    with client:
        _check(client, where)
        yield client


def _check(client: Any, where: str) -> None:
    """Workers there are, with this version of bayesid: others would not give the same numbers."""
    try:
        found = client.run(_version)
    except ImportError as error:
        raise WorkerError(f"a worker of {where} cannot import bayesid ({error}); install it there") from None
    if not found:
        raise WorkerError(f"the scheduler {where} has no worker; start one with `dask worker {where}`")
    others = sorted({v for v in found.values() if v != bayesid.__version__})
    if others:
        raise WorkerError(f"{where}: {_other_version(others, bayesid.__version__)}")


def _other_version(others: list[str], here: str) -> str:
    return f"workers have bayesid {', '.join(others)}, here is {here}; install one version everywhere"


def _version() -> str:
    import bayesid as there

    return there.__version__
