"""Figures of identifiability: spectra against the prior, the coefficient table, open directions, profiles.

Takes plain arrays. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.model.terms import TERMS, term
from bayesid.report.figure_style import COLOURS, FITTED, styled, subplots

Array = np.ndarray
VERDICTS = {
    "fixed by data": COLOURS["blue"],
    "traded off": COLOURS["orange"],
    "too small to matter": COLOURS["amber"],
    "at a bound": COLOURS["purple"],
    "prior only": COLOURS["grey"],
}
HATCHES = {"traded off": "///", "too small to matter": "xx", "at a bound": "\\\\"}  # told apart in grey
SIGNED = 0.1  # share of a direction from which its sign is written
FLOOR = 1e-9  # of the largest singular value; what is below is drawn there
_ROWS = {t.name for t in TERMS}


def label(name: str) -> str:
    """Mathtext of a coefficient, the name itself for anything else."""
    return term(name).label if name in _ROWS else name


@styled
def spectra(found: Mapping[str, Array]) -> Any:
    """Singular values of the sensitivities per prior sd, in noise units; below 1 the prior knows more."""
    figure, axes = subplots(height=3.0)
    floor = FLOOR * max(float(v.max()) for v in found.values())
    for (name, values), marker in zip(found.items(), "osD^v", strict=False):
        count = np.arange(1, values.size + 1)
        axes.semilogy(count, np.maximum(values, floor), f"{marker}-", label=name, linewidth=0.6)
    axes.axhspan(floor / 3, 1.0, color="#F0F0F0", zorder=0)
    axes.text(0.01, 0.02, "the prior knows more than the data", transform=axes.transAxes, fontsize=8)
    axes.set_ylim(bottom=floor / 3)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("number")
    axes.set_ylabel("residual change per prior sd")
    if len(found) > 1:
        axes.legend()
    return figure


@styled
def index(names: Sequence[str], share: Array, contraction: Array, verdicts: Sequence[str]) -> Any:
    """Share of the data per coefficient as bars, contraction as a mark, a colour per verdict."""
    figure, axes = subplots(height=2.8)
    place = np.arange(len(names))
    for verdict, colour in VERDICTS.items():
        chosen = np.array([v == verdict for v in verdicts])
        if chosen.any():
            axes.bar(
                place[chosen], np.maximum(share[chosen], 0.006), 0.7, color=colour, label=verdict,
                hatch=HATCHES.get(verdict), edgecolor="white", linewidth=0,
            )  # fmt: skip
    axes.plot(place, contraction, "_", color="black", markersize=9, label="contraction")
    axes.set_xticks(place, [label(n) for n in names], rotation=60, ha="right", rotation_mode="anchor")
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_ylim(0, 1.02)
    axes.set_ylabel("share of the data")
    axes.grid(axis="x", visible=False)
    axes.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


@styled
def directions(names: Sequence[str], vectors: Array, kinds: Sequence[str]) -> Any:
    """Open directions as rows of a map: relative change of every coefficient along each.

    Parameters
    ----------
    vectors : (m, k) unit vectors of relative changes
    kinds : (m,) labels of the rows
    """
    count = len(kinds)
    figure, axes = subplots(height=0.22 * count + 1.1)
    axes.imshow(vectors, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for i, j in np.argwhere(np.abs(vectors) >= SIGNED):  # red and blue are one grey in print
        ink = "white" if abs(vectors[i, j]) > 0.6 else "black"
        axes.text(j, i, "+" if vectors[i, j] > 0 else "−", ha="center", va="center", color=ink, fontsize=9)
    ticks = [label(n) for n in names]
    axes.set_xticks(np.arange(len(names)), ticks, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(np.arange(count), [f"{i}. {kind}" for i, kind in enumerate(kinds, 1)])
    axes.grid(visible=False)
    axes.tick_params(length=0)
    return figure


@styled
def profiles(curves: Sequence[tuple[str, Array, Array, Array, Array]]) -> Any:
    """Profiles of several coefficients.

    Parameters
    ----------
    curves : name, offsets [posterior sd], rise of half chi-square, the data's part of it, the rise where
        no parameter has a prior (nan where not asked)
    """
    columns = min(6, len(curves))
    rows = -(-len(curves) // columns)
    figure, grid = subplots(rows, columns, height=1.25 * rows + 0.5, squeeze=False, sharex=True, sharey=True)
    fine = np.linspace(-2.2, 2.2, 60)
    for axes in grid.flat[len(curves) :]:
        axes.remove()
    for axes, (name, offsets, rise, data_rise, alone) in zip(grid.flat, curves, strict=False):
        x = np.concatenate([offsets, [0.0]])
        order = np.argsort(x)
        axes.plot(fine, 0.5 * fine**2, color=COLOURS["grey"], linewidth=0.7)
        axes.plot(x[order], np.append(rise, 0.0)[order], "o", color=FITTED, markersize=3)
        axes.fill_between(
            x[order], np.append(data_rise, 0.0)[order], color=COLOURS["sky"], alpha=0.6, linewidth=0
        )
        axes.plot(offsets, np.minimum(alone, 2.9), "^", color="black", markersize=4, markerfacecolor="white")
        axes.set_title(label(name), fontsize=9)
        axes.set_ylim(-0.1, 3)
    figure.supxlabel("held so many posterior sd away", fontsize=9)
    figure.supylabel("rise of half chi-square", fontsize=9)
    return figure
