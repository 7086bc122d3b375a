"""Whose result a folder holds: a command writes into its own, never into that of another.

Takes a folder and the command that wants it. Knows a result by the command in results.json, which every
report brings along, and by the files that one command only writes, as earlier versions left them and as one
that was killed leaves them. Reads only; writes nothing.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from bayesid.errors import BayesidError
from bayesid.files import UnreadableError, read_regular
from bayesid.lock import LOCK, left_behind

LARGEST = 2**28  # bytes of a file that is looked into
RESULTS = "results.json"
STUDY = "study"
# they add one file of a name of their own, or read tables where these lie
SHARING = frozenset({"trial check", "trial measure", "trial init", "vehicle check"})
TRIAL = ("simulate", "trial import", "trial init", "start")


class OtherResultError(BayesidError):
    """The folder holds the result of another command."""


class _Mark(NamedTuple):
    """A file that tells a result, if its JSON has these keys; the first command is told, all may write."""

    pattern: str
    keys: frozenset[str]
    commands: tuple[str, ...]


def _mark(pattern: str, keys: str, *commands: str) -> _Mark:
    return _Mark(pattern, frozenset(keys.split()), commands)


DIAGNOSES = {"diagnosis.json": frozenset({"verdict"}), "fleet.json": frozenset({"verdicts"})}
# studies keep some of these files in a folder of their own
MARKS = (
    *(_Mark(file, keys, ("diagnose",)) for file, keys in DIAGNOSES.items()),
    _mark("*/done.json", "key verdict failure", "diagnose", STUDY),
    _mark("refits/*.fit.npz", "", "diagnose"),
    _mark("chain/setup.json", "density", "sample"),
    _mark("posterior.nc", "", "sample", "diagnose"),
    _mark("predictions.json", "predictions", "predict"),
    _mark("excitation.json", "groups", "excite"),
    _mark("comparison.json", "vehicle", "compare"),
    _mark("design.json", "vehicle goal", "design"),
    _mark("ensemble.json", "members", "export"),
    _mark("profile.jsonl", "digest", "identify"),
    _mark("fit.json", "names cost", "fit", "sample"),
    _mark("iterates.jsonl", "digest", "fit", "sample"),
    _mark("model.json", "hypotheses", "fit", "diagnose"),
    _mark("seal.json", "verdicts", "blind solve", STUDY),
    _mark("*/solved.json", "bundle", "blind solve", STUDY),
    _mark("secret.key", "", "blind make", "blind remove", STUDY),
    _mark("commitments.json", "bundles", "blind make", "blind remove", STUDY),
    _mark("detectability.json", "", "blind score", STUDY),
    _mark("trial.toml", "", *TRIAL),
)  # fmt: skip
# keys of results.json beside those every report has, of reports that name no command and bring no other file
IDENTIFY_KEYS = frozenset({"inputs", "identifiability", "derived"})
REPORT_KEYS = frozenset({"title", "created", "versions"})


def refuse_other(folder: Path, command: str) -> None:
    """Nothing where a command may write into a folder.

    Parameters
    ----------
    command : as a shell takes it, e.g. "bayesid fit", "bayesid study ridges"

    Raises
    ------
    OtherResultError
        the folder holds what another command wrote, or began to write before it was killed
    """
    mine = _name(command)
    if mine in SHARING:
        return
    found = _other(folder, mine)
    if found is not None:
        raise OtherResultError(refusal(folder, mine, *found))


def refusal(folder: Path, mine: str, owner: str, file: str) -> str:
    """What is wrong, where, and what to do next.

    Parameters
    ----------
    mine, owner : name of the command that wants the folder, and of the one whose result is in it
    file : by which it was recognised
    """
    verb = mine.split()[0] if mine.startswith(STUDY) else mine.replace(" ", "_")
    if owner in TRIAL:
        held, another = f"a trial ({file})", folder / verb
    elif file == LOCK:
        held, another = f"what `bayesid {owner}` began and did not end ({file})", _beside(folder, verb)
    elif owner:
        held, another = f"a result of `bayesid {owner}` ({file})", _beside(folder, verb)
    else:
        held, another = f"a report of another command of bayesid ({file})", _beside(folder, verb)
    gone = ", or delete this one if it is no longer needed"
    if owner in TRIAL:
        gone = ""
    elif file == LOCK:  # files of one's own may lie there, and the command may have written none
        gone = f", or delete {folder / LOCK} if nothing of that command is wanted"
    return (
        f"{folder}: holds {held}, and `bayesid {mine}` would mix its files with it; nothing was changed. "
        f"Choose another folder, --out {another} say{gone}"
    )


def refuse_diagnosis(folder: Path, file: str) -> None:
    """Nothing where a folder holds no diagnosis of the other kind, of one bundle or of a folder of bundles.

    Parameters
    ----------
    file : what the other kind writes

    Raises
    ------
    OtherResultError
        it is there
    """
    if _has(folder / file, DIAGNOSES[file]):
        kind = "one bundle" if file == "diagnosis.json" else "a folder of bundles"
        raise OtherResultError(
            f"{folder}: holds the diagnosis of {kind} ({file}); nothing was changed. Choose another folder, "
            f"--out {_beside(folder, 'diagnose')} say, or delete this one if it is no longer needed"
        )


def _beside(folder: Path, verb: str) -> Path:
    whole = folder if folder.name else folder.resolve()
    return whole.with_name(f"{whole.name}_{verb}")


def _other(folder: Path, mine: str) -> tuple[str, str] | None:
    """(command whose result a folder holds, file that tells it) where that is another than this one."""
    if not folder.is_dir():
        return None
    group = mine.split()[0] if mine.startswith(STUDY) else mine
    own = False
    for file, commands in _marks(folder):
        if group not in commands:
            return commands[0], file
        own = own or file != "iterates.jsonl"
    report = _report(folder)
    if report is not None:
        writer = _writer(report)
        if writer:
            named = mine != STUDY and mine.startswith(STUDY)
            same = writer == mine if named else writer.split()[0] == group or writer == mine
            if not same:
                return writer, RESULTS
        elif mine == "sample" and "fit" in report:
            return "fit", RESULTS
        elif not own and not mine.startswith((STUDY, "blind score")):
            return "", RESULTS
    return _begun(folder, mine)


def _marks(folder: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """(file, commands that write it) of every mark a folder has."""
    for mark in MARKS:
        for path in sorted(folder.glob(mark.pattern)):
            if path.is_file() and _has(path, mark.keys):
                yield path.relative_to(folder).as_posix(), mark.commands
                break
    if "What `bayesid start` did" in _text(folder / "steps.sh")[:200]:
        yield "steps.sh", ("start", "trial import")


def _has(path: Path, keys: frozenset[str]) -> bool:
    """Whether a JSON file, or the first line of one of lines, is an object with these keys; of a secret,
    whether it is one."""
    if path.suffix == ".key":
        return re.fullmatch(r"[0-9a-f]{32,}\s*", _text(path)) is not None
    return not keys or keys <= set(_object(path, lines=path.suffix == ".jsonl"))


def _object(path: Path, lines: bool = False) -> dict[str, Any]:
    text = _text(path)
    try:
        found = json.loads(text.partition("\n")[0] if lines else text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _text(path: Path) -> str:
    """Text of a file; empty where it is none, is too large or cannot be read."""
    with suppress(UnreadableError, ValueError):
        return read_regular(path, LARGEST).decode()
    return ""


def _report(folder: Path) -> dict[str, Any] | None:
    """results.json of a report of bayesid."""
    found = _object(folder / RESULTS)
    versions = found.get("versions")
    return found if isinstance(versions, dict) and "bayesid" in versions and "title" in found else None


def _writer(report: dict[str, Any]) -> str:
    """Name of the command that wrote a report; empty where it does not tell."""
    command = report.get("command")
    if isinstance(command, str):
        return _name(command)
    beside = set(report) - REPORT_KEYS
    return "identify" if "identifiability" in beside and beside <= IDENTIFY_KEYS else ""


def _begun(folder: Path, mine: str) -> tuple[str, str] | None:
    """The same of what a killed command left: its lock, and files."""
    command = left_behind(folder)
    if command is None or all(path.name == LOCK for path in folder.iterdir()):
        return None
    owner = _name(command)
    same = owner == mine or {owner, mine} <= set(TRIAL)
    some_study = STUDY in (owner, mine) and owner.startswith(STUDY) and mine.startswith(STUDY)
    return None if owner in SHARING or same or some_study else (owner, LOCK)


def _name(command: str) -> str:
    """ "bayesid fit" as "fit", and a study by its name whether it was given as a command or as a script."""
    study = re.search(r"\bstud(?:y|ies)(?:[ /](\w+))?", command)
    if study is not None:
        return f"{STUDY} {study[1]}" if study[1] else STUDY
    return command.removeprefix("bayesid ").strip()
