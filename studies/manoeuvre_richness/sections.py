"""Sections of the richness report: per vehicle, contraction, two causes, the vertical plane, real logs.

Takes the study's records (plain data). Does not compute beyond summaries.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report import manoeuvre_figures as figures
from bayesid.report.writer import Block, Figure, Table, Text, literal
from studies.manoeuvre_richness.summaries import (
    FACTOR,
    WELL,
    crossing_of,
    maps_of,
    margins_of,
    paired_tests,
    table_of,
    vector_of,
    well_determined,
)

Array = np.ndarray
MAP_CAPTION = (
    "Manoeuvres down, richest first, coefficients across. Contraction is the share of the prior sd that "
    "is gone: "
    "dark columns no manoeuvre tells. The two upper panels should look alike; the lowest asks another "
    "question "
    "(is the row needed?) and need not."
)
CROSS_CAPTION = (
    "Identify on the row, predict the column; the scale is logarithmic, dark is a large error. A dark "
    "row teaches "
    "little of the others, a dark column is hard to foretell."
)
LOGS_CAPTION = (
    "One point per run: the more it tells (right), the lower it should stand (error over the other runs; "
    "1 is that "
    "of the fit of all)."
)


def vehicle_blocks(name: str, v: Mapping[str, Any]) -> list[Block]:
    manoeuvres, names, expected, found, included = maps_of(v)
    panels = {"expected from Fisher information": expected}
    if found is not None:
        panels["found by refits"] = found
    if included is not None:
        panels["inclusion frequency of sparse regression"] = included
    rows = [
        [m["name"], m["gain_nats"], m["variance_left"], m["identified_directions"], m["condition_with_prior"]]
        for m in v["comparison"]["manoeuvres"]
    ]
    crossed, _, predicted, actual = crossing_of(v)
    tables = {"from information": predicted}
    if np.isfinite(actual).any():
        tables["by refits"] = actual
    blocks: list[Block] = [
        Table(["manoeuvre", "gain [nats]", "variance left", "directions", "condition"], rows,
              f"All of {v['comparison']['duration_s']:.0f} s, richest first; {len(names)} coefficients.", 3),
        Figure(f"map_{name}", _map(panels, manoeuvres, names), MAP_CAPTION),
        Table(["measures", "rank correlation"], list(v["comparison"]["rank_correlations"].items()),
              "Spearman.", 2),
        Figure(f"cross_{name}", _table(tables, crossed), CROSS_CAPTION),
    ]  # fmt: skip
    for goal, plan in v["plans"].items():
        orders = {k: np.array(x) for k, x in v["orders"][goal].items()}
        after = next(c["after"] for c in plan["candidates"] if c["kind"] == "designed")
        blocks.append(
            Figure(
                f"orders_{name}_{goal}",
                _drawn(orders),
                f"Designed after a 10/10 zig-zag to {plan['goal']}: {plan['unit']} "
                f"{plan['before']:.3g} before, "
                f"{after:.3g} after it.",
            )
        )
        blocks.append(
            Table(
                ["rival", "posterior, times ours", "won", "p", "error made, times ours", "won ", "p "],
                paired_tests(v, goal),
                f"{plan['goal']}: {len(v['test']['left'][0])} true vehicles run the zig-zag and "
                "one run more; ratio of "
                "medians, share of pairs the design wins, one-sided Wilcoxon p. Left: what the "
                "posterior expects; "
                "right: errors really made, which scatter.",
                3,
            )
        )
    blocks.append(Text(f"{v['test']['converged']:.1%} of the refits of the paired test converged."))
    return blocks


def contraction_blocks(vehicles: Mapping[str, Any]) -> list[Block]:
    points = {f"{n}, refits": well_determined(v) for n, v in vehicles.items()}
    rows = []
    for n, v in vehicles.items():
        for label, c in (v.get("sampled") or {}).items():
            e, r, s = (vector_of(c[k]) for k in ("expected", "refitted", "sampled"))
            good = e > WELL
            points[f"{n}, emcee: {label}"] = (1 - e[good], 1 - s[good])
            both = (1 - s) / (1 - r)
            rows.append([n, label, c["converged"], c["evaluations"], float(both.min()), float(both.max())])
    points = {k: p for k, p in points.items() if p[0].size}
    blocks: list[Block] = []
    if points:
        blocks.append(
            Figure(
                "contraction",
                figures.against(points, "expected sd / prior sd", "actual sd / prior sd", FACTOR),
                f"Coefficients expected to lose more than half of their spread; dotted: a factor {FACTOR}.",
            )
        )  # fmt: skip
    if rows:
        blocks.append(
            Table(
                ["vehicle", "runs", "converged", "evaluations", "least sd over Laplace", "most"], rows,
                "Sampled by emcee beside the Laplace refit of the same readings; all coefficients.", 3,
            )
        )  # fmt: skip
    return blocks


def _map(panels: Mapping[str, Array], rows: list[str], columns: list[str]) -> bytes:
    return figures.compact(figures.contraction_map(panels, rows, columns))


def _table(
    panels: Mapping[str, Array], names: list[str], label: str = "rms error over sensor noise"
) -> bytes:
    return figures.compact(figures.cross_map(panels, names, label))


def _drawn(orders: Mapping[str, Array]) -> bytes:
    commands = {k: x for k, x in orders.items() if k.endswith("_cmd")}
    return figures.compact(figures.orders(orders["t"], commands, {k: orders[k] for k in "xy"}))


def tell_blocks(discrimination: Mapping[str, Any]) -> list[Block]:
    plan = discrimination["plan"]
    orders = {k: np.array(x) for k, x in discrimination["orders"].items()}
    rows = [
        [k, v.size, float(np.mean(v)), float(np.min(v)), f"{np.mean(v > 0):.0%}"]
        for k, v in margins_of(discrimination).items()
    ]
    return [
        Text(
            f"After a straight run and a 10/10 zig-zag: {plan['goal']}, each "
            f"{discrimination['size']:g} of its "
            "prior "
            "sd. Below, either is planted in vehicles drawn from what is known, the campaign is executed "
            "with "
            "noise, and the bank of the gap diagnosis weighs both."
        ),
        Figure(
            "orders_tell", _drawn(orders), "The design."
        ),
        Table(
            ["flown besides", "trials", "mean margin [nats]", "least", "true one ahead"], rows,
            "Log evidence of the planted cause over the other.", 3,
        ),
    ]  # fmt: skip


def vertical_blocks(deep: Mapping[str, Any]) -> list[Block]:
    return [
        Text(
            f"generic_sub in six degrees of freedom; {len(deep['names'])} coefficients that act "
            "only out of the "
            "horizontal plane. Held upright (no rolling moments, centre of gravity on the axis) "
            "horizontal manoeuvres "
            "tell nothing of them, exactly. As built, the vehicle rolls in a turn and roll tips "
            "yaw into pitch, so a "
            "turn tells a little of the vertical plane."
        ),
        Table(
            ["manoeuvre", "largest contraction, upright", "as built", "of"], deep["rows"],
            "The last rows move out of the plane by their own planes.", 3,
        ),
    ]  # fmt: skip


def logs_blocks(key: str, v: Mapping[str, Any]) -> list[Block]:
    table = v["table"]
    names = [literal(n) for n in table["names"]]
    gains, others = vector_of(table["gains"]), vector_of(v["others"])
    predicted = vector_of(v["predicted_others"])
    order = np.argsort(-gains)
    rows = [[names[i], gains[i], float(others[i]), float(predicted[i])] for i in order]
    kinds = sorted({n.split(" ")[0] for n in table["names"]})
    excess = table_of(v["excess"])
    where = {k: [i for i, n in enumerate(table["names"]) if n.startswith(k)] for k in kinds}
    grouped = []
    for a in kinds:
        cells = []
        for b in kinds:
            logs = [np.log(excess[i, j]) for i in where[a] for j in where[b] if i != j]
            cells.append(float(np.exp(np.mean(logs))) if logs else float("nan"))
        grouped.append([a, *cells])
    blocks: list[Block] = [
        Text(
            f"{literal(v['attribution'])}\n\nEach run is fitted alone (in pieces) and predicts "
            "every other from its "
            "first readings. Weights are what a fit of all runs misses, so the model, not the "
            "sensor, sets the scale; "
            "errors are over those of that joint fit, 1 being as good."
            + ("" if v["converged"] else " The joint fit did not converge; weights are its last ones.")
        ),
        Table(["identified on", "gain [nats]", "error over the others", "expected"], rows,
              "Richest first.", 3),
        *_promised(v),
        Figure(
            f"logs_{key}", figures.against({key: (gains, others)}, "information gain [nats]",
            "error over the joint fit's", 1.0, False), LOGS_CAPTION,
        ),
        Figure(f"cross_{key}", _table({"each run alone": excess}, names, "error over the joint fit's"),
               CROSS_CAPTION),
    ]  # fmt: skip
    if len(kinds) > 1:
        blocks.append(
            Table(["identified on", *kinds], grouped, "Geometric means by kind of run, columns predicted.", 3)
        )
    return blocks


def _promised(v: Mapping[str, Any]) -> list[Block]:
    """Rank correlations as measured, as right posteriors would give them, and the ceiling of the errors."""
    rows = []
    for words, told in v["likelihoods"].items():
        for by, rank in told["ranks"].items():
            theory, interval = told["theory"][by], rank["interval"]
            rows.append([
                words, by, rank["made"], f"{interval[0]:.2f} to {interval[1]:.2f}", theory[1],
                f"{theory[0]:.2f} to {theory[2]:.2f}",
            ])  # fmt: skip
    times = ", ".join(f"{w} {t['expected_over_made']:.1f}" for w, t in v["likelihoods"].items())
    half = v["halves"]["halves"]
    text = (
        "Why the rank correlation is what it is. The errors of a run are well measured: ranked by one half "
        f"of the other runs and by the other half they agree to {half[1]:.2f} ({half[0]:.2f} to "
        f"{half[2]:.2f}), so that a perfect predictor of them would reach {v['halves']['ceiling']:.2f}. But "
        "every run is fitted once, and how far one fit falls from the joint one is a draw, which no measure "
        "of information foresees. `promised` draws it: coefficients of each run from its posterior about "
        "the joint fit, 2000 times, their errors over the other runs, and the rank correlation that then "
        "comes out. These runs differ less in what they tell than one fit scatters: little is "
        "promised, and what is measured is not less than that. `composite` is the likelihood of `bayesid "
        f"fit` ({literal(v['noise'])}): readings tell {100 * v['share']:.2g} % of what white noise would. "
        f"Expected errors are larger than those made (times, median: {times})."
    )
    return [
        Text(text),
        Table(["noise", "ranked by", "measured", "90 %", "promised", "90 % "], rows,
              "Spearman with the error over the other runs; runs drawn again for the interval.", 2),
    ]  # fmt: skip
