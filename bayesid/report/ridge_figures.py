"""The ridge of a posterior in two pictures: as coefficients, and turned to what is fixed and what is open.

Takes plain arrays in units of the prior sd. Does not compute beyond histograms, means and covariances. Drawn
without the package corner, so that the command has its figure without an extra.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, styled, subplots
from bayesid.report.identify_figures import label

Array = np.ndarray
SIZE, MOST_DOTS = 3.9, 1500
PRIOR90 = 2.146  # radius that holds 90 % of a round Gaussian in the plane
REACH = 3.2  # prior sds drawn of a coefficient


@styled
def plain_corner(names: Sequence[str], draws: Array, loose: Array, fixed: Array) -> Any:
    """Coefficients against each other, with the ridge.

    Parameters
    ----------
    draws : (m, g) distance from the prior mean in prior sds
    loose : (l, g) the combinations left open, unit vectors; each is drawn where it shows
    fixed : (g,) the combination known best
    """
    g = len(names)
    figure, grid = subplots(g, g, height=SIZE, width=SIZE, squeeze=False)
    middle = draws.mean(axis=0)
    halves = 1.645 * np.std(draws @ loose.T, axis=0)[:, None] * loose
    for i in range(g):
        for j in range(g):
            axes = grid[i, j]
            if j > i:
                axes.remove()
                continue
            axes.grid(visible=False)
            _ticks(axes, i == g - 1, j == 0 and i > 0)
            axes.set_xlim(-REACH, REACH)
            if i == j:
                _histogram(axes, draws[:, i], REACH)
                axes.set_title(label(names[i]), fontsize=9, pad=2)
                continue
            axes.set_ylim(-REACH, REACH)
            _circle(axes)
            axes.plot(
                *_dots(draws, j, i), ".", color=COLOURS["sky"], markersize=1.4, alpha=0.6, rasterized=True
            )
            for half in halves:
                if np.hypot(half[i], half[j]) > 0.5 * np.linalg.norm(half):
                    _through(axes, middle[[j, i]], half[[j, i]], COLOURS["orange"], 1.6, "-")
            seen = float(np.hypot(fixed[i], fixed[j]))
            if seen > 0.3:
                _through(axes, middle[[j, i]], 0.9 * fixed[[j, i]] / seen, "black", 0.9, (0, (2, 1.5)))
            if j == 0:
                axes.set_ylabel(label(names[i]), fontsize=9)
    for j in range(g):
        grid[g - 1, j].set_xlabel(label(names[j]), fontsize=9)
    return figure


@styled
def rotated_corner(
    titles: Sequence[str], left: Sequence[float], turned: Array, laplace: Sequence[float]
) -> Any:
    """The same draws along combinations, each axis at its own scale.

    Parameters
    ----------
    titles : combinations, best known first
    left : posterior over prior sd along each
    turned : (m, g) draws along them from their mean, in prior sds along the combination
    laplace : the sd of the Laplace approximation; nan draws none
    """
    g = len(titles)
    figure, grid = subplots(g, g, height=SIZE, width=SIZE, squeeze=False)
    reach = [3.6 * max(one, 1e-12) for one in left]
    for i in range(g):
        for j in range(g):
            axes = grid[i, j]
            if j > i:
                axes.remove()
                continue
            axes.grid(visible=False)
            _ticks(axes, i == g - 1, j == 0 and i > 0)
            axes.set_xlim(-reach[j], reach[j])
            axes.xaxis.get_major_locator().set_params(nbins=3)
            if i == j:
                _histogram(axes, turned[:, i], reach[i])
                axes.set_title(f"{_short(left[i])} left", fontsize=8, pad=2)
                continue
            axes.set_ylim(-reach[i], reach[i])
            axes.yaxis.get_major_locator().set_params(nbins=3)
            _circle(axes)
            axes.plot(
                *_dots(turned, j, i), ".", color=COLOURS["sky"], markersize=1.4, alpha=0.6, rasterized=True
            )
            _circle(axes, laplace[j], laplace[i])
            if left[i] > 3 * left[j]:
                axes.axvline(0.0, color="white", linewidth=2.8)
                axes.axvline(0.0, color=COLOURS["orange"], linewidth=1.6)
    for j in range(g):
        grid[g - 1, j].set_xlabel(_broken(titles[j]), fontsize=7)
        if j:
            grid[j, 0].set_ylabel(_broken(titles[j]), fontsize=7)
    return figure


@styled
def combinations(titles: Sequence[str], left: Sequence[float], laplace: Sequence[float]) -> Any:
    """What is left of the prior sd along every combination, best known on top; logarithmic."""
    k = len(titles)
    figure, axes = subplots(height=0.2 * k + 0.9)
    at = np.arange(k)
    tone = [
        COLOURS["blue"] if v <= 0.1 else COLOURS["sky"] if v < 0.7071 else COLOURS["orange"] for v in left
    ]
    hatch = ["" if v <= 0.1 else "///" if v < 0.7071 else "xxx" for v in left]
    lowest = 0.5 * min(min(left), 0.05)
    bars = axes.barh(at, left, color=tone, height=0.66)
    for bar, marks in zip(bars, hatch, strict=True):
        bar.set_hatch(marks)
        bar.set_edgecolor("white")
        bar.set_linewidth(0)
    axes.plot(laplace, at, "|", color="black", markersize=9, markeredgewidth=1.4)
    axes.set_xscale("log")
    axes.set_xlim(lowest, 1.4)
    axes.axvline(1.0, color="black", linewidth=0.8)
    axes.set_yticks(at, titles, fontsize=7)
    axes.set_ylim(k - 0.5, -0.5)
    axes.set_xlabel("posterior sd / prior sd along the combination")
    return figure


def _through(axes: Any, middle: Array, half: Array, tone: str, width: float, dash: Any) -> None:
    """A line of this half length through a point."""
    ends = np.array([middle - half, middle + half])
    axes.plot(ends[:, 0], ends[:, 1], color="white", linewidth=width + 1.2)  # seen in grey among the dots
    axes.plot(ends[:, 0], ends[:, 1], color=tone, linewidth=width, linestyle=dash)


def _histogram(axes: Any, values: Array, reach: float) -> None:
    count, edges = np.histogram(values, bins=40, range=(-reach, reach), density=True)
    axes.stairs(count, edges, fill=True, color=COLOURS["sky"], alpha=0.75, linewidth=0)
    at = np.linspace(-reach, reach, 100)
    axes.plot(
        at, np.exp(-0.5 * at**2) / np.sqrt(2 * np.pi), color=COLOURS["grey"], linestyle="--", linewidth=1.0
    )
    axes.set_ylim(bottom=0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)


def _circle(axes: Any, a: float = 1.0, b: float = 1.0) -> None:
    """90 % of the prior, dashed grey, or of the Laplace approximation with half axes a and b, black."""
    angle = np.linspace(0.0, 2 * np.pi, 200)
    prior = a == b == 1.0
    axes.plot(
        PRIOR90 * a * np.cos(angle), PRIOR90 * b * np.sin(angle),
        color=COLOURS["grey"] if prior else "black", linestyle="--" if prior else "-",
        linewidth=1.0 if prior else 0.8,
    )  # fmt: skip


def _dots(draws: Array, j: int, i: int) -> tuple[Array, Array]:
    picked = draws[:: max(1, len(draws) // MOST_DOTS)]
    return picked[:, j], picked[:, i]


def _ticks(axes: Any, bottom: bool, side: bool) -> None:
    axes.tick_params(labelsize=6, labelbottom=bottom, labelleft=side, length=2, pad=1)


def _short(share: float) -> str:
    """A share as percent of two digits."""
    return f"{100 * share:.2g} %" if share < 0.995 else "100 %"


def _broken(title: str) -> str:
    """A combination with a line per coefficient from the second on, four at most."""
    words = title.split(" ")
    parts, line = [], words[:2]
    for sign, size, name in zip(words[2::3], words[3::3], words[4::3], strict=False):
        parts.append(" ".join(line))
        line = [sign, size, name]
    parts.append(" ".join(line))
    return "\n".join(parts[:4])
