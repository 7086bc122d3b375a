"""Sealed statements about the wind laid beside the anemometer: direction, speed, coverage.

Takes the committed verdicts, the runs as they were diagnosed, and the opened wind logs. Gives plain records.
The
truth is the mean of the measured wind vector over the seconds that were diagnosed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import BayesidError
from studies.withheld_score.effects import INSIDE


def measured(file: Path, start: float, end: float) -> dict[str, float]:
    """Mean wind vector of a log between two times [s].

    Returns
    -------
    speed : of the mean vector [m/s]; mean_speed : mean of the speeds; from : where it comes from [rad]

    Raises
    ------
    BayesidError               no such file, other columns, or no reading between the times
    """
    try:
        header, *lines = file.read_text("utf-8").splitlines()
    except (OSError, ValueError):
        raise BayesidError(f"{file.name}: no wind log of this run in {file.parent.name}") from None
    if header.split(",") != ["t[s]", "wind_speed[m/s]", "wind_from[rad]"]:
        raise BayesidError(f"{file.name}: columns are {header!r}; wanted t[s],wind_speed[m/s],wind_from[rad]")
    t, speed, come = np.array([[float(x) for x in line.split(",")] for line in lines if line]).T
    inside = (t >= start) & (t <= end) & np.isfinite(speed) & np.isfinite(come)
    if not inside.any():
        raise BayesidError(f"{file.name}: no reading between {start:g} and {end:g} s")
    x, y = np.mean(speed[inside] * np.cos(come[inside])), np.mean(speed[inside] * np.sin(come[inside]))
    return {
        "speed": float(np.hypot(x, y)),
        "mean_speed": float(np.mean(speed[inside])),
        "from": float(np.arctan2(y, x) % (2 * np.pi)),
    }


def turned(angle: float) -> float:
    """An angle brought to -pi .. pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def scored(found: Mapping[str, Any], known: Mapping[str, float], area: Mapping[str, float]) -> dict[str, Any]:
    """One committed verdict beside its anemometer.

    Parameters
    ----------
    area : exposed area of October over the catalogue's, with sd; the committed report divided speeds by its
    root
    """
    out: dict[str, Any] = {"verdict": found["verdict"], "set": list(found["set95"]), "measured": dict(known)}
    out["in_set"] = bool({"wind", "steady_force"} & set(found["set95"]))
    force: Mapping[str, Any] = next((e for e in found["effects"] if e["name"] == "steady_force"), {})
    wind: Mapping[str, Any] = next((e for e in found["effects"] if e["name"] == "wind"), {})
    if force and "F_north" in force["parameters"] and not wind:
        n, e = (force["parameters"][k]["value"] for k in ("F_north", "F_east"))
        out["force_direction_error"] = turned(math.atan2(-e, -n) - known["from"])
    if "V_wind" not in wind.get("parameters", {}):
        return out
    speed, come = wind["parameters"]["V_wind"], wind["parameters"]["from"]
    root = math.sqrt(area["area"])
    scaled = speed["value"] / root
    scaled_sd = math.hypot(speed["sd"] / root, 0.5 * scaled * area["sd"] / area["area"])
    direction = turned(come["value"] - known["from"])
    error, after = speed["value"] - known["speed"], scaled - known["speed"]
    return out | {
        "from": come["value"], "from_sd": come["sd"], "direction_error": direction,
        "direction_inside": abs(direction) <= INSIDE * come["sd"],
        "speed": speed["value"], "speed_sd": speed["sd"], "speed_error": error,
        "speed_inside": abs(error) <= INSIDE * speed["sd"],
        "scaled": scaled, "scaled_sd": scaled_sd, "scaled_error": after,
        "scaled_inside": abs(after) <= INSIDE * scaled_sd,
    }  # fmt: skip


def checked(rows: Sequence[Mapping[str, Any]], area: Mapping[str, float]) -> list[dict[str, float]]:
    """Speeds of the runs whose measured wind was known and hidden: measured, said, and scaled by the area."""
    out = []
    for row in rows:
        wind = next((e for e in row["found"]["effects"] if e["name"] == "wind"), None)
        if wind and "V_wind" in wind["parameters"] and row["measured"]:
            stated = wind["parameters"]["V_wind"]["value"]
            scaled = stated / math.sqrt(area["area"])
            out.append({"measured": row["measured"]["speed"], "said": stated, "scaled": scaled})
    return out


def summed(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Counts and mean errors over the runs with a statement, and what blew where none was made."""
    stated = [r for r in rows if "speed" in r]
    silent = [r for r in rows if "speed" not in r and "force_direction_error" not in r]

    def mean(key: str) -> float:
        return float(np.mean([abs(r[key]) for r in stated])) if stated else math.nan

    return {
        "runs": len(rows), "said": len(stated),
        **{f"{k}_inside": sum(r[f"{k}_inside"] for r in stated) for k in ("direction", "speed", "scaled")},
        "direction_error": mean("direction_error"),
        "speed_error": mean("speed_error"), "scaled_error": mean("scaled_error"),
        "in_set": sum(r["in_set"] for r in rows),
        "silent": len(silent), "silent_speeds": [r["measured"]["speed"] for r in silent],
    }  # fmt: skip
