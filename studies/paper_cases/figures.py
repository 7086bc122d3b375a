"""Figures of simulated recovery experiments: tracks, errors over time, coefficient ratios, singular values.

Takes plain arrays and records. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes
from studies.paper_cases.counts import Shown

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
def errors_over_time(t: Array, cases: Mapping[str, Mapping[str, Array]], bars: Mapping[str, float]) -> Any:
    """Distance from the target track [m], logarithmic: one panel per case, with the paper's largest error."""
    figure, axes = subplots(len(cases), height=2.0 * len(cases) + 0.4, sharex=True)
    look = {"start": NOMINAL, "estimate": FITTED, "carried on": COLOURS["orange"]}
    for axis, (title, errors) in zip(np.atleast_1d(axes), cases.items(), strict=True):
        for name, values in errors.items():
            colour = look.get(name, COLOURS["green"])
            axis.semilogy(t[1:], np.maximum(values[1:], 1e-12), label=name, color=colour)
        axis.axhline(bars[title], color="black", linewidth=0.9, linestyle=":", label="paper: largest error")
        axis.set_title(title)
        axis.set_ylabel("error [m]")
        axis.legend(ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axis.set_xlabel("time [s]")
    return figure


KNOWN, ZERO = COLOURS["green"], COLOURS["purple"]


@styled
def ratios(
    columns: Sequence[Shown],
    limits: tuple[float, float],
    words: tuple[str, str] = ("estimate", "carried on to rounding"),
) -> Any:
    """Coefficients over their true values: starts, estimates and bounds of every seed, known and zero ones.

    Parameters
    ----------
    columns : see `Shown`; a known coefficient is a square at the value the fit was given, a zero one, whose
        ratio does not exist, a cross on the lower edge
    limits : range of the axis; what lies outside is drawn on the edge
    """
    figure, axes = subplots(height=3.7)
    seen: set[str] = set()

    def dots(at: float, values: Sequence[float], label: str, marker: str = "o", **style: Any) -> None:
        jitter = np.linspace(-0.09, 0.09, len(values)) if len(values) > 1 else np.zeros(1)
        shown = np.clip(values, *limits)
        word = "_" if label in seen else label
        axes.plot(at + jitter, shown, marker, linestyle="none", label=word, **style)
        seen.add(label)

    axes.axhline(1.0, color="black", linewidth=0.8)
    for i, column in enumerate(columns):
        if column.kind == "unknown":
            word = "_" if "bounds" in seen else "bounds"
            axes.bar(i, column.high - column.low, 0.84, column.low, color="#EEEEEE", label=word)
            seen.add("bounds")
            dots(i - 0.22, column.start, "start", color=NOMINAL, markersize=2.6, fillstyle="none",
                 markeredgewidth=0.6)  # fmt: skip
            dots(i + 0.05, column.end, words[0], color=FITTED, markersize=2.8)
            if column.later:
                dots(i + 0.3, column.later, words[1], color=COLOURS["orange"], markersize=2.4)
        elif column.kind == "known":
            dots(i, column.end, "known", "s", color=KNOWN, markersize=3.4, alpha=0.8)
        else:
            edge = limits[0] + 0.03 * (limits[1] - limits[0])
            dots(i, (edge,), "zero (no ratio)", "x", color=ZERO, markersize=5, markeredgewidth=1.4)
    labels = axes.set_xticks(
        range(len(columns)),
        [c.name for c in columns],
        rotation=60,
        ha="right",
        rotation_mode="anchor",
    )
    for tick, column in zip(labels, columns, strict=True):
        tick.label1.set_color({"known": KNOWN, "zero": ZERO}.get(column.kind, "black"))
    axes.set_xlim(-0.6, len(columns) - 0.4)
    axes.set_ylim(*limits)
    axes.set_ylabel("value / true value")
    axes.grid(axis="x", visible=False)
    axes.legend(ncols=6, loc="lower center", bbox_to_anchor=(0.5, 1.0), handletextpad=0.2, columnspacing=1.0)
    return figure


@styled
def bound_counts(groups: Mapping[str, Sequence[int]], paper: int) -> Any:
    """Share of fits over the number of coefficients that ended on a bound, one row per kind of fit."""
    figure, axes = subplots(height=0.62 * len(groups) + 0.9)
    top = max(paper, *(max(counts) for counts in groups.values()))
    for row, counts in enumerate(groups.values()):
        share = np.bincount(counts, minlength=top + 1) / len(counts)
        axes.bar(range(top + 1), 0.8 * share, 0.8, bottom=-row - 0.4, color=FITTED)
        for k, part in enumerate(share):
            if part:
                axes.text(
                    k, -row - 0.4 + 0.8 * part, f"{100 * part:.0f} %", ha="center", va="bottom", fontsize=7
                )
    axes.axvline(paper, color=COLOURS["orange"], linewidth=1.4)
    axes.text(paper + 0.06, 0.62, f"paper: {paper}", color=COLOURS["orange"], va="center")
    axes.set_yticks([-i for i in range(len(groups))], list(groups))
    axes.set_ylim(-len(groups) + 0.4, 0.8)
    axes.set_xlim(-0.6, top + 1.0)
    axes.set_xticks(range(top + 1))
    axes.set_xlabel("coefficients on a 25 % bound, per fit")
    axes.grid(axis="y", visible=False)
    return figure


@styled
def sizes(rows: Mapping[str, tuple[float, float, float]]) -> Any:
    """Coefficient errors over the share of force and over the track sensitivity; one colour per axis."""
    figure, axes = subplots(1, 2, height=3.6, sharey=True)
    noise_model = {"X": COLOURS["orange"], "Y": COLOURS["blue"], "N": COLOURS["green"]}
    for axis, which, word in ((axes[0], 0, "share of the force of its axis [%]"),
                              (axes[1], 1, "track sensitivity [m per 100 %]")):  # fmt: skip
        for letter, colour in noise_model.items():
            mine = {n: row for n, row in rows.items() if n[0] == letter}
            axis.plot([r[which] for r in mine.values()], [r[2] for r in mine.values()], "o", color=colour,
                      label=letter)  # fmt: skip
            for name, row in mine.items():
                if row[2] > 2.5:
                    axis.annotate(name, (row[which], row[2]), xytext=(4, 3),
                                  textcoords="offset points", fontsize=7, color=colour)  # fmt: skip
        axis.set_xscale("log")
        axis.set_xlabel(word)
        axis.set_xmargin(0.12)
    axes[0].set_ylabel("median coefficient error [%]")
    axes[0].set_ylim(bottom=0)
    axes[1].legend(title="axis", loc="upper right")
    return figure


@styled
def search(traces: Mapping[str, Mapping[str, Sequence[float]]]) -> Any:
    """What the SQP iterations of one seed report, a column per case: V, slope, step, gradient, bounds."""
    figure, axes = subplots(5, len(traces), height=7.6, sharex="col", squeeze=False)
    rows = (
        ("V [m²]", "cost", 2.0, True),
        ("-dV along step [m²]", "slope", -2.0, True),
        ("step length", "length", 1.0, False),
        ("largest dV/dp [m²]", "gradient", 2.0, True),
        ("on a bound", "active", 1.0, False),
    )
    for j, (title, trace) in enumerate(traces.items()):
        axes[0][j].set_title(title)
        split = [
            i for i, (a, b) in enumerate(zip(trace["samples"], trace["samples"][1:], strict=False)) if a != b
        ]
        for i, (word, key, factor, logarithmic) in enumerate(rows):
            axis, shown = axes[i][j], factor * np.array(trace[key], dtype=float)
            if logarithmic:
                shown = np.where(shown > 0, shown, np.nan)
                axis.semilogy(shown, ".", color=FITTED, markersize=3)
            else:
                axis.plot(shown, ".", color=FITTED, markersize=3)
                axis.set_ylim(-0.08, max(1.15, 1.1 * float(shown.max(initial=0))))
            for edge in split:
                axis.axvline(edge + 0.5, color="black", linewidth=0.6, linestyle=":")
            if j == 0:
                axis.set_ylabel(word, fontsize=8)
        axes[-1][j].set_xlabel("iteration")
    figure.align_ylabels()
    return figure


@styled
def error_against_cost(groups: Mapping[str, tuple[Array, Array]]) -> Any:
    """Rms coefficient error over V/V0, one group of points per stage."""
    figure, axes = subplots(height=3.0)
    noise_model = (NOMINAL, FITTED, COLOURS["orange"])
    for (name, (cost, error)), colour in zip(groups.items(), noise_model, strict=False):
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
def prediction_errors(rows: Mapping[str, Mapping[str, Any]], kinds: Sequence[str]) -> Any:
    """Largest position and heading error per manoeuvre: starts grey, estimates blue, all seeds."""
    figure, axes = subplots(1, 2, height=4.0, sharey=True)
    ordered = [n for kind in kinds for n, row in rows.items() if row["kind"] == kind]
    for axis, key, unit in (
        (axes[0], "position", "position error [m]"),
        (axes[1], "heading", "heading error [deg]"),
    ):
        for i, name in enumerate(ordered):
            for stage, colour, shift in (("start", NOMINAL, 0.16), ("goal", FITTED, -0.16)):
                found = np.maximum(rows[name][stage][key], 1e-9)
                if found.max() <= 1e-9:
                    continue
                word = "_" if i else {"start": "start values", "goal": "estimate"}[stage]
                spread = np.linspace(-0.1, 0.1, len(found))
                axis.semilogx(found, -i + shift + spread, "o", color=colour, markersize=2.6, label=word)
                middle = [float(np.median(found))] * 2
                axis.semilogx(middle, [-i + shift - 0.14, -i + shift + 0.14], color="black", linewidth=1.4)
        edge = -sum(rows[n]["kind"] == kinds[0] for n in ordered) + 0.5
        axis.axhline(edge, color="black", linewidth=0.7, linestyle=":")
        axis.set_xlabel(f"largest {unit}")
    axes[0].set_yticks([-i for i in range(len(ordered))], ordered)
    axes[0].grid(axis="y", visible=False)
    axes[1].grid(axis="y", visible=False)
    figure.legend(*axes[0].get_legend_handles_labels(), ncols=2, loc="outside upper center")
    return figure
