"""The report: winds by the motion of the ship beside the anemometer, and the marks that were set.

Takes the record of `run`. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Report, Section, Table, Text, literal
from studies.wind_from_motion.estimate import NAMED

NO_SHIP = "no ship could be fitted to the other half of the runs"
LEAST = 1.0  # m/s of mean wind from which a direction is asked for
MARK_DIRECTION, MARK_NAMED, MARK_COVERED = 10.0, 80.0, (88.0, 99.0)


def scores(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Direction error, rms and median [deg], and share named [%] where the mean wind is above `LEAST`, by sds
    as stated and by sds scaled by the rms of error over sd; of all runs, against the steady wind that pushes
    as the measured one, share of components within 1.96 sd [%], rms of error over sd, rms error of the
    components [m/s]; median of the speed over that of either wind."""
    told = [r for r in rows if "mean" in r]
    windy = [r for r in rows if np.hypot(*r["measured"]) > LEAST]
    errors = np.array([r["direction_error"] for r in windy if "mean" in r])
    over = errors / np.array([r["direction_sd"] for r in windy if "mean" in r])
    z = np.array([r["z"] for r in told])
    rms_z = float(np.sqrt(np.mean(z**2)))
    evidence = np.array([r.get("evidence", 0.0) for r in windy])
    off = np.array([np.subtract(r["mean"], r["pushing"]) for r in told])

    def ratio(of: str) -> float:
        return float(np.median([np.hypot(*r["mean"]) / np.hypot(*r[of]) for r in told]))

    return {
        "windy": len(windy), "runs": len(rows),
        "direction": float(np.degrees(np.sqrt(np.mean(errors**2)))),
        "direction_median": float(np.degrees(np.median(np.abs(errors)))),
        "direction_covered": 100.0 * float(np.mean(np.abs(over) < 1.96)),
        "named": 100.0 * float(np.mean(evidence > NAMED)),
        "named_scaled": 100.0 * float(np.mean(evidence / max(rms_z, 1.0) ** 2 > NAMED)),
        "covered": 100.0 * float(np.mean(np.abs(z) < 1.96)), "rms_z": rms_z,
        "speed": float(np.sqrt(np.mean(off**2))),
        "ratio": ratio("measured"), "ratio_pushing": ratio("pushing"),
    }  # fmt: skip


def wind_report(record: Mapping[str, Any]) -> Report:
    """Headline with the marks, scores of the passes, run by run."""
    alone = {words: scores(rows) for words, rows in record["passes"].items()}
    together = {words: scores(rows) for words, rows in record["together"].items()}
    last, rows = list(record["together"].items())[-1]
    s, hours = together[last], record["hours"][last]
    told = "; ".join(f"{words}: {_marks(one)}" for words, one in together.items())
    without = [r["run"] for r in rows if r.get("failed") == NO_SHIP]
    lost = ""
    if without:
        lost = f" For {len(without)} runs no ship could be fitted; they count as told nothing."
    by_itself = "; ".join(
        f"{words}: directions {one['direction']:.2g} degrees rms off, sds {one['rms_z']:.2g} times too "
        f"small, {one['named_scaled']:.0f} % named with sds scaled by that"
        for words, one in alone.items()
    )
    lead = (
        f"**The wind by the motion alone, {s['windy']} runs with a mean wind above {LEAST:g} m/s. "
        f"{told[0].upper()}{told[1:]}.** Marks: directions within {MARK_DIRECTION:g} degrees, named in "
        f"{MARK_NAMED:g} %, 95 % of components (of all {s['runs']} runs) within 1.96 sd. The speed found is "
        f"{s['ratio']:.2g} times the mean of the measured wind and {s['ratio_pushing']:.2g} times the steady "
        "wind that pushes as the measured one does with its gusts (medians; a force goes with the square of "
        f"the speed): components are set against that one.{lost}"
    )
    if record["inputs"]["quick"]:
        lead += " Four runs of a kind, published ship only (`--quick`)."
    lead += "\n\n" + literal(record["attribution"])
    how = (
        "The wind column of a run is looked at when all winds are there. Wind and what the prior of the ship "
        "leaves open are fitted to every run by itself. Of the published ship, with 20 % a coefficient, no "
        "anemometer is read at all; the fitted ship was fitted to the other half of the runs in their "
        "measured wind. The water may move with a share of the wind. Zig-zags and turns begin where the ship "
        "has way on.\n\n"
        f"Told each by itself, {by_itself}. Runs of the same hours therefore tell their winds together. "
        f"How fast the wind changes ({hours['sd']:.2g} m/s over {hours['time'] / 3600:.2g} h) and what a run "
        f"errs beyond its stated sd ({hours['scatter']:.2g} m/s) is read off how the runs differ, by no "
        "anemometer. A wind is named where two components at zero have a probability below 1 %."
    )
    head = ["ship", "winds told", "direction rms [deg]", "median [deg]", "within 1.96 sd [%]", "named [%]",
            "named, sds scaled [%]", "components within 1.96 sd [%]",
            "rms error over sd", "components rms [m/s]"]  # fmt: skip
    keys = ("direction", "direction_median", "direction_covered", "named", "named_scaled", "covered", "rms_z",
            "speed")  # fmt: skip
    lines = [
        [words, how, *(one[words][k] for k in keys)]
        for words in alone
        for how, one in (("run by run", alone), ("by the runs of those hours", together))
    ]
    table = Table(
        head, lines,
        f"Directions and names: the {s['windy']} runs with a mean wind above {LEAST:g} m/s. Sds scaled: by "
        "the rms of error over sd, where that is above 1.", 3,
    )  # fmt: skip
    return Report(
        "Wind from the motion of a ship",
        lead,
        [
            Section("Scores", [table]),
            Section("How the winds are told", [Text(how)]),
            Section("Run by run", [_runs(rows, record["passes"][last])]),
        ],
    )


def _marks(s: Mapping[str, float]) -> str:
    """What one ship tells, against the marks."""
    direction, named = _word(s["direction"] <= MARK_DIRECTION), _word(s["named"] >= MARK_NAMED)
    covered = _word(MARK_COVERED[0] <= s["covered"] <= MARK_COVERED[1])
    return (
        f"direction {s['direction']:.2g} degrees rms ({direction}; median {s['direction_median']:.2g}), "
        f"named in {s['named']:.0f} % ({named}), {s['covered']:.0f} % of components within 1.96 sd "
        f"({covered}; rms of error over sd {s['rms_z']:.2g}), components {s['speed']:.2g} m/s rms off"
    )


def _word(met: bool) -> str:
    return "met" if met else "missed"


def _runs(rows: Sequence[Mapping[str, Any]], alone: Sequence[Mapping[str, Any]]) -> Table:
    head = ["run", "time [s]", "measured [m/s]", "with gusts [m/s]", "found [m/s]",
            "from, measured [deg]", "from, found [deg]", "sd [deg]", "off [deg]", "chi-square",
            "off, by itself [deg]"]  # fmt: skip
    lines: list[list[Any]] = []
    for r, single in zip(rows, alone, strict=True):
        front = [r["run"], r["seconds"], *(float(np.hypot(*r[of])) for of in ("measured", "pushing"))]
        if "mean" not in r:
            lines.append([*front, r["failed"], *[None] * 6])
            continue
        lines.append(
            [
                *front, float(np.hypot(*r["mean"])), _from(r["measured"]), _from(r["mean"]),
                float(np.degrees(r["direction_sd"])), float(np.degrees(r["direction_error"])), r["evidence"],
                float(np.degrees(single["direction_error"])),
            ]
        )  # fmt: skip
    return Table(head, lines, "Directions count from x0 towards y0 of the pond.", 3)


def _from(air: Sequence[float]) -> float:
    return float(np.degrees(np.arctan2(-air[1], -air[0])) % 360.0)
