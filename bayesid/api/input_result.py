"""The result of `bayesid.diagnose` where the log, not the vehicle, is what is wrong."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.api.result import Result, table
from bayesid.files import write_json
from bayesid.report import writer
from bayesid.report.input import after_words, check_record, input_report, input_summary
from bayesid.report.writer import Report
from bayesid.trials.mistakes import InputCheck

if TYPE_CHECKING:
    import pandas

    from bayesid.api.diagnose import DiagnoseResult

COLUMNS = ("what", "channels", "runs", "probability", "mend")


@dataclass(frozen=True, eq=False, repr=False)
class InputResult(Result):
    """A verdict on the input, before any on the gap.

    Attributes
    ----------
    trial : name
    checked : what was found
    reasons : why there is not enough to say anything; empty where mistakes were found
    after : diagnosis of the log with its mends applied in memory; None where it was not made
    """

    trial: str
    checked: InputCheck
    reasons: tuple[str, ...] = ()
    after: DiagnoseResult | None = None

    @property
    def verdict(self) -> str:
        """`input`, or `not_enough` where the log has no mistake and too little in it."""
        return "input" if self.checked.findings else "not_enough"

    @property
    def effects(self) -> tuple[str, ...]:
        """No effect is named before the input is in order."""
        return ()

    def record(self) -> Mapping[str, Any]:
        return {
            "format": 1,
            "verdict": self.verdict,
            "trial": {"name": self.trial},
            "input": check_record(self.checked),
            "reasons": list(self.reasons),
            "after_mend": None if self.after is None else dict(self.after.record()),
        }

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per mistake."""
        rows = [
            [f.says, ", ".join(f.channels), ", ".join(f.runs), f.probability, "; ".join(f.mend)]
            for f in self.checked.findings
        ]
        return table(COLUMNS, rows)

    def report(self) -> Report:
        after = None if self.after is None else self.after.report()
        words = "" if self.after is None else self.after.headline.rstrip(".")
        words = after_words(None if self.after is None else self.after.record(), words)
        return input_report(self.trial, self.checked, self.reasons, after, words)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        write_json(target / "diagnosis.json", dict(self.record()))
        if self.after is not None:
            self.after.save(target / "after_mend")
        return writer.write(self.report(), target, dict(self.record()))

    def summary(self, verbose: bool = False) -> str:
        after = None if self.after is None else self.after.record()
        headline = "" if self.after is None else self.after.headline
        text = input_summary(self.checked, self.reasons, after, self.verdict, headline)
        if verbose and self.after is not None:
            text += "\n\nThe mended log:\n" + self.after.summary(verbose)
        return text
