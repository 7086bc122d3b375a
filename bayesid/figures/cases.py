"""Figures of twin experiments: tracks, errors over time, coefficient ratios, singular values.

Takes plain arrays and records. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.figures.style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes
from bayesid.terms import term

Array = np.ndarray


@styled
def tracks(found: Mapping[str, tuple[Array, Array]], inset: float = 0.0) -> Any:
    """Plan view; entries "target", "start", others: (x north, y east) [m]."""
    figure, axes = subplots(height=4.2, width=5.6)
    look = {"target": (MEASURED, "-", 2.6), "start": (NOMINAL, "--", 1.2)}
    for name, (x, y) in found.items():
        colour, line, width = look.get(name, (FITTED, "-", 1.1))
        axes.plot(y, x, line, color=colour, linewidth=width, label=name)
    track_axes(axes)
    axes.legend()
    return figure


@styled
def errors_over_time(t: Array, errors: Mapping[str, Array]) -> Any:
    """Distance between the simulated and the target track [m], logarithmic."""
    figure, axes = subplots(height=3.0)
    for (name, values), colour in zip(errors.items(), [NOMINAL, *COLOURS.values()], strict=False):
        axes.semilogy(t[1:], np.maximum(values[1:], 1e-12), label=name, color=colour)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("position error [m]")
    axes.legend(ncols=2)
    return figure


def _label(name: str) -> str:
    try:
        return term(name).label
    except KeyError:
        return name


@styled
def ratios(
    names: Sequence[str],
    start: Array,
    end: Array,
    low: Array,
    high: Array,
    limits: tuple[float, float],
    later: Array | None = None,
    words: tuple[str, str] = ("estimate", "carried on to rounding"),
) -> Any:
    """Coefficients over their true values: starts, estimates and bounds of every seed.

    Parameters
    ----------
    start, end, low, high, later : (seeds, k) ratios to the truth
    limits : range of the axis; what lies outside is drawn on the edge
    """
    figure, axes = subplots(height=3.4)
    k = len(names)
    place = np.arange(k)
    bottom, top = np.minimum(low, high).min(axis=0), np.maximum(low, high).max(axis=0)
    axes.bar(place, top - bottom, 0.84, bottom, color="#EEEEEE", label="bounds")
    axes.axhline(1.0, color="black", linewidth=0.8)

    def dots(values: Array, shift: float, colour: str, label: str, **style: Any) -> None:
        jitter = np.linspace(-0.09, 0.09, values.shape[0])[:, None]
        axes.plot(
            (place + shift + jitter).ravel(),
            np.clip(values, *limits).ravel(),
            "o",
            color=colour,
            label=label,
            **style,
        )

    dots(start, -0.22, NOMINAL, "start", markersize=2.6, fillstyle="none", markeredgewidth=0.6)
    dots(end, 0.05, FITTED, words[0], markersize=2.8)
    if later is not None:
        dots(later, 0.3, COLOURS["orange"], words[1], markersize=2.4)
    axes.set_xticks(place, [_label(n) for n in names], rotation=60, ha="right", rotation_mode="anchor")
    axes.set_xlim(-0.6, k - 0.4)
    axes.set_ylim(*limits)
    axes.set_ylabel("value / true value")
    axes.grid(axis="x", visible=False)
    axes.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


@styled
def error_against_cost(groups: Mapping[str, tuple[Array, Array]]) -> Any:
    """Rms coefficient error over V/V0, one group of points per stage."""
    figure, axes = subplots(height=3.0)
    colours = (NOMINAL, FITTED, COLOURS["orange"])
    for (name, (cost, error)), colour in zip(groups.items(), colours, strict=False):
        axes.semilogx(np.maximum(cost, 1e-30), 100 * np.asarray(error), "o", color=colour, label=name)
    axes.set_xlabel("V / V at the start")
    axes.set_ylabel("rms coefficient error [%]")
    axes.set_ylim(bottom=0)
    axes.invert_xaxis()
    axes.legend()
    return figure


@styled
def singular_spectra(spectra: Mapping[str, Array]) -> Any:
    """Singular values of track sensitivities; those at rounding level fall to the bottom."""
    figure, axes = subplots(height=3.2)
    for (name, values), marker in zip(spectra.items(), "osD^v", strict=False):
        shown = np.maximum(values, 1e-14)
        axes.semilogy(np.arange(1, values.size + 1), shown, f"{marker}-", label=name, linewidth=0.6)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.set_xlabel("number")
    axes.set_ylabel("singular value [m per relative change]")
    axes.legend()
    return figure


@styled
def prediction_errors(groups: Mapping[str, Array]) -> Any:
    """Largest position error of one estimate on several manoeuvres, all seeds."""
    figure, axes = subplots(height=2.6)
    for i, values in enumerate(groups.values()):
        spread = np.linspace(-0.18, 0.18, len(values))
        axes.semilogy(i + spread, np.maximum(values, 1e-9), "o", color=FITTED, markersize=3.5)
        axes.semilogy([i - 0.3, i + 0.3], [np.median(values)] * 2, color=COLOURS["orange"], linewidth=2)
    axes.set_xticks(range(len(groups)), list(groups))
    axes.set_ylabel("largest position error [m]")
    axes.grid(axis="x", visible=False)
    return figure
