"""Where tasks run changes no number, and a worker that is killed costs no more than its task."""

import importlib.util
import os
import pickle
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.executor import HERE, Executor, WorkerError, executor_of
from bayesid.executor.cluster import ANY_PORT, _checked
from bayesid.manoeuvres.standard import zigzag
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import run_manoeuvre, steady_start

TWO = Executor("processes", 2)
needs_dask = pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="extra cluster")


def replicate(model, seed):
    """A truth drawn from the seed of the task, run, and solved for: BLAS, LAPACK and a compiled kernel."""
    rng = np.random.default_rng([5, seed])
    par = model.nominal * (1.0 + 0.01 * rng.standard_normal(model.nominal.size))
    start = steady_start(model)
    track, _ = run_manoeuvre(model, par, zigzag(0.3, 0.3, 1500.0, approach=2.0, duration=30.0, dt=0.5), start)
    a = rng.standard_normal((160, 160)) + track.states[-1, 0]
    return np.linalg.solve(a @ a.T, a[:, 0]), track.states


def fails(task):
    raise BayesidError(f"task {task} cannot be read")


def killed_once(folder, task):
    """Ends its own process at the first try of task 1, as the lack of memory does."""
    flag = Path(folder) / f"{task}-{os.getpid()}"
    flag.touch()
    if task == 1 and len(list(Path(folder).glob("1-*"))) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return task**2


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("remus100"), 3)


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and two workers that run already, as processes of their own."""
    pytest.importorskip("distributed")
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None,
        scheduler_kwargs=ANY_PORT,
    ) as made:  # fmt: skip
        yield made.scheduler_address


def same(one, other):
    return all(
        np.array_equal(a, b) for x, y in zip(one, other, strict=True) for a, b in zip(x, y, strict=True)
    )


def test_a_model_goes_to_another_process_and_back(model):
    again = pickle.loads(pickle.dumps(model))
    assert again.kernel.full.module is model.kernel.full.module and again.digest == model.digest


@pytest.mark.thorough
def test_two_processes_give_the_numbers_of_one_to_the_bit(model):
    work = partial(replicate, model)
    assert same(list(HERE.in_order(work, range(5))), list(TWO.in_order(work, range(5))))


@pytest.mark.thorough
@needs_dask
def test_a_dask_cluster_gives_the_same_numbers_to_the_bit(model, cluster):
    work = partial(replicate, model)
    assert same(list(HERE.in_order(work, range(5))), list(executor_of(cluster).in_order(work, range(5))))


@pytest.mark.thorough
def test_a_killed_worker_costs_its_task_only_and_that_runs_again(tmp_path):
    assert list(TWO.in_order(partial(killed_once, tmp_path), range(4))) == [0, 1, 4, 9]
    tries = sorted(p.name[0] for p in tmp_path.iterdir())
    assert tries == ["0", "1", "1", "2", "3"]


@needs_dask
def test_a_killed_worker_of_a_cluster_costs_its_task_only(tmp_path, cluster):
    assert list(executor_of(cluster).in_order(partial(killed_once, tmp_path), range(4))) == [0, 1, 4, 9]


def span_after(seconds):
    begun = time.monotonic()
    time.sleep(seconds)
    return begun, time.monotonic()


@pytest.mark.thorough
@needs_dask
def test_workers_that_join_later_get_tasks(monkeypatch):
    """As those of a batch system do; with the one there was at first two tasks would be out at a time."""
    from distributed import LocalCluster

    monkeypatch.setattr("bayesid.executor.cluster.COUNT_TIME", 0.2)
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1",
        dashboard_address=None, scheduler_kwargs=ANY_PORT,
    ) as made:  # fmt: skip
        coming = executor_of(made.scheduler_address).as_they_come(span_after, [0.2] * 40)
        next(coming)
        made.scale(4)
        made.wait_for_workers(4)
        spans = [span for _, span in coming]
    assert max(sum(a <= begun < b for a, b in spans) for begun, _ in spans) == 4


def test_a_worker_of_another_version_gives_no_number():
    with pytest.raises(WorkerError, match=r"workers have bayesid .*, here is 0\.0\.1"):
        _checked("0.0.1", abs, 1)


@pytest.mark.thorough
@pytest.mark.parametrize("executor", [HERE, TWO], ids=["here", "processes"])
def test_an_error_of_a_task_is_the_error_of_the_work(executor):
    with pytest.raises(BayesidError, match="task 0 cannot be read"):
        list(executor.in_order(fails, [0]))


@pytest.mark.parametrize("executor", [HERE, TWO], ids=["here", "processes"])
def test_no_task_is_begun_after_the_time_given(executor):
    assert list(executor.as_they_come(abs, [1, 2], until=time.monotonic() - 1.0)) == []


@needs_dask
def test_a_scheduler_that_is_not_there_is_one_sentence(monkeypatch):
    monkeypatch.setattr("bayesid.executor.cluster.CONNECT_TIME", 0.5)
    with pytest.raises(WorkerError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1 "):
        list(executor_of("tcp://127.0.0.1:1").in_order(abs, [1]))


def test_without_dask_the_sentence_says_what_to_install():
    hidden = "import sys; sys.modules['distributed'] = None\n"
    code = hidden + "from bayesid.executor import Executor\nlist(Executor('dask').in_order(abs, [1]))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "pip install 'bayesid[cluster]'" in found.stderr.splitlines()[-1]


@pytest.mark.parametrize("given", [("grid", 1), ("http://x:1", 1), (None, 0)])
def test_an_executor_that_is_none_is_refused(given):
    with pytest.raises(BayesidError, match=r"--executor|--workers"):
        executor_of(*given)
