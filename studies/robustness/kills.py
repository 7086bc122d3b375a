"""Commands that are killed on their way, and what they give once they are run again.

Takes a command line and the files it writes. Gives one `Killed` per signal: how many were sent, how many of
the finished results were byte for byte those of the unbroken command, and every word that was wrong. The
time of each signal is drawn from a seed.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SIGNALS = {"SIGKILL": -9, "SIGTERM": 143, "SIGINT": 130}
LONGEST = 900.0  # s, of one command
# Numbers that say when and how fast, not what.
STAMPS = frozenset({"seconds", "shares", "clock", "cpu_seconds", "wall_seconds", "started", "sealed", "cost",
                    "stamp", "made", "created", "time", "seal"})  # fmt: skip


@dataclass
class Killed:
    """One kind of fault of one command.

    Attributes
    ----------
    sent : signals that met the command at work
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
    name: str, arguments: Sequence[str], files: Sequence[str], work: Path, count: int, seed: int,
    again: Sequence[str] = (),
) -> list[Killed]:  # fmt: skip
    """Kill a command `count` times by each signal at random times, finish it, compare its files.

    Parameters
    ----------
    arguments : of `python`, with OUT for the folder of the results
    again : added when it is run once more, e.g. --resume
    """
    rng = random.Random(seed)
    whole = work / name / "whole"
    shutil.rmtree(work / name, ignore_errors=True)
    begun = time.monotonic()
    code, _, err = _run(arguments, whole)
    took = time.monotonic() - begun
    if code not in (0, 3):
        return [Killed(name, "unbroken", 0, 1, 0, [f"exit code {code}: {err[-300:]}"])]
    out = []
    for word, expected in SIGNALS.items():
        row = Killed(name, word)
        for k in range(count):
            folder = work / name / f"{word}{k}"
            code, met, err = _run(arguments, folder, getattr(signal, word), rng.uniform(0.1, 0.95) * took)
            if met:
                row.sent += 1
                if code != expected:
                    row.wrong.append(f"exit code {code}")
                if "Traceback" in err or (word != "SIGKILL" and len(err.strip().splitlines()) == 0):
                    row.wrong.append(err[-300:])
                last, _, err = _run([*arguments, *again], folder)
                if last not in (0, 3):
                    row.wrong.append(f"run again: exit code {last}: {err[-300:]}")
            row.finished += 1
            apart = different(whole, folder, files)
            row.same += not apart
            row.wrong += apart
            shutil.rmtree(folder, ignore_errors=True)
        out.append(row)
    return out


def different(one: Path, other: Path, files: Sequence[str]) -> list[str]:
    """Names of files, of patterns, that differ by more than stamps."""
    out = []
    for pattern in files:
        names = sorted(p.relative_to(one) for p in one.glob(pattern))
        if not names:
            out.append(f"{pattern}: not written")
        out += [f"{n}: differs" for n in names if _content(one / n) != _content(other / n)]
    return out


def _content(path: Path) -> Any:
    if not path.exists():
        return None
    if path.suffix == ".json":
        return _bare(json.loads(path.read_text(encoding="utf-8")))
    if path.suffix in (".npz", ".nc", ".h5"):
        return _arrays(path)
    return path.read_bytes()


def _bare(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _bare(v) for k, v in value.items() if k not in STAMPS}
    return [_bare(v) for v in value] if isinstance(value, list) else value


def _arrays(path: Path) -> dict[str, bytes]:
    import h5py
    import numpy as np

    if path.suffix == ".npz":
        with np.load(path) as kept:
            return {n: kept[n].tobytes() for n in kept.files}
    found: dict[str, bytes] = {}
    with h5py.File(path) as file:
        file.visititems(lambda n, d: found.update({n: d[()].tobytes()}) if hasattr(d, "dtype") else None)
    return found


def _run(
    arguments: Sequence[str], out: Path, number: int | None = None, after: float = 0.0
) -> tuple[int, bool, str]:
    """Exit code, whether the signal met it at work, and what it said on stderr."""
    line = [sys.executable, *(str(out) if a == "OUT" else a for a in arguments)]
    child = subprocess.Popen(
        line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    met = False
    try:
        _, err = child.communicate(timeout=after if number is not None else LONGEST)
    except subprocess.TimeoutExpired:
        if number is None:
            child.kill()
            return -9, False, f"no end within {LONGEST:g} s"
        met = True
        os.killpg(child.pid, number)
        _, err = child.communicate(timeout=60)
    return child.returncode, met, err
