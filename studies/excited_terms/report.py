"""Report of the excited terms: what PySINDy names rightly, what it misses, and what the controls say.

Takes the counts. Does not count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.excited_terms import figures
from studies.excited_terms.counting import OURS, PLAIN, SHOWN, STEPWISE, TRUTHS, VERDICTS

PERMUTED = "control: labels permuted"
BAR_WRONG = 0.05  # of the terms found singly, absent: the rate at which one would trust a single find


def told(s: Mapping[str, float]) -> str:
    """ "1 of 115 (1 %; 0 to 5)"."""
    if not s["of"]:
        return "none"
    low, high = _round(s["low"]), _round(s["high"])
    return f"{s['hits']} of {s['of']} ({100 * s['hits'] / s['of']:.0f} %; {low} to {high})"


def _round(x: float) -> str:
    return f"{100 * x:.0f}"


def excited_terms_report(
    cases: Sequence[Mapping[str, Any]], numbers: Mapping[str, Any], quick: bool = False
) -> Report:
    """The report as plain data."""
    ours, table = numbers["shares"][OURS], numbers["matrices"][OURS]
    caught, missed = ours["shows and found"], ours["shows and not needed"]
    single = ours["found singly and absent"]
    lead = (
        f"**Of {single['of']} terms that PySINDy names singly {single['hits']} do not act "
        f"({_round(single['low'])} to {_round(single['high'])} %, 95 % interval).** Of {caught['of']} terms "
        "that act and "
        f"show it names {ours['shows and found singly']['hits']} singly and "
        f"{caught['hits'] - ours['shows and found singly']['hits']} in a group, cannot tell "
        f"{table[TRUTHS[2]]['cannot tell']} and calls {missed['hits']} not needed "
        f"({_round(missed['low'])} to {_round(missed['high'])} %). {numbers['cases']} cases, "
        f"{numbers['terms']} terms."
    )
    designed = numbers.get("designed", numbers["cases"])
    if numbers["cases"] < designed:
        lead += f" These cases were taken at random from {designed}; the others were not run."
    if quick:
        lead += " A quick run of few cases: it decides nothing."
    first = [
        Figure(
            "verdicts",
            figures.verdict_shares(numbers["matrices"]),
            "Verdicts on terms that are absent, that act and show less, and that act and show. A judge is "
            "right where "
            "the dark bar is long in the lowest row and missing in the highest. The plain ensemble is a "
            "control: it "
            "names what is not there.",
        )
    ]
    sections = [
        _shares_section(numbers),
        _matrices_section(numbers),
        _fisher_section(numbers),
        _by_section(numbers),
    ]
    return Report(
        "Does PySINDy name the terms that act, and none that do not?",
        lead,
        sections,
        failures=failures(numbers, quick),
        first=first,
    )


def failures(numbers: Mapping[str, Any], quick: bool) -> list[str]:
    """What the classifier gets wrong, and controls that did not fail."""
    ours, out = numbers["shares"][OURS], []
    wrong = ours["found singly and absent"]
    if wrong["hits"]:
        names = ", ".join(f"{n} ({k})" for n, k in list(numbers["absent_found"].items())[:6])
        beyond = (
            "" if wrong["high"] <= BAR_WRONG else f"; the interval does not exclude {100 * BAR_WRONG:.0f} %"
        )
        out.append(f"Named singly and absent: {told(wrong)}{beyond}. Most often: {names}.")
    g = numbers["groups"]
    if lost := g["found"] - g["with a term that acts"]:
        out.append(
            f"{lost} of {g['found']} groups said to be needed hold no term that acts. A group is a weak "
            "statement: "
            f"half have {g['median size']:g} terms and more."
        )
    if ours["shows and not needed"]["hits"]:
        out.append(
            'Terms that show and are called "not needed" or "not excited": '
            f"{told(ours['shows and not needed'])}."
        )
    v = numbers["values"]
    if v["of"] and v["within 3 sd"] < 0.95 * v["of"]:
        out.append(
            f"The spreads of single terms are too small: {v['within 3 sd']} of {v['of']} values lie within 3 "
            "of them. Values come from fits, not from here."
        )
    empty = numbers["white_force"]
    if empty["found"]:
        out.append(
            f"Of a force of white noise {empty['found']} of {empty['of']} terms are found; none should be."
        )
    for name in (PLAIN, PERMUTED):
        control = numbers["shares"][name]["found singly and absent"]
        if control["of"] and control["low"] <= wrong["high"] and not quick:
            out.append(f"The {name} did not fail: {told(control)}.")
    return out


def _shares_section(numbers: Mapping[str, Any]) -> Section:
    rows = [[name, *(told(s) for s in row.values())] for name, row in numbers["shares"].items()]
    columns = ["judge", *next(iter(numbers["shares"].values()))]
    g, v, s = numbers["groups"], numbers["values"], numbers["seconds"]
    empty = numbers["white_force"]
    text = (
        "Hits, the number they are of, and a 95 % interval: the wider of Clopper and Pearson's and that of "
        "whole "
        "cases resampled. Two controls must fail: PySINDy's ensemble over single rows with a threshold "
        "on single terms, and PySINDy's verdicts beside a truth dealt out anew among the terms of each "
        "axis. A third "
        f"must be silent: beside a force of white noise {empty['found']} of {empty['of']} terms are found. "
        f"{g['with a term that acts']} of {g['found']} groups found hold a term that acts; the median group "
        "has "
        f"{g['median size']:g} terms. Values of terms found singly lie within 3 of their spreads in "
        f"{v['within 3 sd']} of {v['of']}. Processor time a case: PySINDy {s['pysindy']:.1f} s, {STEPWISE} "
        f"{s['stepwise']:.1f} s."
    )
    return Section("Right, wrong, missed", [Text(text), Table(columns, rows)])


def _matrices_section(numbers: Mapping[str, Any]) -> Section:
    text = (
        f"A term shows where who knows which others act would gain {SHOWN:g} nats and more by it: the Fisher "
        "information of the force balance with its noise, at the true coefficients."
    )
    head = ["truth", *VERDICTS]
    tables = [
        Table(head, [[t, *(table[t][k] for k in VERDICTS)] for t in TRUTHS], name)
        for name, table in numbers["matrices"].items()
    ]
    return Section("Confusion matrices", [Text(text), *tables])


def _fisher_section(numbers: Mapping[str, Any]) -> Section:
    text = (
        "Terms of the vehicle file, by the share of the runs in the variance of the coefficient when whole "
        "tracks are "
        "fitted with a prior of 10 %: 1 where the runs decide, 0 where the prior does. The two ask different "
        "questions: a term may be needed while its number stays the prior's, and a number may be known of a "
        "term "
        "that is zero."
    )
    rows = [[k, *(row[c] for c in VERDICTS)] for k, row in numbers["fisher"].items()]
    return Section(
        "Beside Fisher information of the tracks",
        [Text(text), Table(["truth, share of the runs", *VERDICTS], rows, OURS)],
    )


def _by_section(numbers: Mapping[str, Any]) -> Section:
    blocks: list[Any] = [
        Text(
            "Truths: `as_built` has every row of the vehicle file with coefficients that differ by 20 %; "
            "`fewer` lacks "
            "half of the rows of second order, `linear` all of them; in `cubic` a term acts that the file "
            "lacks; in "
            "`other_inertia` the acceleration derivatives, which the regression takes from the file, differ "
            "by 10 %. "
            "Sensors of navigation grade."
        )
    ]
    for name, table in numbers["by"].items():
        columns = [name, *next(iter(table.values()))]
        blocks.append(Table(columns, [[k, *row.values()] for k, row in table.items()], f"{OURS}, by {name}."))
    return Section("By manoeuvre, truth and vehicle", blocks)
