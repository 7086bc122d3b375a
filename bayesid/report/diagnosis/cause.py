"""Sections of a diagnosis on the cause: where the gap lives, what the missing force is made of, which effect.

Takes a `Result`. Does not compute.
"""

from __future__ import annotations

import numpy as np

from bayesid.diagnosis.result import Result
from bayesid.report.coefficient_cells import COLUMNS
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import arrival_words, in_words
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal
from bayesid.words import digits

MOST_SCREENED = 14


def where_blocks(result: Result) -> list[Block]:
    """Evidence of a free signal per channel, parts of the runs, and the smoothed force."""
    where, gains = result.where, result.where.evidence
    blocks: list[Block] = [
        Text(
            "A free signal is let into one channel at a time; the gain in log evidence says how much of "
            "the gap that channel can carry. No cause is named here. " + _place(result) + _period(result)
        ),
        Figure(
            "where",
            figures.bars(
                list(gains),
                np.array(list(gains.values())),
                "gain in log evidence [nats]",
                result.thresholds.remainder,
            ),
            "Evidence of a free signal per channel, before any effect is added.",
        ),
    ]
    parts = sorted((*where.windows, *where.regimes), key=lambda r: -r.evidence)
    if parts:
        blocks.append(
            Table(
                ["kind", "where it may act", "gain [nats]", "share of samples"],
                [[r.kind, literal(r.name), r.evidence, f"{r.share:.0%}"] for r in parts],
                f"The signal in {first_place(result)} allowed only in one manoeuvre, window or regime; the "
                "best of each kind. One that keeps nearly all of the gain is where the gap lives.",
            )
        )
    return blocks


def force_blocks(result: Result) -> list[Block]:
    """The smoothed missing force; none where nothing localises the gap."""
    force = result.drawings.force if result.drawings is not None else None
    if force is None:
        return []
    drawn = figures.force([literal(r) for r in force.runs], force.times, force.values, force.sd, force.axes)
    caption = (
        "The force that, added to the simulator as re-tuned, leads it along the log, in body axes, with two "
        "standard deviations. What to see: when it acts, and whether it follows the orders or the turning."
    )
    return [Figure("force", drawn, caption)]


def first_place(result: Result) -> str:
    """Channel in which a free signal gains most."""
    return next(iter(result.where.evidence))


def _period(result: Result) -> str:
    """Period of the signal that gains most, if it is periodic."""
    if result.where.period is None:
        return ""
    return (
        f" The signal in {first_place(result)} that gains most is periodic: its period is "
        f"{result.where.period:.3g} s. Look for what turns, sheds, sloshes or hunts with it."
    )


def _place(result: Result) -> str:
    """The most probable place of all hypotheses beside that of a free signal alone."""
    first, named = first_place(result), result.where.channel
    above = result.where.evidence[first] > result.thresholds.remainder
    words = "" if above else "None gains more than chance does. "
    if named is None:
        return words + "So no place is named."
    words += f"The most probable place, all hypotheses counted by their probability, is **{named}**"
    if named == first:
        return words + "."
    return words + (
        f", not {first}: a free signal knows no vehicle, while the causes left can act only in places of "
        "their own."
    )


def description_sections(result: Result) -> list[Section]:
    """What the missing force is made of; none where nothing was described."""
    d = result.description
    if d is None:
        return []
    blocks: list[Block] = [Text("\n\n".join(literal(s) for s in d.sentences))]
    if d.terms:
        blocks.append(
            Table(
                ["term", "regressor", *COLUMNS, "sd [%]", "kept in draws", "gain [nats]", "or else"],
                [
                    [
                        t.name,
                        t.expression,
                        t.prime,
                        t.value,
                        t.unit,
                        100 * t.sd / abs(t.value) if t.value else None,
                        t.inclusion,
                        t.gain,
                        ", ".join(t.rivals),
                    ]
                    for t in d.terms
                ],
                "Terms of the missing force. Each was proposed by a sparse regression of the smoothed force "
                "(bayesid's own stepwise selection) "
                "and then earned its evidence beside coefficients that were free within their prior. Between "
                "terms of one axis the readings chose, not the regression, whose draws may then be few.",
            )
        )
    return [Section("What the missing force is made of", blocks)]


def which_blocks(result: Result) -> list[Block]:
    """Screen of the catalogue, and the refits of what it proposed."""
    shown = result.screen[:MOST_SCREENED]
    rows = [
        [
            " + ".join(in_words(n) for n in r.effects) or "none",
            r.gain,
            r.chi2,
            arrival_words(r.converged),
            "; ".join(
                f"{n.split('.')[1]} = {digits(p.value, 4)} ± {digits(p.sd, 2)}"
                for n, p in r.parameters.items()
            ),
        ]
        for r in result.refits
    ]
    return [
        Figure(
            "screen",
            figures.bars(
                [in_words(s.name) for s in shown],
                np.array([s.gain for s in shown]),
                "gain in log evidence, screen [nats]",
                result.thresholds.named,
            ),
            "Screen of the whole catalogue along one path, coefficients free.",
        ),
        Table(
            ["effects", "gain [nats]", "chi²", "refit", "parameters (SI)"],
            rows,
            "Refits of the shortlist to convergence. chi² near 1 means residuals of the size of the noise. "
            "± is one standard deviation of a refit, by its curvature at the optimum with the stated "
            "coefficients' uncertainty as prior; a 95 % interval is 1.96 of them to either side.",
        ),
    ]
