"""Figures of a sampled posterior: intervals beside the prior, and traces of the ensembles.

Takes plain arrays. Does not compute beyond quantiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, styled, subplots
from bayesid.report.identify_figures import label

Array = np.ndarray


@styled
def intervals(names: Sequence[str], draws: Array) -> Any:
    """50 and 90 % intervals of (n, k) draws in prior standard deviations about the prior mean."""
    k = len(names)
    figure, axes = subplots(height=0.19 * k + 0.9)
    axes.axvspan(-1.645, 1.645, color="#EEEEEE", zorder=0)
    q = np.quantile(draws, [0.05, 0.25, 0.5, 0.75, 0.95], axis=0)
    at = np.arange(k)
    axes.hlines(at, q[0], q[4], color=COLOURS["blue"], linewidth=1.0)
    axes.hlines(at, q[1], q[3], color=COLOURS["blue"], linewidth=3.0)
    axes.plot(q[2], at, "o", color="white", markeredgecolor=COLOURS["blue"], markersize=3.5)
    axes.set_yticks(at, [label(n) for n in names])
    axes.set_ylim(k - 0.5, -0.5)
    axes.set_xlabel("distance from the prior mean [prior sd]")
    return figure


@styled
def traces(names: Sequence[str], mean: Array, sd: Array, thin: int) -> Any:
    """Mean and sd over walkers along the chain, one panel per unknown, one colour per ensemble.

    Parameters
    ----------
    mean, sd : (ensembles, steps, k)
    """
    e, n, k = mean.shape
    figure, grid = subplots(k, 1, height=0.85 * k + 0.5, squeeze=False, sharex=True)
    stride = max(1, n // 800)
    at = thin * np.arange(n)[::stride]
    for j, axes in enumerate(grid[:, 0]):
        centre, width = mean[..., j].mean(), max(float(sd[..., j].mean()), 1e-300)
        for i in range(e):
            colour = list(COLOURS.values())[i % 7]
            axes.plot(at, (mean[i, ::stride, j] - centre) / width, color=colour, linewidth=0.8)
            axes.plot(at, sd[i, ::stride, j] / width, color=colour, linewidth=0.8, linestyle=":")
        axes.set_ylim(-1.5, 2.0)
        axes.set_ylabel(label(names[j]) if ":" not in names[j] else names[j], fontsize=8)
    grid[-1, 0].set_xlabel("step (solid: mean, dotted: sd, both in posterior sd)")
    return figure
