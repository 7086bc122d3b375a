"""What the operator orders: standard manoeuvres, rich inputs, command tables, names for a command line.

Takes: SI, radians, rpm; positive rudder turns to port. Returns frozen OpenLoop and ClosedLoop objects.
Does not: simulate (`bayesid.simulation`) or measure (`bayesid.measures`).
"""

from bayesid.manoeuvres.catalogue import REGISTRY, Scale
from bayesid.manoeuvres.core import (
    ClosedLoop,
    Manoeuvre,
    OpenLoop,
    describe,
    first_orders,
    grid,
    held,
    mirrored,
    on_grid,
)
from bayesid.manoeuvres.excite import chirp, combined, combined_held, multisine, prbs, random_rudder
from bayesid.manoeuvres.order_words import order_words
from bayesid.manoeuvres.registry import LIBRARY, library, options, parse
from bayesid.manoeuvres.standard import (
    coast_down,
    depth_change,
    dieudonne,
    meander,
    pull_out,
    speed_steps,
    spiral,
    straight,
    turn,
    vertical_zigzag,
    zigzag,
)
from bayesid.manoeuvres.table import read_table, with_rows_every, write_table
from bayesid.model.channels import COMMANDS

__all__ = [
    "COMMANDS",
    "ClosedLoop",
    "LIBRARY",
    "Manoeuvre",
    "OpenLoop",
    "REGISTRY",
    "Scale",
    "chirp",
    "coast_down",
    "combined",
    "combined_held",
    "depth_change",
    "describe",
    "dieudonne",
    "first_orders",
    "grid",
    "held",
    "library",
    "meander",
    "mirrored",
    "multisine",
    "on_grid",
    "options",
    "order_words",
    "parse",
    "prbs",
    "pull_out",
    "random_rudder",
    "read_table",
    "speed_steps",
    "spiral",
    "straight",
    "turn",
    "vertical_zigzag",
    "with_rows_every",
    "write_table",
    "zigzag",
]
