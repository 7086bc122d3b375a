"""Figures of a sampled posterior: intervals beside the prior, chains, and runs predicted before and after.

Takes plain arrays. Does not compute beyond quantiles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, styled, subplots, track_axes
from bayesid.report.identify_figures import label

Array = np.ndarray


@styled
def intervals(names: Sequence[str], draws: Array) -> Any:
    """50 and 90 % intervals of (n, k) draws in prior standard deviations about the prior mean."""
    k = len(names)
    figure, axes = subplots(height=0.19 * k + 0.9)
    axes.axvspan(-1.645, 1.645, color="#EEEEEE", zorder=0)
    q = np.quantile(draws, [0.05, 0.25, 0.5, 0.75, 0.95], axis=0)
    at = np.arange(k)
    axes.hlines(at, q[0], q[4], color=COLOURS["blue"], linewidth=1.0)
    axes.hlines(at, q[1], q[3], color=COLOURS["blue"], linewidth=3.0)
    axes.plot(q[2], at, "o", color="white", markeredgecolor=COLOURS["blue"], markersize=3.5)
    axes.set_yticks(at, [label(n) for n in names])
    axes.set_ylim(k - 0.5, -0.5)
    axes.set_xlabel("distance from the prior mean [prior sd]")
    return figure


@styled
def traces(names: Sequence[str], mean: Array, sd: Array, thin: int) -> Any:
    """Mean and sd over walkers along the chain, one panel per unknown, one colour per ensemble.

    Parameters
    ----------
    mean, sd : (ensembles, steps, k)
    """
    e, n, k = mean.shape
    figure, grid = subplots(k, 1, height=0.85 * k + 0.5, squeeze=False, sharex=True)
    stride = max(1, n // 800)
    at = thin * np.arange(n)[::stride]
    for j, axes in enumerate(grid[:, 0]):
        centre, width = mean[..., j].mean(), max(float(sd[..., j].mean()), 1e-300)
        for i in range(e):
            colour = list(COLOURS.values())[i % 7]
            axes.plot(at, (mean[i, ::stride, j] - centre) / width, color=colour, linewidth=0.8)
            axes.plot(at, sd[i, ::stride, j] / width, color=colour, linewidth=0.8, linestyle=":")
        axes.set_ylim(-1.5, 2.0)
        axes.set_ylabel(label(names[j]) if ":" not in names[j] else names[j], fontsize=8)
    grid[-1, 0].set_xlabel("step (solid: mean, dotted: sd, both in posterior sd)")
    return figure


@styled
def chain_health(
    names: Sequence[str], forgets: Array, thin: int, steps: Array, sizes: Array, need: float, energy: Array
) -> Any:
    """Three panels: autocorrelation, growth of the effective size, energy of every ensemble.

    Parameters
    ----------
    names : (s,) unknowns shown, slowest first
    forgets : (lags, s)
    steps, sizes : (p,) sampler steps per ensemble, (p, s) effective draws
    need : effective draws the check asks for
    energy : (ensembles, n) minus log density above its least
    """
    figure, (left, middle, right) = subplots(1, 3, height=2.6)
    styles = ["-", "--", "-.", ":"]
    tones = [COLOURS[c] for c in ("blue", "orange", "green", "grey")]
    for j, name in enumerate(names):
        look = {"color": tones[j % 4], "linestyle": styles[j % 4]}
        left.plot(thin * np.arange(len(forgets)), forgets[:, j], label=_named(name), **look)
        middle.plot(steps, sizes[:, j], marker="o", markersize=2.5, **look)
    left.axhline(0.0, color="black", linewidth=0.6)
    left.set_xlabel("lag [steps]")
    left.set_ylabel("autocorrelation")
    left.legend(fontsize=7, handlelength=2.4)
    middle.axhline(need, color="black", linewidth=0.8, linestyle=":")
    middle.set_xlabel("steps per ensemble")
    middle.set_ylabel("effective draws")
    middle.set_ylim(bottom=0)
    top = float(np.quantile(energy, 0.999))
    for i, one in enumerate(energy):
        count, edges = np.histogram(one, bins=40, range=(0.0, top), density=True)
        right.stairs(count, edges, color=list(COLOURS.values())[i % 7], linewidth=0.9)
    right.set_xlabel("energy: −log density [nats]")
    right.set_ylabel("share per nat")
    return figure


@styled
def predicted(
    name: str, t: Array, readings: Array, tracks: Mapping[str, Array], radius: Mapping[str, Array]
) -> Any:
    """One run before and after: tracks of draws on the left, 90 % radius of the position on the right."""
    figure, (plan, axes) = subplots(1, 2, height=2.9, width_ratios=[1.0, 1.1])
    after = tracks["posterior"]
    seen = readings if np.isfinite(readings).any() else after[0]
    low, high = np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
    room = 0.9 * max(float((high - low).max()), 1e-6)
    for which, style in (
        ("prior", {"color": "#B5B5B5", "linewidth": 0.6}),
        ("posterior", {"color": COLOURS["blue"], "linewidth": 0.9}),
    ):
        for one in tracks[which]:
            near = np.isfinite(one).all(axis=1) & np.all((one > low - room) & (one < high + room), axis=1)
            end = np.flatnonzero(~near)
            cut = one[: end[0]] if end.size else one
            plan.plot(cut[:, 1], cut[:, 0], **style)
    if np.isfinite(readings).any():
        keep = np.linspace(0, t.size - 1, min(t.size, 60)).astype(int)
        plan.plot(readings[keep, 1], readings[keep, 0], "o", color="black", markersize=2.2, zorder=3)
    track_axes(plan)
    plan.set_title(name, fontsize=8)
    for which, dash in (("prior", "--"), ("posterior", "-")):
        tone = COLOURS["grey"] if which == "prior" else COLOURS["blue"]
        axes.semilogy(t - t[0], np.maximum(radius[which], 1e-3), dash, color=tone, label=which)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("90 % radius of the position [m]")
    axes.legend()
    return figure


def _named(name: str) -> str:
    return name if ":" in name else label(name)
