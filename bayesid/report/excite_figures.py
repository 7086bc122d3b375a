"""Figures of an excitation: how often each term is kept, with a colour for what that means.

Takes plain names and numbers. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from bayesid.report.figure_style import COLOURS, styled, subplots

MEANING = {
    "found": COLOURS["blue"],
    "cannot tell": COLOURS["amber"],
    "uncertain": COLOURS["sky"],
    "not needed": COLOURS["grey"],
    "not excited": "#CCCCCC",
}
HATCH = {"cannot tell": "//", "not needed": "..."}  # for prints in grey


@styled
def inclusion(names: Sequence[str], values: Sequence[float], statuses: Sequence[str]) -> Any:
    """Bars of inclusion frequency, first term on top, one colour per status."""
    figure, axes = subplots(height=max(1.6, 0.21 * len(names) + 0.9))
    where = np.arange(len(names))[::-1]
    hatches = [HATCH.get(s, "") for s in statuses]
    axes.barh(
        where, values, color=[MEANING[s] for s in statuses], height=0.7, hatch=hatches, edgecolor="white",
        linewidth=0.0,
    )  # fmt: skip
    for y, value, status in zip(where, values, statuses, strict=True):
        if status == "not excited":
            axes.text(value + 0.01, y, "not excited", va="center", fontsize=7, color=COLOURS["grey"])
    axes.axvline(0.8, color="black", linestyle=":", linewidth=0.8)
    axes.set_xlim(0, 1.02)
    axes.set_yticks(where, names)
    axes.set_xlabel("share of bootstrap draws that keep the term")
    present = [s for s in MEANING if s in statuses]
    axes.legend(
        handles=[
            Patch(facecolor=MEANING[s], edgecolor="white", hatch=HATCH.get(s, ""), label=s) for s in present
        ],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=len(present),
    )
    return figure
