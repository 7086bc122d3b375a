"""A diagnosis that would not fit into the memory is refused in a sentence before it starts."""

import os
import platform
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid import memory
from bayesid.diagnosis.input import memory_needed as needed
from bayesid.diagnosis.run import diagnose
from bayesid.errors import TrialError


def longer(trial, times):
    runs = []
    for run in trial.runs:
        t = np.arange(run.t.size * times) * (run.t[1] - run.t[0])
        runs.append(replace(
            run, t=t, data={c: np.tile(v, times) for c, v in run.data.items()},
            commands={c: np.tile(v, times) for c, v in run.commands.items()},
        ))  # fmt: skip
    return replace(trial, runs=tuple(runs))


def test_what_is_needed_grows_with_the_samples_and_not_with_runs_held_out():
    model, trial = model_of(), planted_trial(model_of())
    one, ten = (needed.memory_needed(t, model) - needed.FIXED for t in (trial, longer(trial, 10)))
    assert ten == pytest.approx(10 * one)
    held = replace(trial, runs=(*trial.runs, *(replace(r, role="holdout") for r in trial.runs)))
    assert needed.memory_needed(held, model) - needed.FIXED == pytest.approx(one)


def test_slopes_of_a_long_run_do_not_count_per_sample():
    model, trial = model_of(), planted_trial(model_of())
    samples = sum(run.t.size for run in trial.identify)
    short = (needed.memory_needed(trial, model) - needed.FIXED) / samples
    far, farther = (needed.memory_needed(longer(trial, k), model) for k in (1000, 2000))
    # 9 states, 12 inputs, at most 8 channels: maps by state and input, and paths, but nothing per parameter
    assert (farther - far) / (1000 * samples) < min(25e3, 0.5 * short)


def test_too_little_memory_is_a_sentence_with_both_numbers_and_a_sampling_that_fits(monkeypatch):
    model, trial = model_of(), longer(planted_trial(model_of()), 2000)
    monkeypatch.setattr(needed, "available_memory", lambda: int(0.9e9))
    monkeypatch.setattr(needed, "taken_memory", lambda: int(0.3e9))
    words = r"320000 samples need about \d+\.\d GB .* 1\.2 GB are there; read every (\S+) s"
    with pytest.raises(TrialError, match=words) as told:
        diagnose(trial, model)
    step = float(re.search(words, str(told.value))[1]) / (trial.runs[0].t[1] - trial.runs[0].t[0])
    needed.check_memory(longer(planted_trial(model_of()), int(2000 / step) - 1), model)
    with pytest.raises(TrialError, match="GB are there"):
        needed.check_memory(longer(planted_trial(model_of()), int(1.3 * 2000 / step)), model)


def test_a_container_and_a_limit_of_the_shell_count(monkeypatch, tmp_path):
    (tmp_path / "memory.max").write_text("1000000\n")
    (tmp_path / "memory.current").write_text("400000\n")
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    assert memory.available_memory() == 600000
    # files read once fill the rest of a container and go when memory is wanted
    (tmp_path / "memory.stat").write_text("anon 100000\ninactive_file 250000\nactive_file 50000\n")
    assert memory.available_memory() == 850000
    (tmp_path / "memory.max").write_text("max\n")
    assert memory.available_memory() is None or memory.available_memory() > 10**6


FREED = """
import sys
import numpy as np
from bayesid.memory import give_back_freed, taken_memory
if sys.argv[1] == "asked":
    give_back_freed()
np.ones(3 * 10**6)  # once such an array is freed, the C library keeps the next ones in its heap
before, large, small = taken_memory(), [], []
for _ in range(10):
    large.append(np.ones(10**6))
    small.append(np.ones(10**4))
del large
print(taken_memory() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a matter of the GNU C library")
def test_freed_arrays_leave_the_process():
    env = {k: v for k, v in os.environ.items() if not k.startswith("MALLOC_")}

    def left(how):
        line = [sys.executable, "-c", FREED, how]
        return int(subprocess.run(line, env=env, capture_output=True, text=True, check=True).stdout)

    assert left("asked") < 5e6
    assert left("not asked") > 70e6  # control: of 80 MB freed nothing went back
