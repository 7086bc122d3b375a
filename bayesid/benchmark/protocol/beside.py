"""Verdicts of several methods on the same bundles in one table, as competitions of fault diagnosis print it.

Takes scorecards. Gives rows and a section. Does not judge: every method is judged as the diagnosis is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.benchmark.protocol.judgement import DETECTABLE_NONCENTRALITY, NAMING_VERDICTS, ScoredCase
from bayesid.benchmark.protocol.scorecard import Scorecard, score_pack
from bayesid.benchmark.protocol.verdicts import load_verdicts
from bayesid.report.writer import Section, Table, Text

COLUMNS = (
    "method", "bundles", "detection rate", "detection rate, D >= 25", "false-alarm rate",
    "cause told of none", "mean probability of the true cause", "the same, D >= 25", "named right, D >= 25",
    "wrong names of all named", "log score", "median CPU [s]",
)  # fmt: skip
SILENT = ("none", "failed")
# Verdicts that need no cause: the simulator's own coefficients or equations are to blame.
WITHOUT_CAUSE = (*SILENT, "coefficients", "model_form")
ABOUT = (
    "Every method answers the same bundles in the same form and is judged alike. Detection: something is "
    "planted and the verdict is not none. False alarm: nothing is planted and it is not none. A cause is "
    "told of none where nothing is planted and the verdict is neither none nor one that needs no cause "
    "(coefficients, model form). The probability of the true cause counts where one is planted; a verdict "
    "that failed has stated the prior."
)


def scored_beside(
    sheet: Scorecard,
    verdicts: Path,
    answers: Path,
    beside: Sequence[Path],
    uncommitted: bool,
    cache: Path | None,
    commitments: Path | None,
) -> dict[str, tuple[ScoredCase, ...]]:
    """Method -> judged cases of the bundles that all methods were asked, the first being those of `sheet`.

    Raises
    ------
    BlindError
        two folders hold verdicts of the same method, or there is no bundle that all were asked
    """
    out = {method_of(verdicts): sheet.cases}
    for folder in beside:
        name = method_of(folder)
        if name in out:
            raise BlindError(f"{folder}: holds verdicts of the method {name} as another folder does")
        out[name] = score_pack(answers, folder, uncommitted, cache, commitments=commitments).cases
    common = set.intersection(*({c.name for c in cases} for cases in out.values()))
    if not common:
        raise BlindError("no bundle was answered by all these methods")
    return {name: tuple(c for c in cases if c.name in common) for name, cases in out.items()}


def method_of(folder: Path) -> str:
    """The method whose verdicts lie in a folder."""
    stated = {str(v.get("method", {}).get("name", "diagnosis")) for v in load_verdicts(folder).values()}
    if len(stated) > 1:
        raise BlindError(f"{folder}: holds verdicts of several methods: {', '.join(sorted(stated))}")
    return stated.pop() if stated else "diagnosis"


def method_rows(compared: Mapping[str, Sequence[ScoredCase]]) -> list[dict[str, Any]]:
    """Counts and means of every method, plain."""
    return [method_row(name, cases) for name, cases in compared.items()]


def beside_section(compared: Mapping[str, Sequence[ScoredCase]]) -> Section:
    """All methods in one table."""
    table = Table(list(COLUMNS), method_cells(compared), "", digits=3)
    return Section("Beside other methods", [Text(ABOUT), table])


def method_cells(compared: Mapping[str, Sequence[ScoredCase]]) -> list[list[Any]]:
    """The cells of the table, a method in a row."""
    return [cells(row) for row in method_rows(compared)]


def cells(row: Mapping[str, Any]) -> list[Any]:
    """The cells of one method; a count may have been through JSON, and be of an entry made without it."""
    return [_cell(row.get(c)) for c in COLUMNS]


def method_row(name: str, cases: Sequence[ScoredCase]) -> dict[str, Any]:
    """Counts (hits, number) and means of one method by the words of `COLUMNS`."""
    caused = [c for c in cases if c.kind != "none"]
    plain = [c for c in caused if c.noncentrality >= DETECTABLE_NONCENTRALITY]
    nulls = [c for c in cases if c.kind == "none"]
    one = [c for c in caused if c.kind != "two"]
    named = [c for c in cases if c.word in NAMING_VERDICTS]
    single = [c for c in cases if c.kind != "two"]
    costs = [c.cost for c in cases if math.isfinite(c.cost)]
    values = (
        name, len(cases),
        _count([c.word not in SILENT for c in caused]),
        _count([c.word not in SILENT for c in plain]),
        _count([c.word not in SILENT for c in nulls]),
        _count([c.word not in WITHOUT_CAUSE for c in nulls]),
        _mean([c.p_right for c in one]),
        _mean([c.p_right for c in one if c.noncentrality >= DETECTABLE_NONCENTRALITY]),
        _count([c.outcome == "right" for c in plain if c.kind != "outside"]),
        _count([bool(c.named - c.right) for c in named]),
        _mean([c.log for c in single]),
        float(np.median(costs)) if costs else None,
    )  # fmt: skip
    return dict(zip(COLUMNS, values, strict=True))


def _count(hits: Sequence[bool]) -> tuple[int, int]:
    return sum(hits), len(hits)


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _cell(value: Any) -> Any:
    if not isinstance(value, tuple | list):
        return value
    hits, count = value
    return f"{hits}/{count} = {hits / count:.2f}" if count else "–"
