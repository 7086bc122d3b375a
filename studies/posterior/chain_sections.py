"""Sections on chains: which passed their convergence check, and whether two samplers agree.

Takes sampled cases. Does not sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.estimation.sampling.compare_samplers import agreement
from bayesid.report import posterior_figures as figures
from bayesid.report.writer import Block, Figure, Section, Table, Text, literal
from studies.posterior.sampled_case import Sampled

RANKED = ("spiral22",)  # one picture is enough, and a report is to stay below 1 MB
CONVERGENCE_COLUMNS = (
    "case", "sampler", "R-hat", "ESS bulk", "tail", "tau", "in tau", "CPU [s]", "ESS / s", "passed",
)  # fmt: skip


def chains_section(every: Mapping[str, Sampled]) -> Section:
    text = (
        "A chain is converged when R-hat over independent ensembles (chains) is at most 1.01, it is at least "
        "50 autocorrelation times long with a stable estimate, and the effective size (ESS, ArviZ) of every "
        "unknown is at least 400 in bulk and tail. tau is in steps of the ensembles or draws of NUTS, "
        "`in tau` the length of the chain in it, `ESS / s` the least bulk size per processor second. Where a "
        "gate stays shut, intervals are not final."
    )
    rows: list[list[Any]] = []
    reasons = []
    for case in every.values():
        if not case.posteriors:
            rows.append([case.words, "none: Laplace", *[None] * 8])
        for name, p in case.posteriors.items():
            g = p.convergence
            rows.append(
                [
                    case.words, name, f"{np.nanmax(g.rhat):.4f}",
                    round(float(g.ess_bulk.min())), round(float(g.ess_tail.min())), float(g.tau.max()),
                    round(g.n_tau), p.seconds, p.ess_per_second, p.converged,
                ]
            )  # fmt: skip
            if g.reasons:
                reasons.append(f"- {literal(case.words)}, {name}: {literal('; '.join(g.reasons))}")
    blocks: list[Block] = [Text(text), Table(CONVERGENCE_COLUMNS, rows, digits=3)]
    if reasons:
        blocks.append(Text("Short of the convergence check:\n\n" + "\n".join(reasons)))
    for case in every.values():
        if case.key not in RANKED:
            continue
        p = next(iter(case.posteriors.values()))
        count = min(p.n_params, 24)
        e = p.draws.shape[0]
        drawn = p.draws[..., :count].reshape(e, -1, count)
        drawn = drawn[:, :: max(1, drawn.shape[1] // 20_000)]
        caption = (
            f"Rank plots, {literal(case.words)}: the share of each ensemble's draws per twentieth of all."
        )
        blocks.append(Figure(f"ranks_{case.key}", figures.ranks(p.names[:count], drawn), caption))
    return Section("Chains", blocks)


def samplers_section(cases: Mapping[str, Sampled]) -> Section:
    text = (
        "The ensembles know the density only, NUTS follows its gradient (adjoint) in Laplace-whitened "
        "coordinates; both sample the same density and are measured in the same unknowns. Means are apart "
        "by their Monte Carlo errors if the second column is of the order of 2 to 3, spreads are the same if "
        "the ratio is 1 within a few of its errors."
    )
    rows = []
    for case in cases.values():
        if len(case.posteriors) < 2:
            continue
        (a, one), (b, two) = list(case.posteriors.items())[:2]
        found = agreement(one, two)
        rows.append(
            [
                case.words, float(np.abs(found.mean).max()), float(np.abs(found.shift).max()),
                f"{found.spread.min():.3f} to {found.spread.max():.3f}", float(found.spread_error.max()),
                one.ess_per_second, two.ess_per_second,
            ]
        )  # fmt: skip
    columns = [
        "case",
        "means apart [errors]",
        "[posterior sd]",
        "ratio of sd",
        "its error",
        f"ESS/s {a}",
        f"ESS/s {b}",
    ]
    return Section("Two samplers, one posterior", [Text(text), Table(columns, rows, digits=3)])
