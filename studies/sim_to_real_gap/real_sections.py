"""Real logs in the study of gaps: KVLCC2 in a tank, Esso Osaka in a pond.

Takes what `studies/sim_to_real_gap/kvlcc2.py` and `studies/sim_to_real_gap/esso_osaka.py` found. Does not
compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bayesid.diagnosis.hypotheses.rules import NAMING
from bayesid.diagnosis.plain_words import in_words
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report.diagnosis.holdout import record_as_given, record_label
from bayesid.report.writer import Block, Section, Table, Text, literal
from bayesid.words import first_few

DEG = 180.0 / math.pi
MOST = 6  # names of a set that are spelt out


def kvlcc2_section(found: Mapping[str, Any]) -> Section:
    """How well sets of rows explain a tanker, what is left, and what a diagnosis says of it."""
    sets = found["sets"]
    seconds = sets[0]["seconds"]
    short = [h for h, value in seconds.items() if value is not None and np.isfinite(value)]
    rows = [
        [
            s["words"],
            *(f"{s['left'][axis]:.1%}" for axis in "XYN"),
            *(DEG * s["rms"][h]["psi"] for h in short),
            DEG * s["rms"]["full replay"]["psi"] if "full replay" in s["rms"] else None,
        ]
        for s in sets
    ]
    nominal = next(s["nominal"] for s in sets if s["key"] == "race")
    blocks: list[Block] = [
        Text(
            "A tanker is no submarine: full, shallow, and unstable on course. How far do rows made for "
            "submarines "
            "carry? Each set was re-tuned to the same identify runs and judged on zig-zags it never read. "
            + literal(found["attribution"])
        ),
        Table(
            [
                "rows",
                "left of X",
                "of Y",
                "of N",
                *(f"heading rms over {seconds[h]:.0f} s [deg]" for h in short),
                "whole run",
            ],
            rows,
            "Left: rms of the random force the identify runs still need, over that of the force that moves "
            "the "
            "ship. Heading: held-out zig-zags, predicted from a lead-in with the measured rudder. As given, "
            "the "
            "cubic rows with the race miss by "
            + ", ".join(f"{DEG * nominal[h]['psi']:.1f} degrees over {seconds[h]:.0f} s" for h in short)
            + ".",
            3,
        ),
    ]
    if stripped := found["diagnoses"].get("plain"):
        blocks.append(Text(_asked_back(stripped)))
    words = {s["key"]: s["words"] for s in sets}
    for key, record in found["diagnoses"].items():
        blocks.append(Section(f"Diagnosis: {words[key]}", told(record)))
    blocks.append(
        Text(
            "Left out of the diagnosis, because a tank and a measured rudder rule them out: "
            + ", ".join(n.replace("_", " ") for n in found["excluded"])
            + "."
        )
    )
    return Section("KVLCC2: a tanker told in a submarine's terms", blocks)


RACE = "rudder_propeller_interaction"


def _asked_back(record: Mapping[str, Any]) -> str:
    """Whether the diagnosis of the stripped rows asks for what was stripped, and what else it names."""
    named = [e["name"] for e in record["effects"]] if record["verdict"] in NAMING else []
    text = "The plain set was stripped of the rows of the rudder in the propeller race: " + (
        "its diagnosis asks for them." if RACE in named else "its diagnosis does not ask for them."
    )
    if others := [in_words(n) for n in named if n != RACE]:
        text += (
            f" Beside them it names {', '.join(others)}; mass and thrust were measured, so a name of theirs "
            "stands in for rows."
        )
    row = next((h for h in record["gap"]["horizons"] if h["horizon"] == "full replay"), None)
    if row and row["rms"]["with effect"]["psi"] >= row["rms"]["nominal"]["psi"]:
        text += " Held-out heading of whole runs does not get better by it."
    return text


class Against(NamedTuple):
    """A diagnosis of a real ship against the untouched simulator: whether it names a cause, by how much what
    it explains misses the heading of held-out runs by more [rad, rms], over the longest horizon there is, and
    whether that simulator itself predicts, so that there is nothing to compare."""

    named: bool
    more: float
    as_given: bool = False


def lost_against_given(found: Mapping[str, Any]) -> list[Against]:
    """Every diagnosis of a real ship against the untouched simulator."""
    records = list(found.get("diagnoses", {}).values())
    records += [q["found"] for q in found.get("questions", {}).values()]
    out = []
    for record in records:
        rows = [h for h in record["gap"]["horizons"] if h["rms"]["nominal"].get("psi") is not None]
        if rows:
            rms = rows[-1]["rms"]
            more = rms["with effect"]["psi"] - rms["nominal"]["psi"]
            out.append(Against(record["verdict"] in NAMING, more, record_as_given(record)))
    return out


def lost_words(lost: Sequence[Against]) -> str:
    """Failure of the explanations that predict worse than the simulator as given; empty where none does."""
    asked = [one for one in lost if not one.as_given]
    if not any(one.more > 0.0 for one in asked):
        return ""
    parts = []
    for named, words in ((True, "that name a cause"), (False, "that name none")):
        mine = [one.more for one in asked if one.named is named]
        worse = [more for more in mine if more > 0.0]
        if mine:
            by = f", by up to {np.degrees(max(worse)):.2g} degrees" if worse else ""
            parts.append(f"{len(worse)} of {len(mine)} {words}{by}")
    left = [one for one in lost if one.as_given]
    names = sum(one.named for one in left)
    beside = (
        f" In {len(left)} more ({names} that {'names' if names == 1 else 'name'} a cause) that simulator "
        "itself predicts, and nothing is compared."
        if left
        else ""
    )
    return (
        f"On real ships {sum(one.more > 0.0 for one in asked)} of {len(asked)} explanations predict the "
        "heading of held-out runs worse than the simulator as given, over the longest horizon: "
        f"{'; '.join(parts)}.{beside} Predict with an explanation of a real ship only where held-out "
        "runs are predicted better by it."
    )


def esso_section(found: Mapping[str, Any]) -> Section:
    """Questions to the pond runs, and what the answers are worth."""
    blocks: list[Block] = [
        Text(
            "A 3 m tanker in an open pond: rudder and propeller are orders, not measurements, the wind is a "
            "force "
            "like the rudder's, and the logged velocities passed a causal filter. "
            + literal(found["attribution"])
        )
    ]
    for key, question in found["questions"].items():
        more: list[Block] = []
        if key == "sensors":
            more = _gyro(found["gyro"])
        if key == "sides":
            more = _sides(found["sides"])
        if key == "late":
            more = _delays(found["delays"])
        if "direct" in question:
            more.append(Text(_direct(question["direct"])))
        title = question["words"][0].upper() + question["words"][1:]
        blocks.append(Section(title, [*told(question["found"]), *more]))
    if "wind" in found:
        blocks.append(_hidden(found["wind"]))
    return Section("Esso Osaka: a tanker in wind", blocks)


def told(record: Mapping[str, Any]) -> list[Block]:
    """A diagnosis in short: verdict, where, the best refits."""
    where = record["where"]
    places = sorted(where["evidence"].items(), key=lambda p: -p[1])[:4]
    regimes = [m for m in where["regimes"] if m["evidence"] > 5.0][:3]
    named = "; ".join(_effect(e) for e in record["effects"] if e["parameters"])
    lines = [
        f"- verdict: **{record['verdict'].replace('_', ' ')}**" + (f", {named}" if named else ""),
        "- 95 % set: " + _set(record["set95"]),
        "- a free signal gains most in " + ", ".join(f"{name} ({value:+.0f})" for name, value in places),
    ]
    if regimes:
        lines.append(
            "- of the regimes most in " + ", ".join(f"{m['name']} ({m['evidence']:+.0f})" for m in regimes)
        )
    lines += [f"- {unsigned_zeros(reason)}" for reason in record["reasons"]]
    lines += [f"- {literal(w)}" for w in record["warnings"][:4]]
    tuned = record.get("retuning") or {}
    if tuned.get("as_given"):
        times = math.exp(-tuned["given_gain"])
        lines.append(
            "- the simulator as given predicts: with the best explanation, errors of runs left out are "
            f"{times:.2g} times as large"
        )
    rows = [
        [
            h["horizon"],
            *(_degrees(h["rms"][k].get("psi")) for k in ("nominal", "recalibrated", "with effect")),
        ]
        for h in record["gap"]["horizons"]
    ]
    blocks: list[Block] = [Text("\n".join(lines))]
    if rows:
        blocks.append(
            Table(
                ["horizon", "as given", "recalibrated", record_label(record)],
                rows,
                "Heading rms on held-out runs [degrees].",
                3,
            )
        )
    return blocks


def _degrees(value: float | None) -> float | None:
    return None if value is None else DEG * value


def _set(names: Sequence[str]) -> str:
    return first_few((n.replace("_", " ") for n in names), MOST)


def _effect(effect: Mapping[str, Any]) -> str:
    values = []
    for name, p in effect["parameters"].items():
        scale, unit = (DEG, "deg") if p["unit"] == "rad" else (1.0, "" if p["unit"] == "-" else p["unit"])
        values.append(
            f"{name.replace('_', ' ')} {p['value'] * scale:.3g} ± {p['sd'] * scale:.1g} {unit}".strip()
        )
    return effect["name"].replace("_", " ") + (f" ({', '.join(values)})" if values else "")


def _direct(d: Mapping[str, Any]) -> str:
    unit = "" if d["unit"] in ("-", "") else f" {d['unit']}"
    words = (
        f"Asked directly, whatever the verdict: {d['effect'].replace('_', ' ')} alone is refitted as "
        f"{d['parameter']} {d['value']:.2g} ± {d['sd']:.1g}{unit} and changes the log evidence by "
        f"{d['gain']:+.1f}"
    )
    return words + ("." if d["converged"] else "; a refit did not arrive, so do not rely on it.")


def _gyro(rows: Sequence[Sequence[Any]]) -> list[Block]:
    slopes = np.array([row[2] for row in rows])
    return [
        Text(
            f"By hand, without any model: in {len(rows)} runs that turn by more than a circle the compass "
            "advances by "
            f"{slopes.min():.3f} to {slopes.max():.3f} (median {np.median(slopes):.3f}) of the integrated "
            "gyro, in "
            "held-out runs as in the others. A gyro that reads low by the difference is a fault of the "
            "sensor, not of "
            "the ship."
        )
    ]


def _delays(rows: Sequence[Sequence[Any]]) -> list[Block]:
    """Delay of u, v behind the track, run by run, in the axes of the ship and in those of the earth."""
    body, earth = np.array([row[1:3] for row in rows]), np.array([row[3:5] for row in rows])
    better = int(np.sum(earth[:, 1] < body[:, 1]))
    late = f"{earth[:, 0].min():.1f} to {earth[:, 0].max():.1f} s old (median {np.median(earth[:, 0]):.1f})"
    apart = f"{1e3 * np.median(earth[:, 1]):.1f} mm/s against {1e3 * np.median(body[:, 1]):.1f}"
    return [
        Text(
            "The makers of the data say that the filter lags by 0.4 to 0.6 s. By hand, from track and "
            f"heading without any model: velocities over ground {late}, turned by the heading of the moment, "
            "fit u and v better than late ones in the axes of the ship "
            f"({body[:, 0].min():.1f} to {body[:, 0].max():.1f} s) in {better} of {len(rows)} runs: the "
            f"filter works in earth axes. Median difference {apart}; in a steady turn a delay in the axes of "
            "the ship does nothing."
        )
    ]


def _sides(rows: Sequence[Sequence[Any]]) -> list[Block]:
    return [
        Table(
            ["run", "rudder [deg, port positive]", "yaw rate [deg/s]"],
            rows,
            "Turning circles, second half, from the compass: the ship turns faster to one side.",
            3,
        )
    ]


def _hidden(found: Mapping[str, Any]) -> Section:
    from studies.withheld_real.report import COLUMNS, wind_row

    area = found["area"]["area"]
    return Section(
        "Wind hidden from the diagnosis",
        [
            Text(
                "The October runs have an anemometer. With its readings they give the coefficients and an "
                "exposed area; "
                "then each run is diagnosed alone with the anemometer hidden."
            ),
            Table(
                COLUMNS, [wind_row(row, area) for row in found["runs"]], "Hidden, asked back, compared.", 3
            ),
        ],
    )
