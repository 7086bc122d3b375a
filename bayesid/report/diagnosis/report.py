"""The report of a diagnosis, told in the order a reader asks: verdict, where, which, proof, what next.

Takes a `Result`, nothing else: no fit, problem or trial. Does not compute; the sections themselves are in
the modules beside it.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from bayesid.diagnosis.result import Effect, Result
from bayesid.diagnosis.summary import unsigned_zeros
from bayesid.report import writer
from bayesid.report.diagnosis import effect_posterior
from bayesid.report.diagnosis.cause import description_sections, where_blocks, which_blocks
from bayesid.report.diagnosis.effect_interval import lead_words
from bayesid.report.diagnosis.holdout import MODELS, holdout_blocks, proof_label
from bayesid.report.diagnosis.limits import ambiguity_blocks, next_blocks, notes_blocks
from bayesid.report.diagnosis.model_form import form_lead, form_sections
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
    "model_form": "No cause beyond a force that the equations lack is needed, or told from what such a force "
    "leaves.",
    "ambiguous": "Something seems to act, but these runs cannot tell which of several causes it is.",
}


def write_diagnosis_report(result: Result, folder: str | os.PathLike[str]) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file."""
    results = {
        "inputs": {
            "trial": result.trial.name,
            "trial_digest": result.trial.digest,
            "vehicle": result.trial.vehicle,
            "vehicle_digest": result.trial.vehicle_digest,
            "attribution": result.trial.attribution,
        },
        "seeds": [result.seed],
        "diagnosis": result.record(),
    }
    return writer.write(diagnosis_report(result), folder, results)


def diagnosis_report(result: Result) -> Report:
    """The report as plain data."""
    parts = (
        f"**{HEADLINES[result.verdict]}**",
        _names(result),
        _unlisted(result),
        form_lead(result),
        lead_words(result),
        _outcome(result),
    )
    lead = " ".join(part for part in parts if part)
    if result.trial.attribution:
        lead += f"\n\n{literal(result.trial.attribution)}"
    sections = [
        Section("Verdict", _verdict(result)),
        Section("Where the gap lies", where_blocks(result)),
        *form_sections(result),
        *description_sections(result),
        Section("Which effect", which_blocks(result)),
        *effect_posterior.sections(result),
        Section("How far it shrinks", holdout_blocks(result)),
        Section("What these runs can tell apart", ambiguity_blocks(result)),
        Section("What to run next", next_blocks(result)),
        Section("Data, environment and notes", notes_blocks(result)),
    ]
    return Report(f"Sim-to-real gap of {literal(result.trial.name)}", lead, sections)


def _names(result: Result) -> str:
    parts = []
    for effect in result.effects:
        values = ", ".join(value_words(n, p) for n, p in effect.parameters.items())
        parts.append(f"**{in_words(effect.name)}**" + (f" ({values})" if values else ""))
    return "; ".join(parts) + ("." if parts else "")


def _unlisted(result: Result) -> str:
    """How probable it is that what acts only looks like what is named."""
    if not result.effects or "outside" not in result.set95:
        return ""
    share = result.probabilities["outside"]
    return f"With a probability of {share:.0%} what acts is not on the list and only looks like it."


def _outcome(result: Result) -> str:
    """What it comes to on held-out runs, in degrees of heading."""
    significant = [
        h for h in result.gap.horizons if h.worth_shrinking and h.rms["nominal"].get("psi") is not None
    ]
    if not significant or not result.effects:
        return ""
    last = significant[-1]
    over = "a whole run" if last.seconds is None else f"{last.seconds:.0f} s"
    as_was, tuned, now = ((last.rms[k]["psi"] or 0.0) * 180 / math.pi for k in MODELS)
    return (
        f"Over {over} of the held-out runs the heading was off by {_short(as_was)} degrees rms as given, "
        f"by {_short(tuned)} with re-tuned coefficients, and by {_short(now)} {_with(proof_label(result))}."
    )


def _short(x: float) -> str:
    return f"{x:.0f}" if x >= 100 else f"{x:.2g}"


def _with(label: str) -> str:
    return label if label.startswith("with ") else f"with the {label}"


def _meaning(effect: Effect) -> str:
    """What the parameters of a named effect stand for, and how large they usually are."""
    about = "; ".join(f"{in_words(n)} is {words}" for n, words in effect.meaning.items())
    usual = f" Usual size: {effect.usual_size}." if effect.usual_size else ""
    return f"- {in_words(effect.name)}: {about}.{usual}"


def _verdict(result: Result) -> list[Block]:
    probability, acting = result.probabilities, result.acting
    top = sorted(probability, key=lambda n: -probability[n])[:6]
    joint = any(acting[n] > probability[n] + 1e-3 for n in top)
    also = ["acts, alone or with others"] if joint else []
    reasons = [unsigned_zeros(r) for r in result.reasons] + _held(result)
    meanings = [_meaning(e) for e in result.effects if e.parameters]
    blocks: list[Block] = [
        Text(
            "\n".join([*meanings, *(f"- {r}" for r in reasons)])
            + "\n\nLog evidence is in nats: 3 are odds of 20 to 1, 7 of 1000 to 1."
        ),
        Table(
            ["hypothesis", "probability", *also, "in the 95 % set"],
            [
                [
                    in_words(n),
                    *(_probability(p[n]) for p in (probability, acting)[: 1 + joint]),
                    _in_set(n, result),
                ]
                for n in top
            ],
            "Probabilities over no effect, every effect of the catalogue, one wrong coefficient, and "
            f"something outside{'; effects that act together share theirs' if joint else ''}. What these "
            "runs could not show at its usual size, and do not speak for, is no other answer than none.",
        ),
    ]
    if result.hidden_by_coefficients:
        blocks.append(
            Text(
                "The coefficients' own uncertainty can imitate these effects on these runs, so none of "
                "them is named unless the evidence is sure that they do not: "
                + ", ".join(in_words(n) for n in result.hidden_by_coefficients)
                + ". Their probabilities above still "
                "count. An earlier clean identification (`--prior 0.02`) or an outside measurement can tell."
            )
        )
    return blocks


def _in_set(name: str, result: Result) -> str:
    if name in result.set95:
        return "yes"
    return "counts as none" if name in result.unseen else ""


def _held(result: Result) -> list[str]:
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


def _probability(p: float) -> Any:
    return p if p >= 1e-6 else "below 1e-6"
