"""Printing answers: aligned columns for people, JSON for programs, both on stdout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.files import json_text
from bayesid.progress import printable
from bayesid.report.writer.text import table_text

if TYPE_CHECKING:
    from bayesid.api.result import Result


def say(text: str = "") -> None:
    """One line or paragraph of the answer."""
    print(printable(text))


def say_json(data: Any) -> None:
    """The answer for a program."""
    print(json_text(data))


def say_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 4) -> None:
    """Aligned columns; numbers to the right, the last column as long as it wants."""
    print(table_text(columns, rows, digits))


def answer(
    found: Result,
    out: Path | None,
    as_json: bool,
    verbose: bool,
    files: Mapping[str, Path] | None = None,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Print a result, then save it where a folder is given: should drawing fail, the answer is on the screen.

    Parameters
    ----------
    files : what else lies in the folder, in words
    extra : added to the JSON
    """
    if as_json:
        say_json({**found.record(), **(extra or {})})
    else:
        say(found.summary(verbose))
    report = found.save(out) if out is not None else None
    if report is not None and not as_json:
        say()
        for words, path in {**(files or {}), "report": report}.items():
            say(f"{words}: {path}")
