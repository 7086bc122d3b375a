"""How long does the command line take to answer `bayesid --help`?

Takes no input. Prints one table row per start: warm, and cold (the package freshly unpacked, so that Python
compiles each of its files again; libraries are compiled by their installer). Target: 0.3 s.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import bayesid

PACKAGE = Path(bayesid.__file__).parent
REPEATS = 9
COMMANDS = (["--help"], ["vehicle", "list"])


def start_time(arguments: list[str], package_parent: Path) -> float:
    """Wall time of one `python -m bayesid` from the package below this folder [s]."""
    environment = {**os.environ, "PYTHONPATH": str(package_parent)}
    begin = time.perf_counter()
    command = [sys.executable, "-m", "bayesid", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - begin


def main() -> None:
    print("| command | start | median [s] | worst [s] |")
    print("|---|---|---|---|")
    for arguments in COMMANDS:
        start_time(arguments, PACKAGE.parent)
        warm = [start_time(arguments, PACKAGE.parent) for _ in range(REPEATS)]
        cold = []
        for _ in range(REPEATS):
            with tempfile.TemporaryDirectory() as folder:
                unpacked = Path(folder) / "bayesid"
                shutil.copytree(PACKAGE, unpacked, ignore=shutil.ignore_patterns("__pycache__"))
                cold.append(start_time(arguments, Path(folder)))
        for kind, times in (("warm", warm), ("cold", cold)):
            name = "bayesid " + " ".join(arguments)
            print(f"| `{name}` | {kind} | {statistics.median(times):.2f} | {max(times):.2f} |")


if __name__ == "__main__":
    main()
