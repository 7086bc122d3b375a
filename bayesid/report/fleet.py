"""One page over the diagnoses of many bundles.

Takes their records and what they share (`bayesid.diagnosis.fleet`, `.shared_coefficients`). Does not
diagnose.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.diagnosis.fleet import CHANGED, COMMON, SharedEffect, SharedParameter, verdict_words
from bayesid.diagnosis.shared_coefficients import CoefficientSharing
from bayesid.report.fleet_coefficients import sharing_blocks, sharing_words
from bayesid.report.writer import Report, Section, Table, Text, literal
from bayesid.words import digits, first_few

FEW = 6  # bundles named in a cell
MOST_VEHICLES = 3  # whose coefficients the lead speaks of
NO_SHARING = CoefficientSharing()


def fleet_report(
    records: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    effects: Sequence[SharedEffect],
    parameters: Sequence[SharedParameter],
    sharing: CoefficientSharing,
) -> Report:
    """Report of all bundles; each has its own beside it."""
    sections = [Section("Every bundle", [_bundles(records)])]
    if failures:
        rows = [[n, why] for n, why in sorted(failures.items())]
        sections.append(Section("Without a verdict", [Table(["bundle", "why"], rows, "Not diagnosed.")]))
    sections.append(Section("What is in question where", _effects(effects)))
    sections.append(Section("The same, or changed", _parameters(parameters)))
    sections.append(Section("Coefficients of a vehicle", sharing_blocks(sharing, tuple(failures))))
    lead = fleet_lead(records, failures, effects, parameters, sharing)
    return Report("Diagnosis of many bundles", lead, sections)


def fleet_lead(
    records: Mapping[str, Mapping[str, Any]],
    failures: Mapping[str, str],
    effects: Sequence[SharedEffect],
    parameters: Sequence[SharedParameter],
    sharing: CoefficientSharing = NO_SHARING,
) -> str:
    """The answer in a few sentences."""
    words = Counter(verdict_words(r).partition(" (")[0] for r in records.values())
    counted = ", ".join(f"{n} {literal(w)}" for w, n in words.most_common())
    text = f"**{len(records)} of {len(records) + len(failures)} bundles diagnosed**: {counted or 'none'}."
    common = [s for s in effects if s.acting > COMMON * s.bundles and s.acting > 1]
    text += "".join(
        f" {_name(s.effect)} is in question in {s.acting} of {s.bundles} bundles of "
        f"{literal(s.vehicle) if s.vehicle else 'all vehicles'}."
        for s in common[:3]
    )
    for p in [p for p in parameters if p.changed][:3]:
        (first, a, _), (last, b, _) = p.each[0], p.each[-1]
        text += (
            f" **{_name(p.effect)} of {literal(p.vehicle)} is not one value** (p = {p.p:.1g}): "
            f"{p.parameter} {a:.3g} {p.unit} in {literal(first)}, {b:.3g} in {literal(last)}."
        )
    told = [sharing_words(s) for s in sharing.vehicles[:MOST_VEHICLES]]
    if told and sharing.left_out:
        names = first_few([literal(n) for n in sharing.left_out], MOST_VEHICLES)
        told.append(f"{names} {'does' if len(sharing.left_out) == 1 else 'do'} not count for coefficients.")
    return " ".join([text, *told])


def _bundles(records: Mapping[str, Mapping[str, Any]]) -> Table:
    rows = []
    for name, r in records.items():
        shrink = r["gap"].get("shrink")
        named = "; ".join(_told(e) for e in r["effects"] if e["parameters"])
        rows.append([
            name, r["trial"]["vehicle"], verdict_words(r), named or None,
            max((e["probability"] for e in r["effects"]), default=None),
            None if shrink is None else f"{shrink:.0%}",
        ])  # fmt: skip
    columns = ["bundle", "vehicle", "verdict", "effects", "P", "gap closes by"]
    return Table(columns, rows, "In the order of their names. Each folder holds its own report.", digits=3)


def _effects(effects: Sequence[SharedEffect]) -> list[Any]:
    if not effects:
        return [Text("No effect acts, more probably than not, in any bundle.")]
    rows = [
        [s.vehicle or "all", _name(s.effect), f"{s.acting}/{s.bundles}", s.mean, first_few(s.names, FEW)]
        for s in effects
    ]
    about = "Bundles in which an effect acts more probably than not, and its mean probability over all."
    return [Table(["vehicle", "effect", "in question in", "mean P", "bundles"], rows, about, digits=2)]


def _parameters(parameters: Sequence[SharedParameter]) -> list[Any]:
    if not parameters:
        return [Text("No effect is named in two bundles of one vehicle.")]
    rows = []
    for p in parameters:
        each = "; ".join(f"{n} {digits(v, 3)} ± {digits(s, 1)}" for n, v, s in p.each[:FEW])
        state = "changed" if p.changed else "the same"
        rows.append([p.vehicle, f"{_name(p.effect)}: {p.parameter}", p.value, p.sd, p.unit, p.p, state, each])
    columns = ["vehicle", "parameter", "mean", "sd", "unit", "p", "", "by bundle"]
    about = (
        "Mean weighted by 1/sd². p is the probability of such differences if there were one value "
        f"(Cochran's Q); below {CHANGED:g} it changed, or an error is larger than stated."
    )
    return [Table(columns, rows, about, digits=3)]


def _told(effect: Mapping[str, Any]) -> str:
    parts = [
        f"{n} {digits(p['value'], 3)} ± {digits(p['sd'], 1)} {p['unit']}"
        for n, p in effect["parameters"].items()
    ]
    return f"{_name(effect['name'])} ({', '.join(parts)})"


def _name(effect: str) -> str:
    return effect.replace("_", " ")
