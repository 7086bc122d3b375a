"""Figures of a blind check: calibration, confusion, shrink, and outcome by detectability.

Takes plain arrays and counts. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, styled, subplots

Array = np.ndarray


@styled
def calibration(stated: Array, hit: Array, low: Array, high: Array, counts: Sequence[int]) -> Any:
    """Share of hits against stated probability with 95 % intervals; the diagonal is perfect."""
    figure, axes = subplots(height=3.6, width=4.4)
    axes.plot([0, 1], [0, 1], color=COLOURS["grey"], linewidth=1.0, linestyle="--")
    axes.errorbar(stated, hit, yerr=[hit - low, high - hit], fmt="o", color=COLOURS["blue"], capsize=3)
    for x, y, n in zip(stated, hit, counts, strict=True):
        axes.annotate(f"{n}", (x, y), textcoords="offset points", xytext=(-6, 6), ha="right", fontsize=8)
    axes.set_xlim(0, 1.03)
    axes.set_ylim(0, 1.05)
    axes.set_xlabel("stated probability of the first answer")
    axes.set_ylabel("share that was right")
    return figure


@styled
def confusion(rows: Sequence[str], columns: Sequence[str], counts: Array) -> Any:
    """Counts of answers (columns) per planted family (rows); empty cells stay white."""
    figure, axes = subplots(height=0.9 + 0.24 * len(rows), width=max(4.5, 1.9 + 0.28 * len(columns)))
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes.imshow(np.where(counts > 0, share, np.nan), cmap="Blues", vmin=0, vmax=1.4, aspect="auto")
    for i, j in np.argwhere(counts > 0):
        axes.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=7)
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    axes.set_yticks(range(len(rows)), rows)
    axes.grid(False)
    axes.set_xlabel("most probable family of the diagnosis")
    axes.set_ylabel("planted family")
    return figure


@styled
def shrink(values: Mapping[str, Array]) -> Any:
    """Distribution of the shrink per outcome, as steps of the cumulative share."""
    figure, axes = subplots(height=2.8, width=5.5)
    noise_model = (COLOURS["blue"], COLOURS["orange"], COLOURS["green"])
    for (label, x), colour in zip(values.items(), noise_model, strict=False):
        if len(x):
            ordered = np.sort(np.clip(x, -1.0, 1.0))
            axes.step(ordered, np.arange(1, ordered.size + 1) / ordered.size, where="post", color=colour,
                      label=f"{label} ({ordered.size})")  # fmt: skip
    axes.set_xlabel("share of the held-out gap that closed (below -1 drawn at -1)")
    axes.set_ylabel("share of bundles")
    axes.legend(loc="upper left")
    return figure


@styled
def outcomes(noncentrality: Mapping[str, Array], threshold: float) -> Any:
    """Where each outcome lies on the scale of detectability; one row of dots per outcome."""
    labels = list(noncentrality)
    figure, axes = subplots(height=0.8 + 0.32 * len(labels), width=6.0)
    rng = np.random.default_rng(0)
    for k, label in enumerate(labels):
        x = np.maximum(noncentrality[label], 0.1)
        axes.plot(
            x, k + rng.uniform(-0.25, 0.25, x.size), ".", color=list(COLOURS.values())[k % len(COLOURS)]
        )
    axes.axvline(threshold, color=COLOURS["grey"], linestyle="--", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_yticks(range(len(labels)), [f"{n} ({noncentrality[n].size})" for n in labels])
    axes.set_xlabel(f"noncentrality D of the planted cause (detectable from {threshold:g})")
    return figure
