"""The report of the study of gaps: one told in full, planted ones, published numbers, real logs.

Takes what `studies/sim_to_real_gap/run.py` gathered, as plain data. Does not diagnose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.diagnosis.holdout import at_floor
from bayesid.report.writer import Report, Section, Table, Text
from studies.sim_to_real_gap.delphin2_section import delphin2_section
from studies.sim_to_real_gap.example_section import example_section
from studies.sim_to_real_gap.real_sections import lost_words

_RIGHT = {"none": "none", "outside": "outside"}


def gap_report(parts: Mapping[str, Any]) -> Report:
    """Report of the parts that were run: "example", "planted", "delphin2", and more sections ready-made."""
    rows = parts["planted"]
    judged = [judge(row) for row in rows]
    measured = "delphin2" in parts or bool(parts.get("more"))
    others = ", measured ones whose cause nobody planted" if measured else ""
    many = f"{len(rows)} gaps" if len(rows) != 1 else "one gap"
    lead = (
        f"**{' '.join(filter(None, parts['example']['said']))}**\n\n"
        "That is what `bayesid diagnose` says of a log of a small vehicle that comes with the package: a gap "
        f"between simulator and log, followed to its cause below{others}, and {many} planted beside it. "
        "Plants share no code with the diagnosed model; a diagnosis saw orders, noisy readings and the "
        f"nominal vehicle, and read held-out runs after its verdict. {_score(judged, rows)}"
    )
    failures = [words] if (words := lost_words(parts.get("lost", ()))) else []
    sections = [
        example_section(parts["example"]),
        planted_section(rows, judged),
        *([delphin2_section(parts["delphin2"])] if "delphin2" in parts else []),
        *parts.get("more", ()),
    ]
    return Report("From a gap to its cause", lead, sections, failures)


def _score(judged: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """How the planted gaps came out, in a sentence for any number of them."""
    if len(judged) == 1:
        return f"The planted gap ({_planted(rows[0])}) came out so: {judged[0]}."
    right, wrong = judged.count("right"), judged.count("wrong name")
    return f"**Of the {len(judged)} planted gaps {right} came out right and {wrong} got a wrong name.**"


def planted_section(rows: Sequence[Mapping[str, Any]], judged: Sequence[str]) -> Section:
    """What was planted, what was said, how far it shrank."""
    table = [
        [
            row["vehicle"],
            row["sea"],
            _planted(row),
            row["found"]["verdict"].replace("_", " "),
            ", ".join(_words(n) for n in row["found"]["set95"]),
            _parameters(row),
            outcome,
        ]
        for row, outcome in zip(rows, judged, strict=True)
    ]
    return Section(
        "Planted gaps",
        [
            Text(
                "Each campaign has its own coefficients, drawn about the nominal vehicle, its own sea and "
                "sensor "
                "noise, six runs to identify from and two held out."
            ),
            Table(
                ["vehicle", "sea", "planted", "verdict", "95 % set", "found (planted)", "outcome"],
                table,
                "An honest set that holds the cause counts as right; a wrong name is the worst outcome.",
            ),
            Table(
                ["planted", "horizon", "nominal", "recalibrated", "best explanation", "shrinks by"],
                [_horizon_row(row) for row in rows],
                "Held-out runs: mean squared prediction error above the floor, in noise variances, over the "
                "shortest horizon with a sure gap. Where re-tuned coefficients leave little, the right name "
                "adds nothing over so short a time; all horizons are in results.json. The best explanation "
                "may hold more effects than are sure enough to be named.",
            ),
        ],
    )


def _horizon_row(row: Mapping[str, Any]) -> list[Any]:
    """Shortest horizon over which the gap before is sure, else the shortest."""
    found = row["found"]
    if not found["gap"]["horizons"]:
        return [_planted(row), "", None, None, None, "no held-out run"]
    h = next((h for h in found["gap"]["horizons"] if h["worth_shrinking"]), found["gap"]["horizons"][0])
    start = [_planted(row), h["horizon"]]
    nominal, tuned, now = (at_floor(h["excess"][k]) for k in ("nominal", "recalibrated", "with effect"))
    if found["verdict"] not in ("effect", "effect_with_remainder", "several"):
        return [*start, nominal, tuned, "none named", ""]
    if h["shrink"] is None or not h["worth_shrinking"]:
        unsure = "gap not sure: too few pieces" if tuned != "at the floor" else "nothing to shrink"
        return [*start, nominal, tuned, now, unsure]
    low, high = h["interval"]
    between = "" if low is None or high is None else f" ({low:.0%} to {high:.0%})"
    return [*start, nominal, tuned, now, f"{h['shrink']:.0%}{between}"]


def _planted(row: Mapping[str, Any]) -> str:
    return " + ".join(_words(n) for n in row["planted"]) or "nothing"


def _words(name: str) -> str:
    return name.replace("_", " ")


def judge(row: Mapping[str, Any]) -> str:
    """right, in part, not found, not sure or wrong name."""
    found, planted, kind = row["found"], set(row["planted"]), row["kind"]
    named = {e["name"] for e in found["effects"]}
    if kind in _RIGHT:
        if found["verdict"] == _RIGHT[kind]:
            return "right"
        return "wrong name" if found["verdict"] in ("effect", "several") else "not sure"
    if found["verdict"] in ("effect", "effect_with_remainder", "several"):
        if planted <= named:
            return "right"
        return "in part" if planted & named else "wrong name"
    return "right" if planted & set(found["set95"]) and "none" not in found["set95"] else "not found"


def _parameters(row: Mapping[str, Any]) -> str:
    true = {e["name"]: e["parameters"] for e in row["truth"]["effects"]}
    parts = []
    for effect in row["found"]["effects"]:
        for name, p in effect["parameters"].items():
            unit = "" if p["unit"] == "-" else f" {p['unit']}"
            planted = true.get(effect["name"], {}).get(name)
            beside = "" if planted is None else f" ({planted:.3g})"
            parts.append(f"{_words(name)} {p['value']:.3g} ± {p['sd']:.1g}{unit}{beside}")
    return "; ".join(parts)
