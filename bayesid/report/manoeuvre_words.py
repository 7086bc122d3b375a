"""Words that the reports of comparing manoeuvres and of the next one share.

Takes a `PlanningCase` and notes. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bayesid.analysis.design.compare import PlanningCase
from bayesid.report.writer import Block, Text, literal

# what to run with a vehicle whose manoeuvres cannot be designed
APART = "tables of orders in which every actuator moves by itself (no manoeuvre is designed without a rudder)"


def logger_words(case: PlanningCase) -> str:
    """The logger in one sentence."""
    parts = [f"{c} {_sigma(c, s)}" for c, s in case.logging.sigma.items()]
    return f"Readings every {case.logging.dt:.3g} s with white noise of {', '.join(parts)}."


def _sigma(channel: str, value: float) -> str:
    if channel in ("phi", "theta", "psi"):
        return f"{math.degrees(value):.3g} deg"
    if channel in ("p", "q", "r"):
        return f"{math.degrees(value):.3g} deg/s"
    return f"{value:.3g} {'m' if channel in 'xyz' else 'm/s'}"


def note_blocks(notes: Sequence[str]) -> list[Block]:
    """Notes as a list; nothing where there are none."""
    return [Text("\n".join(f"- {literal(n)}" for n in notes))] if notes else []
