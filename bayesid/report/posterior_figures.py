"""Figures of posteriors: corner plots, rank plots, widths along directions, bands of predicted runs.

Takes plain arrays. Does not compute results beyond histograms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from bayesid.errors import SampleError
from bayesid.report.figure_style import COLOURS, MEASURED, styled, subplots
from bayesid.report.identify_figures import label

Array = np.ndarray
ORDER = tuple(COLOURS[c] for c in ("blue", "orange", "green", "grey", "purple", "sky", "amber"))
LINES, MARKS = ("-", "--", ":", "-.") * 2, "osD^vPX"  # told apart in grey
LINE_WORDS = ("solid", "dashed", "dotted", "dash-dotted")
MOST_DRAWS = 4000  # per set in a corner plot


@styled
def corner(
    names: Sequence[str], sets: Mapping[str, Array], truth: Array | None = None, size: float = 1.4
) -> Any:
    """Corner plot of some unknowns, one colour per set of draws.

    Parameters
    ----------
    sets : label -> (m, k) draws, in units the reader compares (value over its true or nominal value)
    truth : (k,) marked with lines

    Raises
    ------
    SampleError
        the package corner is missing
    """
    try:
        import corner as package
    except ImportError:
        raise SampleError("corner plots need the package corner: pip install 'bayesid[corner]'") from None
    k = len(names)
    size *= 1.4 if k == 2 else 1.0  # room for the names of the sets
    every = np.concatenate(list(sets.values()))
    low, high = np.quantile(every, [0.002, 0.998], axis=0)
    pad = 0.05 * (high - low)
    reach = list(zip(low - pad, high + pad, strict=True))
    with rc_context({"figure.constrained_layout.use": False}):  # corner lays out its panels itself
        figure = Canvas(figsize=(size * k, size * k))
    FigureCanvasAgg(figure)
    figure.subplots(k, k)
    for (_, draws), colour, line in zip(sets.items(), ORDER, LINES, strict=False):
        picked = draws[:: max(1, len(draws) // MOST_DRAWS)]
        package.corner(
            picked, fig=figure, bins=30, range=reach, labels=[label(n) for n in names], color=colour,
            levels=(0.5, 0.9), smooth=1.0, plot_datapoints=False, plot_density=False, fill_contours=False,
            hist_kwargs={"density": True, "linestyle": line}, contour_kwargs={"linestyles": line},
            truths=None if truth is None else list(truth),
            truth_color="black", label_kwargs={"fontsize": 9}, labelpad=0.0,
        )  # fmt: skip
    edge = 0.45 / k + 0.02
    figure.subplots_adjust(left=edge, bottom=edge, right=0.98, top=0.98, wspace=0.06, hspace=0.06)
    for axes in figure.axes:
        axes.tick_params(labelsize=6)
        axes.grid(visible=False)
    for i in range(k):  # corner scales a histogram to the last set only
        axes = figure.axes[i * k + i]
        tops = [
            p.get_xy()[:, 1].max() for p in axes.patches if hasattr(p, "get_xy") and np.ndim(p.get_xy()) == 2
        ]
        if tops:
            axes.set_ylim(0, 1.1 * max(tops))
    for number, name in enumerate(sets):
        figure.text(
            0.98,
            0.98 - 0.14 / (size * k) * number,
            f"{name} ({LINE_WORDS[number % len(LINE_WORDS)]})",
            color=ORDER[number % len(ORDER)],
            ha="right",
            va="top",
            fontsize=9,
        )
    return figure


@styled
def ranks(names: Sequence[str], draws: Array, bins: int = 20) -> Any:
    """Rank plots: where the draws of each ensemble lie among all draws; flat where ensembles agree.

    Parameters
    ----------
    draws : (ensembles, n, k)
    """
    e, n, k = draws.shape
    columns = min(6, k)
    rows = -(-k // columns)
    figure, grid = subplots(rows, columns, height=0.85 * rows + 0.4, squeeze=False, sharex=True, sharey=True)
    for axes in grid.flat[k:]:
        axes.remove()
    for axes, j in zip(grid.flat, range(k), strict=False):
        order = np.argsort(np.argsort(draws[:, :, j].ravel())).reshape(e, n)
        for i in range(e):
            count, edges = np.histogram(order[i], bins=bins, range=(0, e * n))
            share = np.append(count, count[-1]) * bins / n
            axes.step(edges, share, where="post", color=list(COLOURS.values())[i % 7], linewidth=0.8)
        axes.set_title(label(names[j]) if not names[j].startswith("sigma") else names[j], fontsize=8, pad=2)
        axes.set_ylim(0, 2)
        axes.set_xticks([])
    figure.supylabel("share of draws, 1 if all agree", fontsize=8)
    return figure


@styled
def widths(found: Mapping[str, tuple[Array, Array | None]]) -> Any:
    """Posterior standard deviations along eigenvectors, in prior units, falling; 1 is the prior.

    Parameters
    ----------
    found : label -> sd from draws (k,), and the same of Laplace or None
    """
    figure, axes = subplots(height=3.0)
    for (name, (drawn, laplace)), colour, mark in zip(found.items(), ORDER, MARKS, strict=False):
        count = np.arange(1, drawn.size + 1)
        axes.semilogy(count, drawn, mark, color=colour, label=name, markersize=3.5)
        if laplace is not None:
            axes.semilogy(count, laplace, "-", color=colour, linewidth=0.8)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("eigenvector of the posterior covariance")
    axes.set_ylabel("posterior sd / prior sd")
    axes.legend()
    return figure


@styled
def bands(t: Array, rows: Sequence[tuple[str, Mapping[str, Array], Array]]) -> Any:
    """Distance of draws from the true run over time: 90 % bands, one row per quantity.

    Parameters
    ----------
    rows : label of the axis, set -> (2, n) lower and upper edge, (n,) truth
    """
    figure, grid = subplots(len(rows), 1, height=1.25 * len(rows) + 0.6, squeeze=False, sharex=True)
    for axes, (name, found, truth) in zip(grid[:, 0], rows, strict=True):
        for (words, edges), colour in zip(found.items(), ORDER, strict=False):
            axes.fill_between(
                t, edges[0] - truth, edges[1] - truth, color=colour, alpha=0.45, label=words, linewidth=0
            )
        axes.axhline(0.0, color=MEASURED, linewidth=0.8)
        axes.set_ylabel(name)
    grid[0, 0].legend(ncols=len(rows[0][1]), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    grid[-1, 0].set_xlabel("time [s]")
    return figure


@styled
def spread(t: Mapping[str, Array], found: Mapping[str, Mapping[str, Array]]) -> Any:
    """90 % radius of predicted positions over time, one panel per run, one line per set of draws.

    Parameters
    ----------
    t : run -> (n,) [s]
    found : run -> set -> (n,) radius [m]
    """
    figure, grid = subplots(1, len(found), height=2.6, squeeze=False, sharey=True)
    for axes, (run, lines) in zip(grid[0], found.items(), strict=True):
        for (name, radius), colour, line in zip(lines.items(), ORDER, LINES, strict=False):
            axes.semilogy(t[run][1:], np.maximum(radius[1:], 1e-4), line, color=colour, label=name)
        axes.set_title(run)
        axes.set_xlabel("time [s]")
    grid[0, 0].set_ylabel("90 % radius [m]")
    grid[0, 0].legend()
    return figure
