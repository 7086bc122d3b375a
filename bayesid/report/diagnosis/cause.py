"""Sections of a diagnosis on the cause: where the gap lives, what the missing force is made of, which effect.

Takes a `Diagnosis`. Does not compute.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.run import Diagnosis
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import arrival_words, in_words
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal


def where_blocks(found: Diagnosis, record: Mapping[str, Any]) -> list[Block]:
    """Evidence of a free signal per channel, parts of the runs, and the smoothed force."""
    where, limits = found.candidates.where, found.candidates.thresholds
    blocks: list[Block] = [
        Text(
            "A free signal is let into one channel at a time; the gain in log evidence says how much of "
            "the gap that "
            "channel can carry. No cause is named here. " + _place(found, record) + _beat(where)
        ),
        Figure(
            "where",
            figures.bars(
                [p.channel for p in where.places],
                np.array([p.evidence for p in where.places]),
                "gain in log evidence [nats]",
                limits.remainder,
            ),
            "Evidence of a free signal per channel, before any effect is added.",
        ),
    ]
    if where.masks:
        rows = [[m.kind, literal(m.name), m.evidence, f"{m.share:.0%}"] for m in where.masks[:10]]
        blocks.append(
            Table(
                ["kind", "where it may act", "gain [nats]", "share of samples"],
                rows,
                f"The signal in {where.places[0].channel} allowed only in one manoeuvre, window or "
                f"regime. One that keeps "
                "nearly all of the gain is where the gap lives.",
            )
        )
        axes = [n[-1] for n in found.model.kernel.exogenous if n.startswith("force_")]
        many = min(len(where.runs), 4)
        drawn = figures.force(
            [literal(r) for r in where.runs[:many]],
            where.times[:many],
            where.force[:many],
            where.band[:many],
            axes,
        )
        blocks.append(
            Figure("force", drawn, "Smoothed missing force in body axes, with two standard deviations.")
        )
    return blocks


def _beat(where: Localisation) -> str:
    """Period of the signal that gains most, if it keeps time."""
    best = where.places[0]
    if best.period is None:
        return ""
    return (
        f" The signal in {best.channel} that gains most keeps time: its period is {best.period:.3g} s. "
        "Look for what turns, sheds, sloshes or hunts with it."
    )


def _place(found: Diagnosis, record: Mapping[str, Any]) -> str:
    """The most probable place of all hypotheses beside that of a free signal alone."""
    first, chance = found.candidates.where.places[0], found.candidates.thresholds.remainder
    named = record["where"]["channel"]
    words = "" if first.evidence > chance else "None gains more than chance does. "
    if named is None:
        return words + "So no place is named."
    words += f"The most probable place, all hypotheses counted by their probability, is **{named}**"
    if named == first.channel:
        return words + "."
    return words + (
        f", not {first.channel}: a free signal knows no vehicle, while the causes left can act only in "
        "places of their own."
    )


def description_sections(found: Diagnosis) -> list[Section]:
    d = found.description
    if d is None:
        return []
    blocks: list[Block] = [Text("\n\n".join(literal(s) for s in d.sentences))]
    if d.terms:
        blocks.append(
            Table(
                ["term", "regressor", "value", "sd", "unit", "kept in draws", "gain [nats]", "or else"],
                [
                    [t.name, t.expression, t.value, t.sd, t.unit, t.inclusion, t.gain, ", ".join(t.rivals)]
                    for t in d.terms
                ],
                "Terms of the missing force. Each was proposed by a sparse regression of the smoothed force "
                "(bayesid's own stepwise selection) "
                "and then earned its evidence beside coefficients that were free within their prior. Between "
                "terms of one axis the readings chose, not the regression, whose draws may then be few.",
            )
        )
    return [Section("What the missing force is made of", blocks)]


def which_blocks(found: Diagnosis) -> list[Block]:
    c = found.candidates
    scores = c.scores[:14]
    base = c.none.log_evidence
    rows = [["none", 0.0, c.none.fit.chi2, arrival_words(c.none.fit.converged), ""]]
    for r in c.refits:
        k = len(found.problem.coefficients.names)
        values = "; ".join(
            f"{n.split('.')[1]} = {v:.4g} ± {s:.2g}"
            for n, v, s in zip(r.fit.free.names[k:], r.fit.values[k:], r.fit.sd[k:], strict=True)
        )
        rows.append(
            [
                " + ".join(in_words(n) for n in r.effects),
                r.log_evidence - base,
                r.fit.chi2,
                arrival_words(r.fit.converged),
                values,
            ]
        )
    return [
        Figure(
            "screen",
            figures.bars(
                [in_words(s.name) for s in scores],
                np.array([s.gain for s in scores]),
                "gain in log evidence, screen [nats]",
                c.thresholds.named,
            ),
            "Screen of the whole catalogue along one path, coefficients free.",
        ),
        Table(
            ["effects", "gain [nats]", "chi²", "refit", "parameters (SI)"],
            rows,
            "Refits of the shortlist to convergence. chi² near 1 means residuals of the size of the noise.",
        ),
    ]
