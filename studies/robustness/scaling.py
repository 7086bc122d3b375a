"""The same work in one process, in two, and on a Dask cluster of real processes, some of which are killed.

Takes a work and a way. Gives a row: processor time in all, of the tasks alone and of the scheduler, how busy
workers were, and whether every result is the one of a single process.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studies.robustness.kills import cpu_of, group_of, line_of
from studies.robustness.same_files import different
from studies.robustness.small import small_pack

WORKERS = 2
LONGEST = 3600.0  # s, of one command
START_TIME = 60.0  # s for a scheduler and its workers
LOOK = 0.1  # s


@dataclass(frozen=True)
class Work:
    """Tasks of one kind.

    Attributes
    ----------
    line : after `python -m`, with OUT, PACK for folders
    count : tasks
    files : patterns of results that are compared
    notes : pattern of the file that tells what a task took, once it is done; "" where there is none
    """

    line: tuple[str, ...]
    count: int
    files: tuple[str, ...]
    notes: str


_ONE = "studies.robustness.scaling_work"
WORKS = {
    "64 calibration replicates": Work(
        (_ONE, "calibration", "--out", "OUT", "--count", "64"), 64, ("seeds/*.json",), "seeds/*.json"
    ),
    "pack of 40 bundles": Work(
        ("bayesid", "blind", "solve", "PACK", "--quick", "--quiet", "--out", "OUT"), 40,
        ("*/diagnosis.json",), "*/solved.json",
    ),
    "500 tasks without work": Work((_ONE, "empty", "--out", "OUT", "--count", "500"), 500, (), ""),
}  # fmt: skip
HERE, PROCESSES, DASK, KILLED = "one process", "two processes", "Dask cluster", "Dask cluster, killed"
WAYS = (HERE, PROCESSES, DASK, KILLED)


@dataclass
class _Cluster:
    """A scheduler and its workers, as processes of their own on loopback."""

    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]
    address: str

    def used(self) -> float:
        return sum(cpu_of(child.pid) for child in [self.scheduler, *self.workers])

    def kill_worker(self) -> None:
        """A working process, not the nanny that starts it again."""
        found = [pid for child in self.workers for pid in group_of(child.pid) if "spawn_main" in line_of(pid)]
        os.kill(found[0], signal.SIGKILL)


@dataclass
class _Ended:
    """How the command and its cluster ended."""

    codes: list[int] = field(default_factory=list)
    words: str = ""
    cpu: float = 0.0
    command: float = 0.0
    scheduler: float = 0.0
    wall: float = 0.0


def can_scale(way: str) -> bool:
    """Whether what it needs is there."""
    return way in (HERE, PROCESSES) or importlib.util.find_spec("distributed") is not None


def scaling_row(name: str, way: str, folder: Path) -> dict[str, Any]:
    """One work done in one way; results stay in `folder` to be compared with those of one process."""
    work = WORKS[name]
    pack, place = folder / "pack", folder / name.replace(" ", "-")
    if "PACK" in work.line and not pack.exists():
        small_pack(pack, work.count)
    out = place / way.replace(", ", "-").replace(" ", "-")
    line = [a.replace("OUT", str(out)).replace("PACK", str(pack)) for a in work.line]
    ended = _Ended()
    if way in (HERE, PROCESSES):
        more = () if way == HERE else ("--workers", str(WORKERS))
        _run([*line, *more], ended)
    else:
        with _cluster() as cluster:
            before = cpu_of(cluster.scheduler.pid)
            strikes = _strikes(cluster, out, work) if way == KILLED else None
            _run([*line, "--executor", cluster.address], ended, strikes)
            with contextlib.suppress(OSError):
                ended.scheduler += cpu_of(cluster.scheduler.pid) - before
            ended.cpu += cluster.used()
        if way == KILLED:  # the same line, once there is a cluster again
            with _cluster() as cluster:
                _run([*line, "--executor", cluster.address], ended)
                ended.cpu += cluster.used()
    return _row(name, way, work, out, place / HERE.replace(" ", "-"), ended)


def _row(name: str, way: str, work: Work, out: Path, good: Path, ended: _Ended) -> dict[str, Any]:
    notes = [json.loads(path.read_text("utf-8")) for path in out.glob(work.notes)] if work.notes else []
    tasks = {k: sum(note.get(k, 0.0) for note in notes) for k in ("cpu_seconds", "wall_seconds")}
    took = out / "took.json"
    inside: dict[str, Any] = {"wall": ended.wall, "cpu": None}
    if took.exists():
        inside = json.loads(took.read_text("utf-8"))
    workers = 1 if way == HERE else WORKERS
    return {
        "work": name, "way": way, "tasks": work.count, "codes": ended.codes, "words": ended.words,
        "cpu": ended.cpu, "task_cpu": tasks["cpu_seconds"], "scheduler_cpu": ended.scheduler,
        "wall": inside["wall"], "client_cpu": inside["cpu"], "command_cpu": ended.command,
        "busy": tasks["wall_seconds"] / (workers * inside["wall"]) if notes and way != KILLED else None,
        "done": len(notes) if notes else work.count,
        "apart": different(good, out, work.files),
    }  # fmt: skip


def _strikes(cluster: _Cluster, out: Path, work: Work) -> list[tuple[int, Any]]:
    """After how many results what is killed: a worker, then the scheduler."""
    quarter = work.count // 4
    return [(quarter, cluster.kill_worker), (2 * quarter, cluster.scheduler.kill), (0, (out, work.notes))]


def _run(line: Sequence[str], ended: _Ended, strikes: list[tuple[int, Any]] | None = None) -> None:
    """One command, with what is to be killed on its way."""
    begun = time.monotonic()
    child = subprocess.Popen(
        [sys.executable, "-m", *line], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    waiting, watched = (strikes[:-1], strikes[-1][1]) if strikes else ([], None)
    while watched is not None and waiting and child.poll() is None:
        if len(list(watched[0].glob(watched[1]))) >= waiting[0][0]:
            waiting.pop(0)[1]()
        time.sleep(LOOK)
    words = child.stderr.read() if child.stderr else ""
    _, status, spent = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    ended.codes.append(child.returncode)
    ended.wall += time.monotonic() - begun
    ended.cpu += spent.ru_utime + spent.ru_stime
    ended.command += spent.ru_utime + spent.ru_stime
    if child.returncode:
        ended.words = (words.strip().splitlines() or [""])[-1]


@contextlib.contextmanager
def _cluster() -> Iterator[_Cluster]:
    """A scheduler and `WORKERS` workers until the work is done."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = ["dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    started = [
        subprocess.Popen([sys.executable, "-m", f"distributed.cli.{one}", *options], **quiet)
        for one, *options in [scheduler, *[worker] * WORKERS]
    ]
    try:
        _wait(address)
        yield _Cluster(started[0], started[1:], address)
    finally:
        for child in started[::-1]:
            with contextlib.suppress(ProcessLookupError):
                child.terminate()
        for child in started:
            try:
                child.wait(START_TIME)
            except subprocess.TimeoutExpired:
                child.kill()


def _wait(address: str) -> None:
    from distributed import Client

    until = time.monotonic() + START_TIME
    while True:
        try:
            with Client(address, timeout=START_TIME) as client:
                client.wait_for_workers(WORKERS, timeout=START_TIME)
                return
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(1.0)
