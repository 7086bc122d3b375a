"""The result of `bayesid.diagnose` where the log, not the vehicle, is what is wrong."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.api.result import Result, table
from bayesid.diagnosis.input_gap import InputGap
from bayesid.files import write_json
from bayesid.report import writer
from bayesid.report.input import after_words, check_record, input_report, input_summary
from bayesid.report.writer import Report
from bayesid.trials.held_out_log import held_out_notes
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
    gap : how far the simulator as given misses the log as it is and mended; None where it is not known
    """

    trial: str
    checked: InputCheck
    reasons: tuple[str, ...] = ()
    after: DiagnoseResult | None = None
    gap: InputGap | None = None

    @property
    def verdict(self) -> str:
        """`input`, or `not_enough` where the log has no mistake and too little in it."""
        return "input" if self.checked.findings else "not_enough"

    @property
    def effects(self) -> tuple[str, ...]:
        """No effect is named before the input is in order."""
        return ()

    @property
    def failures(self) -> tuple[str, ...]:
        """No explanation is checked before the input is in order."""
        return ()

    def record(self) -> Mapping[str, Any]:
        return {
            "format": 1,
            "verdict": self.verdict,
            "trial": {"name": self.trial},
            "input": check_record(self.checked),
            "reasons": list(self.reasons),
            "missed": None if self.gap is None else self._missed(self.gap),
            "after_mend": None if self.after is None else dict(self.after.record()),
        }

    @staticmethod
    def _missed(gap: InputGap) -> dict[str, Any]:
        return {
            "run": gap.run,
            "rms": {
                f"{row.what} [{row.unit}]": {
                    name: value if math.isfinite(value) else None
                    for name, value in zip(("as logged", "mended"), row.values, strict=True)
                }
                for row in gap.rows
            },
        }

    @property
    def _gap_words(self) -> str:
        return "" if self.gap is None else self.gap.sentence()

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
        return input_report(self.trial, self.checked, self.reasons, after, words, self._gap_words)

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
        if self.after is not None:  # the mend may reach held-out runs that were right
            text += "".join(f"\n{note}" for note in held_out_notes(self.after.found.result.warnings))
        if self.gap is not None:
            text = f"{self._gap_words}\n\n{text}"
        if verbose and self.after is not None:
            text += "\n\nThe mended log:\n" + self.after.summary(verbose)
        return text
