"""The report: winds by the motion of the ship beside the anemometer, and the marks that were set.

Takes the record of `run`. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Report, Section, Table, literal
from studies.wind_from_motion.estimate import NAMED

NO_SHIP = "no ship could be fitted to the other half of the runs"
LEAST = 1.0  # m/s of mean wind from which a direction is asked for
MARK_DIRECTION, MARK_NAMED, MARK_COVERED = 10.0, 80.0, (88.0, 99.0)


def scores(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Direction error rms [deg] and share named [%] where the mean wind is above `LEAST`, by sds as stated
    and by sds scaled by the rms of error over sd; of all runs, share of components within 1.96 sd [%], rms of
    error over sd, rms error of the components [m/s]."""
    told = [r for r in rows if "mean" in r]
    windy = [r for r in rows if np.hypot(*r["measured"]) > LEAST]
    errors = np.array([r["direction_error"] for r in windy if "mean" in r])
    over = errors / np.array([r["direction_sd"] for r in windy if "mean" in r])
    z = np.array([r["z"] for r in told])
    rms_z = float(np.sqrt(np.mean(z**2)))
    evidence = np.array([r.get("evidence", 0.0) for r in windy])
    off = np.array([np.subtract(r["mean"], r["measured"]) for r in told])
    return {
        "windy": len(windy), "runs": len(rows),
        "direction": float(np.degrees(np.sqrt(np.mean(errors**2)))),
        "direction_covered": 100.0 * float(np.mean(np.abs(over) < 1.96)),
        "named": 100.0 * float(np.mean(evidence > NAMED)),
        "named_scaled": 100.0 * float(np.mean(evidence / max(rms_z, 1.0) ** 2 > NAMED)),
        "covered": 100.0 * float(np.mean(np.abs(z) < 1.96)), "rms_z": rms_z,
        "speed": float(np.sqrt(np.mean(off**2))),
        "ratio": float(np.median([np.hypot(*r["mean"]) / np.hypot(*r["measured"]) for r in told])),
    }  # fmt: skip


def wind_report(record: Mapping[str, Any]) -> Report:
    """Headline with the marks, scores of both passes, run by run."""
    passes = {words: scores(rows) for words, rows in record["passes"].items()}
    last, rows = list(record["passes"].items())[-1]
    s = passes[last]
    direction, named = _word(s["direction"] <= MARK_DIRECTION), _word(s["named_scaled"] >= MARK_NAMED)
    covered = _word(MARK_COVERED[0] <= s["covered"] <= MARK_COVERED[1])
    first = next(iter(passes))
    ships = (
        "Every run is fitted by itself: wind, and what the prior of the ship leaves open: the published one "
        "with 20 % a coefficient, with which no anemometer is read at all"
    )
    ships += "." if last == first else (
        f" ({_short(passes[first])}); then the ship fitted to the other half of the runs in their measured "
        "wind, which the headline is of."
    )  # fmt: skip
    without = [r["run"] for r in rows if r.get("failed") == NO_SHIP]
    if without:
        ships += f" For {len(without)} runs no ship could be fitted; they count as told nothing."
    lead = (
        f"**Direction of the wind by the motion alone, {s['windy']} runs with a mean wind above {LEAST:g} "
        f"m/s: {s['direction']:.2g} degrees rms (mark {MARK_DIRECTION:g}: {direction}); named in "
        f"{s['named_scaled']:.0f} % of them with sds scaled by the {s['rms_z']:.2g} they are too small by, "
        f"{s['named']:.0f} % with sds as stated (mark {MARK_NAMED:g}: {named}); "
        f"{s['direction_covered']:.0f} % of directions and, of all {s['runs']} runs, {s['covered']:.0f} % of "
        f"components within 1.96 sd (mark 95: {covered}; rms of error over sd {s['rms_z']:.2g}).** "
        f"Components are {s['speed']:.2g} m/s rms off; the speed found is {s['ratio']:.2g} times the "
        "measured one (median), and that factor, of anemometer and areas, is in the components. The wind "
        f"column of a run is looked at when all winds are there. {ships} A wind is named where two "
        "components at zero have a probability below 1 %; without an anemometer the factor of the sds is not "
        "known, so names by sds as "
        "stated are not to be trusted. Zig-zags and turns begin where the ship has way on."
    )
    if record["inputs"]["quick"]:
        lead += " Four runs of a kind, published ship only (`--quick`)."
    lead += "\n\n" + literal(record["attribution"])
    head = ["ship", "direction rms [deg]", "within 1.96 sd [%]", "named, sds scaled [%]",
            "named, sds as stated [%]", "components within 1.96 sd [%]",
            "rms error over sd", "components rms [m/s]"]  # fmt: skip
    keys = ("direction", "direction_covered", "named_scaled", "named", "covered", "rms_z", "speed")
    table = Table(
        head, [[words, *(one[k] for k in keys)] for words, one in passes.items()],
        f"Directions and names: the {s['windy']} runs with a mean wind above {LEAST:g} m/s.", 3,
    )  # fmt: skip
    return Report(
        "Wind from the motion of a ship",
        lead,
        [Section("Scores", [table]), Section("Run by run", [_runs(rows)])],
    )


def _short(s: Mapping[str, float]) -> str:
    return (
        f"directions {s['direction']:.2g} degrees rms, named in {s['named_scaled']:.0f} % with sds scaled, "
        f"{s['named']:.0f} % as stated"
    )


def _word(met: bool) -> str:
    return "met" if met else "missed"


def _runs(rows: Sequence[Mapping[str, Any]]) -> Table:
    head = ["run", "time [s]", "measured [m/s]", "found [m/s]", "from, measured [deg]", "from, found [deg]",
            "sd [deg]", "off [deg]", "chi-square"]  # fmt: skip
    lines: list[list[Any]] = []
    for r in rows:
        front = [r["run"], r["seconds"], float(np.hypot(*r["measured"]))]
        if "mean" not in r:
            lines.append([*front, r["failed"], None, None, None, None, None])
            continue
        lines.append(
            [
                *front, float(np.hypot(*r["mean"])), _from(r["measured"]), _from(r["mean"]),
                float(np.degrees(r["direction_sd"])), float(np.degrees(r["direction_error"])), r["evidence"],
            ]
        )  # fmt: skip
    return Table(head, lines, "Directions count from x0 towards y0 of the pond.", 3)


def _from(air: Sequence[float]) -> float:
    return float(np.degrees(np.arctan2(-air[1], -air[0])) % 360.0)
