"""The report of a blind check: bars, calibration, confusion, shrink, and every miss with its reason.

Takes a `Sheet` as plain attributes. Does not score.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.benchmark.protocol import figures
from bayesid.report.writer import Figure, Report, Section, Table, Text

RIGHT = ("right", "rejected")
COLUMNS = (
    "",
    "bundles",
    "right",
    "first answer right",
    "set holds it",
    "set size",
    "wrong names",
    "log score",
)


BARS_ARE = (
    "A bar is met when the score itself is within it, undecided when the score misses it and its 95 % "
    "interval holds it (which few cases make easy), and missed otherwise."
)


def blind_report(sheet: Any, extra: Sequence[Section] = (), title: str = "Blind check") -> Report:
    """Report of a scorecard; `extra` sections follow the scores (baselines, say)."""
    sections = [
        Section("Bars", bars_blocks(sheet)),
        *extra,
        Section("By detectability and factors", _strata(sheet)),
    ]
    sections += [
        Section("Calibration", _calibration(sheet)),
        Section("What was taken for what", _confusion(sheet.cases)),
        Section("How far the gap shrank", _shrink(sheet.cases)),
        Section("Parameters", _parameters(sheet.cases)),
        Section("Every miss, and why", _gallery(sheet.cases)),
        Section("Commitments and versions", _commitments_and_versions(sheet)),
    ]
    return Report(title, _lead(sheet), sections, failures(sheet.quantities))


def results(sheet: Any) -> dict[str, Any]:
    """Plain data of a sheet."""
    return {
        "sealed": sheet.committed is not None,
        "caveats": list(sheet.caveats),
        "quantities": {str(d): list(q) for d, q in sheet.quantities.items()},
        "calibration": list(sheet.calibration),
        "control": sheet.control,
        "missing": list(sheet.missing),
        "cases": list(sheet.cases),
    }


def _lead(sheet: Any) -> str:
    cases = sheet.cases
    counted = "; ".join(_counted(dof, rows, cases) for dof, rows in sheet.quantities.items())
    named = [c for c in cases if c.named]
    wrong = sum(bool(c.named - c.right) for c in named)
    nulls = [c for c in cases if c.kind == "none"]
    alarms = sum(c.word != "none" for c in nulls)
    text = (
        f"**{wrong} of {len(named)} verdicts that name an effect name a wrong one; {alarms} of {len(nulls)} "
        f"bundles without any effect raised an alarm.** {counted}."
    )
    if sheet.committed is None:
        text += " These verdicts are **not committed**: a development score, no blind check."
    if sheet.committed is not None and sheet.missing:
        text += (
            f" {len(sheet.missing)} bundles were not solved in the time given and are left out, whatever "
            "their answers."
        )
    text += "".join(f" **{sentence}**" for sentence in sheet.caveats)
    if not sheet.control.count:
        text += " Verdicts exchanged between bundles, the control, were not scored: none has a single effect."
    elif sheet.control.standing != "missed":
        text += " **The control did not fail**: with so few bundles these scores show nothing."
    return text


def failures(quantities: Mapping[int, Sequence[Any]]) -> list[str]:
    """Every bar that is missed, by degrees of freedom."""
    return [
        f"{q.name[:1].upper()}{q.name[1:]}: {f'{q.hits} of {q.count}' if q.hits >= 0 else f'{q.value:.3g}'}, "
        f"bar {bar_text(q)} ({q.about}; {dof} degrees of freedom)."
        for dof, rows in quantities.items()
        for q in rows
        if q.standing == "missed"
    ]


def _counted(dof: int, rows: Sequence[Any], cases: Sequence[Any]) -> str:
    """Bars met, undecided and missed of one number of degrees of freedom."""
    return standings(dof, [q.standing for q in rows], sum(c.dof == dof for c in cases))


def standings(dof: int, words: Sequence[str], bundles: int) -> str:
    """How many bars of one number of degrees of freedom are met, undecided and missed, in words."""
    barred = [word for word in words if word]
    met, undecided, missed = (barred.count(word) for word in ("met", "undecided", "missed"))
    return (
        f"{dof} degrees of freedom, {bundles} bundles: of {len(barred)} bars {met} met, "
        f"{undecided} undecided, {missed} missed"
    )


def bar_text(quantity: Any) -> str:
    """The bar in words."""
    if quantity.bar is None:
        return "–"
    low, high = quantity.bar
    if math.isfinite(low) and math.isfinite(high):
        return f"{low:g} to {high:g}"
    return f"≥ {low:g}" if math.isfinite(low) else f"≤ {high:g}"


def quantity_row(q: Any) -> list[Any]:
    """Cells of one quantity."""
    count = f"{q.hits}/{q.count}" if q.hits >= 0 else f"{q.count}"
    interval = "–" if q.count == 0 else f"{q.interval[0]:.3g} to {q.interval[1]:.3g}"
    return [
        q.name, q.about, q.value if q.count else None, count, interval, bar_text(q), q.standing or "–",
    ]  # fmt: skip


def bars_blocks(sheet: Any) -> list[Any]:
    """Every quantity of a sheet with its bar."""
    blocks: list[Any] = [
        Text(
            f"{BARS_ARE} D is the noncentrality of the planted cause at its true size, computed from the "
            "noise-free answer of the true vehicle; below 25 the right answer is no gap, or a set that holds "
            "the cause."
        )
    ]
    for dof, rows in sheet.quantities.items():
        shown = [quantity_row(q) for q in rows]
        if dof == min(sheet.quantities):
            shown.append(quantity_row(sheet.control))
        blocks.append(Table(["quantity", "over", "score", "cases", "95 % interval", "bar", ""], shown,
                            f"{dof} degrees of freedom.", digits=3))  # fmt: skip
    return blocks


def _strata(sheet: Any) -> list[Any]:
    return [Table(COLUMNS, rows, f"{name}.", digits=3) for name, rows in sheet.strata.items()]


def _calibration(sheet: Any) -> list[Any]:
    bins = sheet.calibration
    rows = []
    for b in bins:
        interval = f"{b.interval[0]:.2f} to {b.interval[1]:.2f}"
        rows.append([b.stated, b.hit, b.count, interval, b.standing])
    stated, hit = (np.array([getattr(b, k) for b in bins]) for k in ("stated", "hit"))
    low, high = (np.array([b.interval[k] for b in bins]) for k in (0, 1))
    picture = figures.calibration(stated, hit, low, high, [b.count for b in bins])
    return [
        Figure("calibration", picture, "Most probable answer: stated probability that it acts, alone or with "
               "others, against how often it was right (none counts where D < 25); numbers are bundles per "
               "bin."),
        Table(["stated", "right", "bundles", "95 % interval", "within 0.07"], rows, "Bins.", digits=3),
    ]  # fmt: skip


def _confusion(cases: Sequence[Any]) -> list[Any]:
    single = [c for c in cases if c.kind in ("none", "effect", "variant", "outside")]
    rows = sorted({next(iter(c.right)) for c in single}, key=_order)
    columns = sorted({*rows, *(c.top for c in single)}, key=_order)
    counts = np.zeros((len(rows), len(columns)))
    for c in single:
        counts[rows.index(next(iter(c.right))), columns.index(c.top)] += 1
    words = [n.replace("_", " ") for n in rows]
    picture = figures.confusion(words, [n.replace("_", " ") for n in columns], counts)
    spread: dict[str, dict[str, int]] = {}
    for c in single:
        spread.setdefault(next(iter(c.right)), {}).setdefault(c.fate, 0)
        spread[next(iter(c.right))][c.fate] += 1
    fates = (
        "right",
        "nearest rival",
        "other family",
        "none",
        "outside",
        "coefficients",
        "cannot tell",
        "failed",
    )
    table = [[n.replace("_", " "), *(spread[n].get(f, 0) for f in fates)] for n in rows]
    return [
        Figure("confusion", picture, "Most probable family of the diagnosis per planted family."),
        Table(["planted", *fates], table, "Verdicts per planted family; the nearest rival is the family with "
              "the smallest expected margin, computed before any verdict."),
    ]  # fmt: skip


def _order(name: str) -> tuple[int, str]:
    return {"none": 0, "outside": 2}.get(name, 1), name


def _shrink(cases: Sequence[Any]) -> list[Any]:
    def of(test: Any) -> np.ndarray:
        return np.array([c.shrink for c in cases if test(c) and math.isfinite(c.shrink)])

    values = {
        "right": of(lambda c: c.outcome == "right"),
        "wrong name": of(lambda c: c.outcome in ("wrong name", "in part")),
        "neither": of(lambda c: c.outcome not in ("right", "wrong name", "in part")),
    }
    rows = [[n, len(x), *(float(np.quantile(x, q)) if len(x) else None for q in (0.1, 0.5, 0.9))]
            for n, x in values.items()]  # fmt: skip
    blocks: list[Any] = [Table(["outcome", "bundles", "10th percentile", "median", "90th percentile"], rows,
                               "Shrink of the held-out gap, where there was one.", digits=3)]  # fmt: skip
    if any(len(x) for x in values.values()):
        blocks.insert(
            0, Figure("shrink", figures.shrink(values), "Share of bundles whose gap closed by less.")
        )
    planted = [c for c in cases if c.planted and math.isfinite(c.noncentrality)]
    if planted:
        kinds = {o: np.array([c.noncentrality for c in planted if c.outcome == o])
                 for o in sorted({c.outcome for c in planted})}  # fmt: skip
        blocks.append(
            Figure("outcomes", figures.outcomes(kinds, 25.0), "Outcome by detectability of the cause.")
        )
    return blocks


def _parameters(cases: Sequence[Any]) -> list[Any]:
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for c in cases:
        for effect, name, error, sds in c.parameters:
            found.setdefault((effect, name), []).append((error, sds))
    rows = []
    for (effect, name), pairs in sorted(found.items()):
        errors = [abs(e) for e, _ in pairs if math.isfinite(e)]
        sds = [abs(s) for _, s in pairs if math.isfinite(s)]
        rows.append([effect, name, len(pairs), float(np.median(errors)) if errors else None,
                     sum(s <= 2 for s in sds), max(sds, default=None)])  # fmt: skip
    columns = ["effect", "parameter", "bundles", "median relative error", "within 2 sd", "worst, in sd"]
    return [Table(columns, rows, "Parameters of effects that were rightly named.", digits=3)]


def _gallery(cases: Sequence[Any]) -> list[Any]:
    rows = [
        [c.name, " + ".join(c.planted) or "none", ", ".join(f"{s:.2g}" for s in c.sizes),
         c.noncentrality if math.isfinite(c.noncentrality) else None,
         c.word + (f": {', '.join(sorted(c.named))}" if c.named else ""), c.p_right, c.outcome, c.reason]
        for c in sorted(cases, key=lambda c: (c.outcome, c.name))
        if c.outcome not in RIGHT
    ]  # fmt: skip
    tally: dict[str, int] = {}
    for c in cases:
        tally[c.outcome] = tally.get(c.outcome, 0) + 1
    tallied = ", ".join(f"{n} {o}" for o, n in sorted(tally.items(), key=lambda kv: -kv[1]))
    return [
        Text(f"Of {len(cases)} bundles: {tallied}."),
        Table(["bundle", "planted", "size", "D", "verdict", "P(true)", "outcome", "why"], rows, "", digits=3),
    ]


def _commitments_and_versions(sheet: Any) -> list[Any]:
    if sheet.committed is None:
        text = "The verdicts carry no commitment."
        if sheet.missing:
            text += f" {len(sheet.missing)} answers have no verdict yet and are left out."
        return [Text(text)]
    s: Mapping[str, Any] = sheet.committed
    codes = sorted({c.get("code", "") for c in s["cost"].values()})
    committed = (
        "and every answer is the one committed to" if s["pack"]["commitments"] else "without commitments"
    )
    failed = "; ".join(f"{n}: {m}" for n, m in s["failures"].items())
    return [
        Text(f"{len(s['verdicts'])} verdicts, committed {s['sealed']} as `{s['seal'][:16]}`, unchanged since, "  # noqa: E501
             f"{committed}. Versions: " + ", ".join(f"{k} {v}" for k, v in s["versions"].items())
             + f". States of the deciding code: {', '.join(codes)}."
             + (f" Failed: {failed}." if failed else "")),
    ]  # fmt: skip
