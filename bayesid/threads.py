"""One thread for linear algebra: the matrices here are small.

Takes a function. Gives it with BLAS held to one thread while it runs, whatever the process has set. On two
busy cores a fit of five runs takes 1.3 s of processor time so, and 5 s with a thread per core, which wait for
one another.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
R = TypeVar("R")


def one_blas_thread(function: Callable[P, R]) -> Callable[P, R]:
    """The function, with one thread for linear algebra; the process has its own setting back afterwards."""

    @wraps(function)
    def held(*args: P.args, **kwargs: P.kwargs) -> R:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return held
