"""Sections of a diagnosis on its limits: what these runs can tell apart, what to run next, data left out.

Takes a `Diagnosis`. Does not compute.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.diagnosis.run import Diagnosis
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import in_words
from bayesid.report.writer import Block, Figure, Table, Text, literal


def ambiguity_blocks(found: Diagnosis) -> list[Block]:
    a = found.candidates.ambiguity
    order = np.argsort(-a.detect)
    seen = [i for i in order if a.size**2 * a.detect[i] >= 10.0]
    blocks: list[Block] = [
        Text(
            f"From information alone, before any data: of {len(a.names)} effects these runs would show "
            f"{len(seen)} at "
            f"{a.size:g} prior standard deviations."
            + (
                " Told apart poorly: "
                + "; ".join("{" + ", ".join(in_words(n) for n in g) + "}" for g in a.groups)
                + "."
                if a.groups
                else ""
            )
        )
    ]
    if len(seen) > 1:
        index = np.array(sorted(seen))
        drawn = figures.isolability([in_words(a.names[i]) for i in index], a.margin[np.ix_(index, index)])
        blocks.append(
            Figure(
                "isolability",
                drawn,
                "Expected log-evidence margin of a truth over an explanation; dark is blind.",
            )
        )
    rows = [
        [in_words(a.names[i]), float(np.sqrt(10.0 / max(a.detect[i], 1e-12))), f"{a.absorbed[i]:.3f}"]
        for i in order
    ]
    blocks.append(
        Table(
            ["effect", "smallest visible size [prior sd]", "share the coefficients can hide"],
            rows,
            "What would have been seen. Above 0.98 hidden, an effect is never named alone.",
        )
    )
    return blocks


def next_blocks(found: Diagnosis) -> list[Block]:
    if not found.proposals:
        return [Text("No manoeuvre was ranked.")]
    rows = [[in_words(p.name), p.duration, p.margin_now, p.margin_with] for p in found.proposals]
    return [
        Text(
            "`bayesid predict BUNDLE MANOEUVRE --model THIS_FOLDER` says, with a band, what each would show."
        ),
        Table(
            ["manoeuvre", "duration [s]", "margin now [nats]", "margin with it [nats]"],
            rows,
            "Expected margin of the worst pair still in the 95 % set (or of a typical effect over none "
            "where the set has one "
            "member) at 0.3 prior standard deviations.",
        ),
    ]


EVENT_KINDS = {
    "sensor": "readings wrong for a while",
    "jump": "position shifts and stays",
    "motion": "the vehicle moves as nothing here explains",
}


def _events(found: Diagnosis) -> list[Block]:
    if not found.problem.events:
        return []
    rows = [
        [literal(e.run), f"{e.start:.1f}", f"{e.end:.1f}", e.channel, EVENT_KINDS[e.kind], e.misfit]
        for e in found.problem.events
    ]
    return [
        Table(
            ["run", "from [s]", "to [s]", "channel", "what", "misfit over the median"],
            rows,
            "Events: short pieces predicted far worse than all others whatever effect is added. They are "
            "left out; what follows starts from a state of its own.",
        )
    ]


def notes_blocks(found: Diagnosis, record: Mapping[str, Any]) -> list[Block]:
    """The environment, what was set aside or cut out, and warnings."""
    e = found.problem.environment
    c = e.noise_model
    lines = [
        f"- environment {e.source}: force "
        + ", ".join(f"{f:.3g}" for f in c.force)
        + f" N or N m, correlated over {c.force_tau:.3g} s; slow position error {c.drift:.3g} m over "
        f"{c.drift_tau:.3g} s" + (f", of the depth {c.depth:.3g} m" if c.depth is not None else ""),
        f"- {len(found.problem.outliers)} readings were set aside as outliers",
        *[f"- {literal(w)}" for w in record["warnings"]],
    ]
    rows = [[run, f"{t:.2f}", channel] for run, t, channel in found.problem.outliers[:20]]
    blocks: list[Block] = [Text("\n".join(lines)), *_events(found)]
    if rows:
        blocks.append(Table(["run", "time [s]", "channel"], rows, "Readings set aside (first 20)."))
    return blocks
