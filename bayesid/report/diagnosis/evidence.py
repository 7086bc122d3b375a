"""Sections below the first screen of a diagnosis: every run, coefficients that move, causes, appendix.

Takes a `Result` and its `Answer`. Does not compute.
"""

from __future__ import annotations

import math
from typing import Any

from bayesid.diagnosis.answer import Answer
from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, MOTION_EVENT, NAMING
from bayesid.diagnosis.hypotheses.verdict import REFUTED
from bayesid.diagnosis.plain_words import in_words, lowered, number, probability, sentence
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import Effect
from bayesid.diagnosis.run_errors import against_given, error_rows, name_of_run, still_missed, whole_turns
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.diagnosis.third_model import coefficients_alone, in_its_place
from bayesid.diagnosis.threshold_table import NAMING_PROBABILITY
from bayesid.report import run_picture
from bayesid.report.diagnosis.cause import where_blocks, which_blocks
from bayesid.report.diagnosis.first_screen import EVENT_SHADED, picture_of, played_blocks
from bayesid.report.diagnosis.holdout import holdout_blocks, measures_table
from bayesid.report.diagnosis.limits import margin_table
from bayesid.report.writer import Block, Figure, Row, Section, Table, Text, literal

MOST_CAUSES, MOST_PICTURES = 8, 4
ROLES = {"holdout": "held out", "identify": "read"}


def runs_blocks(result: Result, a: Answer) -> list[Block]:
    """Errors of every run three ways, standard measures, pictures of the other runs."""
    rows: list[list[Any]] = []
    for run in sorted(result.runs, key=lambda r: r.role != "holdout"):
        for e in error_rows(run):
            rows.append(
                [
                    literal(run.run), literal(run.manoeuvre) or "–", ROLES.get(run.role, run.role),
                    f"{e.what} [{e.unit}]", *map(_cell, e.values),
                ]
            )  # fmt: skip
    if not rows:
        measured = [measures_table(result, a.labels)] if result.measures else []
        return [Text("No run could be replayed."), *measured]
    which = "second" if coefficients_alone(result) else "first"
    seen = f"The last column repeats the {which} and proves no explanation."
    if not in_its_place(result):
        seen = f"What to see: {against_given(result.runs, a.labels)}"
        if missed := still_missed(result.runs, a.labels):
            seen += f" {missed}"
    blocks: list[Block] = [
        Table(
            ["run", "manoeuvre", "role", "rms error", *a.labels],
            rows,
            "Every run replayed open loop from its orders, begun on its first seconds. "
            f"{literal(a.explained)} {literal(seen)}"
            + whole_turns(e for run in result.runs for e in error_rows(run)),
        )
    ]
    if result.measures:
        blocks.append(measures_table(result, a.labels))
    others = result.drawings.replays[1 : 1 + MOST_PICTURES] if result.drawings is not None else ()
    for k, replay in enumerate(others, 1):
        drawn = picture_of(replay, a, result.events)
        where = literal(name_of_run(replay.run, replay.manoeuvre, replay.role))
        title = where[:1].upper() + where[1:]
        blocks.append(
            Row(
                (
                    Figure(f"run{k}_track", run_picture.track(drawn), alt=f"Track of {where}"),
                    Figure(f"run{k}_time", run_picture.over_time(drawn), alt=f"Errors of {where}"),
                ),
                f"{title}.{EVENT_SHADED if drawn.events else ''}",
            )
        )
        if replay.role == "holdout":
            blocks += played_blocks(replay, a, title)
    return blocks


def moved_blocks(result: Result, a: Answer) -> list[Block]:
    """Every coefficient as given, re-tuned and explained."""
    moved = sorted(result.moved.items(), key=lambda i: -i[1].deviations)
    if not moved:
        return [Text("The coefficients were not compared.")]

    def cells(given: float, value: float, sd: float) -> list[Any]:
        further = math.copysign(1.0, given) * (value - given)
        share = unsigned_zeros(f"{100 * further / abs(given):+.1f}") if given else "–"
        return [value, share, unsigned_zeros(f"{further / sd:+.1f}") if sd > 0 else "–"]

    rows = [
        [
            n,
            m.given,
            *cells(m.given, m.retuned, m.prior_sd),
            unsigned_zeros(f"{m.retuned_sd:.2g}") if m.retuned_sd is not None else "–",
            *cells(m.given, m.explained, m.prior_sd),
        ]
        for n, m in moved
    ]
    third = a.labels[2]
    return [
        Table(
            ["coefficient", "as given", "re-tuned", "[%]", "[sd]", "its own sd", third, "[%]", "[sd]"],
            rows,
            "Units of the vehicle file; [sd] counts in standard deviations stated by the vehicle file, what "
            "was known before these logs; its own sd is what these runs leave open of the re-tuned value; "
            "the surest change comes first. In both, + is further from zero than as given, - nearer to zero "
            "or beyond it, whatever the sign of the coefficient. What to see: an explanation that holds "
            "leaves the coefficients nearer to what is stated than re-tuning does.",
        )
    ]


# Rules that come after the hypotheses have been compared, and what the probabilities do not know of them.
OF_BEFORE = {
    LEFT_OUT_WORSE: " They stand as they were before runs were left out, which took the name away.",
    REFUTED: " They stand as they were before the held-out runs were read, which took the name away.",
    MOTION_EVENT: " They are of the runs without the time that is left out.",
}


def cause_blocks(result: Result) -> list[Block]:
    """Probabilities of the causes and what their sizes mean."""
    shares, acting = result.probabilities, result.acting
    top = [n for n in sorted(shares, key=lambda n: -shares[n]) if shares[n] >= 5e-4]
    joint = any(acting.get(n, 0.0) > shares[n] + 1e-3 for n in top)
    rows = [
        [
            in_words(n), f"{shares[n]:.3f}", *([f"{acting.get(n, 0.0):.3f}"] if joint else []),
            _in_set(n, result),
        ]
        for n in top[:MOST_CAUSES]
    ]  # fmt: skip
    named = result.verdict in NAMING
    said = [f"- {literal(sentence(e) if named else _if_it_acts(e))}" for e in result.effects if e.says]
    blocks: list[Block] = [Text("\n".join([*said, *(meaning(e) for e in result.effects if e.parameters)]))]
    if not result.effects:
        blocks = []
    blocks.append(
        Table(
            ["cause", "probability", *(["acts, alone or with others"] if joint else []), "in the 95 % set"],
            rows,
            "Shares that add to 1 over no effect, every effect of the catalogue, one wrong coefficient and "
            f"something outside the list; a name needs {NAMING_PROBABILITY:.2f}."
            + OF_BEFORE.get(result.rule, ""),
        )
    )
    if result.hidden_by_coefficients:
        blocks.append(
            Text(
                "Changed coefficients act on these runs as these effects do, so none of them is named unless "
                "the evidence is sure: "
                + ", ".join(in_words(n) for n in result.hidden_by_coefficients)
                + ". An earlier clean identification (`--prior 0.02`) or a measurement can tell."
            )
        )
    return blocks


def _if_it_acts(effect: Effect) -> str:
    """What an effect in question does, which is no finding."""
    said = lowered(sentence(effect))
    return f"If {in_words(effect.name)} acts (probability {probability(effect.probability)}): {said}"


def meaning(effect: Effect) -> str:
    """What the parameters of a named effect stand for, and how large they usually are."""
    about = "; ".join(
        f"`{n}` = {effect.parameters[n].value:.4g} {effect.parameters[n].unit.replace('-', '')}".rstrip()
        + f", {words}"
        for n, words in effect.meaning.items()
        if n in effect.parameters
    ) or "; ".join(f"{n} = {p.value:.4g} {p.unit}" for n, p in effect.parameters.items())
    usual = f" Usual size: {effect.usual_size}." if effect.usual_size else ""
    return f"- {in_words(effect.name)}: {about}.{usual}"


def _in_set(name: str, result: Result) -> str:
    if name in result.set95:
        return "yes"
    return "counts as none" if name in result.unseen else ""


def appendix_blocks(result: Result) -> list[Block]:
    """What the answer rests on, in nats."""
    reasons = [unsigned_zeros(r) for r in result.reasons] + held_words(result)
    blocks: list[Block] = [
        Text(
            "Log evidence is in nats: 3 are odds of 20 to 1, 7 of 1000 to 1. Thresholds are what chance "
            "reaches in at most 1 of 100 trials drawn without any effect.\n\n"
            + "\n".join(f"- {r}" for r in reasons)
        ),
        Section("Which effect", which_blocks(result)),
        Section("Where the gap lies: a free signal", where_blocks(result)),
        Section("Held-out runs by horizon", holdout_blocks(result)),
    ]
    if result.next_manoeuvre:
        blocks.append(Section("Next manoeuvres: expected margins", [margin_table(result)]))
    return blocks


def held_words(result: Result) -> list[str]:
    """Why an effect can gain much where a free signal gains nothing."""
    free, limits = max(result.where.evidence.values()), result.thresholds
    best = result.refits[1].gain if len(result.refits) > 1 else 0.0
    if free > limits.remainder or best <= limits.named:
        return []
    return [
        "a free signal gains no more than chance although an effect gains: the environment of these runs "
        f"({result.environment.source}) already holds a random force as large as what is missing, so one "
        "more random force adds nothing; an effect gains because it says the same in every run, which no "
        "random force does"
    ]


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
