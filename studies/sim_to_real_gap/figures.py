"""Figures of a gap story: a log beside the simulator as it was, and beside the diagnosed model with its band.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes

Array = np.ndarray
DEG = 180.0 / np.pi


@styled
def overlay(runs: Sequence[Mapping[str, Any]], models: Sequence[str]) -> Any:
    """Track and heading of each run, the log in black, one line per model, a band around the diagnosed one.

    Parameters
    ----------
    runs : name, t, log (channel -> array), and per model its mean (channel -> array); "low" and "high"
    models : which of "nominal", "recalibrated", "diagnosed" to draw
    """
    looks = {
        "nominal": (NOMINAL, "-", "simulator as it was"),
        "recalibrated": (COLOURS["amber"], "-", "coefficients re-tuned, no effect"),
        "diagnosed": (FITTED, "-", "diagnosed model, 95 % band"),
    }
    figure, grid = subplots(len(runs), 2, height=2.9 * len(runs), squeeze=False)
    for (left, right), run in zip(grid, runs, strict=True):
        log, t = run["log"], np.asarray(run["t"]) - run["t"][0]
        left.plot(log["y"], log["x"], ".", color=MEASURED, markersize=2, label="log")
        right.plot(t, DEG * log["psi"], ".", color=MEASURED, markersize=2, label="log")
        for name in models:
            colour, line, words = looks[name]
            mean = run[name]
            left.plot(mean["y"], mean["x"], line, color=colour, label=words)
            right.plot(t, DEG * mean["psi"], line, color=colour, label=words)
            if name == "diagnosed":
                low, high = run["low"]["psi"], run["high"]["psi"]
                right.fill_between(t, DEG * low, DEG * high, color=COLOURS["sky"], alpha=0.5, linewidth=0)
        track_axes(left)
        left.set_title(run["name"])
        right.set_xlabel("time [s]")
        right.set_ylabel("heading [deg]")
    grid[0, 1].legend(loc="best")
    return figure


@styled
def steady(
    title: Sequence[str],
    x: Sequence[Array],
    measured: Sequence[Array],
    lines: Sequence[Mapping[str, Array]],
    xlabels: Sequence[str],
    ylabels: Sequence[str],
) -> Any:
    """Panels of measured steady values (black) and what models say (lines with markers)."""
    figure, axes = subplots(1, len(x), height=2.8, squeeze=False)
    noise_model = [NOMINAL, FITTED, COLOURS["orange"], COLOURS["green"], COLOURS["purple"]]
    for k, panel in enumerate(axes[0]):
        panel.plot(x[k], measured[k], "o", color=MEASURED, label="measured")
        for colour, (name, values) in zip(noise_model, lines[k].items(), strict=False):
            panel.plot(x[k], values, "-", marker=".", color=colour, label=name)
        panel.set_xlabel(xlabels[k])
        panel.set_ylabel(ylabels[k])
        panel.set_title(title[k])
        panel.margins(x=0.08)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure
