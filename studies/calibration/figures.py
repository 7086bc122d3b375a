"""Figures of a calibration: coverage with its bars, and distributions of ranks about the uniform one.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.terms import term
from bayesid.report.figure_style import COLOURS, styled, subplots

Array = np.ndarray


def label(name: str) -> str:
    """Coefficient in mathematical type, anything else as it is."""
    try:
        return term(name).label
    except VehicleError:
        return name


@styled
def rank_panels(panels: Mapping[str, tuple[Array, Array, Array, Array, Sequence[str]]]) -> Any:
    """Distribution of ranks minus the uniform one, a panel per condition, a line per unknown.

    Parameters
    ----------
    panels : condition -> (m,) ranks, (m,) low and (m,) high of the band, (k, m) shares, k names
    """
    rows = (len(panels) + 1) // 2
    figure, axes = subplots(rows, 2, height=1.75 * rows + 0.3, sharex=True, sharey=True, squeeze=False)
    for panel in axes.flat[len(panels) :]:
        panel.set_visible(False)
    for panel, (title, (at, low, high, shares, names)) in zip(axes.flat, panels.items(), strict=False):
        uniform, count = (at + 1) / at.size, at.size - 1
        panel.fill_between(
            at / count, low - uniform, high - uniform, color="#DDDDDD", step="mid", linewidth=0
        )
        outside = ~np.all((shares >= low) & (shares <= high), axis=1)
        for row, name, out in zip(shares, names, outside, strict=True):
            colour, width = (COLOURS["orange"], 1.5) if out else (COLOURS["blue"], 0.7)
            panel.plot(
                at / count, row - uniform, color=colour, linewidth=width, label=label(name) if out else None
            )
        panel.axhline(0.0, color="black", linewidth=0.6)
        panel.set_title(title, fontsize=8)
        if outside.any():
            panel.legend(loc="upper right", fontsize=6, ncols=2)
    for panel in axes[-1]:
        panel.set_xlabel("rank of the truth, of its largest")
    for panel in axes[:, 0]:
        panel.set_ylabel("share below - uniform")
    return figure


@styled
def coverages(
    rows: Mapping[str, Mapping[str, tuple[float, float, float]]],
    levels: Mapping[str, float],
    controls: Sequence[str] = (),
) -> Any:
    """Pooled coverage of each condition with its interval, beside the nominal level; controls hollow.

    Parameters
    ----------
    rows : condition -> interval -> (share, low, high); levels : interval -> nominal share
    """
    figure, axes = subplots(height=0.34 * len(rows) + 1.2)
    looks = zip(levels.items(), (COLOURS["blue"], COLOURS["orange"]), ("s", "o"), strict=False)
    for i, ((word, level), colour, marker) in enumerate(looks):
        axes.axvline(level, color=colour, linewidth=1.0, linestyle="--")
        for j, (name, found) in enumerate(rows.items()):
            share, low, high = found[word]
            axes.errorbar(
                share, j + 0.12 * (2 * i - 1), xerr=[[share - low], [high - share]], fmt=marker, color=colour,
                markerfacecolor="white" if name in controls else colour,
                label=f"{word} intervals" if j == 0 else None,
            )  # fmt: skip
    axes.set_yticks(range(len(rows)), list(rows))
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0, 1)
    axes.set_xlabel("share of intervals that hold the truth (dashed: what they claim)")
    axes.legend(loc="lower left")
    return figure
