"""Cost curves: processor time and memory over length, rate, runs and free coefficients.

Takes rows of `size_row`. Gives a figure.
"""

from __future__ import annotations

from typing import Any

from bayesid.report.figure_style import COLOURS, styled, subplots

# What varies in the sizes of these names, and how it is written on the axis.
CURVES = {
    "length": ("hours", "length [h]"), "rate": ("rate", "rate [Hz]"), "runs": ("runs", "runs"),
    "free": ("free", "free coefficients"),
}  # fmt: skip
KINDS = {"diagnose": "blue", "fit": "orange"}


@styled
def cost_curves(rows: list[dict[str, Any]]) -> Any:
    """Time above, memory below."""
    figure, axes = subplots(2, len(CURVES), height=4.2, sharey="row", squeeze=False)
    for column, (name, (key, label)) in enumerate(CURVES.items()):
        ticks = sorted({r[key] for r in of_curve(rows, name)})
        for command, colour in KINDS.items():
            found = sorted(
                (r[key], r["cpu"], r["mb"]) for r in of_curve(rows, name) if r["command"] == command
            )
            for k in (0, 1):
                axes[k, column].plot(
                    [f[0] for f in found],
                    [f[1 + k] for f in found],
                    "o-",
                    color=COLOURS[colour],
                    label=command,
                )
        for k in (0, 1):
            axes[k, column].set_xscale("log")
            axes[k, column].set_xticks(ticks, [f"{x:g}" for x in ticks])
            axes[k, column].minorticks_off()
            axes[k, column].set_ylim(bottom=0.0)
        axes[1, column].set_xlabel(label)
    axes[0, 0].set_ylabel("CPU [s]")
    axes[1, 0].set_ylabel("peak memory [MB]")
    axes[0, 0].legend(frameon=False)
    return figure


def of_curve(rows: list[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    """Rows in which one thing varies and that were measured to their end."""
    return [r for r in rows if name in r["size"].split(",")[0].split() and r["cpu"] is not None]
