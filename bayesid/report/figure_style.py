"""One look for every figure: colour-blind-safe, readable in print and at 800 pixels, PNG below 200 kB.

Gives figures that need no screen and leave the caller's matplotlib settings alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib
from cycler import cycler
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

P = ParamSpec("P")
R = TypeVar("R")

# Okabe & Ito (2008), distinguishable with the common colour deficiencies; black is kept for measured data
COLOURS = {
    "blue": "#0072B2",
    "orange": "#D55E00",
    "green": "#009E73",
    "amber": "#E69F00",
    "purple": "#CC79A7",
    "sky": "#56B4E9",
    "grey": "#7A7A7A",
}
MEASURED, NOMINAL, FITTED = "#000000", COLOURS["grey"], COLOURS["blue"]
WIDTH = 7.2  # inches, the text width of a report

STYLE: Any = {
    "figure.dpi": 120,
    "savefig.dpi": "figure",
    "savefig.facecolor": "white",
    "figure.facecolor": "white",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=list(COLOURS.values())),
    "axes.formatter.useoffset": False,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "figure.constrained_layout.use": True,
    "axes.xmargin": 0.02,
}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Decorator: run a drawing function under the house style and restore the caller's settings after it."""

    @wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return wrapper


@styled
def subplots(
    rows: int = 1, columns: int = 1, height: float = 3.0, width: float = WIDTH, **kwargs: Any
) -> tuple[Figure, Any]:
    """A figure without pyplot (nothing to close, safe in threads) and its axes as `Figure.subplots` does.

    `width` and `height` are in inches; other arguments go to `Figure.subplots`. Call it inside a `styled`
    function so that legends and texts added later follow the style too.
    """
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **kwargs)


@styled
def track_axes(axes: Any) -> None:
    """Label an east-north plan view with equal scales."""
    axes.set_xlabel("east y [m]")
    axes.set_ylabel("north x [m]")
    axes.set_aspect("equal", adjustable="datalim")
