"""The errors to expect of blind predictions, as a page of text.

Takes the record of held-out predictions. Does not predict.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

CHANNELS = {"x": (1.0, "m"), "y": (1.0, "m"), "psi": (57.29578, "deg"), "u": (1.0, "m/s"), "v": (1.0, "m/s"),
            "r": (57.29578, "deg/s")}  # fmt: skip


def expectation_text(name: str, record: Mapping[str, Any]) -> str:
    """Markdown: rms error and share inside the band per kind of motion and channel, from held-out runs."""
    lines = [
        f"# {name}: what errors are expected, written before the predictions",
        "",
        "Half of the known runs were fitted, the other half predicted as the blind runs are: orders and wind "
        f"of the whole run, readings of its first {record['inputs']['lead']:g} s. Median rms error over the "
        "held-out runs of each kind, and the share of time their readings lay inside the 95 % band. The "
        "blind runs are expected to do the same; kinds of motion that were not fitted, and another basin, "
        "are expected to do worse.",
        "",
        "| kind of motion | runs | channel | median rms error | largest | inside the 95 % band |",
        "|---|---|---|---|---|---|",
    ]
    kinds = dict.fromkeys(r["kind"] for r in record["runs"])
    for kind in kinds:
        rows = [r for r in record["runs"] if r["kind"] == kind and "rms" in r]
        lost = [r for r in record["runs"] if r["kind"] == kind and "failed" in r]
        for channel, (factor, unit) in CHANNELS.items():
            errors = [factor * r["rms"][channel] for r in rows if channel in r["rms"]]
            inside = [r["inside"][channel] for r in rows if channel in r["inside"]]
            if errors:
                numbers = f"{np.median(errors):.3g} {unit} | {max(errors):.3g} {unit}"
                share = f"{100 * np.mean(inside):.0f} %"
                lines.append(f"| {kind} | {len(errors)} | {channel} | {numbers} | {share} |")
        if lost:
            lines.append(f"| {kind} | {len(lost)} | all | cannot be predicted: {lost[0]['failed']} | | |")
    return "\n".join(lines) + "\n"


def left_out_text(name: str, record: Mapping[str, Any]) -> str:
    """Markdown: rms error of left-out runs, and the share of their readings inside bands that other runs of
    their kind made, per kind of motion and channel.
    """
    lines = [
        f"# {name}, ship by MMG: what errors are expected, written before the predictions",
        "",
        "The known runs were left out of the fit in turn and predicted as the blind runs are: orders and "
        f"wind of the whole run, readings of its first {record['inputs']['lead']:g} s. The bands are those "
        "of draws of the coefficients and the usual error of left-out runs together, times a factor by kind "
        "of motion, channel and time, with which 95 % of the errors of left-out runs lie inside. `inside` is "
        "the share of the readings of each left-out run in the band that the other runs of its kind make, "
        "mean over runs (target 90 to 98 %): what the blind runs are expected to do.",
        "",
        "| kind of motion | fit | runs | channel | median rms error | largest | inside the 95 % band |",
        "|---|---|---|---|---|---|---|",
    ]
    words = {"ahead": "zig-zags and turns", "slow": "all runs"}
    for what, found in record["kinds"].items():
        rows = [row["rms"] for row in record["runs"][f"{what} {found['regime']}"]]
        for channel, (factor, unit) in CHANNELS.items():
            errors = [factor * row[channel] for row in rows if channel in row]
            if errors:
                inside = f"{100 * found['inside'][channel]:.0f} %" if channel in found["inside"] else "-"
                numbers = f"{np.median(errors):.3g} {unit} | {max(errors):.3g} {unit}"
                fit = words[found["regime"]]
                lines.append(f"| {what} | {fit} | {len(errors)} | {channel} | {numbers} | {inside} |")
    if name.startswith("kvlcc2"):
        lines += [
            "",
            "No circle of this ship is known here. The row `circle` is of the three zig-zags of 25 to 35 "
            "degrees, predicted by fits to smaller angles; a steady turn goes further. Their errors in x "
            "count for y too, and vice versa. In another basin all are expected to do worse than stated.",
        ]
    return "\n".join(lines) + "\n"
