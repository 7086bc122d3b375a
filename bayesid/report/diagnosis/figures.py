"""Figures of a diagnosis: where, which, the smoothed force, what can be told apart, errors by horizon.

Takes plain arrays and numbers. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter

from bayesid.report.figure_style import COLOURS, styled, subplots

Array = np.ndarray


# Gains are linear up to here and logarithmic beyond, where any exceeds the second number [nats].
LINEAR, WIDE = 10.0, 40.0
# Arrows of a map.
MOST_ARROWS = 120


@styled
def bars(names: Sequence[str], values: Array, xlabel: str, threshold: float | None = None) -> Any:
    """Horizontal bars, best on top; the scale is named on the axis where it is not linear.

    Parameters
    ----------
    threshold : what chance alone reaches, drawn as a line
    """
    figure, axes = subplots(height=max(1.8, 0.24 * len(names) + 0.8))
    where = np.arange(len(names))[::-1]
    noise_model = [COLOURS["blue"] if v > 0 else COLOURS["grey"] for v in values]
    axes.barh(where, values, color=noise_model, height=0.7)
    axes.set_yticks(where, names)
    if threshold is not None:
        axes.axvline(
            threshold,
            color=COLOURS["orange"],
            linestyle="--",
            linewidth=1.0,
            label=f"{threshold:.1f} nats: chance reaches it in at most 1 of 100 trials",
        )
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0))
    finite = np.append(values[np.isfinite(values)], 0.0)
    if np.abs(finite).max() > WIDE:
        axes.set_xscale("symlog", linthresh=LINEAR)
        axes.set_xticks(symlog_ticks(float(finite.min()), float(finite.max())))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axes.minorticks_off()
        xlabel += f"; linear within {LINEAR:g}, logarithmic beyond"
    axes.set_xlabel(xlabel)
    return figure


def symlog_ticks(low: float, high: float) -> list[float]:
    """Round numbers from low to high for an axis that is linear within `LINEAR`; thirds of decades if few."""

    def one_side(end: float) -> list[float]:
        decades = [LINEAR * 10.0**k for k in range(12) if LINEAR * 10.0**k <= end]
        between = [3.0 * d for d in decades if 3.0 * d <= end] if len(decades) < 4 else []
        return sorted([*([0.5 * LINEAR] if len(decades) < 4 and end >= LINEAR else []), *decades, *between])

    return [*(-t for t in reversed(one_side(-low))), 0.0, *one_side(high)]


@styled
def force(
    runs: Sequence[str],
    times: Sequence[Array],
    values: Sequence[Array],
    bands: Sequence[Array],
    axes_names: Sequence[str],
) -> Any:
    """Smoothed latent force of every run with a band of two standard deviations; one row per axis."""
    figure, grid = subplots(
        len(axes_names), len(runs), height=1.3 * len(axes_names) + 0.6, squeeze=False, sharey="row"
    )
    for k, (t, f, b) in enumerate(zip(times, values, bands, strict=True)):
        keep = np.unique(np.linspace(0, t.size - 1, min(t.size, 400)).astype(int))
        for j, name in enumerate(axes_names):
            axes = grid[j, k]
            axes.fill_between(
                t[keep],
                (f - 2 * b)[keep, j],
                (f + 2 * b)[keep, j],
                color=COLOURS["sky"],
                alpha=0.4,
                linewidth=0,
            )
            axes.plot(t[keep], f[keep, j], color=COLOURS["blue"], linewidth=1.0)
            axes.axhline(0.0, color="black", linewidth=0.5)
            if j == 0:
                axes.set_title(runs[k], fontsize=8)
            if k == 0:
                axes.set_ylabel(f"{name} [{'N' if name in 'XYZ' else 'N m'}]")
            if j == len(axes_names) - 1:
                axes.set_xlabel("time [s]")
    return figure


@styled
def isolability(names: Sequence[str], margin: Array) -> Any:
    """Expected margin of every truth (row) over every explanation (column), blind where below 5."""
    n = len(names)
    size = float(np.clip(0.22 * n + 1.6, 3.0, 8.5))
    figure, axes = subplots(height=size, width=size + 0.8)
    shown = np.log10(np.maximum(margin, 0.1))
    image = axes.imshow(shown, cmap="viridis", vmin=-1, vmax=4)
    axes.grid(False)
    axes.set_xticks(range(n), names, rotation=90, fontsize=6)
    axes.set_yticks(range(n), names, fontsize=6)
    axes.set_xlabel("explanation")
    axes.set_ylabel("truth")
    bar = figure.colorbar(image, ax=axes, shrink=0.7)
    bar.set_label("expected margin [nats]")
    bar.set_ticks(range(-1, 5), labels=["< 0.1", "1", "10", "100", "1000", "10000"])
    return figure


@styled
def horizon_errors(
    horizons: Sequence[str],
    before_nominal: Array,
    before: Array,
    after: Array,
    label: str = "with the effect",
) -> Any:
    """Excess prediction error on held-out runs of the three models over every horizon, log scale.

    Parameters
    ----------
    label : what the third model is
    """
    figure, axes = subplots(height=2.6)
    x = np.arange(len(horizons))
    series = (
        ("nominal", before_nominal, COLOURS["grey"]),
        ("recalibrated, no effect", before, COLOURS["amber"]),
        (label, after, COLOURS["blue"]),
    )
    for i, (words, values, colour) in enumerate(series):
        axes.bar(x + 0.27 * (i - 1), np.maximum(values, 1e-3), width=0.25, color=colour, label=words)
    axes.set_yscale("log")
    axes.set_xticks(x, horizons)
    axes.set_ylabel("mean squared error\nabove the floor [noise variances]")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    return figure


@styled
def place_map(north: Array, east: Array, acts: Array, of_hull: bool) -> Any:
    """What acts where, on the tracks: a share of the hull's forces by colour, or a force by arrows.

    Parameters
    ----------
    north, east : (m,) places [m]
    acts : (m, 1) share, or (m, 2) force to the north and to the east [N]
    """
    figure, axes = subplots(height=4.2)
    if of_hull:
        most = max(float(np.abs(acts).max()), 1e-9)
        drawn = axes.scatter(
            east, north, c=100.0 * acts[:, 0], cmap="coolwarm", vmin=-100.0 * most, vmax=100.0 * most, s=14
        )
        figure.colorbar(drawn, ax=axes, label="change of the hull's forces [%]")
    else:
        axes.plot(east, north, ".", color=COLOURS["grey"], markersize=2)
        some = slice(None, None, -(-north.size // MOST_ARROWS))
        largest = max(float(np.hypot(*acts.T).max()), 1e-300)
        arrows = axes.quiver(
            east[some], north[some], acts[some, 1], acts[some, 0], color=COLOURS["blue"], width=0.003
        )
        axes.quiverkey(arrows, 0.82, 0.95, largest, f"{largest:.2g} N", labelpos="E", coordinates="axes")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    return figure
