"""Where replicates run: in this process, in worker processes, or on a Dask cluster; the numbers are the same.

Takes a function and its tasks, each with all it needs (its seed among it). Gives results as they come or in
the order of the tasks. A worker that is killed costs its task, which runs again. Does not split a task: one
lasts seconds, so that no scheduler is the limit.
"""

from bayesid.executor.executor import HERE, Executor, add_executor, executor_from, executor_of
from bayesid.executor.processes import WorkerError

__all__ = ["HERE", "Executor", "WorkerError", "add_executor", "executor_from", "executor_of"]
