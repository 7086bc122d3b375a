"""The report of a diagnosis, told in the order a reader asks: verdict, where, which, proof, what next.

Takes a `Diagnosis` and its JSON record. Does not compute; the sections themselves are in the modules
`diagnosis_*` beside it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.diagnosis.run import Diagnosis
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report import writer
from bayesid.report.diagnosis import effect_posterior
from bayesid.report.diagnosis.cause import description_sections, where_blocks, which_blocks
from bayesid.report.diagnosis.effect_interval import lead_words
from bayesid.report.diagnosis.holdout import proof_label, shrink_blocks
from bayesid.report.diagnosis.limits import ambiguity_blocks, next_blocks, notes_blocks
from bayesid.report.diagnosis.words import in_words, value_words
from bayesid.report.writer import Block, Report, Section, Table, Text, literal

HEADLINES = {
    "none": "No gap beyond what noise, environment and the stated uncertainty of the coefficients explain.",
    "effect": "One unmodelled effect explains the gap.",
    "effect_with_remainder": "One unmodelled effect is sure, and it does not explain the whole gap.",
    "several": "Several unmodelled effects are each needed to explain the gap.",
    "outside": "There is a gap, and no effect of the catalogue explains it well enough to be named.",
    "coefficients": "The gap closes by moving coefficients beyond their stated uncertainty. An effect named "
    "below acts on these runs as such a change does, so the track alone cannot prove it.",
    "ambiguous": "Something seems to act, but these runs cannot tell which of several causes it is.",
}


def write_diagnosis_report(
    found: Diagnosis, folder: str | os.PathLike[str], record: Mapping[str, Any]
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": found.trial.name,
            "trial_digest": found.trial.digest,
            "vehicle": found.model.vehicle.name,
            "vehicle_digest": found.model.vehicle.digest,
            "attribution": found.trial.attribution,
        },
        "seeds": [found.seed],
        "diagnosis": record,
    }
    return writer.write(diagnosis_report(found, record), folder, results)


def diagnosis_report(found: Diagnosis, record: Mapping[str, Any]) -> Report:
    """The report as plain data."""
    parts = (
        f"**{HEADLINES[found.verdict.word]}**",
        _names(record),
        _unlisted(record),
        lead_words(record),
        _outcome(found),
    )
    lead = " ".join(part for part in parts if part)
    if found.trial.attribution:
        lead += f"\n\n{literal(found.trial.attribution)}"
    sections = [
        Section("Verdict", _verdict(found, record)),
        Section("Where the gap lies", where_blocks(found, record)),
        *description_sections(found),
        Section("Which effect", which_blocks(found)),
        *effect_posterior.sections(found, record),
        Section("How far it shrinks", shrink_blocks(found)),
        Section("What these runs can tell apart", ambiguity_blocks(found)),
        Section("What to run next", next_blocks(found)),
        Section("Data, environment and notes", notes_blocks(found, record)),
    ]
    return Report(f"Sim-to-real gap of {literal(found.trial.name)}", lead, sections)


def _names(record: Mapping[str, Any]) -> str:
    parts = []
    for effect in record["effects"]:
        values = ", ".join(value_words(n, p) for n, p in effect["parameters"].items())
        parts.append(f"**{in_words(effect['name'])}**" + (f" ({values})" if values else ""))
    return "; ".join(parts) + ("." if parts else "")


def _unlisted(record: Mapping[str, Any]) -> str:
    """How probable it is that what acts only looks like what is named."""
    if not record["effects"] or "outside" not in record["set95"]:
        return ""
    share = record["probabilities"]["outside"]
    return f"With a probability of {share:.0%} what acts is not on the list and only looks like it."


def _outcome(found: Diagnosis) -> str:
    """What it comes to on held-out runs, in degrees of heading."""
    worth = [
        r for r in found.shrink.horizons if r.worth and math.isfinite(r.rms["nominal"].get("psi", math.nan))
    ]
    if not worth or not found.verdict.effects:
        return ""
    last = worth[-1]
    over = "a whole run" if not math.isfinite(last.seconds) else f"{last.seconds:.0f} s"
    as_was, tuned, now = (
        last.rms[k]["psi"] * 180 / math.pi for k in ("nominal", "recalibrated", "with effect")
    )
    return (
        f"Over {over} of the held-out runs the heading was off by {_short(as_was)} degrees rms as given, "
        f"by {_short(tuned)} with re-tuned coefficients, and by {_short(now)} {_with(proof_label(found))}."
    )


def _short(x: float) -> str:
    return f"{x:.0f}" if x >= 100 else f"{x:.2g}"


def _with(label: str) -> str:
    return label if label.startswith("with ") else f"with the {label}"


def _meaning(found: Diagnosis, record: Mapping[str, Any]) -> list[str]:
    """What the parameters of the named effects stand for, and how large they usually are."""
    lines = []
    for named in record["effects"]:
        effect = found.model.effects.get(named["name"])
        if effect is not None and named["parameters"]:
            about = "; ".join(f"{in_words(p.name)} is {p.about}" for p in effect.parameters if p.about)
            usual = f" Usual size: {effect.magnitude}." if effect.magnitude else ""
            lines.append(f"- {in_words(effect.name)}: {about}.{usual}")
    return lines


def _verdict(found: Diagnosis, record: Mapping[str, Any]) -> list[Block]:
    probability, acting = record["probabilities"], record["acting"]
    top = sorted(probability, key=lambda n: -probability[n])[:6]
    joint = any(acting[n] > probability[n] + 1e-3 for n in top)
    also = ["acts, alone or with others"] if joint else []
    reasons = [unsigned_zeros(r) for r in found.verdict.reasons] + _held(found)
    blocks: list[Block] = [
        Text(
            "\n".join([*_meaning(found, record), *(f"- {r}" for r in reasons)])
            + "\n\nLog evidence is in nats: 3 are odds of 20 to 1, 7 of 1000 to 1."
        ),
        Table(
            ["hypothesis", "probability", *also, "in the 95 % set"],
            [
                [
                    in_words(n),
                    *(_probability(p[n]) for p in (probability, acting)[: 1 + joint]),
                    _in_set(n, record),
                ]
                for n in top
            ],
            "Probabilities over no effect, every effect of the catalogue, one wrong coefficient, and "
            f"something outside{'; effects that act together share theirs' if joint else ''}. What these "
            "runs could not show at its usual size, and do not speak for, is no other answer than none.",
        ),
    ]
    if found.verdict.hidden:
        blocks.append(
            Text(
                "The coefficients' own uncertainty can imitate these effects on these runs, so none of "
                "them is named "
                "alone: "
                + ", ".join(in_words(n) for n in found.verdict.hidden)
                + ". Their probabilities above still "
                "count. An earlier clean identification (`--prior 0.02`) or an outside measurement can tell."
            )
        )
    return blocks


def _in_set(name: str, record: Mapping[str, Any]) -> str:
    if name in record["set95"]:
        return "yes"
    return "counts as none" if name in record["unseen"] else ""


def _held(found: Diagnosis) -> list[str]:
    """Why an effect can gain much where a free signal gains nothing."""
    c = found.candidates
    free, limits = c.where.places[0].evidence, c.thresholds
    if free > limits.remainder or c.best.log_evidence - c.none.log_evidence <= limits.named:
        return []
    e = found.problem.environment
    return [
        "a free signal gains no more than chance although an effect gains: the environment of these runs "
        f"({e.source}) already holds a random force as large as what is missing, so one more random force "
        "adds nothing; an effect gains because it says the same in every run, which no random force does"
    ]


def _probability(p: float) -> Any:
    return p if p >= 1e-6 else "below 1e-6"
