"""Printing the standard measures of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from bayesid.model.vehicles import Vehicle
    from bayesid.trials import Run


def measured_channels(run: Run, vehicle: Vehicle | None) -> Mapping[str, np.ndarray]:
    """What `named_measures` reads of a run: its data, and the ordered angles, else the measured ones.

    Parameters
    ----------
    vehicle : the vehicle of the run, whose named rudders count as one; None where that is not known
    """
    from bayesid.model.vehicles.orders import gathered

    orders, positions = dict(run.commands), dict(run.measured_inputs)
    if vehicle is not None:
        orders, positions = gathered(vehicle, orders), gathered(vehicle, positions, "")
    return {**run.data, **positions, **{name.removesuffix("_cmd"): one for name, one in orders.items()}}


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
