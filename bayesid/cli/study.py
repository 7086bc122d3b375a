"""`bayesid study`: lists and runs the studies of a checkout (`studies/*/run.py`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from bayesid.cli.options import Out, Quick, Quiet, Verbose
from bayesid.cli.result_folder import refuse_other
from bayesid.lock import lock, release

HELP = ("-h", "--help")
# what this command does not know is an option of the study, help among it
HANDED_ON: dict[str, Any] = {
    "ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []
}  # fmt: skip

QUESTIONS = ("study", "question")
OWN_OPTIONS = ("--data", "--out", "--seed", "--quick")
EXECUTOR_OPTIONS = ("--workers", "--executor")  # of `bayesid.executor.add_executor`


def study(
    context: typer.Context,
    name: Annotated[str | None, typer.Argument(help="Study to run; left out: list them.")] = None,
    data: Annotated[
        Path | None, typer.Option("--data", help="Folder of the logs, for a study that reads some.")
    ] = None,
    out: Out = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed instead of the study's own.")] = None,
    quick: Quick = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Run a study and write its report.

    Further options are those of the study: `bayesid study NAME --help`.
    """
    from bayesid.cli.output import print_table, print_text

    studies = _studies()
    if name in HELP:
        print_text(context.get_help())
        print_text("\nStudies:")
        print_table(QUESTIONS, [[key, _question(path)] for key, path in studies.items()])
        print_text("\nFurther options of the studies, which `bayesid study NAME --help` explains:")
        print_table(["study", "options"], [[key, " ".join(_options(path))] for key, path in studies.items()])
        return 0
    if name is None:
        print_table(QUESTIONS, [[key, _question(path)] for key, path in studies.items()])
        return 0
    if name.startswith("-"):
        raise typer.BadParameter(f"options of a study come after its name, {name} among them")
    if name not in studies:
        raise typer.BadParameter(f"no study {name!r}; there are: {', '.join(studies)}", param_hint="NAME")
    if set(HELP) & set(context.args):
        return _run_script(studies[name], ["--help"])
    folder = out or Path("out") / name
    release(folder)  # held by no study in particular until here
    refuse_other(folder, f"bayesid study {name}")
    lock(folder, f"bayesid study {name}")
    arguments = ["--out", str(folder), *(["--quick"] if quick else []), *context.args]
    if data is not None:
        arguments += ["--data", str(data)]
    if seed is not None:
        arguments += ["--seed", str(seed)]
    code = _run_script(studies[name], arguments)
    if code == 0:
        for path in sorted(folder.rglob("report.html")):  # one, or one per data set
            print_text(f"report: {path}")
    return code


def _studies() -> dict[str, Path]:
    """Studies by name, from the working folder or the checkout this package runs from."""
    from bayesid.errors import BayesidError

    for base in (Path.cwd(), Path(__file__).resolve().parents[2]):
        found = {path.parent.name: path for path in sorted((base / "studies").glob("[a-z]*/run.py"))}
        if found:
            return found
    raise BayesidError("no folder 'studies' here; run this command inside a checkout of bayesid")


def _question(path: Path) -> str:
    """First line of a study's docstring."""
    import ast

    try:
        text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    except (SyntaxError, ValueError):
        return ""
    return text.split("\n")[0]


def _options(path: Path) -> list[str]:
    """Options of a study beyond those of this command, as its source adds them."""
    import ast

    try:
        calls = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Call)]
    except (SyntaxError, ValueError):
        return []
    found: list[str] = []
    for call in calls:
        what = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        if what == "add_executor":
            found += EXECUTOR_OPTIONS
        if what == "add_argument":
            given = [str(a.value) for a in call.args if isinstance(a, ast.Constant)]
            found += [text for text in given if text.startswith("--") and text not in OWN_OPTIONS]
    return found


def _run_script(path: Path, arguments: list[str]) -> int:
    import runpy
    import sys

    before, roots = sys.argv, sys.path
    sys.argv = [str(path), *arguments]
    sys.path = [str(path.parents[2]), *roots]  # a study imports its own modules as studies.NAME.module
    try:
        runpy.run_path(str(path), run_name="__main__")
    except SystemExit as end:
        if isinstance(end.code, str):
            print(f"bayesid: {end.code}", file=sys.stderr)
            return 2
        return int(end.code or 0)
    finally:
        sys.argv, sys.path = before, roots
    return 0
