"""Sections on what is known: ridges and widths, how ridges collapse, coefficient tables, structural
directions.

Takes sampled cases and plain facts. Does not sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report import identify_figures as shares
from bayesid.report import posterior_figures as figures
from bayesid.report.identify import (
    COEFFICIENT_COLUMNS,
    DERIVED_COLUMNS,
    DIRECTION_COLUMNS,
    coefficient_rows,
    derived_rows,
    direction_rows,
    percent,
    sentence,
)
from bayesid.report.writer import Block, Figure, Section, Table, Text
from studies.posterior.sampled_case import Sampled, in_prior_units

CORNERS = {  # one posterior laid over another
    ("spiral22", "joint22"): (
        ("X_vv", "X_vr", "X_rr"),
        ("N_v", "N_r", "N_|v|r", "N_r|r|"),
    ),
}


def ridges_section(cases: Mapping[str, Sampled]) -> Section:
    text = (
        "Values over those of the vehicle file, where the prior has its centre; contours of 50 and 90 %, "
        "black lines at the truth, drawn from that prior. On the spiral v², v r and r² are one regressor, "
        "and so are v and r: their coefficients stand on ridges that the prior ends. What a zig-zag and a "
        "rich run do to them depends on the noise; numbers follow."
    )
    blocks: list[Block] = [Text(text)]
    for keys, groups in CORNERS.items():
        chosen = [cases[k] for k in keys if k in cases]
        for number, names in enumerate(groups, 1):
            if not chosen:
                continue
            sets = {}
            for c in chosen:
                where = [c.seen.names.index(n) for n in names]
                sets[c.words] = c.draws[:, where] / c.nominal[where]
            first = chosen[0]
            where = [first.seen.names.index(n) for n in names]
            values = first.nominal if first.truth is None else first.truth
            drawn = figures.corner(names, sets, values[where] / first.nominal[where])
            caption = (
                f"{', '.join(names)}, value over that of the vehicle file. A narrow slanting band is a "
                "ridge: the runs fix the combination across it and leave the one along it to the prior."
            )
            blocks.append(Figure(f"corner_{keys[0]}_{number}", drawn, caption))
    return Section("Ridges", blocks)


def widths_section(cases: Mapping[str, Sampled]) -> Section:
    found, rows = {}, []
    for case in cases.values():
        drawn, laplace = (
            np.sqrt(np.maximum(np.linalg.eigvalsh(c)[::-1], 0.0))
            for c in (np.cov(in_prior_units(case), rowvar=False), case.seen.information.covariance)
        )
        found[case.words] = (drawn, laplace)
        rows.append([case.words, drawn.size, int(np.sum(drawn > np.sqrt(0.5))), float(drawn[-1])])
    spectra = {c.words: c.seen.singular_values for c in cases.values()}
    text = (
        "Eigenvalues of the posterior covariance in units of the prior, dots from draws, lines from the "
        "Laplace approximation; and the singular values of the whitened sensitivities, zero to rounding for "
        "the structural directions. Draws and sensitivities say the same."
    )
    columns = ["case", "unknowns", "wider than 0.71 of the prior", "narrowest (posterior sd / prior sd)"]
    return Section(
        "Eigen-spectrum",
        [
            Text(text),
            Figure("widths", figures.widths(found), "Posterior over prior, along eigenvectors."),
            Figure("spectrum", shares.spectra(spectra), "Singular values per prior sd."),
            Table(columns, rows, digits=3),
        ],
    )


def collapse_section(found: Mapping[str, Any]) -> Section:
    ends = "; ".join(f"{key}: from {one['open'][0]} to {one['open'][1]}" for key, one in found.items())
    text = (
        "The directions a spiral leaves open, at the true vehicle (Laplace): the relative standard deviation "
        "the data alone leave along each, from the spiral and from spiral, zig-zag and rich run together, "
        "and the posterior standard deviation over the prior's. A ridge counts as open while the data know "
        f"less along it than the prior of 10 %. Open directions, one run and three: {ends}. What is "
        "structural for any run, the scales of the sway and of the yaw equation, stays."
    )
    overview = [[key, *one["open"], *one["structural"]] for key, one in found.items()]
    columns = [
        "unknowns, noise of positions",
        "open: spiral",
        "three runs",
        "structural: spiral",
        "three runs",
    ]
    blocks: list[Block] = [Text(text), Table(columns, overview)]
    for key, one in found.items():
        if "0.3 m" in key:
            continue
        rows = []
        for r in one["rows"]:
            sd = [f"{v:.2f}" for v in r["sd_over_prior"]]
            rows.append([r["words"].split(":")[0] or r["name"], *(percent(v) for v in r["data_sd"]), *sd])
        head = ["open on the spiral", "data: spiral", "three runs", "sd / prior: spiral", "three runs"]
        blocks.append(Table(head, rows, f"{key}."))
    return Section("How the ridges collapse", blocks)


def known_section(case: Sampled) -> Section:
    found = case.seen
    share, contraction = (np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction"))
    drawn = shares.index(found.names, share, contraction, [e.verdict for e in found.entries])
    least = (
        f" Least |cos| of an open direction with what a lens calls open: {found.agreement:.4f}."
        if found.directions
        else ""
    )
    blocks: list[Block] = [
        Text(sentence(found) + least + f" Covariance from {found.source}."),
        Figure(f"index_{case.key}", drawn, "Share of the data per coefficient."),
        Table(
            COEFFICIENT_COLUMNS,
            coefficient_rows(found, case.problem.model.vehicle),
            "Coefficients.",
            digits=3,
        ),
    ]
    if found.directions:
        blocks.append(Table(DIRECTION_COLUMNS, direction_rows(found.directions), "Open directions."))
    blocks.append(Table(DERIVED_COLUMNS, derived_rows(*case.behaviour), "What the vehicle does."))
    return Section(f"Known and unknown: {case.words}", blocks)


def accelerations_section(found: Mapping[str, Mapping[str, float]]) -> Section:
    columns = ["structural direction", *(f"accelerations known to {k}" for k in found)]
    first = next(iter(found.values()))
    rows = [[name, *(percent(found[k][name]) for k in found)] for name in first]
    text = (
        "An equation can be scaled only if its added mass follows. What a strip calculation or a planar "
        "motion mechanism says of the acceleration derivatives therefore closes these directions: the "
        "relative standard deviation along each on the spiral, data and prior together."
    )
    return Section(
        "Priors on acceleration derivatives close structural directions", [Text(text), Table(columns, rows)]
    )
