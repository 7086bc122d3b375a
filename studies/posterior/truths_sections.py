"""Sections on truths drawn from the prior: the ridge under priors of 10, 50, 100 %, who holds the truth.

Takes the records and their counts. Does not sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.model.terms import term
from bayesid.report.figure_style import COLOURS, styled, subplots
from bayesid.report.writer import Block, Figure, Section, Table, Text
from studies.posterior.problem import SETS
from studies.posterior.truths_counts import KINDS, counted, found_valley, pooled

Case = Mapping[str, Any]
PAIRS = {"X": (0, 1), "N": (1, 2)}  # of the three of each axis
SHOWN = ("X_vv", "X_vr", "X_rr", "N_v|v|", "N_|v|r", "N_r|r|", "N_v", "N_r", "N_dr")
NORMAL_90 = 2.1460  # radius of the circle that holds 90 % of two normal numbers


def told(s: Mapping[str, float]) -> str:
    if not s["of"]:
        return "none"
    low, high = (f"{100 * s[k]:.0f}" for k in ("low", "high"))
    return f"{s['hits']} of {s['of']} ({100 * s['hits'] / s['of']:.0f} %; {low} to {high})"


def truths_section(cases: Sequence[Case]) -> Section:
    records = counted(cases)
    blocks: list[Block] = []
    pictured = [c for c in found_valley(cases) if "picture" in c and "emcee" in c["said"]]
    if pictured:
        caption = (
            "Two pairs of coefficients, change from the vehicle file in percent; every column another width "
            "of the prior (dashed: 90 % of it), each with a truth of its own (cross). Dots are draws of "
            "emcee. Across the line of dots the runs know the coefficients to the same few percent whatever "
            "the prior is; along it the dots reach as far as the prior does: that is the ridge. Where a row "
            "for three runs shows a cloud shorter than the dashed one, the zig-zag and the rich run have "
            "closed it."
        )
        blocks.append(Figure("ridge_priors", ridge_priors(pictured), caption))
    head = ["runs", "prior [%]", "truths", "fixed", "open", *(f"{n} [%]" for n in SHOWN)]
    rows = [
        [r["set"], f"{100 * r['prior']:g}", r["truths"], r["fixed"], r["open"],
         *(100 * r["left"][n] for n in SHOWN)]
        for r in records
    ]  # fmt: skip
    text = (
        "Nobody centres the prior on the truth here: the prior stands about the vehicle file, and every "
        "truth is drawn from it. All 22 coefficients are unknown; the width of the prior is that of the ten "
        "rows of second order in v and r, which a data sheet knows least, the others have 10 %. "
        "Medians over truths "
        "by the Laplace approximation: how many of the 22 combinations are fixed (to 10 % of the prior sd) "
        "and left open (71 % and more), and what is left of the prior sd of single coefficients."
    )
    blocks += [Text(text), Table(head, rows, digits=3)]
    return Section("The ridge under wider priors", blocks)


def held_section(cases: Sequence[Case]) -> Section:
    records = counted(cases)
    rows = [
        [r["set"], f"{100 * r['prior']:g}", way, w["cases"], *(told(w[k]) for k in KINDS),
         w["narrowest_over_laplace"], w["rhat"]]
        for r in records for way, w in r["ways"].items()
    ]  # fmt: skip
    head = ["runs", "prior [%]", "by", "truths", *KINDS, "narrowest / Laplace", "largest R-hat"]
    controls = []
    for name in SETS:
        some = [c for c in cases if c["set"] == name]
        for way in ("Laplace", "fit", "emcee"):
            found = pooled(some, way)
            if found["cases"]:
                controls.append([name, way, *(told(found["control"][k]) for k in KINDS)])
    refused = sum(len(c.get("refused", ())) for c in cases)
    anew = sum(r["drawn_anew"] for r in records)
    file, high = (sum(r[k] for r in records) for k in ("from_file_too_high", "too_high"))
    text = (
        "Truths within the central 90 % of the draws along each eigenvector of the posterior, by how much of "
        "the prior it leaves. Laplace is linear theory about the estimate, `fit` the covariance that "
        "`bayesid fit` tells, which counts that ridges bend. Intervals are 95 %, whole cases resampled where "
        "that is wider. "
        f"{anew} vehicles were drawn anew because they diverged in their runs (prior and likelihood are cut "
        f"there alike). The search from the vehicle file ended in another valley in {file} of {len(cases)} "
        f"cases, the best of three starts in {high} (by thousands of nats and more, which no one could "
        f"overlook); {refused} chains found no start about that mode. All count here. emcee was given "
        "at most "
        "1000 steps: its R-hat is told, its draws count all the same. The last column but one is the "
        "width along the best known "
        "combination over Laplace's, median."
    )
    control = (
        "Control: another vehicle of the same prior read beside each posterior. Along what is fixed hardly "
        "any interval may hold it; along what is open the prior does."
    )
    return Section(
        "Truths drawn from the prior",
        [Text(text), Table(head, rows, digits=3), Text(control),
         Table(["runs", "by", *KINDS], controls)],
    )  # fmt: skip


def foretold_section(cases: Sequence[Case]) -> Section:
    rows = [
        [r["set"], f"{100 * r['prior']:g}", way, w["cases"], w["radius"], told(w["predicted"]),
         told(w["single"])]
        for r in counted(cases) for way, w in r["ways"].items()
    ]  # fmt: skip
    text = (
        "A zig-zag that was not executed (20/20 after the spiral, 10/10 after the three runs), predicted "
        "from a known start with the orders of the true vehicle. `radius`: median over truths of the 90 % "
        "radius of the position, largest over the run; `holds`: x, y and heading at the end within the "
        "90 % band. "
        "The last column asks the same of the coefficients one by one, whose intervals are wide where they "
        "stand on a ridge."
    )
    head = ["runs", "prior [%]", "by", "truths", "radius [m]", "holds", "coefficients held singly"]
    return Section("A run not executed, predicted for every truth", [Text(text), Table(head, rows, digits=3)])


@styled
def ridge_priors(cases: Sequence[Case]) -> Any:
    """Draws of two pairs, one row per set of runs and pair, one column per prior; relative change [%]."""
    priors = sorted({c["prior"] for c in cases})
    keys = [(axis, name) for axis in PAIRS for name in SETS if any(c["set"] == name for c in cases)]
    figure, grid = subplots(len(keys), len(priors), height=1.75 * len(keys) + 0.4, squeeze=False)
    around = np.linspace(0, 2 * np.pi, 200)
    names = {"X": ("X_vv", "X_vr", "X_rr"), "N": ("N_v|v|", "N_|v|r", "N_r|r|")}
    for row, (axis, name) in enumerate(keys):
        i, j = PAIRS[axis]
        for column, prior in enumerate(priors):
            panel = grid[row, column]
            case = next((c for c in cases if (c["set"], c["prior"]) == (name, prior)), None)
            if case is None:
                panel.remove()
                continue
            drawn = 100 * prior * np.array(case["picture"][axis]["draws"])
            true = 100 * prior * np.array(case["picture"][axis]["truth"])
            reach = 100 * prior * NORMAL_90
            panel.plot(reach * np.cos(around), reach * np.sin(around), "--", color=COLOURS["grey"],
                       linewidth=0.9, label="90 % of the prior")  # fmt: skip
            panel.plot(drawn[:, i], drawn[:, j], ".", color=COLOURS["blue"], markersize=1.3, alpha=0.4,
                       label="draws", rasterized=True)  # fmt: skip
            panel.plot(true[i], true[j], "k+", markersize=9, markeredgewidth=1.4, label="truth")
            panel.set_xlim(-1.35 * reach, 1.35 * reach)
            panel.set_ylim(-1.35 * reach, 1.35 * reach)
            panel.set_xlabel(f"{term(names[axis][i]).label} [%]", labelpad=1)
            if column == 0:
                panel.set_ylabel(f"{name}\n{term(names[axis][j]).label} [%]", labelpad=1)
            if row == 0:
                panel.set_title(f"prior {100 * prior:g} %")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure
