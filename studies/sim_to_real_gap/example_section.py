"""The built-in example told from first overlay to closed gap.

Takes what `studies/sim_to_real_gap/example.py` found, as plain data. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report.diagnosis.holdout import record_label
from bayesid.report.diagnosis.words import in_words
from bayesid.report.writer import Block, Figure, Section, Table, Text
from studies.sim_to_real_gap.figures import overlay

DEG = 180.0 / math.pi
TAUGHT = 0.9  # share of the prior sd above which the runs are said to have taught nothing


def example_section(story: Mapping[str, Any]) -> Section:
    """One gap from beginning to end."""
    found, runs = story["found"], story["runs"]
    return Section(
        "One gap from beginning to end",
        [
            Text(
                "The package carries a small trial bundle, `example`: eight runs of a small vehicle in a "
                "calm sea, logged by a plant that shares no code with the model. `bayesid diagnose example` "
                "does what is told here. Two of the runs are held out; the verdict stands before any of it "
                "is "
                "read."
            ),
            _first(runs),
            _where(found),
            _which(found),
            _closed(found, runs),
            _answer(story),
            _taught(story),
        ],
    )


def _first(runs: list[Mapping[str, Any]]) -> Section:
    blocks: list[Block] = [
        Figure("example_gap", overlay(runs, ("nominal",)), "Held-out runs and the simulator as it was.")
    ]
    return Section("First overlay", [Text(_apart(runs, "nominal", "With the simulator as it was")), *blocks])


def _apart(runs: list[Mapping[str, Any]], model: str, words: str) -> str:
    """How far log and a simulation get apart that begin together."""
    parts = []
    for run in runs:
        late = np.asarray(run["t"]) - run["t"][0] > run["lead"]
        miss = np.hypot(*(run["log"][c] - run[model][c] for c in ("x", "y")))[late]
        turn = (run["log"]["psi"] - run[model]["psi"])[late]
        worst = DEG * np.nanmax(np.abs(turn))
        parts.append(f"{run['manoeuvre']}: at most {np.nanmax(miss):.1f} m and {worst:.1f} degrees")
    return f"{words}, log and simulation, begun together, get apart: {'; '.join(parts)}."


def _where(found: Mapping[str, Any]) -> Section:
    where = found["where"]
    places = sorted(where["evidence"].items(), key=lambda p: -p[1])[:4]
    masks = [*where["windows"], *where["regimes"]]
    best = sorted(masks, key=lambda m: -m["evidence"])[:4]
    return Section(
        "Where",
        [
            Text("A free signal is let into one channel at a time, then only into parts of the runs."),
            Table(["channel", "gain in log evidence"], [list(p) for p in places], "Channels."),
            Table(
                ["the same, only in", "gain"],
                [[m["name"], m["evidence"]] for m in best],
                f"Parts of the runs for the best channel ({places[0][0]}).",
            ),
        ],
    )


def _which(found: Mapping[str, Any]) -> Section:
    top = sorted(found["probabilities"].items(), key=lambda p: -p[1])[:4]
    rows = [[in_words(name), p if p > 1e-6 else "below 1e-6"] for name, p in top]
    return Section(
        "Which",
        [
            Text("\n".join(f"- {unsigned_zeros(reason)}" for reason in found["reasons"])),
            Table(["hypothesis", "probability"], rows, f"The verdict is: {found['verdict']}."),
        ],
    )


def _closed(found: Mapping[str, Any], runs: list[Mapping[str, Any]]) -> Section:
    rows = []
    for h in found["gap"]["horizons"]:
        shrinks = (
            f"{h['shrink']:.1%}" if h["worth_shrinking"] and h["shrink"] is not None else "nothing to shrink"
        )
        rows.append(
            [
                f"{h['seconds']:.0f} s" if h["seconds"] else h["horizon"],
                *(_position_and_heading(h["rms"][k]) for k in ("nominal", "recalibrated", "with effect")),
                shrinks,
            ]
        )
    return Section(
        "Closed",
        [
            Text(
                _apart(runs, "recalibrated", "With coefficients re-tuned and no effect")
                + " "
                + _apart(runs, "diagnosed", "With the diagnosed model")
            ),
            Figure(
                "example_closed",
                overlay(runs, ("recalibrated", "diagnosed")),
                "The same held-out runs, predicted from their first seconds and their orders.",
            ),
            Table(
                ["predicted over", "as given", "re-tuned", record_label(found), "gap shrinks by"],
                rows,
                "Rms error of position and heading, noise of the readings included; the gap is the mean "
                "squared error beyond that noise, of all channels.",
            ),
        ],
    )


def _position_and_heading(rms: Mapping[str, float | None]) -> str:
    x, y, psi = (rms[c] for c in ("x", "y", "psi"))
    if x is None or y is None or psi is None:
        return "diverges"
    return f"{number(math.hypot(x, y))} m, {number(DEG * psi)} degrees"


def _answer(story: Mapping[str, Any]) -> Section:
    planted = story["truth"]["effects"]
    named = {e["name"]: e["parameters"] for e in story["found"]["effects"]}
    rows = []
    for effect in planted:
        for name, value in effect["parameters"].items():
            p = named.get(effect["name"], {}).get(name)
            estimate = f"{p['value']:.4g} ± {p['sd']:.2g}" if p else "not named"
            rows.append([effect["name"].replace("_", " "), name.replace("_", " "), value, estimate])
    return Section(
        "What had been planted",
        [Table(["effect", "parameter", "planted", "found"], rows, "Drawn by the plant, read last.")],
    )


def _regression(story: Mapping[str, Any]) -> str:
    """What a regression that knows no effect makes of the same runs, and what the diagnosis leaves of it."""
    selection, found = story["excitation"], story["found"]
    taught = {name: sd / prior for name, _, prior, _, sd, _ in story["coefficients"]}
    needed = [n for n in selection["needed"] if n in taught]
    learnt = [n for n in needed if taught[n] < TAUGHT]
    idle = [n for n in needed if taught[n] >= TAUGHT]
    words = [
        "A sparse regression (bayesid's own stepwise selection) on the same logs knows neither a coefficient "
        "nor an effect. It says which columns move the forces, not how large a coefficient is."
    ]
    if learnt:
        words.append(f"Of the vehicle's own rows it needs {', '.join(learnt)}, and the table agrees.")
    if idle:
        words.append(
            f"It also needs {', '.join(idle)}, of which the fit has learnt next to nothing (at least "
            f"{TAUGHT:g} of the prior sd is left). That is no finding about these coefficients: a regression "
            "that knows neither the effect nor the prior puts there what it lacks elsewhere."
        )
    many = len(selection["beyond"]) + len(selection["beyond_groups"])
    after = found["where"]["after"]
    if many and after:
        left, limit = max(after.values()), found["limit"]
        words.append(
            f"Beyond the vehicle's rows it takes up {many} more (or sets of which one would do). The "
            f"diagnosis puts them to the test: with its best explanation in the model, a free force or "
            f"signal anywhere gains {unsigned_zeros(f'{left:+.1f}')} nats, where chance reaches {limit:.1f}. "
            + (
                "So none of them is needed; they stand in for the effect, and their values are not printed."
                if left <= limit
                else "So something is left, of which these are candidates, not findings."
            )
        )
    if selection["groups"]:
        sets = "; ".join("{" + ", ".join(g) + "}" for g in selection["groups"])
        words.append(f"Columns it cannot tell apart on these runs: {sets}.")
    return " ".join(words)


def _taught(story: Mapping[str, Any]) -> Section:
    """Posterior of the coefficients beside prior and truth, and which rows the runs excite."""
    rows, inside = [], 0
    for name, nominal, prior, value, sd, true in sorted(story["coefficients"], key=lambda r: r[4] / r[2]):
        inside += abs(true - value) <= 2 * sd
        rows.append([name, nominal, value, sd, f"{sd / prior:.2f}", true])
    return Section(
        "What the runs teach of the coefficients",
        [
            Text(
                "The effect is estimated jointly with all coefficients, so their posterior knows what the "
                "effect "
                f"could hide. Of {len(rows)} true coefficients {inside} lie within two standard deviations."
            ),
            Table(
                ["coefficient", "nominal", "estimate", "sd", "sd over prior sd", "true"],
                rows,
                "Best determined first; 1 in the fifth column means that the runs taught nothing beyond what "
                "was known before.",
            ),
            Text(_regression(story)),
        ],
    )
