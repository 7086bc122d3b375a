"""Figures of a fit: measured runs with the vehicle as given and as found laid over them, and the search
itself.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesid.model.channels import channel
from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes

Array = np.ndarray
_SHOWN = {"rad": ("deg", 180 / np.pi), "rad/s": ("deg/s", 180 / np.pi)}
MOST_POINTS = 600


@styled
def overlay(t: Array, channels: Sequence[str], readings: Array, nominal: Array, fitted: Array) -> Any:
    """One run: track on the left where positions were measured, all other channels over time on the right.

    Parameters
    ----------
    readings, nominal, fitted : (n, c) SI
    """
    keep = np.unique(np.linspace(0, t.size - 1, min(t.size, MOST_POINTS)).astype(int))
    t, readings, nominal, fitted = t[keep], readings[keep], nominal[keep], fitted[keep]
    position = [channels.index(c) for c in ("x", "y") if c in channels]
    others = [i for i, c in enumerate(channels) if len(position) < 2 or c not in ("x", "y")][:5]
    rows = max(len(others), 1)
    figure, grid = subplots(rows, 2, height=max(2.6, 0.95 * rows + 0.5), squeeze=False)
    for axes in grid[:, 0]:
        axes.remove()
    plan = figure.add_subplot(grid[0, 0].get_gridspec()[:, 0])
    series = (
        (readings, MEASURED, "measured", ".", 2.0),
        (nominal, NOMINAL, "as given", "--", 1.0),
        (fitted, FITTED, "as found", "-", 1.1),
    )
    if len(position) == 2:
        shown = np.concatenate([readings, fitted])[:, position]
        low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
        margin = 0.25 * max((high - low).max(), 1e-6)
        for values, colour, label, line, width in series:
            style: dict[str, Any] = {"markersize": width} if line == "." else {"linewidth": width}
            inside = np.all(
                (values[:, position] > low - margin) & (values[:, position] < high + margin), axis=1
            )
            drawn = np.where(inside[:, None], values[:, position], np.nan)
            plan.plot(drawn[:, 1], drawn[:, 0], line, color=colour, label=label, **style)
        track_axes(plan)
        plan.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))  # above: tracks go anywhere
    else:
        plan.axis("off")
    for axes, i in zip(grid[:, 1], others, strict=False):
        unit, factor = _SHOWN.get(channel(channels[i]).unit, (channel(channels[i]).unit, 1.0))
        for values, colour, label, line, width in series:
            style = {"markersize": width} if line == "." else {"linewidth": width}
            axes.plot(t, factor * values[:, i], line, color=colour, label=label, **style)
        axes.set_ylabel(f"{channels[i]} [{unit}]")
        span = factor * np.concatenate([readings[:, i], fitted[:, i]])
        pad = 0.15 * (np.nanmax(span) - np.nanmin(span)) + 1e-12
        axes.set_ylim(np.nanmin(span) - pad, np.nanmax(span) + pad)
    for axes in grid[:-1, 1]:
        axes.tick_params(labelbottom=False)
    grid[-1, 1].set_xlabel("time [s]")
    return figure


@styled
def estimates(labels: Sequence[str], change: Array, sd: Array, prior_sd: Array, limit: float = 1.5) -> Any:
    """Coefficients over the values they started from: estimate with its sd, prior sd as a grey bar."""
    figure, axes = subplots(height=3.0)
    place = np.arange(len(labels))
    prior = np.minimum(np.where(np.isfinite(prior_sd), prior_sd, 0.0), 10.0)
    axes.bar(place, 2 * prior, 0.8, 1 - prior, color="#E6E6E6", label="prior, one sd")
    axes.axhline(1.0, color="black", linewidth=0.8)
    bars = np.minimum(np.where(np.isfinite(sd), sd, 0.0), 10.0)
    axes.errorbar(
        place, change, bars, fmt="o", color=FITTED, capsize=2, linewidth=1, label="estimate, one sd"
    )
    reach = min(limit, max(0.1, 1.2 * float(np.max(np.abs(change - 1) + np.minimum(bars, limit)))))
    for outside, marker, edge in ((change > 1 + reach, "^", 1 + reach), (change < 1 - reach, "v", 1 - reach)):
        if outside.any():
            axes.plot(place[outside], np.full(outside.sum(), edge), marker, color=FITTED, clip_on=False)
    axes.set_ylim(1 - reach, 1 + reach)
    axes.set_xlim(-0.6, len(labels) - 0.4)
    axes.set_xticks(place, list(labels), rotation=60, ha="right", rotation_mode="anchor")
    axes.set_ylabel("value / start")
    axes.grid(axis="x", visible=False)
    axes.legend(ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


@styled
def search(costs: Sequence[float], steps: Sequence[float]) -> Any:
    """Cost above the lowest and step over iterations, logarithmic; the cost itself where it rises because the
    weights are estimated between rounds.
    """
    figure, axes = subplots(height=2.4)
    count = np.arange(1, len(costs) + 1)
    last = min(costs)
    reweighed = costs[-1] > 1.01 * last
    above = np.asarray(costs) - (0.0 if reweighed else last)
    axes.semilogy(count, np.maximum(above, 1e-6 * max(last, 1e-300)), color=FITTED)
    axes.set_xlabel("iteration")
    axes.set_ylabel("cost, weights changing" if reweighed else "cost above its last", color=FITTED)
    recovery = axes.twinx()
    recovery.semilogy(count, np.maximum(steps, 1e-16), ".", color=COLOURS["orange"], markersize=3)
    recovery.set_ylabel("step (rms relative change)", color=COLOURS["orange"])
    recovery.grid(visible=False)
    return figure
