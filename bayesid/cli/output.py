"""Printing answers: aligned columns for people, JSON for programs, both on stdout.

JSON printed has the digits that mean something; files written beside it keep all of them.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.files import json_text, to_plain
from bayesid.progress import printable
from bayesid.report.writer.text import table_text

if TYPE_CHECKING:
    from bayesid.api.result import Result

DIGITS, SD_DIGITS = 6, 3  # significant digits of a number, and of a standard deviation a number ends with
BESIDE_SD = ("value", "mean", "sd", "low95", "high95")


def print_text(text: str = "") -> None:
    """One line or paragraph of the answer."""
    _print(printable(text))


def _print(text: str) -> None:
    try:
        print(text)
    except BrokenPipeError:  # `| head`: the reader has seen enough; files are written all the same
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def command(*words: object) -> str:
    """A command of bayesid as a shell takes it: paths with spaces are quoted."""
    return shlex.join(["bayesid", *map(str, words)])


def print_json(data: Any) -> None:
    """The answer for a program."""
    _print(json_text(rounded(to_plain(data))))


def rounded(data: Any) -> Any:
    """Plain data whose numbers have the digits they mean.

    What stands beside its standard deviation `sd` ends with the third significant digit of it; every other
    number has six significant digits.
    """
    if isinstance(data, dict):
        sd = data.get("sd")
        if not (isinstance(sd, float) and sd > 0):
            return {k: rounded(v) for k, v in data.items()}
        beside = {k: v for k, v in data.items() if k in BESIDE_SD and isinstance(v, float)}
        return {k: _to_place(v, sd) if k in beside else rounded(v) for k, v in data.items()}
    if isinstance(data, list):
        return [rounded(item) for item in data]
    return _significant(data, DIGITS) if isinstance(data, float) else data


def _significant(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _to_place(value: float, sd: float) -> float:
    """Value to the place of the third significant digit of its standard deviation."""
    place = SD_DIGITS - 1 - math.floor(math.log10(sd))
    return round(value, place)


def print_table(columns: Sequence[str], rows: Sequence[Sequence[Any]], digits: int = 4) -> None:
    """Aligned columns; numbers to the right, the last column as long as it wants."""
    _print(table_text(columns, rows, digits))


def answer(
    found: Result,
    out: Path | None,
    as_json: bool,
    verbose: bool,
    files: Mapping[str, Path] | None = None,
    extra: Mapping[str, Any] | None = None,
    figures: Sequence[str] | None = None,
) -> None:
    """Print a result, then save it where a folder is given: should drawing fail, the answer is on the screen.

    Parameters
    ----------
    files : what else lies in the folder, in words
    extra : added to the JSON
    figures : formats in which the figures are written beside the report
    """
    if as_json:
        print_json({**found.record(), **(extra or {})})
    else:
        print_text(found.summary(verbose))
    report = found.save(out) if out is not None else None
    if out is not None and figures:
        found.save_figures(out, figures)
    if report is not None and not as_json:
        print_text()
        for words, path in {**(files or {}), "report": report}.items():
            print_text(f"{words}: {path}")
