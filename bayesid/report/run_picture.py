"""The picture of a run: log and simulations; track, heading, and below it how far each is from the log.

Takes a `RunPicture` of finished series. Does not compute but differences of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.measures.angle_errors import counted_on
from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots, track_axes
from bayesid.words import and_list

Array = np.ndarray
EVENT = "#F9D9B0"  # behind a time in which nothing known explains the motion
MOST_POINTS, MOST_TRACKS = 500, 40
# Radius of 95 % of a round Gaussian in the plane over the half width of 95 % along a line.
PLANE95 = 2.45 / 1.96
NEAR = 4.0  # times the last series' own reach, up to which a line is kept inside its panel
# Reach of an error panel over that of its lines at most, however wide the band.
MOST_OF_BAND = 3.0
HEIGHT, WIDTH = 4.3, 3.75
MISSES = {"heading error": "logged heading", "distance": "logged position"}  # panels of errors, of what
# Lines differ in dashes and width as well: a grey print tells them apart.
GIVEN: dict[str, Any] = {"color": NOMINAL, "linestyle": (0, (5, 2)), "linewidth": 1.3}
BETWEEN: dict[str, Any] = {"color": COLOURS["orange"], "linestyle": (0, (1, 1.2)), "linewidth": 2.2}
BEST: dict[str, Any] = {"color": FITTED, "linestyle": "-", "linewidth": 1.2}


@dataclass(frozen=True, eq=False)
class Series:
    """One simulation: label, style of its line, (n, q) values SI, nan where it diverges.

    `known` is the time from the start [s] after which its heading is not known: no track is drawn beyond.
    """

    label: str
    style: dict[str, Any]
    values: Array
    known: float = np.inf

    @property
    def ends(self) -> bool:
        """Whether the run is simulated to its end."""
        return bool(np.isfinite(self.values[-1]).any())

    @property
    def legend(self) -> str:
        """Label; says so where the simulation diverges, without which a line would be missing."""
        return self.label if self.ends else f"{self.label}: diverges"


@dataclass(frozen=True, eq=False)
class RunPicture:
    """What is drawn of one run.

    Attributes
    ----------
    t : (n,) [s]
    channels : (q,) names
    readings : (n, q) SI, nan where there is none
    series : simulations in drawing order, the one that matters last
    lead : first seconds, read to begin on the track
    half : (n, q) half width of the 95 % band around the last series; None without one
    draws : (k, n, q) of which the band is made, drawn as tracks; None without
    events : begin and end [s], by the clock of `t`, of what is shaded
    """

    t: Array
    channels: tuple[str, ...]
    readings: Array
    series: tuple[Series, ...]
    lead: float = 0.0
    half: Array | None = None
    draws: Array | None = None
    events: tuple[tuple[float, float], ...] = ()

    def column(self, name: str) -> int | None:
        return self.channels.index(name) if name in self.channels else None

    @property
    def last(self) -> Series:
        """The last series that does not diverge, of which panels take their scale."""
        drawn = [s for s in self.series if s.ends] or [s for s in self.series if np.isfinite(s.values).any()]
        return (drawn or self.series)[-1]

    @property
    def band(self) -> Array | None:
        """`half` where the series it belongs to is there to be drawn."""
        return self.half if self.series[-1].ends else None

    def logged(self, *names: str) -> bool:
        """Whether readings of these channels are there."""
        columns = [self.column(n) for n in names]
        return all(j is not None and np.isfinite(self.readings[:, j]).any() for j in columns)

    @property
    def kept(self) -> Array:
        """Samples drawn."""
        n = self.t.size
        return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).astype(int))


def caption(p: RunPicture, band: str = "") -> str:
    """What the two figures show; `band` says what the band is, where one is drawn."""
    logged = "; black dots: the log" if p.logged("x", "y") else ""
    left = (
        f"Left: track, begun at the ring{logged}." if p.column("x") is not None else "Left: channels logged."
    )
    names = [name for name, _ in _panels(p)]
    errors = [name for name in names if name in MISSES]
    right = f"Right: {and_list(n for n in names if n not in MISSES) or 'nothing'} over time"
    if errors:
        of = and_list(MISSES[n] for n in errors)
        dots = f"(lines: running means; small dots: every reading, {p.last.label})"
        right += f", and below it by how much each simulation misses the {of} {dots}"
    return " ".join(text for text in (left, f"{right}.", band if p.band is not None else "") if text)


@styled
def track(p: RunPicture) -> Any:
    """Plan view, or the first channels over time where no position is known."""
    x, y = p.column("x"), p.column("y")
    if x is None or y is None:
        return _channels(p)
    figure, axes = subplots(height=HEIGHT, width=WIDTH)
    keep = p.kept
    if p.draws is not None:
        for one in p.draws[:MOST_TRACKS]:
            axes.plot(one[keep, y], one[keep, x], color=COLOURS["sky"], alpha=0.35, linewidth=0.7, zorder=0)
    until = p.t[keep] - p.t[0]
    seen = p.readings[keep] if p.logged("x", "y") else p.last.values[keep][until <= p.last.known]
    low, high = np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)
    room = 0.6 * max(high[x] - low[x], high[y] - low[y], 1e-6)
    if p.logged("x", "y"):
        axes.plot(seen[:, y], seen[:, x], ".", color=MEASURED, markersize=4.5, label="log", zorder=1)
    for s in p.series:
        z = s.values[keep]
        inside = (
            (z[:, x] > low[x] - room) & (z[:, x] < high[x] + room)
            & (z[:, y] > low[y] - room) & (z[:, y] < high[y] + room) & (until <= s.known)
        )  # fmt: skip
        out = np.flatnonzero(~inside)
        end = out[0] if out.size else len(z)
        axes.plot(z[:end, y], z[:end, x], label=s.legend, **s.style)
    axes.plot(seen[:1, y], seen[:1, x], "o", color=MEASURED, markersize=6, fillstyle="none")
    track_axes(axes)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, handlelength=2.6)
    return figure


def _channels(p: RunPicture) -> Any:
    count = min(len(p.channels), 3)
    figure, grid = subplots(count, 1, height=HEIGHT, width=WIDTH, squeeze=False, sharex=True)
    keep, t = p.kept, p.t - p.t[0]
    for j, axes in enumerate(grid[:, 0]):
        axes.plot(t[keep], p.readings[keep, j], ".", color=MEASURED, markersize=2.6, label="log")
        for s in p.series:
            axes.plot(t[keep], s.values[keep, j], label=s.legend, **s.style)
        axes.set_ylabel(f"{p.channels[j]} [SI]")
    grid[0, 0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


@styled
def over_time(p: RunPicture) -> Any:
    """Heading, and below it what each simulation misses: heading and distance, with the 95 % band."""
    panels = [draw for _, draw in _panels(p)]
    figure, grid = subplots(max(len(panels), 1), 1, height=HEIGHT, width=WIDTH, squeeze=False, sharex=True)
    t = p.t - p.t[0]
    for axes, draw in zip(grid[:, 0], panels, strict=False):
        draw(axes, p, p.kept, t)
        if p.lead > 0:
            axes.axvspan(0.0, p.lead, color="0.9", zorder=0, linewidth=0)
        for start, end in p.events:
            axes.axvspan(start - p.t[0], end - p.t[0], color=EVENT, zorder=0, linewidth=0)
    grid[-1, 0].set_xlabel("time [s]")
    return figure


def _panels(p: RunPicture) -> list[tuple[str, Callable[[Any, RunPicture, Array, Array], None]]]:
    """Name and drawing of each panel over time, from the top."""
    return [
        (name, draw)
        for name, draw, there in (
            ("heading", _heading, p.column("psi") is not None),
            ("heading error", _heading_error, p.logged("psi")),
            ("distance", _distance, p.logged("x", "y")),
            ("speed ahead", _speed, not p.logged("psi") and p.column("u") is not None),
            ("yaw rate", _yaw_rate, not p.logged("psi") and p.column("r") is not None),
        )
        if there
    ]


def _value(axes: Any, p: RunPicture, keep: Array, t: Array, name: str, factor: float, label: str) -> None:
    j = p.column(name)
    assert j is not None
    shown = factor * (p.readings[keep, j] if p.logged(name) else p.last.values[keep, j])
    if p.logged(name):
        axes.plot(t[keep], shown, ".", color=MEASURED, markersize=4.0, zorder=1)
    elif p.band is not None:
        band = factor * p.band[keep, j]
        axes.fill_between(t[keep], shown - band, shown + band, color=COLOURS["sky"], alpha=0.35, linewidth=0)
    for s in p.series:
        axes.plot(t[keep], factor * s.values[keep, j], **s.style)
    spread = float(np.nanmax(shown) - np.nanmin(shown))
    room = 0.4 * spread + (2.0 if name == "psi" else 1e-9)
    axes.set_ylim(np.nanmin(shown) - room, np.nanmax(shown) + room)
    axes.set_ylabel(label)


def _heading(axes: Any, p: RunPicture, keep: Array, t: Array) -> None:
    _value(axes, p, keep, t, "psi", 180 / np.pi, "heading\n[deg]")


def _speed(axes: Any, p: RunPicture, keep: Array, t: Array) -> None:
    _value(axes, p, keep, t, "u", 1.0, "speed ahead\n[m/s]")


def _yaw_rate(axes: Any, p: RunPicture, keep: Array, t: Array) -> None:
    _value(axes, p, keep, t, "r", 180 / np.pi, "yaw rate\n[deg/s]")


def _heading_error(axes: Any, p: RunPicture, keep: Array, t: Array) -> None:
    j = p.column("psi")

    def miss(values: Array) -> Array:
        return np.degrees(counted_on(values - p.readings, p.channels)[keep, j])

    band = None if p.band is None else np.degrees(p.band[keep, j])
    reach = _misses(axes, p, t[keep], [miss(s.values) for s in p.series], band)
    if band is not None:
        axes.fill_between(t[keep], -band, band, color=COLOURS["sky"], alpha=0.35, linewidth=0)
    axes.set_ylim(-reach, reach)
    axes.set_ylabel("simulated −\nlogged [deg]")


def _distance(axes: Any, p: RunPicture, keep: Array, t: Array) -> None:
    at = [p.channels.index("x"), p.channels.index("y")]
    miss = [np.hypot(*((s.values - p.readings)[keep][:, at].T)) for s in p.series]
    band = None if p.band is None else PLANE95 * np.sqrt(np.mean(p.band[keep][:, at] ** 2, axis=1))
    reach = _misses(axes, p, t[keep], miss, band)
    if band is not None:
        axes.fill_between(t[keep], 0.0, band, color=COLOURS["sky"], alpha=0.35, linewidth=0)
    axes.set_ylim(0.0, reach)
    axes.set_ylabel("distance to\nthe log [m]")


def _misses(axes: Any, p: RunPicture, t: Array, miss: list[Array], band: Array | None) -> float:
    """Draw running means and the dots of the last series; gives the reach, its own, of what is near it and of
    the band."""
    for s, values in zip(p.series, miss, strict=True):
        axes.plot(t, _smooth(values), **s.style)
    of_last = miss[p.series.index(p.last)]
    axes.plot(t, of_last, ".", color=p.last.style["color"], markersize=1.5, alpha=0.35, zorder=1)
    own = max(_largest(of_last), 0.0 if band is None else _largest(band), 0.1)
    reach = max([_largest(of_last), 0.1, *(x for x in map(_largest, miss) if x < NEAR * own)])
    # a band that grows beyond all bounds fills the panel, and must not flatten the lines in it
    return 1.25 * min(max(own, reach), MOST_OF_BAND * reach)


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
