"""Figures of a prediction: mean and band of track and channels, with readings where there are any.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.model.channels import channel
from bayesid.report.figure_style import FITTED, MEASURED, styled, subplots, track_axes

Array = np.ndarray
_SHOWN = {"rad": ("deg", 180 / np.pi), "rad/s": ("deg/s", 180 / np.pi)}
MOST_POINTS = 600


@styled
def bands(
    t: Array,
    channels: Sequence[str],
    mean: Array,
    low: Array,
    high: Array,
    readings: Mapping[str, Array] | None = None,
    lead: float = 0.0,
    known: float = np.inf,
) -> Any:
    """Track on the left, channels over time on the right; the part read to begin on the track is shaded.

    Parameters
    ----------
    mean, low, high : (n, c) SI
    readings : channel -> (n,) SI
    lead : seconds whose readings were used
    known : time from the start [s] after which the heading is not known; no track is drawn beyond
    """
    keep = np.unique(np.linspace(0, t.size - 1, min(t.size, MOST_POINTS)).astype(int))
    readings = {name: values[keep] for name, values in (readings or {}).items()}
    t, mean, low, high = t[keep], mean[keep], low[keep], high[keep]
    position = [channels.index(c) for c in ("x", "y") if c in channels]
    others = [i for i, c in enumerate(channels) if len(position) < 2 or c not in ("x", "y")][:5]
    rows = max(len(others), 1)
    figure, grid = subplots(rows, 2, height=max(2.6, 0.95 * rows + 0.5), squeeze=False)
    for axes in grid[:, 0]:
        axes.remove()
    plan = figure.add_subplot(grid[0, 0].get_gridspec()[:, 0])
    if len(position) == 2:
        if {"x", "y"} <= set(readings):
            plan.plot(readings["y"], readings["x"], ".", color=MEASURED, markersize=2, label="measured")
        sure = t - t[0] <= known
        plan.plot(mean[sure, position[1]], mean[sure, position[0]], color=FITTED, label="predicted mean")
        track_axes(plan)
        plan.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))  # above: tracks go anywhere
    else:
        plan.axis("off")
    for axes, i in zip(grid[:, 1], others, strict=False):
        unit, factor = _SHOWN.get(channel(channels[i]).unit, (channel(channels[i]).unit, 1.0))
        axes.fill_between(t, factor * low[:, i], factor * high[:, i], color=FITTED, alpha=0.25, linewidth=0)
        axes.plot(t, factor * mean[:, i], color=FITTED, linewidth=1.1)
        if channels[i] in readings:
            axes.plot(t, factor * readings[channels[i]], ".", color=MEASURED, markersize=2)
        if lead > 0:
            axes.axvspan(t[0], t[0] + lead, color="0.85", zorder=0)
        axes.set_ylabel(f"{channels[i]} [{unit}]")
    for axes in grid[:-1, 1]:
        axes.tick_params(labelbottom=False)
    grid[-1, 1].set_xlabel("time [s]")
    return figure
