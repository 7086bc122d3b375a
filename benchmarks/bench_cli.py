"""How long does the command line take to answer `bayesid --help`?

Takes no input. Prints one table row per start: warm (compiled files there) and cold (an empty cache of compiled
files, so every module is compiled again). Does not assert; the target is 0.3 s.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time

REPEATS = 9
COMMANDS = (["--help"], ["vehicle", "list"])


def start_time(arguments: list[str], cache: str | None) -> float:
    """Wall time of one `python -m bayesid` [s]; `cache` holds the compiled files, None: the usual place."""
    environment = dict(os.environ)
    if cache is not None:
        environment["PYTHONPYCACHEPREFIX"] = cache
    begin = time.perf_counter()
    command = [sys.executable, "-m", "bayesid", *arguments]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    return time.perf_counter() - begin


def main() -> None:
    print("| command | start | median [s] | worst [s] |")
    print("|---|---|---|---|")
    for arguments in COMMANDS:
        start_time(arguments, None)
        warm = [start_time(arguments, None) for _ in range(REPEATS)]
        cold = []
        for _ in range(3):
            with tempfile.TemporaryDirectory() as cache:
                cold.append(start_time(arguments, cache))
        for kind, times in (("warm", warm), ("cold", cold)):
            name = "bayesid " + " ".join(arguments)
            print(f"| `{name}` | {kind} | {statistics.median(times):.2f} | {max(times):.2f} |")


if __name__ == "__main__":
    main()
