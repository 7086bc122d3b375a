"""A diagnosis on one screen of the terminal: what `bayesid diagnose` prints and `Diagnosis.summary()` gives.

Takes a `Result`. Does not choose words of the answer: `answer` does, for the report as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from bayesid.diagnosis.answer import Answer, answer, counted_after
from bayesid.diagnosis.evidence.effect_draws import warning
from bayesid.diagnosis.moved_words import moved_title
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.result import Result
from bayesid.places import NOWHERE, Places
from bayesid.words import grouped

_SIGNED_ZERO = re.compile(r"(?<![\w.])[+-](0(?:\.0+)?)(?!\.?\d)")


def unsigned_zeros(text: str) -> str:
    """Text in which what was rounded to zero has lost its sign."""
    return _SIGNED_ZERO.sub(r"\1", text)


def notes(result: Result) -> tuple[str, ...]:
    """Warnings but the one on which interval to use: the interval that is shown is that one."""
    drawn = result.posterior and warning(result.posterior)
    return tuple(w for w in result.warnings if w != drawn)


def summary(result: Result, verbose: bool = False, places: Places = NOWHERE) -> str:
    """Answer, failed checks, errors three ways, how sure, what next, notes; `verbose` adds the evidence, and
    the notes of every run."""
    a = answer(result, places)
    out = [a.headline]
    if a.outcome:
        out.append(a.outcome)
    out += [f"CHECK FAILED: {text}" for text in a.failures]
    if a.errors:
        out += ["", f"rms errors, {a.where}, {counted_after(result)}", *_errors(a), f"  {a.explained}"]
    out += _listed("how sure, and what else it could be", a.certainty)
    out += _listed(moved_title(result), a.moved)
    out += _listed("what to do next", a.steps)
    out += _listed("notes", notes(result) if verbose else grouped(notes(result)))
    out.append(f"\nverdict: {result.verdict}; 95 % set: {', '.join(result.set95)}")
    if verbose:
        described = result.description.sentences if result.description else ()
        out += _listed("evidence, in nats", (*map(unsigned_zeros, result.reasons), *described))
    return "\n".join(out)


def _listed(title: str, lines: Iterable[str]) -> list[str]:
    told = [f"  {line}" for line in lines]
    return ["", title, *told] if told else []


def _errors(a: Answer) -> list[str]:
    rows = [["", *(f"{r.what} [{r.unit}]" for r in a.errors)]]
    for k, label in enumerate(a.labels):
        rows.append([label, *(_cell(r.values[k]) for r in a.errors)])
    widths = [max(len(row[j]) for row in rows) for j in range(len(rows[0]))]
    return [
        "  "
        + "  ".join(
            c.ljust(w) if j == 0 else c.rjust(w) for j, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
