"""Commands that are killed on their way, and what they give once they are run again.

Takes a command line and the files it writes. Gives one `Killed` per fault: how many met the command at work,
how many of the finished results were those of the unbroken command byte for byte, and every word that was
wrong. Every command is a fork of this process in a process group of its own, with libraries loaded: a fault
strikes work, not imports (these have tests of their own), after a share of the processor time of the unbroken
command that is drawn from a seed.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import runpy
import shutil
import signal
import sys
import tempfile
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bayesid.executor import WorkerError
from bayesid.executor.processes import MOST_WORKERS
from studies.robustness.same_files import different

# Fault -> signal and the exit code that is right; the last one strikes a worker, which the command survives.
FAULTS = {
    "SIGKILL": (signal.SIGKILL, -9), "SIGTERM": (signal.SIGTERM, 143), "SIGINT": (signal.SIGINT, 130),
    "worker killed": (signal.SIGKILL, 0),
}  # fmt: skip
SIGNALS = ("SIGKILL", "SIGTERM", "SIGINT")
WORKER = "worker killed"
UNBROKEN = "unbroken"
FINE = (0, 3)
LONGEST = 1800.0  # s, of one command
LAST = 0.98  # of the processor time of the unbroken command: later ones find it ended
EARLIER = 0.6
LOOK = 0.05  # s between two looks at a command


@dataclass(frozen=True)
class Command:
    """A command that is to be killed.

    Attributes
    ----------
    module, arguments : of `python -m`, with OUT for the folder of the results
    files : patterns of the files that are compared
    again : added when it is run once more, e.g. --resume
    faults : names of `FAULTS`
    times : how often each strikes in a whole study
    strikes : workers killed within one run, at random times; a signal ends it at once
    """

    name: str
    module: str
    arguments: tuple[str, ...]
    files: tuple[str, ...]
    again: tuple[str, ...] = ()
    faults: tuple[str, ...] = SIGNALS
    times: int = 10
    strikes: int = 1


@dataclass
class Killed:
    """One kind of fault of one command.

    Attributes
    ----------
    sent : faults that met the command at work
    finished, same : commands run to their end afterwards, and those that gave the files of the unbroken one
    wrong : what was not as it should be
    """

    command: str
    fault: str
    sent: int = 0
    finished: int = 0
    same: int = 0
    wrong: list[str] = field(default_factory=list)


def kill_and_resume(
    command: Command,
    work: Path,
    count: int,
    seed: int,
    keep: Callable[[int, list[Killed]], None] = lambda done, rows: None,
    before: Sequence[Killed] = (),
    done: int = 0,
) -> list[Killed]:
    """Strike a command `count` times by each of its faults at random times, finish it, compare its files.

    keep : called after every round with the rounds done and all rows so far; a study stopped loses one
    before, done : what it was called with, to go on from there
    """
    place = work / command.name.replace(" ", "-")
    shutil.rmtree(place, ignore_errors=True)
    whole = place / "whole"
    _run(command, place / "first")  # kernels and fonts are loaded once for all that follow
    ended = _run(command, whole)
    if ended.code not in FINE:
        return [Killed(command.name, UNBROKEN, 0, 1, 0, [f"exit code {ended.code}: {ended.words}"])]
    rows = list(before) or [Killed(command.name, fault) for fault in command.faults]
    for k in range(done, count):
        rng = random.Random(1000 * seed + k)
        for row in rows:
            strikes = command.strikes if row.fault == WORKER else 1
            after = sorted(rng.uniform(0.0, LAST) * ended.used for _ in range(strikes))
            _strike_once(command, row, place, after, k)
        keep(k + 1, rows)
    return rows


def _strike_once(command: Command, row: Killed, place: Path, after: list[float], k: int) -> None:
    """Strike once, finish, compare, count."""
    folder = place / f"{row.fault}{k}".replace(" ", "-")
    ended = _run(command, folder, row.fault, after)
    if not ended.met:  # it was quicker than the unbroken one: this is no strike, the next one comes earlier
        shutil.rmtree(folder, ignore_errors=True)
        ended = _run(command, folder, row.fault, [EARLIER * a for a in after])
    if ended.met:
        row.sent += ended.met
        row.wrong += _wrong_end(row.fault, ended)
        if ended.code not in FINE:
            ended = _run(command, folder, again=command.again)
        if ended.code not in FINE:
            row.wrong.append(f"exit code {ended.code}: {ended.words}")
        row.finished += 1
        apart = different(place / "whole", folder, command.files)
        row.same += not apart
        row.wrong += apart
    shutil.rmtree(folder, ignore_errors=True)


def _wrong_end(fault: str, ended: _Ended) -> list[str]:
    """What is wrong about the exit code and the last words of a command that was struck."""
    right = FAULTS[fault][1]
    out = []
    if fault == WORKER and ended.met >= MOST_WORKERS and ended.code == WorkerError.exit_code:
        # one task lost that many workers, which is told as a lack of memory
        return [] if "worker processes in turn were killed" in ended.words else [ended.words]
    if ended.code != right and not (right == 0 and ended.code in FINE):
        out.append(f"exit code {ended.code} after {fault}: {ended.words}")
    if "Traceback" in ended.words:
        out.append(ended.words)
    if right > 0 and "stopped before it was done" not in ended.words:
        out.append(f"{fault}: no sentence, but {ended.words!r}")
    return out


@dataclass(frozen=True)
class _Ended:
    """How a command ended: exit code, how many faults met it, processor seconds, its words."""

    code: int
    met: int
    used: float
    words: str


def _run(
    command: Command,
    out: Path,
    fault: str | None = None,
    after: Sequence[float] = (),
    again: Sequence[str] = (),
) -> _Ended:
    """The command in a fork, struck each time its group has used so much processor time [s]."""
    with tempfile.TemporaryFile("w+") as said:
        child = os.fork()
        if child == 0:
            _become(command, [*command.arguments, *again], out, said.fileno())
        met, used, waiting, until = 0, 0.0, list(after), time.monotonic() + LONGEST
        while True:
            ended, status, spent = os.wait4(child, os.WNOHANG)
            if ended:
                used = spent.ru_utime + spent.ru_stime
                break
            if fault is not None and waiting and cpu_of(child) >= waiting[0] and _strike(child, fault):
                met += 1
                waiting.pop(0)
            if time.monotonic() > until:
                os.killpg(child, signal.SIGKILL)
                until += LONGEST
            time.sleep(LOOK)
        said.seek(0)
        return _Ended(os.waitstatus_to_exitcode(status), met, used, said.read()[-500:])


def _become(command: Command, arguments: Sequence[str], out: Path, said: int) -> None:
    """The rest of this fork's life."""
    code = 1
    # a stopped command gives back what is to go at its end: the folder of the study is not the fork's
    weakref.finalize._registry.clear()  # type: ignore[attr-defined]
    try:
        os.setpgid(0, 0)
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream, to in ((0, nothing), (1, nothing), (2, said)):
            os.dup2(to, stream)
        sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
        code = _main(command, arguments, out)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _main(command: Command, arguments: Sequence[str], out: Path) -> int:
    """`python -m` of the command in this process; its exit code."""
    sys.argv = [command.module, *(a.replace("OUT", str(out)) for a in arguments)]
    try:
        runpy.run_module(command.module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


def _strike(child: int, fault: str) -> bool:
    number = FAULTS[fault][0]
    if fault != WORKER:
        os.killpg(child, number)
        return True
    workers = [pid for pid in group_of(child) if pid != child and "spawn_main" in line_of(pid)]
    if not workers:  # none yet, or none any more
        return False
    os.kill(random.choice(workers), number)
    return True


def group_of(leader: int) -> list[int]:
    """A process and all that it started; to look through all of /proc cost as much as the command."""
    found, waiting = [], [leader]
    while waiting:
        found.append(waiting.pop())
        for task in Path(f"/proc/{found[-1]}/task").glob("*/children"):
            with contextlib.suppress(OSError):
                waiting += [int(pid) for pid in task.read_text("ascii").split()]
    return found


def cpu_of(leader: int) -> float:
    """Processor seconds of a group: those of its processes and of their ended children."""
    ticks = 0
    for pid in group_of(leader):
        words = _status(pid)
        if len(words) > 14:
            ticks += sum(int(w) for w in words[11:15])
    return ticks / os.sysconf("SC_CLK_TCK")


def line_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""


def _status(pid: int) -> list[str]:
    """State, parent, group, session, ... of a process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("ascii", errors="replace").rsplit(")", 1)[1].split()
    except (OSError, IndexError):
        return []


def rows_of(found: Sequence[Killed]) -> list[dict[str, Any]]:
    """Plain rows for a report, the same words once."""
    return [json.loads(json.dumps(vars(row) | {"wrong": sorted(set(row.wrong))[:5]})) for row in found]
