"""The report of the verdicts on vehicles with other equations: counts first, then every bundle.

Takes scored verdicts of this code and of an earlier commit. Does not score.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.scores import STANDINGS, Quantity
from bayesid.report.writer import Report, Section, Table, Text, literal
from studies.other_equations.scoring import LARGE, LARGEST_SET, SMALL, ScoredVerdict, quantities

Cases = Sequence[ScoredVerdict]
Given = Mapping[str, Mapping[str, Any]]


def other_equations_report(
    cases: Cases, given: Given, before: Cases, before_given: Given, commit: str, quick: bool
) -> Report:
    """Report of the study.

    Parameters
    ----------
    given : verdicts behind `cases`, by bundle
    before, before_given, commit : the same bundles as an earlier commit judged them; may be fewer
    """
    sections = (
        Section("Bars", (_bars(cases, before, commit),)),
        Section("Every bundle", (_bundles(cases, given, before, before_given, commit),)),
        Section("Parameters of effects rightly named", (_parameters(cases),)),
        *_checks(cases, given),
        Section("How it was scored", (Text(_rules()), Text(_cost(given)))),
    )
    return Report("Vehicles made of other equations: are causes named and nothing invented?",
                  lead(cases, before, commit, quick), sections, failures(cases))  # fmt: skip


def lead(cases: Cases, before: Cases, commit: str, quick: bool) -> str:
    """What was found and what was invented, then bars and the same bundles before."""
    rows = quantities(cases)
    count = Counter(q.standing for q in rows)
    words = ", ".join(f"{count[s]} {s}" for s in STANDINGS)
    text = f"**{_found(cases)}** {_sentence(cases)} Bars: {words}."
    if count["undecided"]:
        text += f" Undecided: {_listed(rows, 'undecided')}."
    if before:
        same = [c for c in cases if c.name in {b.name for b in before}]
        now = f"; this code on the same: {sum(c.right for c in same)}" if len(same) < len(cases) else ""
        text += (
            f"\n\nCommit {commit} on {len(before)} of these bundles: {_found(before)} {_sentence(before)}"
            f"{now}"
        )
    return text + (" A quick run of a few bundles: it decides nothing." if quick else "")


def failures(cases: Cases) -> list[str]:
    """Every bar that is missed."""
    return [
        f"{q.name[:1].upper()}{q.name[1:]}: {q.hits} of {q.count} ({q.about})."
        for q in quantities(cases)
        if q.standing == "missed"
    ]


def _found(cases: Cases) -> str:
    """Causes found, names invented and false alarms in one sentence."""
    large, none = ([c for c in cases if c.regime == regime] for regime in ("large", "none"))
    names, wrong = sum(len(c.named) for c in cases), sum(len(c.wrong) for c in cases)
    parts = [
        f"of {len(large)} causes that stand clear of the error of the equations "
        f"{sum(c.right for c in large)} were found" if large else "",
        f"of {names} names given {wrong} are wrong" if names else "no cause was named",
        f"of {len(none)} trials without a cause {sum(not c.right for c in none)} raised a false alarm"
        if none else "",
    ]  # fmt: skip
    text = "; ".join(part for part in parts if part)
    return f"{text[:1].upper()}{text[1:]}."


def _sentence(cases: Cases) -> str:
    parts = [
        f"{sum(c.right for c in some)} of {len(some)} {words}"
        for regime, words in (
            ("large", f"effects more than {LARGE:g} times the form gap found"),
            ("middle", f"of {SMALL:g} to {LARGE:g} times found"),
            ("small", f"below {SMALL:g} not overclaimed"),
            ("none", "without a cause answered so"),
            ("outside", "unlisted causes answered outside"),
        )
        if (some := [c for c in cases if c.regime == regime])
    ]
    return f"{sum(c.right for c in cases)} of {len(cases)} verdicts keep the rule: {'; '.join(parts)}."


def _listed(rows: Sequence[Quantity], standing: str) -> str:
    return "; ".join(
        f"{q.name} ({q.hits} of {q.count}, {q.about})" for q in rows if q.standing == standing
    )  # fmt: skip


def _bars(cases: Cases, before: Cases, commit: str) -> Table:
    old = quantities(before)
    rows = []
    for new, was in zip(quantities(cases), old, strict=True):
        low, high = new.interval
        bar = "–"
        if new.bar is not None:
            bar = f">= {new.bar[0]:.0%}" if new.bar[1] > 1.0 else f"<= {new.bar[1]:.0%}"
        spread = f"{low:.0%} to {high:.0%}" if new.count else "–"
        then = f"{was.hits} of {was.count}" if before else "–"
        count = f"{new.hits} of {new.count}"
        rows.append([new.name, new.about, count, spread, bar, new.standing or "–", then])
    columns = ["what", "over", "count", "95 % interval", "bar", "standing", f"at {commit}"]
    return Table(
        columns, rows, "A bar is met by the share itself, undecided where only its interval reaches."
    )


def _bundles(cases: Cases, given: Given, before: Cases, before_given: Given, commit: str) -> Table:
    old = {c.name: c for c in before}
    rows = []
    for c in cases:
        was = old.get(c.name)
        rows.append([
            c.name, _words(c.truth), c.ratio if c.regime not in ("none",) else None,
            verdict_text(given[c.name]), _set_text(given[c.name]), f"{_yes(c.right)}: {c.how}",
            verdict_text(before_given[c.name]) if was else None,
            f"{_yes(was.right)}: {was.how}" if was else None,
        ])  # fmt: skip
    columns = ["bundle", "truth", "size over form gap", "verdict", "95 % set", "right?",
               f"verdict of {commit}", "right?"]  # fmt: skip
    about = "Size over form gap: change of the track by the effect over what the tuned nominal misses anyway."
    return Table(columns, rows, about, digits=3)


def verdict_text(verdict: Mapping[str, Any]) -> str:
    """Word and effects of a verdict with their probabilities."""
    if verdict.get("failure"):
        return f"failed: {verdict['failure']}"
    effects = ", ".join(f"{_words(e['name'])} {e['probability']:.2f}" for e in verdict["effects"])
    return _words(verdict["verdict"]) + (f": {effects}" if effects else "")


def _set_text(verdict: Mapping[str, Any]) -> str:
    return ", ".join(_words(n) for n in verdict.get("set95", ())) or "–"


def _words(name: str) -> str:
    return name.replace("_", " ").replace("+", " + ")


def _yes(x: bool) -> str:
    return "yes" if x else "no"


def _parameters(cases: Cases) -> Table:
    rows = [[c.name, _words(e), p, true, value, sd, inside]
            for c in cases for e, p, true, value, sd, inside in c.parameters]  # fmt: skip
    columns = ["bundle", "effect", "parameter", "true", "estimate", "sd", "inside 95 %"]
    return Table(columns, rows, "SI and radians; only what label and verdict both state.", digits=3)


def _checks(cases: Cases, given: Given) -> tuple[Section, ...]:
    """What the checks a diagnosis makes of itself say of its verdicts; nothing where they were not kept."""
    kept = [(c.right, given[c.name]["checks"]) for c in cases if given[c.name].get("checks")]
    if not kept:
        return ()
    rows = []
    for name in kept[0][1]:
        failed = [right for right, made in kept if made.get(name)]
        passed = [right for right, made in kept if not made.get(name)]
        rows.append([name, *(f"{sum(part)} of {len(part)}" for part in (failed, passed))])
    columns = ["check", "right verdicts where it failed", "where it passed"]
    about = "A check is worth its place where verdicts that fail it are wrong more often than others."
    return (Section("Checks a diagnosis makes of itself", (Table(columns, rows, about),)),)


def _rules() -> str:
    return (
        f"Effect over form gap above {LARGE:g}: the verdict names every cause and no other, with every "
        f"parameter inside its 95 % interval, or every cause is named or in a set of at most {LARGEST_SET} "
        "families beside a word that does not deny a cause. The same is counted between "
        f"{SMALL:g} and {LARGE:g}, without a bar. Below {SMALL:g} no name but the right one may be given; a "
        "verdict without a cause, or an open one that holds the cause or none, is right. Without a cause "
        f"right are `none`, `coefficients` and `{literal('model_form')}`; a cause outside the list is "
        "answered `outside`. Names count by family; every name of a verdict that names counts, also a "
        "second one that only stands for the form of the equations. The causes were planted and sized by "
        "whoever made the bundles; the diagnosis does not read the labels."
    )


def _cost(given: Given) -> str:
    cpu = [v["cpu_seconds"] for v in given.values() if v.get("cpu_seconds") is not None]
    failed = [f"{n} ({literal(v['failure'])})" for n, v in sorted(given.items()) if v.get("failure")]
    told = f" Not diagnosed: {'; '.join(failed)}." if failed else ""
    return f"Processor time per diagnosis: median {np.median(cpu):.0f} s, longest {max(cpu):.0f} s.{told}"
