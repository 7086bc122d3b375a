"""Two commands never write into one folder at once, and no ended one keeps it shut."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from bayesid import lock as locks
from bayesid.cli.main import run
from bayesid.lock import LOCK, LockError, lock, release, release_all

HOLD = """
import sys, time
from bayesid.lock import lock
lock(sys.argv[1], "bayesid fit")
print("held", flush=True)
time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the lock of a folder until it is killed."""
    child = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "held\n"
    yield child
    child.kill()
    child.wait()
    child.stdout.close()


def test_a_second_command_is_refused_with_the_name_and_process_of_the_first(holder, tmp_path, capsys):
    with pytest.raises(LockError, match=rf"`bayesid fit` \(process {holder.pid} on .*wait until it"):
        lock(tmp_path, "bayesid sample")
    assert run(["simulate", "generic_sub", "turn:25,duration=20", "--out", str(tmp_path)]) == 2
    captured = capsys.readouterr()
    assert f"process {holder.pid}" in captured.err and captured.out == ""
    assert [p.name for p in tmp_path.iterdir()] == [LOCK]


def test_the_lock_of_a_killed_command_is_taken_over_and_told(holder, tmp_path):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / LOCK).exists()
    told = lock(tmp_path, "bayesid fit")
    assert f"process {holder.pid}" in told and "taken over" in told
    release_all()
    assert not (tmp_path / LOCK).exists()


@pytest.mark.parametrize("flock", [True, False])
def test_a_killed_command_that_is_not_yet_reaped_holds_nothing(holder, tmp_path, monkeypatch, flock):
    if not flock:
        monkeypatch.setattr(locks, "_system_lock", lambda handle: None)
    holder.send_signal(signal.SIGKILL)
    os.waitid(os.P_PID, holder.pid, os.WEXITED | os.WNOWAIT)  # it is a zombie now
    assert "taken over" in lock(tmp_path, "bayesid fit")
    release_all()


def test_a_lock_of_another_host_is_left_and_says_what_to_do(tmp_path):
    entry = {"pid": 1, "host": "elsewhere", "command": "bayesid fit", "since": "2026-01-01", "born": ""}
    (tmp_path / LOCK).write_text(json.dumps(entry))
    with pytest.raises(LockError, match=rf"on elsewhere.*delete {tmp_path.name}/{LOCK}"):
        lock(tmp_path, "bayesid fit")
    assert json.loads((tmp_path / LOCK).read_text()) == entry


def test_a_process_number_used_again_is_not_the_holder(tmp_path, monkeypatch):
    entry = {"pid": 1, "host": "here", "command": "bayesid fit", "since": "2026-01-01", "born": "before"}
    monkeypatch.setattr(locks.socket, "gethostname", lambda: "here")
    monkeypatch.setattr(locks, "_born", lambda pid: "after")
    monkeypatch.setattr(locks, "_system_lock", lambda handle: None)  # a file system without its own
    (tmp_path / LOCK).write_text(json.dumps(entry))
    assert "taken over" in lock(tmp_path, "bayesid fit")
    release_all()
    monkeypatch.setattr(locks, "_born", lambda pid: "before")
    (tmp_path / LOCK).write_text(json.dumps(entry))
    with pytest.raises(LockError):
        lock(tmp_path, "bayesid fit")


@pytest.mark.parametrize("text", ["", "{", '{"pid": "x"}', "[1]"])
def test_a_torn_lock_that_nobody_holds_is_taken(text, tmp_path):
    (tmp_path / LOCK).write_text(text)
    assert lock(tmp_path, "bayesid fit") is None
    release_all()


def test_a_process_may_hold_a_folder_twice_and_frees_it_once_done(tmp_path):
    for name in ("a", "b"):
        lock(tmp_path / "new", name)
    for _ in range(2):
        release(tmp_path / "new")
    assert not (tmp_path / "new").exists()  # made for the lock alone
    for name in ("a", "b"):
        lock(tmp_path / "new", name)
    (tmp_path / "new" / "result").write_text("")
    release(tmp_path / "new")
    assert (tmp_path / "new" / LOCK).exists()
    release(tmp_path / "new")
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["result"]


@pytest.mark.thorough
def test_of_many_that_begin_at_once_over_a_dead_lock_one_wins(tmp_path):
    (tmp_path / LOCK).write_text(
        json.dumps({"pid": 2**22 + 1, "host": "x", "command": "a", "since": "b", "born": "c"})
    )
    code = (
        "import socket, sys, time; socket.gethostname = lambda: 'x'\n"
        "from bayesid.lock import lock, LockError\n"
        "time.sleep(max(0.0, float(sys.argv[2]) - time.time()))\n"
        "try: lock(sys.argv[1], 'me'); print('won', flush=True); time.sleep(2)\n"
        "except LockError: print('lost', flush=True)\n"
    )
    begin = str(time.time() + 1.0)
    line = [sys.executable, "-c", code, str(tmp_path), begin]
    children = [subprocess.Popen(line, stdout=subprocess.PIPE, text=True) for _ in range(4)]
    said = sorted(child.communicate()[0].strip() for child in children)
    assert said == ["lost", "lost", "lost", "won"]


def test_start_locks_the_folder_it_is_given_and_the_default_one(tmp_path, holder, capsys):
    (tmp_path / "trial.toml").write_text("")  # the bundle is its own folder of results
    assert run(["start", str(tmp_path), "--yes", "--out", str(tmp_path)]) == 2
    assert f"process {holder.pid}" in capsys.readouterr().err
    logs = tmp_path.parent / "logs"
    (logs / "bayesid").mkdir(parents=True)
    (logs / "bayesid" / "trial.toml").write_text("")
    (logs / "bayesid" / LOCK).hardlink_to(tmp_path / LOCK)
    assert run(["start", str(logs), "--yes"]) == 2
    assert f"process {holder.pid}" in capsys.readouterr().err


def test_wrong_usage_leaves_neither_lock_nor_folder(tmp_path):
    out = tmp_path / "out"
    assert run(["simulate", "generic_sub", "nonsense:1", "--out", str(out)]) == 2
    assert run(["simulate", "--out", str(out), "--nonsense"]) == 2
    assert not out.exists()


def test_every_command_that_writes_to_a_folder_locks_it(tmp_path):
    from bayesid.cli.main import command
    from bayesid.cli.options import claimed

    tree, found = [command()], {}
    while tree:
        for name, one in getattr(tree.pop(), "commands", {}).items():
            tree.append(one)
            for param in one.params:
                # `schema` writes one file, as a whole
                if name != "schema" and {"--out", "--answers"} & set(param.opts):
                    found[name, param.name] = param.callback
    assert len(found) >= 14
    for key, callback in found.items():
        inside = (
            {getattr(c.cell_contents, "__name__", "") for c in (callback.__closure__ or ())}
            if callback
            else {}
        )
        assert claimed.__name__ in inside or getattr(callback, "__name__", "") == claimed.__name__, key
