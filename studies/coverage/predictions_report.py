"""The section on fresh runs: are errors of predictions as large as their bands say?

Takes plain records of `predictions.fresh_runs`. Judges them against the study's bars. Does not predict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.estimation.sampling.rank_statistics import coverage
from bayesid.report.writer import Section, Table, Text

Records = Mapping[str, Sequence[Mapping[str, Any]]]
LEAST, RMS_LOW, RMS_HIGH = 0.88, 0.8, 1.2
STANDARD_ERRORS = 2.0  # a bar is met within so many


def judged_predictions(records: Records) -> dict[str, Any]:
    """Per group of vehicles: rms error over the predicted sd, and share of readings inside the bands."""
    return {name: _group(rows) for name, rows in records.items()}


def _group(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    good = [r for r in rows if not r["failed"]]
    found: dict[str, Any] = {
        "vehicles": len(rows), "predicted": len(good), "runs": sum(len(r["runs"]) for r in good),
        "failed": [r["failed"] for r in rows if r["failed"]],
    }  # fmt: skip
    if len(good) < 2:
        return found
    # every vehicle is one observation: mean over its runs and channels
    squares = np.array([np.mean([v for run in r["runs"] for v in run["square"].values()]) for r in good])
    rms = float(np.sqrt(squares.mean()))
    found |= {
        "rms_z": rms,
        "rms_z_error": float(squares.std(ddof=1) / np.sqrt(squares.size) / (2 * rms)),
        "median_rms_z": float(np.sqrt(np.median(squares))),
        **{key: coverage(_shares(good, key)) for key in ("inside90", "inside95")},
        "final": float(np.mean([r["final"] for r in good])),
        "channels": {c: _channel(good, c) for c in _channels(good)},
        "cpu_seconds": float(sum(r["cpu_seconds"] for r in good)),
    }
    return found


def _shares(good: Sequence[Mapping[str, Any]], key: str) -> np.ndarray:
    return np.array([[np.mean([v for run in r["runs"] for v in run[key].values()])] for r in good])


def _channels(good: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(c for r in good for run in r["runs"] for c in run["square"]))


def _channel(good: Sequence[Mapping[str, Any]], name: str) -> dict[str, float]:
    runs = [run for r in good for run in r["runs"] if name in run["square"]]
    return {
        "rms_z": float(np.sqrt(np.mean([run["square"][name] for run in runs]))),
        "inside90": float(np.mean([run["inside90"][name] for run in runs])),
    }


def prediction_targets(groups: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Targets of all groups."""
    out: dict[str, Any] = {}
    for name, g in groups.items():
        if "rms_z" not in g:
            continue
        rms, share = g["rms_z"], g["inside90"]["share"]
        out[f"rms z of fresh runs, {name}"] = {
            "value": rms, "bar": f"{RMS_LOW} to {RMS_HIGH}",
            "standing": _standing(max(RMS_LOW - rms, rms - RMS_HIGH), g["rms_z_error"]),
        }  # fmt: skip
        out[f"90 % bands of fresh runs, {name}"] = {
            "value": share, "bar": f">= {LEAST:.2f}",
            "standing": _standing(LEAST - share, g["inside90"]["standard_error"]),
        }  # fmt: skip
    return out


def _standing(short: float, error: float) -> str:
    """By how much a bar is missed, against the error of that."""
    if short <= 0:
        return "met"
    return "undecided" if short <= STANDARD_ERRORS * error else "missed"


def prediction_words(groups: Mapping[str, Mapping[str, Any]]) -> str:
    """The answer in a sentence or two; empty without records."""
    able = {n: g for n, g in groups.items() if "rms_z" in g}
    if not able:
        return ""
    listed = "; ".join(
        f"{n}: {100 * g['inside90']['share']:.1f} ± {100 * g['inside90']['standard_error']:.1f} %, rms error "
        f"{g['rms_z']:.2f} predicted sd"
        for n, g in able.items()
    )
    count = sum(g["runs"] for g in able.values())
    return f"Of the readings of {count} fresh runs inside their predicted 90 % band: {listed}."


def predictions_section(groups: Mapping[str, Mapping[str, Any]]) -> Section:
    """Table of groups and channels."""
    able = {n: g for n, g in groups.items() if "rms_z" in g}
    columns = (
        "vehicles", "predicted", "fresh runs", "rms z", "median of vehicles", "90 % band [%]",
        "95 % band [%]", "fit called final [%]",
    )  # fmt: skip
    rows = tuple(
        (
            n, f"{g['predicted']} of {g['vehicles']}", g["runs"],
            f"{g['rms_z']:.2f} ± {g['rms_z_error']:.2f}", f"{g['median_rms_z']:.2f}",
            _percent(g["inside90"]), _percent(g["inside95"]),
            f"{100 * g['final']:.0f}",
        )
        for n, g in able.items()
    )  # fmt: skip
    names = list(dict.fromkeys(c for g in able.values() for c in g["channels"]))
    each = tuple(
        (n, *(f"{g['channels'][c]['rms_z']:.2f}" if c in g["channels"] else "" for c in names))
        for n, g in able.items()
    )
    reasons = dict.fromkeys(why for g in groups.values() for why in g["failed"])
    lost = f" Not predicted: {'; '.join(reasons)}." if reasons else ""
    text = (
        "A vehicle is fitted to its runs as `bayesid fit` does, and runs it has not read are predicted from "
        "their orders and first readings (6 L/U), as `bayesid predict` does. z is the error of the mean over "
        "the predicted sd, sensor noise included, of every reading after those; ± is the standard error that "
        "takes a vehicle as one observation. The first two groups are zig-zags of the conditions above; "
        "fresh are a zig-zag of another angle and a turn, a motion that was not fitted. The independent "
        "plant shares no equation with the fit and has other vehicles, seas, sensors and manoeuvres; fresh "
        "are the runs it holds out; unlisted causes are those the catalogue has not, or in another "
        f"form.{lost}"
    )
    return Section(
        "Predictions of fresh runs",
        (Text(text), Table(columns, rows), Text("Rms z per channel."), Table(("vehicles", *names), each)),
    )


def _percent(found: Mapping[str, float]) -> str:
    return f"{100 * found['share']:.1f} ± {100 * found['standard_error']:.1f}"
