"""The options that mean the same in every command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.guard import set_verbose

Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", file_okay=False, help="Folder for the results; made if missing."),
]
OutFolder = Annotated[
    Path, typer.Option("--out", "-o", file_okay=False, help="Folder for the results; made if missing.")
]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of every random number.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Quick = Annotated[bool, typer.Option("--quick", help="A small version of the work, for a first look.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Show details and tracebacks.", callback=set_verbose)
]
