"""What a check of the input found, in words, as a table and as a short report.

Takes an `InputCheck`. Does not judge.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Block, Report, Section, Table, Text, literal
from bayesid.trials.correction import join
from bayesid.trials.mistakes import InputCheck, InputFinding
from bayesid.words import and_list

TOLD = {
    "track": "the track against speed and heading", "course": "the course against the heading",
    "yaw": "the heading against the yaw rate", "depth": "the depth against speed and pitch",
    "pitch": "the pitch angle against its rate", "roll": "the roll angle against its rate",
    "rudder": "the turn after the rudder", "sway": "the side to which it slides in turns",
    "size": "the size of the numbers", "vehicle's speed": "the vehicle's speed at its revolutions",
    "vehicle's turn": "how the vehicle turns as it is steered",
    "vehicle's single fins": "how it turns, pitches and rolls for each fin",
    "vehicle's steering": "to which side the vehicle turns as it is steered",
    "vehicle's thrust": "whether the vehicle goes where its thrusters push it",
    "vehicle's drift": "how it slides as it turns",
    "vehicle's pitch": "how it pitches for its planes", "vehicle's heave": "how it heaves as it pitches",
    "fixes": "the fixes against the integrated velocities",
    "wind": "how the ship moves in it",
    "orders": "how it turns after its orders, beside the other runs",
}  # fmt: skip


def finding_sentence(finding: InputFinding) -> str:
    """One sentence: what is wrong, where, what tells it, how sure, and the line that mends it."""
    told_where = finding.correction is not None and finding.correction.names_runs
    where = "" if finding.all_runs or told_where else f" in {and_list(finding.runs)}"
    told = and_list([TOLD.get(k, k) for k in finding.told_by[:2]])
    also = (
        f"; these runs do not tell it from: {'; '.join(finding.also)} (that one of all these is wrong has "
        f"probability {_probability(finding.together)})"
        if finding.also
        else ""
    )
    if finding.instead:
        also += f"; a mistake of the simulator would explain it too: {'; '.join(finding.instead)}"
    sure = _probability(finding.probability)
    mend = "; ".join(finding.mend[1:])
    lost = "; the column has to be logged anew" if finding.channels else "; state the right vehicle"
    mend = f"; [corrections] {mend}" if mend else lost
    fit = ""
    if finding.before > 0 and finding.after < finding.before:
        fit = f", unexplained {finding.before:.2g} before and {finding.after:.2g} after"
    return f"{finding.says}{where} (probability {sure}; {told}{fit}){mend}{also}"


def joint_mend(check: InputCheck) -> str:
    """One table in place of several mends, as trial.toml has one; empty where there is one mend or none."""
    mends = [f.correction for f in check.findings if f.correction is not None]
    if len(mends) < 2:
        return ""
    one = join(mends)
    if one is None:
        return (
            "these mends cannot stand in one table [corrections] (other runs, or one channel twice): state "
            "the first, check again, and mend the rest in the log or in a bundle of its own"
        )
    return (
        f"all mends in one table of trial.toml: [corrections] {'; '.join(one.lines())}; where trial.toml has "
        "that table, its entries stay and these are added (factors on one channel are multiplied, offsets "
        "added); then check again"
    )


def in_order_line(check: InputCheck) -> str:
    """What was checked about the input and found in order, one line; empty where nothing was."""
    if not (check.in_order or check.unseen or check.noisy):
        return ""
    good = f"input checked: {', '.join(check.in_order)} in order" if check.in_order else "input checked"
    if check.unseen:
        good += f"; not to be checked: {', '.join(check.unseen)}"
    if check.noisy:
        why = "not to be checked for noise, little motion or what no mistake on the list explains"
        good += f"; {why}: {', '.join(check.noisy)}"
    return good


def check_record(check: InputCheck) -> dict[str, Any]:
    """Plain data."""
    return {
        "findings": [
            {
                "name": f.name, "what": f.says, "channels": list(f.channels), "runs": list(f.runs),
                "all_runs": f.all_runs, "probability": f.probability, "told_by": list(f.told_by),
                "unexplained": {"before": f.before, "after": f.after}, "mend": list(f.mend),
                "not_told_from": list(f.also), "together": f.together if f.also else f.probability,
                "simulator_instead": list(f.instead),
            }
            for f in check.findings
        ],
        "in_order": list(check.in_order),
        "not_checked": list(check.unseen),
        "too_noisy": list(check.noisy),
        "remarks": list(check.remarks),
        "left_open": list(check.left_open),
    }  # fmt: skip


def input_summary(
    check: InputCheck,
    reasons: Sequence[str],
    after: Mapping[str, Any] | None,
    verdict: str,
    headline: str = "",
) -> str:
    """What the terminal prints for a verdict on the input.

    Parameters
    ----------
    reasons : why there is not enough to say anything
    after : record of the diagnosis of the mended log; None where there was none
    headline : its answer in words
    """
    out = [f"verdict: {verdict}"]
    out += [f"  {_upper(finding_sentence(f))}" for f in check.findings]
    out += [f"  {_upper(reason)}" for reason in reasons]
    if joint := joint_mend(check):
        out.append(f"  {_upper(joint)}")
    if line := in_order_line(check):
        out.append(line)
    if check.findings:
        out.append(after_words(after, headline))
        out.append("--trust-input diagnoses the log as it is")
    return "\n".join(out)


def after_words(after: Mapping[str, Any] | None, headline: str = "") -> str:
    """What the gap looks like once the mend is applied in memory; `headline` is its answer in words."""
    if after is None:
        return "the log cannot be mended in memory, so nothing is said of a gap"
    verdict = after["verdict"]
    if verdict == "none":
        return "with that mended, no gap is left"
    if verdict == "model_form":
        return "with that mended, no cause is left beyond a force that the equations lack"
    if headline:
        return f"with that mended: {headline}"
    names = ", ".join(effect["name"] for effect in after.get("effects", ()))
    return f"with that mended, the verdict on the gap is {verdict}" + (f": {names}" if names else "")


def input_report(
    title: str, check: InputCheck, reasons: Sequence[str], after: Report | None, words: str, gap: str = ""
) -> Report:
    """A short report; the one of the mended log follows where there is one, `gap` is said first."""
    lead = f"**{literal(gap)}**\n\n" if gap else ""
    lead += "**The log does not say what its header says.** " if check.findings else ""
    lead += " ".join(f"{_upper(r)}." for r in reasons)
    lead += f" {_upper(words)}." if words and check.findings else ""
    blocks: list[Block] = []
    if check.findings:
        rows = [
            [
                f.says, ", ".join(f.channels), "all" if f.all_runs else ", ".join(f.runs),
                _probability(f.probability), and_list([TOLD.get(k, k) for k in f.told_by]),
            ]
            for f in check.findings
        ]  # fmt: skip
        blocks.append(Table(["what", "channels", "runs", "probability", "told by"], rows))
        for f in check.findings:
            if f.mend:
                blocks.append(Text("To mend it, in trial.toml:\n\n```\n" + "\n".join(f.mend) + "\n```"))
            if f.also:
                blocks.append(
                    Text(
                        f"These runs do not tell it from: {literal('; '.join(f.also))}. That one of all "
                        f"these is wrong has probability {_probability(f.together)}."
                    )
                )
    if joint := joint_mend(check):
        blocks.append(Text(f"{literal(_upper(joint))}."))
    if line := in_order_line(check):
        blocks.append(Text(_upper(line) + "."))
    sections = [Section("The input", blocks)]
    if after is not None:
        sections += [Section(f"Mended: {s.title}", s.blocks) for s in after.sections]
    return Report(f"Input of {literal(title)}", lead.strip(), sections)


def _probability(p: float) -> str:
    return "above 0.999" if p > 0.999 else f"{math.floor(p * 1000) / 1000:.3f}"


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
