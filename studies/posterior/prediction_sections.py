"""Sections on what posteriors are good for: bands of runs not executed, and the posteriors of real logs.

Takes sampled cases and predicted runs. Does not sample or simulate.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.report import identify_figures as shares
from bayesid.report import posterior_figures as figures
from bayesid.report.identify import DERIVED_COLUMNS, DIRECTION_COLUMNS, derived_rows, direction_rows, sentence
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal
from studies.posterior.sampled_case import Sampled, Tracks

THIN = 3  # samples of a picture


def predictions_section(cases: Mapping[str, Sampled], runs: Mapping[str, Tracks]) -> Section:
    text = (
        "Bands of the vehicle, without sensor noise, for runs with the true vehicle's orders. `radius` is "
        "the 90 % radius of the position around the median track, largest over the run; `holds` the share of "
        "samples with the truth inside the 90 % band, least of x, y and heading (one truth and one seed: 0 "
        "or 1 are both possible for a sound band, since errors persist along a run)."
    )
    words = list(next(iter(runs.values())).bands)
    rows = []
    for name, run in runs.items():
        for w in words:
            band = run.bands[w]
            rows.append([name, w, band.end_spread, f"{band.coverage(run.truth):.2f}", band.diverged])
    t = {name: run.bands[words[0]].t for name, run in runs.items()}
    radius = {name: {w: run.bands[w].spread for w in words} for name, run in runs.items()}
    blocks: list[Block] = [
        Text(text),
        Table(["run", "draws of", "radius [m]", "holds", "diverged"], rows, digits=3),
        Figure("radius", figures.spread(t, radius), "90 % radius of predicted positions."),
    ]
    for name in ("zig-zag",):
        run = runs[name]
        chosen = [w for w in words if w != "prior"]
        lines = []
        for label, state, factor in (
            ("x [m]", "x", 1.0),
            ("y [m]", "y", 1.0),
            ("heading [deg]", "psi", 180 / np.pi),
        ):
            found = {}
            for w in chosen:
                j = run.bands[w].states.index(state)
                found[w] = factor * run.bands[w].quantiles[[0, -1], ::THIN, j]
            lines.append((label, found, factor * run.truth[::THIN, j]))
        picture = figures.bands(t[name][::THIN], lines)
        blocks.append(Figure(f"band_{_slug(name)}", picture, f"{name}: 90 % bands minus the true run."))
    return Section("What it predicts", blocks)


def logs_section(logs: Mapping[str, Sampled]) -> Section:
    text = (
        "Two sets of real logs, rows and pieces of the study of real logs, wind left out. Residuals there "
        "are errors of the model more than of sensors and persist; each channel counts for as many readings "
        "as its residuals are worth. The priors are those of the vehicle files."
    )
    blocks: list[Block] = [Text(text)]
    for case in logs.values():
        found = case.seen
        rows = [
            [e.name, *(f"{v:.2f}" for v in _standing(case, i)), f"{e.index:.2f}", e.words]
            for i, e in enumerate(found.entries)
        ]
        columns = ["coefficient", "mean / prior mean", "prior sd", "posterior sd", "index", "verdict"]
        share, contraction = (
            np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction")
        )
        drawn = shares.index(found.names, share, contraction, [e.verdict for e in found.entries])
        inner: list[Block] = [
            Text(sentence(found)),
            Figure(f"index_{case.key}", drawn, "Share of the data per coefficient."),
            Table(columns, rows, "Standard deviations relative to the prior mean."),
        ]
        if found.directions:
            inner.append(Table(DIRECTION_COLUMNS, direction_rows(found.directions), "Open directions."))
        inner.append(Table(DERIVED_COLUMNS, derived_rows(*case.behaviour), "What the ship does."))
        blocks.append(Section(literal(case.words), inner))
    return Section("Real logs", blocks)


def _standing(case: Sampled, i: int) -> tuple[float, float, float]:
    """Mean of the posterior over that of the prior, and both standard deviations over its size."""
    before = float(case.problem.params.start[i])
    size = abs(before) or float(case.seen.information.scale[i])
    mean, sd = float(np.mean(case.draws[:, i])), float(np.std(case.draws[:, i]))
    return mean / (before or size), case.seen.entries[i].prior_sd / size, sd / size


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)
