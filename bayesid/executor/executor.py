"""The executor that commands and studies take: one name, one number of workers.

Takes `here`, `processes`, `dask` or the address of a Dask scheduler. Gives an `Executor`.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from bayesid.errors import BayesidError
from bayesid.threads import one_blas_thread

T = TypeVar("T")
R = TypeVar("R")

ADDRESSES = ("tcp://", "tls://")
NAMES = ("here", "processes", "dask")


@dataclass(frozen=True)
class Executor:
    """Where tasks run.

    Attributes
    ----------
    where : one of `NAMES`, or the address of a running Dask scheduler
    workers : worker processes; of a running scheduler those it has count instead
    """

    where: str = "here"
    workers: int = 1

    def as_they_come(
        self, work: Callable[[T], R], tasks: Sequence[T], until: float | None = None
    ) -> Iterator[tuple[int, R]]:
        """Positions and results of tasks in the order in which they end.

        Parameters
        ----------
        work : a function other processes can import, or a partial of one
        until : `time.monotonic()` [s] after which no task is begun

        Raises
        ------
        WorkerError
            one task ended its worker several times, or the cluster is out of reach
        """
        if not tasks:
            return
        if self.where == "here":
            once = one_blas_thread(work)
            for k, task in enumerate(tasks):
                if until is not None and time.monotonic() >= until:
                    return
                yield k, once(task)
        elif self.where == "processes":
            from bayesid.executor.processes import in_processes

            yield from in_processes(work, tasks, self.workers, until)
        else:
            from bayesid.executor.cluster import on_cluster

            yield from on_cluster(work, tasks, self.where, self.workers, until)

    def in_order(self, work: Callable[[T], R], tasks: Sequence[T]) -> Iterator[R]:
        """Results in the order of the tasks, each as soon as those before it are there."""
        found: dict[int, R] = {}
        following = 0
        for k, result in self.as_they_come(work, tasks):
            found[k] = result
            while following in found:
                yield found.pop(following)
                following += 1


HERE = Executor()


def executor_of(where: str | None = None, workers: int | None = None) -> Executor:
    """The executor of an option `--executor` and an option `--workers`.

    Without a name several workers are processes of this machine, and one is this process.

    Raises
    ------
    BayesidError
        an unknown name, or no worker
    """
    count = 1 if workers is None else int(workers)
    if count < 1:
        raise BayesidError(f"--workers {count}: at least one worker is needed")
    if where is None:
        return Executor("processes", count) if count > 1 else HERE
    if where in NAMES or where.startswith(ADDRESSES):
        return Executor(where, count)
    listed = ", ".join(NAMES)
    raise BayesidError(
        f"--executor {where!r}: not known; give {listed}, or the address of a Dask scheduler such as "
        "tcp://127.0.0.1:8786"
    )


def add_executor(parser: ArgumentParser, workers: int = 1) -> None:
    """The options of a study; `workers` where none are asked for."""
    words = "this one alone" if workers == 1 else str(workers)
    parser.add_argument(
        "--workers", "--jobs", type=int, default=workers, help=f"worker processes; default: {words}"
    )
    parser.add_argument("--executor", help="processes, dask, or tcp://host:port of a Dask scheduler")


def executor_from(given: Namespace) -> Executor:
    """The executor that the options of a study ask for."""
    return executor_of(given.executor, given.workers)
