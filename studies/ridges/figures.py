"""Draws of X_vv, X_vr and X_rr with prior and truth: the ridge, one panel per set of runs and pair.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.model.terms import term
from bayesid.report.figure_style import COLOURS, styled, subplots

Array = np.ndarray
REACH = 2.4  # prior sd
NORMAL_90 = 2.1460  # radius of the circle that holds 90 % of two normal numbers


@styled
def ridge_panels(sets: Mapping[str, tuple[Array, Array, Array]], names: Sequence[str]) -> Any:
    """One row per pair of coefficients, one column per set of runs.

    Parameters
    ----------
    sets : words -> (m, 3) draws, (3,) truth, (3,) direction known least; all in prior sd from its centre
    names : of the three
    """
    pairs = [(0, 1), (2, 1), (0, 2)]
    figure, axes = subplots(len(pairs), len(sets), height=2.15 * len(pairs) + 0.4, squeeze=False)
    around = np.linspace(0, 2 * np.pi, 200)
    for column, (words, (draws, truth, loose)) in enumerate(sets.items()):
        for row, (i, j) in enumerate(pairs):
            panel = axes[row, column]
            panel.plot(NORMAL_90 * np.cos(around), NORMAL_90 * np.sin(around), "--", color=COLOURS["grey"],
                       linewidth=0.9, label="90 % of the prior")  # fmt: skip
            panel.plot(draws[:, i], draws[:, j], ".", color=COLOURS["blue"], markersize=1.5, alpha=0.35,
                       label="draws (emcee)", rasterized=True)  # fmt: skip
            middle = draws.mean(axis=0)
            ends = middle + np.array([[-1.0], [1.0]]) * loose
            panel.plot(ends[:, i], ends[:, j], color=COLOURS["orange"], linewidth=1.6, label="known least")
            panel.plot(truth[i], truth[j], "k+", markersize=9, markeredgewidth=1.4, label="truth")
            panel.set_xlim(-REACH, REACH)
            panel.set_ylim(-REACH, REACH)
            panel.set_aspect("equal")
            panel.set_xlabel(f"{term(names[i]).label} [prior sd]")
            panel.set_ylabel(f"{term(names[j]).label} [prior sd]")
            if row == 0:
                panel.set_title(words)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure
