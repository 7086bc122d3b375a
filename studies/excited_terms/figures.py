"""The confusion matrices as bars: for every judge and truth the share of each verdict.

Takes plain counts. Does not compute results.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report.figure_style import COLOURS, styled, subplots

# light to dark, and hatched where a verdict commits itself to nothing: readable in grey
LOOKS: dict[str, dict[str, Any]] = {
    "found": {"color": COLOURS["blue"]},
    "found in a group": {"color": COLOURS["sky"]},
    "cannot tell": {"color": "white", "edgecolor": COLOURS["grey"], "hatch": "////"},
    "not needed": {"color": "#BBBBBB"},
    "not excited": {"color": "white", "edgecolor": COLOURS["grey"], "hatch": "..."},
}


@styled
def verdict_shares(matrices: Mapping[str, Mapping[str, Mapping[str, int]]]) -> Any:
    """One panel per judge, one bar per truth; counts inside.

    Parameters
    ----------
    matrices : judge -> truth -> verdict -> count
    """
    figure, axes = subplots(len(matrices), 1, height=1.15 * len(matrices) + 0.9, sharex=True, squeeze=False)
    for panel, (judge, table) in zip(axes[:, 0], matrices.items(), strict=True):
        where = np.arange(len(table))[::-1]
        left = np.zeros(len(table))
        totals = np.array([max(sum(row.values()), 1) for row in table.values()])
        for verdict, look in LOOKS.items():
            counts = np.array([row[verdict] for row in table.values()])
            part = counts / totals
            panel.barh(where, part, left=left, height=0.72, linewidth=0.5, label=verdict, **look)
            for y, begin, length, count in zip(where, left, part, counts, strict=True):
                if length > 0.035:
                    dark = verdict == "found"
                    panel.text(
                        begin + length / 2, y, str(count), ha="center", va="center", fontsize=7,
                        color="white" if dark else "black",
                        bbox={"facecolor": look["color"], "edgecolor": "none", "pad": 1},
                    )  # fmt: skip
            left += part
        panel.set_yticks(where, list(table))
        panel.set_title(judge)
        panel.grid(False)
        panel.set_xlim(0, 1)
    axes[-1, 0].set_xlabel("share of the terms of this truth (numbers: terms)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(LOOKS))
    return figure
