"""Figures of a calibration: distributions of ranks about the diagonal, and coverage with its bars.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.model.terms import term
from bayesid.report.figure_style import COLOURS, styled, subplots

Array = np.ndarray


def label(name: str) -> str:
    """Coefficient in mathematical type, anything else as it is."""
    try:
        return term(name).label
    except KeyError:
        return name


@styled
def rank_distributions(
    at: Array, low: Array, high: Array, shares: Array, names: Sequence[str], count: int
) -> Any:
    """Distribution of ranks minus the uniform one, one line per unknown, and the band for all together.

    Parameters
    ----------
    at, low, high : (m,) ranks and band; shares : (k, m); count : largest rank
    """
    figure, axes = subplots(height=3.4)
    uniform = (at + 1) / (count + 1)
    axes.fill_between(at / count, low - uniform, high - uniform, color="#DDDDDD", step="mid", linewidth=0,
                      label="95 % band, all unknowns at once")  # fmt: skip
    outside = ~np.all((shares >= low) & (shares <= high), axis=1)
    for row, name, out in zip(shares, names, outside, strict=True):
        colour, width = (COLOURS["orange"], 1.6) if out else (COLOURS["blue"], 0.8)
        axes.plot(
            at / count, row - uniform, color=colour, linewidth=width, label=label(name) if out else None
        )
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel("rank of the truth among the draws, of its largest")
    axes.set_ylabel("share below, minus uniform")
    axes.legend(loc="upper right")
    return figure


@styled
def coverages(rows: Mapping[str, Mapping[str, tuple[float, float]]], levels: Mapping[str, float]) -> Any:
    """Pooled coverage of each case with two standard errors, beside the nominal level.

    Parameters
    ----------
    rows : case -> interval -> (share, standard error); levels : interval -> nominal share
    """
    figure, axes = subplots(height=0.55 * len(rows) + 1.3)
    for i, (word, level) in enumerate(levels.items()):
        colour = list(COLOURS.values())[i]
        axes.axvline(level, color=colour, linewidth=1.0, linestyle="--")
        for j, found in enumerate(rows.values()):
            share, error = found[word]
            axes.errorbar(share, j + 0.12 * (i - 0.5), xerr=2 * error, fmt="o", color=colour,
                          label=word if j == 0 else None)  # fmt: skip
    axes.set_yticks(range(len(rows)), list(rows))
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.set_xlabel("share of intervals that hold the truth (dashed: what they claim)")
    axes.legend(loc="lower left")
    return figure
