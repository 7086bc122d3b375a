"""Printing the standard measures of a run."""

from __future__ import annotations

import math
from typing import Any


def print_measures(measured: list[dict[str, Any]], length: float | None = None) -> None:
    """Print what `measure` found; with the vehicle's length [m] distances also in lengths."""
    from bayesid.cli.output import print_table, print_text

    for result in measured:
        print_text()
        if result["rows"] and length:
            rows = [
                (*row, f"{row[1] / length:.3g} L" if row[2] == "m" and math.isfinite(row[1]) else "")
                for row in result["rows"]
            ]
            print_table([result["kind"], "value", "unit", ""], rows)
        elif result["rows"]:
            print_table([result["kind"], "value", "unit"], result["rows"])
        else:
            print_text(result["kind"])
        for quantity, reason in result["reasons"].items():
            print_text(f"  {quantity}: {reason}")
