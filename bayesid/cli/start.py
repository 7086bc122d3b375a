"""`bayesid start`: from a folder of logs to the first diagnosis; every step is a command it prints.

Takes a folder. Computes nothing itself: each step calls the command it names.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bayesid.cli.options import Quick, Verbose, claimed
from bayesid.cli.result_folder import refuse_other
from bayesid.cli.terminal import BAD_INPUT, OK
from bayesid.words import counted

if TYPE_CHECKING:
    from bayesid.trials.importing.finding import Found

ASKED = 3  # exit code: a question is open
STEPS, GAP = "steps.sh", "gap"
HEAD = "#!/bin/sh -e\n# What `bayesid start` did. For others: change names of logs and of the folder."

Folder = Annotated[
    Path, typer.Argument(metavar="FOLDER", help="Folder with logs, or one log.", show_default=False)
]
Named = Annotated[
    str | None,
    typer.Option("--vehicle", help="Built-in name or vehicle file.", show_default=False),
]
Target = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        file_okay=False,
        help="Folder for the results; default: FOLDER/bayesid.",
        callback=claimed,
    ),
]
Never = Annotated[
    bool,
    typer.Option("--yes", "-y", help="Never wait for an answer: print the questions and stop (exit code 3)."),
]


def start(
    context: typer.Context,
    folder: Folder,
    vehicle: Named = None,
    out: Target = None,
    yes: Never = False,
    quick: Quick = False,
    verbose: Verbose = False,
) -> int:
    """Guide from raw logs to a first diagnosis: find, import, check, diagnose, report.

    Ends with the exit code of the diagnosis: 3 where a check failed, 4 where the log has a mistake.

    A vehicle is a built-in name (--vehicle), or a vehicle file, a data sheet (`bayesid vehicle new
    --template`) or a simulator's file in the folder. It asks only what files cannot tell; without a
    terminal, or with --yes, it prints the questions, names the file to edit and stops with exit code 3.
    Given again, it goes on where it stopped. The commands are kept in OUT/steps.sh, to be given alone the
    next time.
    """
    from bayesid.cli.output import print_text
    from bayesid.errors import BayesidError
    from bayesid.trials.importing.finding import look_into

    if not folder.exists():
        raise BayesidError(f"{folder}: does not exist")
    if out is None:
        out = (
            folder / "bayesid"
            if folder.is_dir()
            else folder.with_name(f"{folder.name.partition('.')[0]}_bayesid")
        )
    found = look_into(folder, out)
    for path, why in found.damaged:
        print_text(f"{path} is left out: {why}")
    bundle = out
    if not (out / "trial.toml").exists() and found.bundle is not None:
        bundle = found.bundle
        print_text(f"{bundle} is a trial bundle already.")
    elif not found.logs and not (out / "trial.toml").exists():
        raise BayesidError(_nothing(folder, found))
    refuse_other(out / GAP, "bayesid diagnose")
    out.mkdir(parents=True, exist_ok=True)
    claimed(context, out)
    steps = _Steps(out)
    ask = sys.stdin.isatty() and sys.stdout.isatty() and not yes
    named, code = _vehicle(vehicle, found, bundle, out, steps, ask)
    if code:
        return code
    if not (bundle / "trial.toml").exists():
        code = _import(found, named, out, steps, ask)
        if code:
            return code
    return _judge(bundle, out, named, steps, quick, verbose)


class _Steps:
    """Prints each command before it is carried out and keeps it in steps.sh, which can be run again."""

    def __init__(self, out: Path) -> None:
        from bayesid.errors import BayesidError

        self.path = out / STEPS
        try:
            text = self.path.read_text(encoding="utf-8") if self.path.exists() else ""
        except ValueError:
            raise BayesidError(
                f"{self.path}: is not what `bayesid start` wrote; delete it, and give the command again"
            ) from None
        self.lines = text.splitlines()[2:]

    def say(self, *words: object, unless: Path | None = None, passing: int = 0) -> str:
        """The line kept; `unless`: what the command makes, and would not make a second time; `passing`: an
        exit code after which the steps go on."""
        from bayesid.cli.output import command, print_text

        line = command(*words)
        print_text(f"\n$ {line}")
        if unless is not None:
            line = f"{shlex.join(['test', '-e', str(unless)])} || {line}"
        if passing:
            line = f"{line} || test $? -eq {passing}"
        if line not in self.lines:
            self.lines.append(line)
        self._write()
        return line

    def made(self, call: Callable[[], int], made: Path, *words: object) -> int:
        """Exit code of a command that makes a file; one that asked or failed is not kept."""
        line, code = self.say(*words, unless=made), None
        try:
            code = call()
        finally:
            if code != OK:
                self.lines.remove(line)
                self._write()
        return code

    def _write(self) -> None:
        from bayesid.files import write_atomic

        write_atomic(self.path, "\n".join([HEAD, *self.lines]) + "\n")


def _nothing(folder: Path, found: Found) -> str:
    from bayesid.trials.importing.finding import LOGS

    seen = "".join(f"\n  {path.name}: {why}" for path, why in found.skipped[:6])
    return f"{folder}: holds no log that can be read ({', '.join(sorted(LOGS))}){seen}"


def _vehicle(
    given: str | None, found: Found, bundle: Path, out: Path, steps: _Steps, ask: bool
) -> tuple[str | None, int]:
    """(vehicle to use or None where the bundle names one, exit code)."""
    from bayesid.cli.output import command, print_text
    from bayesid.cli.vehicle_new import new
    from bayesid.model.vehicles import builtin_names, load_vehicle

    made = out / "vehicle.toml"
    if given is None:
        if (bundle / "trial.toml").exists() and _bundle_names_one(bundle):
            return None, OK
        if made.exists():
            return str(made), OK
        if len(found.vehicles) > 1:
            given = _which(found.vehicles, ask)
            if given is None:
                return None, ASKED
        elif found.vehicles:
            given = str(found.vehicles[0])
        elif found.sheet is not None:
            code = steps.made(
                lambda: new(made, sheet=found.sheet), made, "vehicle", "new", made, "--sheet", found.sheet
            )
            return (str(made), OK) if code == OK else (None, BAD_INPUT)
        elif found.simulator:
            words = [word for path in found.simulator for word in ("--simulator", path)]
            code = steps.made(
                lambda: new(made, simulator=list(found.simulator)), made, "vehicle", "new", made, *words
            )
            return (str(made), OK) if code == OK else (None, BAD_INPUT)
        elif found.map is None or not _map_names_one(found.map):
            names = ", ".join(builtin_names())
            if ask:
                given = typer.prompt(f"Which vehicle? A built-in name ({names}) or a vehicle file").strip()
            else:
                sheet = (found.logs[0].parent if found.logs else out) / "sheet.toml"
                made_by = f"{command('vehicle', 'new', '--template')} > {shlex.quote(str(sheet))}"
                print_text("Question: which vehicle is it? No file here says. Either")
                print_text(f"  - a built-in one: give --vehicle NAME ({names}), or")
                print_text(f"  - by a data sheet: {made_by}, and edit it (of a ship: --template --ship), or")
                print_text("  - put a vehicle file, or a simulator's sdf, urdf or scn, beside the logs;")
                print_text("then give the same command again.")
                return None, ASKED
    if given is not None:
        load_vehicle(given)
    return given, OK


def _which(vehicles: Sequence[Path], ask: bool) -> str | None:
    """One of several vehicle files; None where nobody can be asked."""
    from bayesid.cli.output import print_text

    print_text("Question: which vehicle is it? There are several files:")
    for path in vehicles:
        print_text(f"  - {path}")
    if ask:
        return str(typer.prompt("Which one?")).strip()
    print_text(
        f"Give the same command again with --vehicle, as in --vehicle {shlex.quote(str(vehicles[0]))}."
    )
    return None


def _bundle_names_one(bundle: Path) -> bool:
    import tomllib

    from bayesid.errors import TrialError

    path = bundle / "trial.toml"
    try:
        return bool(tomllib.loads(path.read_text(encoding="utf-8-sig")).get("vehicle"))
    except (ValueError, RecursionError) as error:
        raise TrialError(
            f"{path}: not valid TOML: {error}; mend it, or delete it to import the logs anew"
        ) from None


def _map_names_one(path: Path) -> bool:
    from bayesid.trials.importing import read_map

    return bool(read_map(path).vehicle)


def _import(found: Found, vehicle: str | None, out: Path, steps: _Steps, ask: bool) -> int:
    """Bundle in `out`; exit code."""
    from bayesid.cli.output import print_text
    from bayesid.cli.trial_import import imported
    from bayesid.trials.importing import read_map

    logs, own, bundle = list(found.logs), out / "map.toml", out / "trial.toml"
    for path, why in found.skipped:
        print_text(f"{path.name} is left out: {why}")
    given = own if own.exists() else found.map
    if given is None:
        words = ["--vehicle", vehicle] if vehicle else []
        order = ["trial", "import", *logs, "--out", out, *words]
        if steps.made(lambda: imported(logs, out, None, vehicle, guided=True)[0], bundle, *order) == OK:
            return OK
        given = own
    if questions := read_map(given).questions:
        are = counted(len(questions), "question is", "questions are")
        print_text(f"\n{are} open in {given}{', most important first' if questions[1:] else ''}:")
        for k, text in enumerate(questions, 1):
            print_text(f"  {k}. {text}")
        if not ask or not _accepted(given, questions):
            print_text(
                f"\nEdit {given}, delete each question when it is answered, and give the same command again."
            )
            return ASKED
    order = ["trial", "import", *logs, "--map", given, "--out", out]
    return steps.made(lambda: imported(logs, out, given, None, guided=True)[0], bundle, *order)


def _accepted(path: Path, questions: tuple[str, ...]) -> bool:
    """Whether the map holds as it stands, question by question; accepted ones leave the file."""
    import re

    from bayesid.files import write_atomic

    for k, _ in enumerate(questions, 1):
        if not typer.confirm(f"Question {k}: does the map hold as it stands?", default=False):
            return False
    text = path.read_text(encoding="utf-8")
    write_atomic(path, re.sub(r"(?ms)^# Answer each by editing.*?\n|^questions = \[.*?^\]\n", "", text))
    return True


def _judge(bundle: Path, out: Path, vehicle: str | None, steps: _Steps, quick: bool, verbose: bool) -> int:
    from bayesid.cli.diagnose import diagnose
    from bayesid.cli.output import print_text
    from bayesid.cli.terminal import OK, WRONG_LOG
    from bayesid.cli.trial import check

    own = ["--vehicle", vehicle] if vehicle and not _bundle_names_one(bundle) else []
    steps.say("trial", "check", bundle, *own, passing=WRONG_LOG)
    code = check(bundle, vehicle=own[1] if own else None, verbose=verbose)
    if code not in (OK, WRONG_LOG):  # a diagnosis mends a mistake of the log in memory
        return code
    gap = out / GAP
    _say_before(bundle, gap, own, quick)
    steps.say("diagnose", bundle, "--out", gap, *own, *(["--quick"] if quick else []))
    code = diagnose(bundle, out=gap, vehicle=own[1] if own else None, quick=quick, verbose=verbose)
    print_text(f"\nThe commands are in {steps.path}, for the next logs.")
    return code


def _say_before(bundle: Path, gap: Path, own: list[str], quick: bool) -> None:
    """What the diagnosis reads, how long it may take, and which run it is judged by."""
    from bayesid.api.outlook import outlook
    from bayesid.cli.output import command, print_text

    ahead = outlook(bundle, own[1] if own else None, quick=quick)
    rate, time, held = ahead.sentences()
    if (step := ahead.coarser) is not None:
        line = command("diagnose", bundle, "--out", gap, *own, "--resample", f"{step:g}")
        time += f" With single readings it is faster, and knows somewhat less: {line}"
    other = "another" if ahead.held_out else "one"
    roles = f'`role = "holdout"` or "identify" of the runs in {bundle / "trial.toml"}'
    print_text(f"\n{rate}\n{time}\n{held} To hold out {other}: {roles}; then give the same command again.")
