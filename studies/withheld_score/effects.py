"""Committed verdicts laid beside labels: what became of each bundle, two ways of counting, and every
parameter.

Takes judged cases, answers and verdicts. Gives plain records. Does not choose words for a report.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.benchmark.protocol.answers import Answer
from bayesid.benchmark.protocol.cause_families import families_of, family_of
from bayesid.benchmark.protocol.judgement import DETECTABLE_NONCENTRALITY, NAMING_VERDICTS, ScoredCase

RIGHT, FIRST, BEHIND = "right", "left open, cause first", "left open, another first"
HALF, NAME, ALARM, MISSED = "one of two named", "wrong name", "false alarm", "missed"
FATES = (RIGHT, FIRST, BEHIND, HALF, NAME, ALARM, MISSED)
INSIDE = 1.96  # half width of a central 95 % interval in standard deviations


def fate(case: ScoredCase) -> str:
    """What became of a bundle: one of FATES."""
    if case.outcome in ("right", "rejected"):
        return RIGHT
    if case.outcome == "set":
        return FIRST if case.top in case.right and case.covered else BEHIND
    if case.outcome == "in part":
        return HALF
    return case.outcome if case.outcome in (NAME, ALARM) else MISSED


def exactly(answer: Answer, verdict: Mapping[str, Any]) -> bool:
    """Whether a verdict says the label word for word: same names, no families, no aliases, no sets."""
    labelled = {e["name"] for e in answer.source["effects"]} - {"none"}
    word, named = verdict["verdict"], {e["name"] for e in verdict["effects"]}
    if answer.kind == "none":
        return bool(word == "none")
    if answer.kind == "outside":
        return bool(word == "outside")
    if labelled == {"coefficient_error"}:
        return bool(word == "coefficients" and named <= labelled)
    return word in NAMING_VERDICTS and named == labelled


def first_right(case: ScoredCase, verdict: Mapping[str, Any]) -> bool:
    """Whether the most probable hypothesis is of a labelled family (none and outside count as their own)."""
    shares: Mapping[str, float] = verdict["probabilities"]
    return family_of(max(shares, key=lambda n: shares[n])) in case.right


def holds_all(case: ScoredCase, verdict: Mapping[str, Any]) -> bool:
    """Whether every labelled family is in the 95 % set; faint causes have no exception here."""
    return case.right <= families_of(verdict["set95"])


def parameters(
    answers: Mapping[str, Answer], verdicts: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Every parameter that label and verdict both state: true, said, sd, error in sd, and whether it was
    named.

    Effects of verdicts that name nothing (ambiguous, coefficients) are included: they too state a size.
    """
    rows = []
    for name, answer in sorted(answers.items()):
        stated = {e["name"]: e["parameters"] for e in verdicts[name]["effects"]}
        for cause in answer.causes:
            for parameter, true in (cause.parameters or {}).items():
                found = stated.get(cause.name, {}).get(parameter)
                if found is None:
                    continue
                error, sd = float(found["value"]) - true, float(found["sd"])
                rows.append({
                    "bundle": name, "effect": cause.name, "parameter": parameter, "unit": found["unit"],
                    "true": true, "said": float(found["value"]), "sd": sd,
                    "error_in_sd": error / sd if sd > 0 else math.nan,
                    "inside": abs(error) <= INSIDE * sd,
                    "named": verdicts[name]["verdict"] in NAMING_VERDICTS,
                })  # fmt: skip
    return rows


def row_of(case: ScoredCase, answer: Answer, verdict: Mapping[str, Any]) -> dict[str, Any]:
    """One row of the table of bundles."""
    shares = verdict["probabilities"]
    return {
        "bundle": case.name,
        "dof": case.dof,
        "labelled": [e["name"] for e in answer.source["effects"]],
        "kind": case.kind,
        "class": answer.source.get("evidence_class", ""),
        "noncentrality": case.noncentrality if case.planted else None,
        "verdict": case.word,
        "effects": [e["name"] for e in verdict["effects"]],
        "first": max(shares, key=lambda n: shares[n]),
        "stated": case.stated,
        "p_right": case.p_right,
        "set": list(verdict["set95"]),
        "fate": fate(case),
        "exactly": exactly(answer, verdict),
        "first_right": first_right(case, verdict),
        "set_holds_all": holds_all(case, verdict),
    }


def expected(cases: Sequence[ScoredCase], verdicts: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """What EXPECTATION.md said before the fifth solving, and what came true."""
    flat = [c for c in cases if c.dof == 3]
    solid = [c for c in cases if c.dof == 6]

    def ratio(hits: Sequence[bool]) -> str:
        return f"{sum(hits)} of {len(hits)}" if hits else "none such"

    def single(some: Sequence[ScoredCase]) -> list[ScoredCase]:
        return [c for c in some if c.kind == "effect" and c.noncentrality >= DETECTABLE_NONCENTRALITY
                and "coefficient_error" not in c.right]  # fmt: skip

    naming = [c for c in cases if c.named]
    none = {d: [c.word == "none" for c in s if c.kind == "none"] for d, s in ((3, flat), (6, solid))}
    top = {d: [c.top in c.right for c in single(s)] for d, s in ((3, flat), (6, solid))}
    named = [c.named == c.right for c in single(cases)]
    held = {d: [holds_all(c, verdicts[c.name]) for c in s] for d, s in ((3, flat), (6, solid))}
    return [
        ["bundles without an effect: called none, planar", "49 of 50", ratio(none[3])],
        ["the same in 6-DOF", "9 of 10", ratio(none[6])],
        ["single causes, D at least 25: true family most probable, planar", "95 % (isolable, not hidden)",
         ratio(top[3])],
        ["the same in 6-DOF", "85 % (isolable, not hidden)", ratio(top[6])],
        ["the same, named", "8 in 10 (isolable, not hidden)", ratio(named)],
        ["every labelled family in the 95 % set, planar", "97 %", ratio(held[3])],
        ["the same in 6-DOF", "88 %", ratio(held[6])],
        ["names that are wrong", "1 in 20", ratio([bool(c.named - c.right) for c in naming])],
        ["causes outside the list: rejected, or outside in the set of an ambiguous verdict", "3 in 4",
         ratio([c.outcome == "right" for c in cases if c.kind == "outside"])],
        ["two effects at once, both named", "8 in 10 where both are plain",
         ratio([c.right <= c.named for c in cases if c.kind == "two"])],
    ]  # fmt: skip
