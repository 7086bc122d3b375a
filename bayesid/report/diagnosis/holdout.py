"""Section of a diagnosis on hold-out validation: how far each model shrinks the error of runs held out.

Takes a `Result`. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.hypotheses.rules import NAMING
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import Horizon
from bayesid.diagnosis.third_model import AS_GIVEN, RE_TUNED, in_its_place
from bayesid.measures.angle_errors import turns_note
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import IN_DEGREES, in_words
from bayesid.report.writer import Block, Figure, Table, Text, literal

MODELS = ("nominal", "recalibrated", "with effect")


def proof_label(result: Result) -> str:
    """What the third model has: what the verdict names, or the best explanation, which may be more or nothing
    at all."""
    if label := in_its_place(result):
        return label
    used = result.explanation
    if result.verdict in NAMING and set(used) == {e.name for e in result.effects}:
        return "with the effect" if len(used) == 1 else "with the effects"
    return f"best explanation ({' + '.join(in_words(n) for n in used) or 'none'})"


def record_label(record: Mapping[str, Any]) -> str:
    """The same for a `diagnosis.json`, of which some do not say what their best explanation holds."""
    if (record.get("retuning") or {}).get("alone", False):
        return RE_TUNED
    if record_as_given(record):
        return AS_GIVEN
    return "with the effect" if record["verdict"] == "effect" else "best explanation"


def record_as_given(record: Mapping[str, Any]) -> bool:
    """Whether held-out runs are predicted by the simulator as given in place of an explanation: nothing is
    re-tuned, and the errors are those of the first model to the last digit."""
    errors, tuned = [h["rms"] for h in record["gap"]["horizons"]], record.get("retuning") or {}
    if tuned.get("kept", True) or not errors:
        return False
    return all(rms["with effect"] == rms["nominal"] for rms in errors)


def holdout_blocks(result: Result) -> list[Block]:
    """The table of horizons on held-out runs, errors per channel and standard measures."""
    horizons, label = result.gap.horizons, proof_label(result)
    if not horizons:
        return [Text("No run was held out, so no prediction could be proven. Give a run the role `holdout`.")]
    blocks: list[Block] = [
        Text(
            "Held-out runs "
            + ", ".join(literal(r) for r in result.gap.runs)
            + " were read only after the verdict stood."
        )
    ]
    rows = []
    for r in horizons:
        name = r.horizon + (f" ({r.seconds:.0f} s)" if r.seconds is not None else "")
        rows.append([name, *(at_floor(r.excess[k]) for k in MODELS), _shrinks(r)])
    blocks.append(
        Table(
            ["horizon", "as given", "re-tuned", label, "shrinks by"],
            rows,
            "Mean squared prediction error above the floor, in noise variances; the floor is what noise, "
            "environment and an unknown start leave to the best of models. The 90 % intervals resample the "
            "pieces predicted and draw the models' parameters from their posteriors.",
        )
    )
    nominal, tuned, now = (np.array([r.excess[k] for r in horizons]) for k in MODELS)
    drawn = figures.horizon_errors([r.horizon for r in horizons], nominal, tuned, now, label)
    blocks.append(Figure("horizon_errors", drawn, "The same as bars; a bar at 0.001 is at the floor."))
    last = horizons[-1].rms
    physical = []
    for channel in result.trial.channels:
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
                *(_scaled(last[k].get(channel), scale) for k in MODELS),
            ]
        )
    blocks.append(
        Table(
            ["channel", "as given", "re-tuned", label],
            physical,
            "Full replay, root mean square error; a dash where no held-out run reads the channel."
            + turns_note(float(last[k].get("psi") or 0.0) for k in MODELS),
        )
    )
    return blocks


def measures_table(result: Result, labels: tuple[str, str, str]) -> Table:
    """Overshoots, diameters and the like of held-out runs."""
    rows: list[list[Any]] = []
    for m in result.measures:
        unit, scale = IN_DEGREES.get(str(m["unit"]), (m["unit"], 1.0))
        values = (_scaled(m.get(k), scale) for k in ("logged", *MODELS))
        rows.append([literal(str(m["run"])), f"{m['name']} [{unit}]", *values])
    return Table(
        ["run", "measure", "as logged", *labels],
        rows,
        "Standard measures of the held-out runs, replayed with the logged orders."
        + _worse_measures(result, labels),
    )


def _worse_measures(result: Result, labels: tuple[str, str, str]) -> str:
    """Measures that the last model misses by more than the first, as a sentence; numbers count as printed."""
    told = []
    for m in result.measures:
        unit, scale = IN_DEGREES.get(str(m["unit"]), (m["unit"], 1.0))
        logged, given, now = (_scaled(m.get(k), scale) for k in ("logged", "nominal", "with effect"))
        if logged is None or given is None:
            continue
        off, before = (math.inf if x is None else abs(x - logged) for x in (now, given))
        if math.isinf(off):
            told.append(f"{m['name']} of {m['run']}, which it does not reach")
        elif float(number(off)) > float(number(before)):
            told.append(f"{m['name']} of {m['run']} by {number(off)} {unit} instead of {number(before)}")
    if not told:
        return ""
    return f" Missed by more {labels[-1]} than {labels[0]}: {literal('; '.join(told))}."


def _scaled(value: Any, scale: float) -> float | None:
    return float(value) * scale if value is not None else None


def _shrinks(horizon: Horizon) -> str:
    """By how much the gap shrinks, with its interval, or why there is none to shrink."""
    excess = horizon.excess
    if not horizon.worth_shrinking or horizon.shrink is None:
        closed = excess["nominal"] > 1.0 and excess["recalibrated"] < 0.1 * excess["nominal"]
        return "closed by recalibration" if closed else "nothing to shrink"
    low, high = horizon.interval
    return f"{horizon.shrink:.1%}" + (
        f" ({low:.0%} to {high:.0%})" if low is not None and high is not None else ""
    )


def at_floor(excess: float) -> Any:
    """An error above the floor; what scatters below it is at the floor."""
    return excess if excess > 0.05 else "at the floor"
