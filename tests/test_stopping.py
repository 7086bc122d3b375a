"""A stop is one sentence and 128 + signal, when it comes while libraries load, at work, or in the workers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from bayesid.cli.stopping import KEPT, STOPPED
from bayesid.executor import Executor, WorkerError

SENTENCE = f"bayesid: {STOPPED}\n"
LOADING = """
import sys, time
from bayesid.cli.stopping import listen
listen()
sys.path.insert(0, sys.argv[1])
print("ready", flush=True)
try:
    import slow_library
except BaseException as error:  # as a library may that has a substitute
    pass
print("gone on")
"""
WORK = """
import sys, time
from bayesid.cli.entry import main

def body():
    print("ready", flush=True)
    time.sleep(30)

import bayesid.cli.study as study
study._studies = body
main(["study"])
"""
POOL = """
import sys, threading, time
from bayesid.cli.entry import main

def body():
    from bayesid.executor import Executor
    threading.Thread(target=tell, daemon=True).start()
    list(Executor("processes", 2).in_order(time.sleep, [30, 30]))

def tell():
    time.sleep(0.3 + float(sys.argv[1]))
    print("ready", flush=True)

if __name__ == "__main__":
    import bayesid.cli.study as study
    study._studies = body
    main(["study"])
"""


def started(code, *arguments):
    """A process group of its own, as a terminal makes one, once it says that it is ready."""
    child = subprocess.Popen(
        [sys.executable, *code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    return child, child.stdout.readline()


SIGNALS = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


@SIGNALS
def test_a_stop_while_a_library_loads_ends_there(number, tmp_path):
    (tmp_path / "slow_library.py").write_text("import time\ntime.sleep(30)\n")
    child, said = started(["-c", LOADING], str(tmp_path))
    assert said == "ready\n"
    time.sleep(0.3)
    child.send_signal(number)
    out, err = child.communicate(timeout=20)
    assert (child.returncode, out, err) == (128 + number, "", SENTENCE)


HALF = """
import os, signal, sys, types
from bayesid.cli.stopping import listen
listen()
sys.modules["bayesid.lock"] = types.ModuleType("bayesid.lock")  # as while it is imported
exec(compile("import os, signal; os.kill(os.getpid(), signal.SIGINT)", "<frozen importlib>", "exec"))
print("gone on")
"""


def test_a_stop_in_the_middle_of_an_import_of_our_own_is_one_sentence_too():
    found = subprocess.run([sys.executable, "-c", HALF], capture_output=True, text=True, timeout=20)
    assert (found.returncode, found.stdout, found.stderr) == (130, "", SENTENCE)


@SIGNALS
def test_a_stop_at_work_is_one_sentence_and_the_code_of_the_signal(number):
    child, _ = started(["-c", WORK])
    child.send_signal(number)
    _, err = child.communicate(timeout=20)
    assert (child.returncode, err) == (128 + number, SENTENCE)


def test_a_stop_of_a_command_with_a_folder_for_its_results_says_that_it_is_kept():
    child, _ = started(["-c", WORK], "--out", "there")
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=20)
    assert (child.returncode, err) == (130, f"bayesid: {STOPPED}{KEPT}\n")


SWALLOWED = WORK.replace(
    "    time.sleep(30)\n",
    """    try:
        time.sleep(30)
    except KeyboardInterrupt:
        raise ValueError("Invalid bounding box") from None
""",
)


@SIGNALS
def test_a_stop_that_a_library_turns_into_its_own_error_is_still_a_stop(number):
    """As matplotlib does with one within its drawing."""
    child, _ = started(["-c", SWALLOWED])
    child.send_signal(number)
    _, err = child.communicate(timeout=20)
    assert (child.returncode, err) == (128 + number, SENTENCE)


DROPPED = """
import bayesid.cli.stopping as stopping
stopping.GRACE = 0.5
""" + WORK.replace(
    "    time.sleep(30)\n",
    """    try:
        time.sleep(30)
    except BaseException:
        pass
    time.sleep(float(sys.argv[1]))
""",
)


@SIGNALS
@pytest.mark.parametrize("rest", [0.0, 30.0], ids=["to its end", "at work"])
def test_a_stop_that_a_library_drops_altogether_is_still_a_stop(number, rest):
    """As Python does with one within a destructor or a callback of C."""
    child, _ = started(["-c", DROPPED], str(rest))
    child.send_signal(number)
    _, err = child.communicate(timeout=20)
    assert (child.returncode, err) == (128 + number, SENTENCE)


@pytest.mark.thorough
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device that is always full")
@pytest.mark.parametrize("full", ["stdout", "stderr"])
def test_a_terminal_log_on_a_full_disk_is_named_or_costs_no_exit_code(full):
    code = "import sys; from bayesid.cli.entry import main; main(sys.argv[1:])"
    for arguments, right in ((["vehicle", "list"], 0), (["simulate", "nothere", "turn:10"], 2)):
        with open("/dev/full", "w") as device:
            streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, full: device}
            found = subprocess.run([sys.executable, "-c", code, *arguments], **streams, text=True, timeout=60)
        if full == "stderr":
            assert found.returncode == right
        elif right == 0:
            words = "bayesid: standard output cannot be written: No space left on device\n"
            assert (found.returncode, found.stderr) == (2, words)


def test_a_library_that_writes_to_a_full_disk_is_told_with_its_file(tmp_path):
    """numba and h5py raise the system's error, which holds no name."""
    written = WORK.replace(
        "    time.sleep(30)\n",
        """    import errno
    def save(filepath):
        raise OSError(errno.ENOSPC, "No space left on device")
    save(sys.argv[1])
""",
    )
    child, _ = started(["-c", written], str(tmp_path / "kept.nbc"))
    _, err = child.communicate(timeout=20)
    advice = "make room there, or give --out a folder elsewhere"
    told = f"bayesid: {tmp_path}/kept.nbc: No space left on device; {advice}\n"
    assert (child.returncode, err) == (2, told)


@pytest.mark.thorough
@pytest.mark.parametrize("wait", [0.0, 2.0], ids=["workers starting", "workers at work"])
@SIGNALS
def test_a_stop_of_the_whole_group_is_told_by_the_parent_alone_and_leaves_no_worker(number, wait, tmp_path):
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    child, _ = started([str(script)], str(wait))
    os.killpg(child.pid, number)  # what Ctrl-C does in a terminal
    _, err = child.communicate(timeout=20)  # stderr is shared: it closes when the last worker is gone
    assert (child.returncode, err) == (128 + number, SENTENCE)


@pytest.mark.thorough
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    child, _ = started([str(script)], "2.0")
    child.kill()
    child.communicate(timeout=20)  # would last as long as a worker holds the stream: 30 s
    assert child.returncode == -signal.SIGKILL


def test_a_task_that_ends_every_worker_is_one_error_in_words():
    with pytest.raises(WorkerError, match="3 worker processes in turn were killed at task 2 of 2") as caught:
        list(Executor("processes", 2).in_order(_kill_self, [None, signal.SIGKILL]))
    assert caught.value.exit_code == 1


def _kill_self(number):
    if number is not None:
        os.kill(os.getpid(), number)
