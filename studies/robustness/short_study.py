"""The calibration study with one of its conditions, three replicates, to be killed many times.

Usage: python -m studies.robustness.short_study --out FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

from bayesid.cli import study as command
from bayesid.cli.entry import main
from studies.calibration import run


def _short(path: Path, arguments: list[str]) -> int:
    run.CONDITIONS = {name: run.CONDITIONS[name] for name in ("one run",)}
    run.main(Path(arguments[arguments.index("--out") + 1]), True, 0)
    return 0


if __name__ == "__main__":
    command._run_script = _short
    main(["study", "calibration", "--quick", *sys.argv[1:]])
