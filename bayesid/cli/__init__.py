"""The command line `bayesid`: reads options, calls the library, prints answers.

Takes arguments of a shell. Does not compute; a command imports what it needs when it runs, so that
`bayesid --help` loads no numerical library.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import NoReturn


def main(args: Sequence[str] | None = None) -> NoReturn:
    """Entry point of the shell command.

    Ends the process with 0 ok, 2 usage or bad input, 3 not converged, 128 + signal where it was stopped.
    """
    from bayesid.cli.stopping import leave, listen

    listen()
    # Matrices here are small: a second BLAS thread costs more than it gives (a diagnosis: 7 s, not 10).
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from bayesid.cli.guard import run

    leave(run(args))
