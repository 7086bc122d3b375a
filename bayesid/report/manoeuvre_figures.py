"""Figures of comparing and designing manoeuvres: maps, cross tables, orders with their track.

Takes plain arrays and names. Does not compute results.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from PIL import Image  # comes with matplotlib

from bayesid.report.figure_style import COLOURS, styled, subplots, track_axes
from bayesid.report.shown_orders import shown_orders

Array = np.ndarray
# Range of a map of errors: a run that tells nothing, which everything predicts, would take all colours.
MOST_DECADES = 4.0


def compact(figure: Any, colours: int = 64) -> bytes:
    """PNG of a figure in few colours: a third of the size, for reports of many maps."""
    whole, small = BytesIO(), BytesIO()
    figure.savefig(whole, format="png")
    Image.open(whole).convert("RGB").quantize(colours, dither=Image.Dither.NONE).save(
        small, "PNG", optimize=True
    )
    return small.getvalue()


@styled
def contraction_map(
    panels: Mapping[str, Array], rows: Sequence[str], columns: Sequence[str], label: str = "contraction"
) -> Any:
    """One map per panel, manoeuvres down, coefficients across; missing cells are grey."""
    figure, axes = subplots(
        len(panels), 1, height=len(panels) * (0.9 + 0.17 * len(rows)) + 0.6, squeeze=False, sharex=True
    )
    image: Any = None
    for ax, (title, values) in zip(axes[:, 0], panels.items(), strict=True):
        ax.set_facecolor("#DDDDDD")
        image = ax.imshow(np.ma.masked_invalid(values), vmin=0, vmax=1, cmap="cividis", aspect="auto")
        ax.set_title(title)
        ax.set_yticks(range(len(rows)), rows, fontsize=7)
        ax.grid(False)
    axes[-1, 0].set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    figure.colorbar(image, ax=list(axes[:, 0]), label=label, fraction=0.03, pad=0.01)
    return figure


@styled
def per_minute(names: Sequence[str], values: Array) -> Any:
    """Bars of what a minute teaches, best on top, whiskers over vehicles; (m, 3) least, mean, most."""
    figure, axes = subplots(height=max(1.6, 0.21 * len(names) + 0.8))
    at = np.arange(len(names))[::-1]
    apart = np.array([values[:, 1] - values[:, 0], values[:, 2] - values[:, 1]])
    axes.barh(at, values[:, 1], color=COLOURS["sky"], height=0.7)
    axes.errorbar(values[:, 1], at, xerr=apart, fmt="none", ecolor="black", elinewidth=0.9, capsize=2)
    axes.set_yticks(at, names)
    axes.set_xlim(left=0)
    axes.set_xlabel("gain per minute of run [nats]")
    return figure


@styled
def ridge_map(rows: Sequence[str], columns: Sequence[str], fixed: Array, left: Array) -> Any:
    """Ridges down, manoeuvres across: percent left along the combination known best, below it known least."""
    figure, axes = subplots(height=1.5 + 0.42 * len(rows))
    halves = np.stack([fixed, left], axis=1).reshape(2 * len(rows), len(columns))
    axes.imshow(
        halves, vmin=0, vmax=1, cmap="cividis", aspect="auto",
        extent=(-0.5, len(columns) - 0.5, len(rows) - 0.5, -0.5),
    )  # fmt: skip
    for i, line in enumerate(halves):
        for j, share in enumerate(line):
            text = f"{100 * share:.0f}" if share >= 0.1 else f"{100 * share:.2g}"
            tone = "black" if share > 0.55 else "white"
            axes.text(j, 0.5 * i - 0.25, text, ha="center", va="center", fontsize=6.5, color=tone)
    for i in range(1, len(rows)):
        axes.axhline(i - 0.5, color="white", linewidth=2.0)
    axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=7)
    axes.set_yticks(range(len(rows)), [r.replace(": ", "\n") for r in rows], fontsize=7)
    axes.grid(False)
    return figure


@styled
def cross_map(
    panels: Mapping[str, Array], names: Sequence[str], label: str = "rms error over sensor noise"
) -> Any:
    """Identify on the row, predict the column; logarithmic."""
    figure, axes = subplots(1, len(panels), height=1.6 + 0.19 * len(names), squeeze=False, sharey=True)
    finite = np.concatenate([v[np.isfinite(v) & (v > 0)] for v in panels.values()])
    low, high = np.log10(np.quantile(finite, [0.02, 0.98]))
    low = max(low, high - MOST_DECADES)
    image: Any = None
    for ax, (title, values) in zip(axes[0], panels.items(), strict=True):
        ax.set_facecolor("#DDDDDD")
        with np.errstate(divide="ignore", invalid="ignore"):
            shown = np.ma.masked_invalid(np.log10(values))
        image = ax.imshow(shown, vmin=low, vmax=high, cmap="cividis_r", aspect="auto")
        ax.set_title(title)
        ax.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
        ax.set_xlabel("predicted")
        ax.grid(False)
    axes[0, 0].set_yticks(range(len(names)), names, fontsize=7)
    axes[0, 0].set_ylabel("identified on")
    bar = figure.colorbar(image, ax=list(axes[0]), label=label, fraction=0.03, pad=0.01)
    ticks = np.arange(math.ceil(low), math.floor(high) + 1)
    if ticks.size >= 2:
        bar.set_ticks(ticks.tolist(), labels=[f"$10^{{{int(t)}}}$" for t in ticks])
    else:
        ends = np.linspace(low, high, 4)
        bar.set_ticks(ends.tolist(), labels=[f"{10**t:.2g}" for t in ends])
    return figure


@styled
def against(
    groups: Mapping[str, tuple[Array, Array]], xlabel: str, ylabel: str, band: float = 1.0, log: bool = True
) -> Any:
    """Points of one quantity against another; with `band` > 1 the diagonal and a factor either side of it."""
    figure, ax = subplots(height=3.4, width=7.2 if len(groups) > 1 else 4.6)
    markers = "os^Dvx"
    for k, (name, (x, y)) in enumerate(groups.items()):
        ax.plot(x, y, markers[k % 6], label=name, alpha=0.7, markersize=4)
    if band > 1:
        every = np.concatenate([np.concatenate([x, y]) for x, y in groups.values()])
        ends = np.array([np.nanmin(every), np.nanmax(every)])
        ax.plot(ends, ends, color=COLOURS["grey"], linewidth=1)
        for f in (band, 1 / band):
            ax.plot(ends, ends * f, color=COLOURS["grey"], linewidth=0.8, linestyle=":")
    if log:
        ax.set_xscale("log")
        ax.set_yscale("log")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axis.set_minor_formatter(NullFormatter())
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    if len(groups) > 1:
        figure.legend(loc="outside right upper")
    return figure


@styled
def candidates(names: Sequence[str], values: Array, designed: str, xlabel: str, randoms: Array) -> Any:
    """Bars of all candidates, best on top, with the range of random designs as a band."""
    figure, ax = subplots(height=max(2.0, 0.21 * len(names) + 0.9))
    where = np.arange(len(names))[::-1]
    colours = [COLOURS["orange"] if n == designed else COLOURS["blue"] for n in names]
    ax.barh(where, values, color=colours, height=0.7)
    ax.set_yticks(where, names)
    if randoms.size:
        ax.axvspan(randoms.min(), randoms.max(), color=COLOURS["grey"], alpha=0.25, label="random designs")
        figure.legend(loc="outside right upper")
    positive = values[np.isfinite(values) & (values > 0)]
    if positive.size == values.size and positive.max() > 30 * positive.min():
        ax.set_xscale("log")
    ax.set_xlabel(xlabel)
    return figure


@styled
def orders(t: Array, commands: Mapping[str, Array], states: Mapping[str, Array]) -> Any:
    """Orders over time beside the track the nominal vehicle would make; with depth where there is one."""
    shown, deep = shown_orders(commands), "z" in states
    rows = max(len(shown) + deep, 1)
    figure, axes = subplots(rows, 2, height=1.25 * rows + 1.2, squeeze=False)
    for ax, order in zip(axes[:, 0], shown, strict=False):
        ax.step(t, order.values, where="post", color=COLOURS["blue"])
        ax.set_ylabel(f"{order.label}\n[{order.unit}]")
    if deep:
        axes[-1, 0].plot(t, states["z"], color=COLOURS["blue"])
        axes[-1, 0].invert_yaxis()
        axes[-1, 0].set_ylabel("depth z [m]")
    axes[-1, 0].set_xlabel("time [s]")
    grid = axes[0, 0].get_gridspec()
    for ax in axes[:, 1]:
        ax.remove()
    plan = figure.add_subplot(grid[:, 1])
    plan.plot(states["y"], states["x"], color=COLOURS["blue"])
    plan.plot(states["y"][0], states["x"][0], "o", color=COLOURS["grey"])
    track_axes(plan)
    plan.set_title("track of the nominal vehicle")
    return figure
