"""Sections of a diagnosis on its limits: what these runs can tell apart, what to run next, data left out.

Takes a `Result`. Does not compute.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.result import Result
from bayesid.diagnosis.summary import notes
from bayesid.diagnosis.threshold_table import CONFOUNDED_SHARE, NAMING_PROBABILITY
from bayesid.report.diagnosis import figures
from bayesid.report.diagnosis.words import in_words
from bayesid.report.writer import Block, Figure, Table, Text, literal

VISIBLE = 10.0  # noncentrality from which an effect is seen


def ambiguity_blocks(result: Result) -> list[Block]:
    """What these runs would show, and what they could tell apart, from information alone."""
    shown, size = result.drawings, result.ambiguity_size
    ranked = sorted(result.detectability.items(), key=lambda item: -item[1].noncentrality_at_one_prior_sd)
    seen = sum(size**2 * d.noncentrality_at_one_prior_sd >= VISIBLE for _, d in ranked)
    blocks: list[Block] = [
        Text(
            f"From information alone, before any data: of {len(ranked)} effects these runs would show {seen} "
            f"at {size:g} prior standard deviations."
            + (
                " Told apart poorly: "
                + "; ".join("{" + ", ".join(in_words(n) for n in g) + "}" for g in result.ambiguity_groups)
                + "."
                if result.ambiguity_groups
                else ""
            )
        )
    ]
    if shown is not None and len(shown.effects) > 1:
        drawn = figures.isolability([in_words(n) for n in shown.effects], shown.margin)
        blocks.append(
            Figure(
                "isolability",
                drawn,
                "Expected log-evidence margin of a truth over an explanation; dark is blind.",
            )
        )
    rows = [
        [
            in_words(n),
            math.sqrt(VISIBLE / max(d.noncentrality_at_one_prior_sd, 1e-12)),
            f"{d.absorbed:.3f}",
        ]
        for n, d in ranked
    ]
    blocks.append(
        Table(
            ["effect", "smallest visible size [prior sd]", "share that coefficients absorb"],
            rows,
            f"What would have been seen. From {CONFOUNDED_SHARE:g} on an effect is confounded with "
            f"coefficients: it is named only where it acts with at least {NAMING_PROBABILITY:.0%}, wrong "
            "coefficients weighed beside it.",
        )
    )
    return blocks


def next_blocks(result: Result) -> list[Block]:
    """Manoeuvres to execute next, best first."""
    if not result.next_manoeuvre:
        return [Text(f"No manoeuvre was ranked: {_why_none(result)}")]
    rows = [
        [in_words(p.name), round(p.duration), literal(p.orders), literal(p.typed)]
        for p in result.next_manoeuvre
    ]
    return [
        Text(
            "Best first: what tells the causes still possible apart, or shows a usual effect where none is. "
            "`bayesid predict` says of each, with a band, what it would show."
        ),
        Table(
            ["manoeuvre", "duration [s]", "what is ordered", "as typed"],
            rows,
            "Sized for this vehicle. `bayesid manoeuvre list` explains what can be typed.",
        ),
    ]


def _why_none(result: Result) -> str:
    if not result.next_asked:
        return "`--quick` leaves it out (in Python `next_manoeuvre=False`)."
    return (
        "none of the library that this vehicle can run would tell more, or ranking failed; see the notes. "
        "A vehicle without a rudder can run none of it."
    )


def margin_table(result: Result) -> Table:
    """What each proposed manoeuvre is expected to tell."""
    rows = [[in_words(p.name), p.margin_now, p.margin_with] for p in result.next_manoeuvre]
    return Table(
        ["manoeuvre", "margin now [nats]", "margin with it [nats]"],
        rows,
        "Expected margin of the worst pair still in the 95 % set (or of a typical effect over none where the "
        "set has one member) at 0.3 prior standard deviations.",
    )


EVENT_KINDS = {
    "sensor": "readings wrong for a while",
    "jump": "position shifts and stays",
    "motion": "the vehicle moves as nothing here explains",
    "stuck": "an actuator stays where it is; its order is not used",
}


def _events(result: Result) -> list[Block]:
    if not result.events:
        return []
    rows = [
        [
            literal(e.run),
            f"{e.start:.1f}",
            f"{e.end:.1f}",
            e.channel,
            EVENT_KINDS[e.kind],
            e.misfit if e.misfit is not None else "–",
            e.evidence,
        ]
        for e in result.events
    ]
    return [
        Table(
            ["run", "from [s]", "to [s]", "channel", "what", "misfit over the median", "gain [nats]"],
            rows,
            "Events: short pieces predicted far worse than all others whatever effect is added, or in which "
            "a free force, allowed only there, gains more than chance beside the best explanation. They are "
            "left out (of a brief one a little more than is told here); what follows starts from a state of "
            "its own. Of an actuator that stuck for longer the readings count, with its order held there.",
        )
    ]


def _depends(result: Result) -> list[Block]:
    """What a force that is left depends on."""
    found = result.dependence
    if found is None:
        return []
    return [
        Table(
            [
                "depends on",
                "acts on",
                "distance or period",
                "size (rms)",
                "gain [nats]",
                "gain with no effect [nats]",
            ],
            [
                [
                    found.on,
                    "the hull's forces" if found.acts == "hull" else "the vehicle, whatever its heading",
                    f"{found.scale:.3g} {'m' if found.on == 'place' else 's'}",
                    f"{found.size:.1%}" if found.acts == "hull" else f"{found.size:.3g} N",
                    found.evidence,
                    found.alone,
                ]
            ],
            "What a force that is left depends on: its gain stands beside the best explanation and beside a "
            "force of the motion and the controls of any shape.",
        ),
    ]


def notes_blocks(result: Result) -> list[Block]:
    """The environment, what was set aside or cut out, and warnings."""
    e = result.environment
    lines = [
        f"- environment {e.source}: force "
        + ", ".join(f"{f:.3g}" for f in e.force)
        + f" N or N m, correlated over {e.force_tau:.3g} s; slow position error {e.drift:.3g} m over "
        f"{e.drift_tau:.3g} s" + (f", of the depth {e.depth:.3g} m" if e.depth is not None else ""),
        f"- {len(result.outliers)} readings were set aside as outliers",
        *[f"- {literal(w)}" for w in notes(result)],
        *([f"- {literal(result.trial.attribution)}"] if result.trial.attribution else []),
    ]
    rows = [[o.run, f"{o.time:.2f}", o.channel] for o in result.outliers[:20]]
    blocks: list[Block] = [Text("\n".join(lines)), *_events(result), *_depends(result)]
    if rows:
        blocks.append(Table(["run", "time [s]", "channel"], rows, "Readings set aside (first 20)."))
    return blocks
