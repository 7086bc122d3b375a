"""The picture of a diagnosis: a run as logged, as given, re-tuned and explained; track, heading, residuals.

Takes a `Replay`. Does not compute but differences of its series.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bayesid.diagnosis.evidence.replay import EXPLAINED, GIVEN, RETUNED, Replay
from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes

Array = np.ndarray
MOST_POINTS = 500
Z95 = 1.96
DISTANCE95 = 2.45  # radius of 95 % of a round Gaussian in the plane, in standard deviations
HEIGHT, WIDTH = 4.3, 3.75
# Lines differ in dashes and width as well: a grey print tells them apart.
LINES: dict[str, dict[str, Any]] = {
    GIVEN: {"color": NOMINAL, "linestyle": (0, (5, 2)), "linewidth": 1.3},
    RETUNED: {"color": COLOURS["orange"], "linestyle": (0, (1, 1.2)), "linewidth": 2.2},
    EXPLAINED: {"color": FITTED, "linestyle": "-", "linewidth": 1.2},
}


@styled
def track(replay: Replay, labels: tuple[str, str, str]) -> Any:
    """Plan view; tracks that leave the surroundings of the log are cut off."""
    figure, axes = subplots(height=HEIGHT, width=WIDTH)
    keep = _kept(replay)
    names = list(replay.channels)
    if not {"x", "y"} <= set(names):
        return rates(replay, labels)
    x, y = names.index("x"), names.index("y")
    log = replay.readings[keep]
    low, high = np.nanmin(log, axis=0), np.nanmax(log, axis=0)
    room = 0.6 * max(high[x] - low[x], high[y] - low[y], 1e-6)
    axes.plot(log[:, y], log[:, x], ".", color=MEASURED, markersize=4.5, label="log", zorder=1)
    for (model, values), label in zip(_shown(replay), labels, strict=False):
        z = values[keep]
        inside = (
            (z[:, x] > low[x] - room) & (z[:, x] < high[x] + room)
            & (z[:, y] > low[y] - room) & (z[:, y] < high[y] + room)
        )  # fmt: skip
        out = np.flatnonzero(~inside)
        z = np.where(np.arange(len(z))[:, None] < (out[0] if out.size else len(z)), z, np.nan)
        axes.plot(z[:, y], z[:, x], label=label, **LINES[model])
    axes.plot(log[:1, y], log[:1, x], "o", color=MEASURED, markersize=6, fillstyle="none")
    track_axes(axes)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, handlelength=2.6)
    return figure


@styled
def rates(replay: Replay, labels: tuple[str, str, str]) -> Any:
    """What was logged, over time, where no track was."""
    count = min(len(replay.channels), 3)
    figure, grid = subplots(count, 1, height=HEIGHT, width=WIDTH, squeeze=False, sharex=True)
    keep, t = _kept(replay), replay.t - replay.t[0]
    for j, axes in enumerate(grid[:, 0]):
        axes.plot(t[keep], replay.readings[keep, j], ".", color=MEASURED, markersize=2.6, label="log")
        for (model, values), label in zip(_shown(replay), labels, strict=False):
            axes.plot(t[keep], values[keep, j], label=label, **LINES[model])
        axes.set_ylabel(f"{replay.channels[j]} [SI]")
    grid[0, 0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


@styled
def over_time(replay: Replay) -> Any:
    """Heading, and below it what each simulation misses: heading and distance, with the 95 % band."""
    names = list(replay.channels)
    panels = [p for p in ("heading", "heading error", "position error") if _has(names, p)]
    figure, grid = subplots(max(len(panels), 1), 1, height=HEIGHT, width=WIDTH, squeeze=False, sharex=True)
    keep, t = _kept(replay), replay.t - replay.t[0]
    for axes, panel in zip(grid[:, 0], panels, strict=False):
        if panel == "heading":
            _heading(axes, replay, keep, t, names.index("psi"))
        elif panel == "heading error":
            _heading_error(axes, replay, keep, t, names.index("psi"))
        else:
            _distance(axes, replay, keep, t, (names.index("x"), names.index("y")))
        axes.axvspan(0.0, replay.lead, color="0.9", zorder=0, linewidth=0)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


def _has(names: list[str], panel: str) -> bool:
    return {"x", "y"} <= set(names) if panel == "position error" else "psi" in names


def _shown(replay: Replay) -> list[tuple[str, Array]]:
    """Models in drawing order; two where the explained model is the re-tuned one."""
    re_tuned, explained = replay.models[RETUNED], replay.models[EXPLAINED]
    given = (GIVEN, replay.models[GIVEN])
    if np.array_equal(re_tuned, explained, equal_nan=True):
        return [given, (EXPLAINED, explained)]
    return [given, (RETUNED, re_tuned), (EXPLAINED, explained)]


def _kept(replay: Replay) -> Array:
    n = replay.t.size
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).astype(int))


def _heading(axes: Any, replay: Replay, keep: Array, t: Array, j: int) -> None:
    log = np.degrees(replay.readings[keep, j])
    axes.plot(t[keep], log, ".", color=MEASURED, markersize=4.0, zorder=1)
    for model, values in _shown(replay):
        axes.plot(t[keep], np.degrees(values[keep, j]), **LINES[model])
    room = 0.4 * (np.nanmax(log) - np.nanmin(log)) + 2.0
    axes.set_ylim(np.nanmin(log) - room, np.nanmax(log) + room)
    axes.set_ylabel("heading\n[deg]")


def _heading_error(axes: Any, replay: Replay, keep: Array, t: Array, j: int) -> None:
    top = []
    for model, values in _shown(replay):
        miss = np.degrees((values[keep, j] - replay.readings[keep, j] + np.pi) % (2 * np.pi) - np.pi)
        axes.plot(t[keep], _smooth(miss), **LINES[model])
        if model != GIVEN:
            top.append(_largest(miss))
    axes.plot(t[keep], miss, ".", color=FITTED, markersize=1.5, alpha=0.35, zorder=1)
    if replay.sd is not None:
        band = Z95 * np.degrees(replay.sd[keep, j])
        axes.fill_between(t[keep], -band, band, color=COLOURS["sky"], alpha=0.35, linewidth=0)
        top.append(_largest(band))
    reach = 1.25 * max([*top, 0.1])
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("simulated −\nlogged [deg]")


def _distance(axes: Any, replay: Replay, keep: Array, t: Array, at: tuple[int, int]) -> None:
    top = []
    for model, values in _shown(replay):
        miss = np.hypot(*((values - replay.readings)[keep][:, list(at)].T))
        axes.plot(t[keep], _smooth(miss), **LINES[model])
        if model != GIVEN:
            top.append(_largest(miss))
    axes.plot(t[keep], miss, ".", color=FITTED, markersize=1.5, alpha=0.35, zorder=1)
    if replay.sd is not None:
        band = DISTANCE95 * np.sqrt(np.mean(replay.sd[keep][:, list(at)] ** 2, axis=1))
        axes.fill_between(t[keep], 0.0, band, color=COLOURS["sky"], alpha=0.35, linewidth=0)
        top.append(_largest(band))
    axes.set_ylim(0.0, 1.25 * max([*top, 0.1]))
    axes.set_ylabel("distance to\nthe log [m]")


def _smooth(values: Array) -> Array:
    """Running mean over what is there, a fortieth of the run wide: residuals without the sensors' noise."""
    weight = np.ones(max(1, values.size // 40))
    there = np.isfinite(values)
    total = np.convolve(np.where(there, values, 0.0), weight, "same")
    count = np.convolve(there.astype(float), weight, "same")
    return np.where(count > 0, total / np.maximum(count, 1.0), np.nan)


def _largest(values: Array) -> float:
    found = np.abs(values[np.isfinite(values)])
    return float(np.quantile(found, 0.99)) if found.size else 0.0
