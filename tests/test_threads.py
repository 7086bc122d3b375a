"""Runs taken several at a time give what they give one after the other."""

import os
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid.api.diagnose import threads_of
from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.hypotheses.localisation import locate
from bayesid.diagnosis.hypotheses.sensitivity_bank import build_bank
from bayesid.diagnosis.input import as_read
from bayesid.diagnosis.input import memory_needed as needed
from bayesid.errors import TrialError
from bayesid.estimation.filter_error.regressor_columns import _kept
from bayesid.threads import each, processors, several_threads

THREADS = 3


def test_results_come_in_order_whichever_ends_first():
    later = threading.Event()

    def work(k):
        if k == 0:
            assert later.wait(10.0)  # ends last
        else:
            later.set()
        return k

    with several_threads(2):
        assert each(work, range(2)) == [0, 1]


def test_one_thread_is_the_thread_that_asks():
    here = threading.get_ident()
    assert each(lambda _: threading.get_ident(), range(3)) == [here] * 3
    with several_threads(1):
        assert each(lambda _: threading.get_ident(), range(3)) == [here] * 3
    with several_threads(2):
        assert here not in each(lambda _: threading.get_ident(), range(3))
    assert each(lambda _: threading.get_ident(), range(3)) == [here] * 3


def test_a_task_that_asks_for_more_does_not_wait_for_its_own_pool():
    def outer(k):
        return sum(each(lambda i: 10 * k + i, range(4)))

    with several_threads(2):
        assert each(outer, range(8)) == [40 * k + 6 for k in range(8)]


def test_the_first_exception_in_order_is_raised_once_all_have_ended():
    ended = []

    def work(k):
        try:
            if k in (1, 2):
                raise ValueError(f"run {k}")
        finally:
            ended.append(k)

    with several_threads(THREADS), pytest.raises(ValueError, match="run 1"):
        each(work, range(6))
    assert sorted(ended) == list(range(6))


def test_settings_of_numpy_reach_the_threads():
    with several_threads(2), np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        each(lambda k: np.ones(1) / np.zeros(1) if k else 0, range(2))


def several_runs(model):
    """Orders of two runs, twice with other noise."""
    one, other = (planted_trial(model, seed=k) for k in (0, 1))
    again = tuple(replace(run, name=f"{run.name} again") for run in other.runs)
    return replace(one, runs=(*one.runs, *again))


def test_a_diagnosis_computes_the_same_numbers_in_threads():
    model = model_of()
    trial = as_read(several_runs(model), model)
    assert len(trial.identify) >= THREADS

    def computed():
        _kept.clear()
        problem = build_problem(model, trial)
        bank = build_bank(problem, problem.path, (problem.environment.noise_model,), list(model.causes)[:6])
        return problem, bank.equations[0], locate(problem, problem.path, problem.coefficients)

    one, bank, place = computed()
    with several_threads(THREADS):
        other, other_bank, other_place = computed()
    assert one.environment == other.environment
    for a, b in zip(one.path, other.path, strict=True):
        np.testing.assert_array_equal(a.states, b.states)
    for a, b in zip(bank, other_bank, strict=True):
        np.testing.assert_array_equal(a.ss, b.ss)
    assert place.places == other_place.places
    assert place.masks == other_place.masks


def test_after_a_stop_what_has_not_begun_is_not_done(monkeypatch):
    begun, free = [], threading.Event()

    def work(k):
        begun.append(k)
        assert free.wait(10.0)

    def stopped(future, timeout=None):
        free.set()
        raise KeyboardInterrupt

    monkeypatch.setattr("concurrent.futures.Future.exception", stopped)
    with several_threads(2), pytest.raises(KeyboardInterrupt):
        each(work, range(400))
    assert len(begun) < 400


@pytest.mark.parametrize("wanted", [0, -3, 1.5, "2"])
def test_a_number_of_threads_that_cannot_be_is_told(wanted):
    model = model_of()
    with pytest.raises(TrialError, match="a whole number of at least 1"):
        threads_of(several_runs(model), model, wanted)


def test_kernels_that_numba_may_not_compile_count_as_compiled():
    code = (
        "from bayesid.equations.model import build_model; from bayesid.model.vehicles import load_vehicle; "
        "print(build_model(load_vehicle('remus100'), 3).kernel.compiled)"
    )
    still = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=still, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "True", done.stderr


def test_no_more_threads_than_runs_and_memory(monkeypatch):
    model = model_of()
    trial = several_runs(model)
    runs = len(trial.identify)
    assert threads_of(trial, model, 1) == 1
    assert threads_of(trial, model, 100) == runs
    assert threads_of(trial, model, None) == min(processors(), runs)
    one, two, all_of_them = (needed.memory_needed(trial, model, 1.0, k) for k in (1, 2, runs))
    assert one < two < all_of_them
    monkeypatch.setattr(needed, "taken_memory", lambda: 0)
    monkeypatch.setattr(needed, "available_memory", lambda: int(0.5 * (one + two)))
    assert threads_of(trial, model, 100) == 1
    monkeypatch.setattr(needed, "available_memory", lambda: 1)  # refused in words, elsewhere
    assert threads_of(trial, model, 100) == 1
