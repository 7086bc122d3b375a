"""What every verb gives back: numbers, a summary in words, a table, figures, a report.

A result wraps the frozen data of the package that computed it. It computes nothing.
"""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.errors import BayesidError
from bayesid.report.writer import FORMATS, Report, write_figures
from bayesid.report.writer.blocks import figures_of

if TYPE_CHECKING:
    import pandas


class Result:
    """Base of the results of the verbs: `bayesid.fit`, `sample`, `diagnose` and the others."""

    def summary(self, verbose: bool = False) -> str:
        """What the command line prints: the answer in words and tables."""
        raise NotImplementedError

    def record(self) -> Mapping[str, Any]:
        """The numbers as plain data, what `--json` prints."""
        raise NotImplementedError

    def to_dataframe(self) -> pandas.DataFrame:
        """The main table, one row per coefficient, effect, manoeuvre or reading."""
        raise NotImplementedError

    def report(self) -> Report:
        """The report as data: sections of texts, tables and figures."""
        raise NotImplementedError

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write the report and its data into a folder.

        Returns
        -------
        Path                   of report.html
        """
        raise NotImplementedError

    def save_figures(self, folder: str | os.PathLike[str], formats: Sequence[str]) -> list[Path]:
        """Write the figures of the report below `figures/` of a folder.

        Parameters
        ----------
        formats : of "png", "pdf", "svg"

        Raises
        ------
        BayesidError
            another format
        """
        other = [f for f in formats if f not in FORMATS]
        if other:
            raise BayesidError(f"no figure is written as {', '.join(other)}; there are {', '.join(FORMATS)}")
        return write_figures(self.report(), folder, formats)

    def figures(self) -> tuple[str, ...]:
        """Names of the figures `plot` can draw, in the order of the report."""
        return tuple(self._drawn())

    def plot(self, name: str | None = None) -> Any:
        """A figure of the report.

        Parameters
        ----------
        name : one of `figures()`; by default the first

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        BayesidError
            no figure of that name, or none at all
        """
        drawn = self._drawn()
        if not drawn:
            raise BayesidError("this result has no figure")
        if name is not None and name not in drawn:
            raise BayesidError(f"no figure {name!r}; there are {', '.join(drawn)}")
        return drawn[name if name is not None else next(iter(drawn))]

    def _drawn(self) -> dict[str, Any]:
        report = self.report()
        return {figure.name: figure.image for figure in figures_of((*report.first, *report.sections))}

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        table = self.to_dataframe().to_html(max_rows=60, float_format=lambda v: f"{v:.4g}")
        return f"<pre>{html.escape(self.summary())}</pre>{table}"


def table(columns: list[str] | tuple[str, ...], rows: list[list[Any]]) -> pandas.DataFrame:
    """Rows as a DataFrame."""
    import pandas

    return pandas.DataFrame(rows, columns=list(columns))
