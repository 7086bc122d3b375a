"""Section of a diagnosis on the proof: how far each model shrinks the error of runs held out.

Takes a `Diagnosis`. Does not compute.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bayesid.diagnose.diagnosis import Diagnosis
from bayesid.diagnose.shrink import Rung
from bayesid.figures import diagnosis as figures
from bayesid.report import Block, Figure, Table, Text, literal
from bayesid.sections.diagnosis_words import IN_DEGREES


def shrink_blocks(found: Diagnosis) -> list[Block]:
    rungs = found.shrink.rungs
    if not rungs:
        return [Text("No run was held out, so no prediction could be proven. Give a run the role `holdout`.")]
    blocks: list[Block] = [
        Text(
            "Held-out runs "
            + ", ".join(literal(r) for r in found.shrink.runs)
            + " were read only after the verdict stood."
        )
    ]
    rows = []
    for r in rungs:
        told = _closed(r) if not r.worth else f"{r.shrink:.1%}"
        if r.worth and math.isfinite(r.interval[0]):
            told += f" ({r.interval[0]:.0%} to {r.interval[1]:.0%})"
        name = r.horizon + (f" ({r.seconds:.0f} s)" if math.isfinite(r.seconds) else "")
        rows.append(
            [name, *(at_floor(r.excess[k]) for k in ("nominal", "recalibrated", "with effect")), told]
        )
    blocks.append(
        Table(
            ["horizon", "nominal", "recalibrated", "with the effect", "shrinks by"],
            rows,
            "Mean squared prediction error above the floor, in noise variances; the floor is what noise, "
            "environment and an unknown start leave to the best of models. The 90 % intervals resample the "
            "pieces predicted and draw the models' parameters from their posteriors.",
        )
    )
    drawn = figures.ladder(
        [r.horizon for r in rungs],
        *(np.array([r.excess[k] for r in rungs]) for k in ("nominal", "recalibrated", "with effect")),
    )
    blocks.append(Figure("ladder", drawn, "The ladder from the simulator as it was to the diagnosed one."))
    last = rungs[-1].rms
    physical = []
    for channel in found.problem.channels:
        unit, scale = (
            ("deg", 180 / math.pi) if channel in ("psi", "phi", "theta") else ("deg/s", 180 / math.pi)
        )
        if channel in ("x", "y", "z"):
            unit, scale = "m", 1.0
        elif channel in ("u", "v", "w"):
            unit, scale = "m/s", 1.0
        physical.append(
            [
                f"{channel} [{unit}]",
                *(last[k][channel] * scale for k in ("nominal", "recalibrated", "with effect")),
            ]
        )
    blocks.append(
        Table(
            ["channel", "nominal", "recalibrated", "with the effect"],
            physical,
            "Full replay, root mean square error.",
        )
    )
    if found.shrink.measures:
        blocks.append(_measures(found))
    return blocks


def _measures(found: Diagnosis) -> Table:
    rows: list[list[Any]] = []
    for m in found.shrink.measures:
        unit, scale = IN_DEGREES.get(m.unit, (m.unit, 1.0))
        models = (m.models.get(k, math.nan) * scale for k in ("nominal", "recalibrated", "with effect"))
        rows.append([literal(m.run), f"{m.name} [{unit}]", m.logged * scale, *models])
    return Table(
        ["run", "measure", "as logged", "nominal", "recalibrated", "with the effect"],
        rows,
        "Standard measures of the held-out runs, replayed with the logged orders.",
    )


def _closed(rung: Rung) -> str:
    """Words where the recalibrated model leaves no gap."""
    if rung.excess["nominal"] > 1.0 and rung.excess["recalibrated"] < 0.1 * rung.excess["nominal"]:
        return "closed by recalibration"
    return "nothing to shrink"


def at_floor(excess: float) -> Any:
    """An error above the floor; what scatters below it is at the floor."""
    return excess if excess > 0.05 else "at the floor"
