"""Delphin2's published speeds and yaw rates, and which effects explain both.

Takes what `studies/sim_to_real_gap/delphin2.py` found. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report.writer import Figure, Section, Table, Text
from studies.sim_to_real_gap.figures import steady

DEG = 180.0 / math.pi


def delphin2_section(found: Mapping[str, Any]) -> Section:
    """Measured against nominal, hypotheses by evidence, what the best of them says."""
    arrived = [h for h in found["hypotheses"] if h["values"]]
    rows = sorted(arrived, key=lambda h: -h["log_evidence"])
    base = next(h for h in rows if not h["effects"])
    lost = [_words(h) for h in found["hypotheses"] if not h["values"]]
    table = [
        [
            _words(h),
            h["log_evidence"] - base["log_evidence"],
            h["chi2"],
            _parameters(h),
            f"{h['largest_pull'][0]} {h['largest_pull'][1]:+.1f}",
            "" if h["converged"] else "stopped",
        ]
        for h in rows
    ]
    return Section(
        "Delphin2: measured speeds and yaw rates",
        [
            Text(
                "The vehicle file of Delphin2 carries measured steady speeds (seven set points) and yaw "
                "rates "
                "(three set points, three rudder angles). Its simulator, fed with the published map from set "
                "point to revolutions, is too fast at every set point and most at low ones; the yaw rates "
                "are "
                f"off by {_range(found)}."
            ),
            Figure("delphin2", _drawn(found, rows), "Measured steady values and what models say of them."),
            Table(
                ["explanation", "log evidence", "misfit", "parameters", "largest coefficient move [sd]", ""],
                table,
                "Refits with all coefficients free within 10 %. Misfit is the mean squared error in units "
                "of an "
                "assumed accuracy of 0.01 m/s and 0.2 degrees/s: 1 would be a complete explanation.",
            ),
            Text(
                _finding(rows)
                + (f" Refits that left the stable vehicles: {', '.join(lost)}." if lost else "")
            ),
        ],
    )


def _words(h: Mapping[str, Any]) -> str:
    return " + ".join(n.replace("_", " ") for n in h["effects"]) or "none"


def _parameters(h: Mapping[str, Any]) -> str:
    return "; ".join(f"{n.split('.')[1]} {v:.3g} ± {s:.1g}" for n, (v, s) in h["parameters"].items())


def _shares(found: Mapping[str, Any], kind: str) -> np.ndarray:
    straight = [m == "straight" for _, m in found["runs"]]
    pick = [s == (kind == "speed") for s in straight]
    nominal, measured = (np.array(found[k])[pick] for k in ("nominal", "measured"))
    return nominal / measured - 1.0


def _range(found: Mapping[str, Any]) -> str:
    speed, rate = _shares(found, "speed"), _shares(found, "rate")
    return f"{rate.min():+.0%} to {rate.max():+.0%}, the speeds by {speed.min():+.0%} to {speed.max():+.0%}"


def _drawn(found: Mapping[str, Any], rows: list[Mapping[str, Any]]) -> Any:
    shown = {"simulator as it was": found["nominal"]}
    alone = {h["effects"][0]: h for h in rows if len(h["effects"]) == 1}
    if "setpoint_map" in alone:
        shown["set-point map re-tuned"] = alone["setpoint_map"]["values"]
    best = rows[0]
    shown[f"best: {_words(best)}"] = best["values"]
    straight = np.array([m == "straight" for _, m in found["runs"]])
    setpoints = np.array([float(name.split(" at ")[1].split(",")[0]) for name, _ in found["runs"]])
    measured = np.array(found["measured"])
    lines = [{k: np.array(v)[straight] for k, v in shown.items()}]
    x, seen, titles = [setpoints[straight]], [measured[straight]], ["straight"]
    for point in sorted(set(setpoints[~straight])):
        pick = ~straight & (setpoints == point)
        rudder = np.array(
            [float(name.split("rudder ")[1]) for (name, _), p in zip(found["runs"], pick, strict=True) if p]
        )
        x.append(rudder)
        seen.append(DEG * measured[pick])
        lines.append({k: DEG * np.array(v)[pick] for k, v in shown.items()})
        titles.append(f"turning at {point:.0f}")
    turns = len(x) - 1
    return steady(
        titles,
        x,
        seen,
        lines,
        ["set point", *["rudder [deg]"] * turns],
        ["speed [m/s]", *["yaw rate [deg/s]"] * turns],
    )


def _finding(rows: list[Mapping[str, Any]]) -> str:
    best = rows[0]
    single = {h["effects"][0]: h for h in rows if len(h["effects"]) == 1}
    words = [f"Most probable of those tried: **{_words(best)}**, with a misfit of {best['chi2']:.1f}."]
    if {"setpoint_map", "linear_drag"} <= set(single):
        a, b = single["linear_drag"], single["setpoint_map"]
        gain = a["log_evidence"] - b["log_evidence"]
        words.append(
            "Is the map the suspect? A wrong map slows straight runs and turns alike; the measured speeds "
            "are far "
            "too low where the measured yaw rates are not. Alone, a drag in proportion to speed explains "
            "more "
            f"than any linear error of the map ({gain:+.0f} nats, misfit {a['chi2']:.0f} against "
            f"{b['chi2']:.0f})."
        )
    if best["chi2"] > 2.0:
        words.append(
            "None of them explains the numbers to their assumed accuracy, and coefficients have to leave "
            "their "
            "prior: the cause is narrowed down, not named. Speeds in the turns, which were not published, "
            "would "
            "tell map, drag and rudder apart."
        )
    return " ".join(words)
