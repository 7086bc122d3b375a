"""The tree of commands of `bayesid`; each lives in its own module and imports the library when it runs.

Takes arguments of a shell. Computes nothing; exit codes and messages are those of `terminal`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from bayesid.cli import blind, effect, manoeuvre, trial, vehicle
from bayesid.cli.compare import compare
from bayesid.cli.design import design
from bayesid.cli.diagnose import diagnose
from bayesid.cli.excite import excite
from bayesid.cli.export import export
from bayesid.cli.fit import fit
from bayesid.cli.identify import identify
from bayesid.cli.options import Verbose
from bayesid.cli.predict import predict
from bayesid.cli.sample import sample
from bayesid.cli.schema import schema
from bayesid.cli.simulate import simulate
from bayesid.cli.start import start
from bayesid.cli.study import HANDED_ON, study
from bayesid.cli.terminal import guarded
from bayesid.cli.trial_import import import_logs, init
from bayesid.cli.trial_measure import measure
from bayesid.cli.vehicle_check import check
from bayesid.cli.vehicle_new import new

EPILOGUE = (
    "Exit codes: 0 ok, 2 usage or bad input, 3 not converged, a check failed, or a question is left, "
    "4 a mistake in the log, 130 stopped."
)


def run(args: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    return guarded(command, args)


def command() -> Any:
    """The command tree as typer's underlying command object."""
    app = typer.Typer(
        epilog=EPILOGUE,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        rich_markup_mode=None,  # plain help: 0.1 s instead of 0.25 s, and `|` in X_u|u| stays as it is
        pretty_exceptions_enable=False,
    )
    app.callback()(_root)
    app.command("start")(start)
    app.command("simulate")(simulate)
    app.command("fit")(fit)
    app.command("identify")(identify)
    app.command("sample")(sample)
    app.command("diagnose")(diagnose)
    app.command("excite")(excite)
    app.command("predict")(predict)
    app.command("export")(export)
    app.command("compare")(compare)
    app.command("design")(design)
    app.command("study", context_settings=HANDED_ON)(study)
    app.command("schema")(schema)
    groups = {
        "vehicle": _group(
            "Look at coefficient sets, check them, make new ones.",
            list=vehicle.listing,
            show=vehicle.show,
            terms=vehicle.terms,
            new=new,
            check=check,
        ),
        "effect": _group("Look up the unmodelled effects.", list=effect.listing, show=effect.show),
        "manoeuvre": _group("Look up the manoeuvres.", list=manoeuvre.listing),
        "trial": _group(
            "Bring logs in and look at them before they are used.",
            **{"import": import_logs},
            init=init,
            check=trial.check,
            measure=measure,
        ),
        "blind": _group(
            "Check the diagnosis on effects nobody here knows.",
            make=blind.make,
            remove=blind.remove,
            solve=blind.solve,
            score=blind.score,
        ),
    }
    for name, group in groups.items():
        app.add_typer(group, name=name)
    return typer.main.get_command(app)


def _group(purpose: str, **commands: Callable[..., Any]) -> typer.Typer:
    group = typer.Typer(help=purpose, no_args_is_help=True, rich_markup_mode=None)
    for name, function in commands.items():
        group.command(name)(function)
    group.callback()(lambda: None)  # without it a group of one command would collapse into that command
    return group


def _version(wanted: bool) -> None:
    if wanted:
        from bayesid import __version__

        print(f"bayesid {__version__}")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", callback=_version, is_eager=True)
    ] = False,
    verbose: Verbose = False,
) -> None:
    """Identify hydrodynamic coefficients from free-running trials and say what they do not fix."""
