"""Entry point of the shell command: listens to signals before anything else is loaded, then runs the command.

Takes arguments of a shell. Loads nothing but the standard library until it listens.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import NoReturn

from bayesid.cli.stopping import leave, listen


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and end the process.

    The exit code is 0 ok, 2 usage or bad input, 3 not converged or a check failed, 4 a log that does not say
    what its header says, 128 + signal where it was stopped.
    """
    listen()
    from bayesid.memory import give_back_freed

    # Matrices here are small: a second BLAS thread costs more than it gives (a diagnosis: 7 s, not 10).
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    give_back_freed()
    from bayesid.cli.main import run

    leave(run(args))
