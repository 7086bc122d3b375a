"""All verdicts on a pack at one glance, with how often they say of themselves that they will be right.

Takes what seal.json holds and the verdicts, both plain. Knows no answers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.report.writer import Report, Section, Table, Text, literal
from bayesid.words import digits

NAMING = ("effect", "effect_with_remainder", "several")


def verdicts_report(commitment: Mapping[str, Any], verdicts: Mapping[str, Mapping[str, Any]]) -> Report:
    """Report of committed verdicts whose answers are not known."""
    first = {n: _first(v) for n, v in verdicts.items()}
    words = Counter(v["verdict"] for v in verdicts.values())
    named = {n: v["effects"][0]["probability"] for n, v in verdicts.items() if v["verdict"] in NAMING}
    counted = ", ".join(f"{count} {literal(word.replace('_', ' '))}" for word, count in words.most_common())
    lead = (
        f"**{len(verdicts)} bundles diagnosed, committed {commitment['sealed']} as "
        f"`{commitment['seal'][:16]}`**: {counted}. "
        "No answer was readable when this was done."
    )
    if commitment["failures"]:
        lead += f" {len(commitment['failures'])} could not be diagnosed."
    return Report("Verdicts on withheld effects", lead, [
        Section("What is expected", [Text(_expected(first, named))]),
        Section("Verdicts", [table(verdicts)]),
        Section("Cost and versions", _cost(commitment)),
    ])  # fmt: skip


def _first(verdict: Mapping[str, Any]) -> float:
    """Probability that the first answer acts, alone or with others."""
    shared = verdict["probabilities"]
    top = max(shared, key=lambda n: shared[n])
    return float(verdict.get("acting", shared)[top])


def _expected(first: Mapping[str, float], named: Mapping[str, float]) -> str:
    p = np.array(list(first.values()))
    text = (
        f"If the stated probabilities are honest, {p.sum():.1f} ± {np.sqrt((p * (1 - p)).sum()):.1f} of "
        f"{p.size} first answers are right by name, and {0.95 * p.size:.0f} of the 95 % sets hold the answer."
    )
    if named:
        q = np.array(list(named.values()))
        text += (
            f" Of the {len(named)} verdicts that name effects, {(1 - q).sum():.1f} should be wrong in the "
            "first name."
        )
    text += (
        " The scores of the project's own committed campaigns say how far such statements can be trusted: "
        "`studies/withheld_effects/run.py`."
    )
    return text


def table(verdicts: Mapping[str, Mapping[str, Any]]) -> Table:
    """Every verdict in a row."""
    rows = []
    for name, v in sorted(verdicts.items()):
        shrink = v["gap"].get("shrink")
        rows.append([
            name, v.get("trial", {}).get("dof"), v["verdict"].replace("_", " "),
            "; ".join(_effect(e) for e in v["effects"]) or None, _first(v),
            ", ".join(n.replace("_", " ") for n in v["set95"]), v["where"]["channel"],
            None if shrink is None else f"{shrink:.0%}",
        ])  # fmt: skip
    columns = ["bundle", "dof", "verdict", "effects", "P", "95 % set", "where", "gap closes by"]
    about = "P is the probability that the first answer acts; 95 % sets by name."
    return Table(columns, rows, about, digits=3)


def _effect(effect: Mapping[str, Any]) -> str:
    parts = []
    for name, p in effect["parameters"].items():
        unit = "" if p["unit"] == "-" else f" {p['unit']}"
        parts.append(f"{name.replace('_', ' ')} {digits(p['value'], 3)} ± {digits(p['sd'], 1)}{unit}")
    return effect["name"].replace("_", " ") + (f" ({', '.join(parts)})" if parts else "")


def _cost(commitment: Mapping[str, Any]) -> list[Any]:
    rows = []
    for dof in (3, 6):
        spent = [
            c["cpu_seconds"]
            for c in commitment["cost"].values()
            if c.get("dof") == dof and "cpu_seconds" in c
        ]
        executed = [
            c["simulated_seconds"]
            for c in commitment["cost"].values()
            if c.get("dof") == dof and "cpu_seconds" in c
        ]
        if spent:
            per_hour = 3600 * sum(spent) / sum(executed)
            rows.append([dof, len(spent), float(np.median(spent)), max(spent), sum(spent) / 60.0, per_hour])
    columns = ["dof", "bundles", "median CPU [s]", "longest [s]", "all [min]", "per logged hour [s]"]
    versions = ", ".join(f"{k} {v}" for k, v in commitment["versions"].items())
    codes = sorted({c.get("code", "") for c in commitment["cost"].values()})
    failed = [[n, m] for n, m in sorted(commitment["failures"].items())]
    return [
        Table(columns, rows, "CPU time of one diagnosis.", digits=3),
        Text(
            f"Versions: {versions}. Started {commitment['started']}. "
            f"States of the deciding code: {', '.join(codes)}."
        ),
        *([Table(["bundle", "why not"], failed, "Not diagnosed.")] if failed else []),
    ]
