"""The options that mean the same in every command."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.result_folder import refuse_other
from bayesid.cli.terminal import set_verbose
from bayesid.lock import lock
from bayesid.progress import printable, set_quiet


def claimed(context: typer.Context, folder: Path | None) -> Path | None:
    """Lock a folder for this command before it reads anything; `terminal.run` gives it back.

    Raises
    ------
    OtherResultError
        it holds the result of another command; nothing in it is touched
    LockError
        another command writes there
    """
    if folder is not None and not context.resilient_parsing:
        refuse_other(folder, context.command_path)
        taken_over = lock(folder, context.command_path)
        if taken_over is not None:
            print(printable(f"note: {taken_over}"), file=sys.stderr)
    return folder


# Every folder a command writes to has `callback=claimed`: two commands in one folder would mix their files.
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", file_okay=False, help="Folder for the results; made if missing.", callback=claimed
    ),
]
OutFolder = Annotated[
    Path,
    typer.Option(
        "--out", "-o", file_okay=False, help="Folder for the results; made if missing.", callback=claimed
    ),
]


FIGURE_FORMATS = ("png", "pdf", "svg")
Figures = Annotated[
    str | None,
    typer.Option(
        "--figures",
        metavar="FORMATS",
        help="Write the figures of the report as pdf or svg too, e.g. pdf or pdf,svg; png is always there.",
    ),
]


def figure_formats(figures: str | None, out: Path | None) -> tuple[str, ...]:
    """Formats asked for, checked before any work."""
    if figures is None:
        return ()
    named = tuple(dict.fromkeys(part.strip().lower() for part in figures.split(",") if part.strip()))
    if not named or set(named) - set(FIGURE_FORMATS):
        raise typer.BadParameter(
            f"{figures!r}: give {', '.join(FIGURE_FORMATS)}, several by commas", param_hint="--figures"
        )
    if out is None:
        raise typer.BadParameter("needs --out", param_hint="--figures")
    return named


Seed = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Seed of every random number.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print the answer only, no progress.", callback=set_quiet)
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", "--jobs", "-j", min=1, help="Worker processes. Default: this process alone."),
]
ExecutorName = Annotated[
    str | None,
    typer.Option(
        "--executor",
        metavar="NAME",
        help="Where tasks run: processes, dask (a cluster of this machine), or tcp://host:port of a Dask "
        "scheduler. The numbers are the same.",
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="A small version of the work, for a first look.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Show details and tracebacks.", callback=set_verbose)
]
