"""Section of a diagnosis on the proof: how far each model shrinks the error of runs held out.

Takes a `Diagnosis`. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.evidence.holdout import HorizonError
from bayesid.diagnosis.hypotheses.verdict import NAMING, simplest
from bayesid.diagnosis.run import Diagnosis
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import IN_DEGREES, in_words
from bayesid.report.writer import Block, Figure, Table, Text, literal


def proof_label(found: Diagnosis) -> str:
    """What the third model has: what the verdict names, or the best explanation, which may be more."""
    best = simplest(found.candidates)
    used = best.effects if best.log_evidence > found.candidates.none.log_evidence else ()
    if found.verdict.word in NAMING and set(used) == set(found.verdict.effects):
        return "with the effect" if len(used) == 1 else "with the effects"
    return f"best explanation ({' + '.join(in_words(n) for n in used) or 'none'})"


def record_label(record: Mapping[str, Any]) -> str:
    """The same for a `diagnosis.json`, which does not say what its best explanation holds."""
    return "with the effect" if record["verdict"] == "effect" else "best explanation"


def shrink_blocks(found: Diagnosis) -> list[Block]:
    """The table of horizons on held-out runs, errors per channel and standard measures."""
    horizons, label = found.shrink.horizons, proof_label(found)
    if not horizons:
        return [Text("No run was held out, so no prediction could be proven. Give a run the role `holdout`.")]
    blocks: list[Block] = [
        Text(
            "Held-out runs "
            + ", ".join(literal(r) for r in found.shrink.runs)
            + " were read only after the verdict stood."
        )
    ]
    rows = []
    for r in horizons:
        told = _closed(r) if not r.worth else f"{r.shrink:.1%}"
        if r.worth and math.isfinite(r.interval[0]):
            told += f" ({r.interval[0]:.0%} to {r.interval[1]:.0%})"
        name = r.horizon + (f" ({r.seconds:.0f} s)" if math.isfinite(r.seconds) else "")
        rows.append(
            [name, *(at_floor(r.excess[k]) for k in ("nominal", "recalibrated", "with effect")), told]
        )
    blocks.append(
        Table(
            ["horizon", "nominal", "recalibrated", label, "shrinks by"],
            rows,
            "Mean squared prediction error above the floor, in noise variances; the floor is what noise, "
            "environment and an unknown start leave to the best of models. The 90 % intervals resample the "
            "pieces predicted and draw the models' parameters from their posteriors.",
        )
    )
    nominal, tuned, now = (
        np.array([r.excess[k] for r in horizons]) for k in ("nominal", "recalibrated", "with effect")
    )
    drawn = figures.ladder([r.horizon for r in horizons], nominal, tuned, now, label)
    blocks.append(Figure("ladder", drawn, "The same as bars; a bar at 0.001 is at the floor."))
    last = horizons[-1].rms
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
                *(_known(last[k].get(channel), scale) for k in ("nominal", "recalibrated", "with effect")),
            ]
        )
    blocks.append(
        Table(
            ["channel", "nominal", "recalibrated", label],
            physical,
            "Full replay, root mean square error; a dash where no held-out run reads the channel.",
        )
    )
    if found.shrink.measures:
        blocks.append(_measures(found, label))
    return blocks


def _measures(found: Diagnosis, label: str) -> Table:
    rows: list[list[Any]] = []
    for m in found.shrink.measures:
        unit, scale = IN_DEGREES.get(m.unit, (m.unit, 1.0))
        models = (m.models.get(k, math.nan) * scale for k in ("nominal", "recalibrated", "with effect"))
        rows.append([literal(m.run), f"{m.name} [{unit}]", m.logged * scale, *models])
    return Table(
        ["run", "measure", "as logged", "nominal", "recalibrated", label],
        rows,
        "Standard measures of the held-out runs, replayed with the logged orders.",
    )


def _known(value: float | None, scale: float) -> float | None:
    return value * scale if value is not None and math.isfinite(value) else None


def _closed(horizon_row: HorizonError) -> str:
    """Words where the recalibrated model leaves no gap."""
    if (
        horizon_row.excess["nominal"] > 1.0
        and horizon_row.excess["recalibrated"] < 0.1 * horizon_row.excess["nominal"]
    ):
        return "closed by recalibration"
    return "nothing to shrink"


def at_floor(excess: float) -> Any:
    """An error above the floor; what scatters below it is at the floor."""
    return excess if excess > 0.05 else "at the floor"
