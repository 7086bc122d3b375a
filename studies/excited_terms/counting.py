"""Counts over cases: confusion matrices, shares with intervals, and what the controls say.

Takes the rows of every case. Does not simulate or choose sentences.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

SHOWN = 12.25  # nats: two prices of a column, so that evidence alone would take it
VERDICTS = ("found", "found in a group", "cannot tell", "not needed", "not excited")
TRUTHS = ("absent", "acts, shows less", "acts and shows")
BANDS = ((0.0, 0.25), (0.25, 0.75), (0.75, 1.01))
OURS, STEPWISE, PLAIN = "PySINDy", "stepwise selection", "control: plain ensemble"
RESAMPLED = 1000
Row = Mapping[str, Any]
Case = Mapping[str, Any]


def verdict_of(row: Row) -> str:
    """PySINDy's verdict on one term."""
    return "found in a group" if row["pysindy"] == "found" and len(row["group"]) > 1 else str(row["pysindy"])


def stepwise_of(row: Row) -> str:
    """The verdict of stepwise selection, "uncertain" as "cannot tell"."""
    return "cannot tell" if row["stepwise"] == "uncertain" else str(row["stepwise"])


def plain_of(row: Row) -> str:
    """The control: kept by 80 % of PySINDy's ensemble of single rows."""
    return "found" if row["plain"] >= 0.8 else "not needed" if row["plain"] <= 0.2 else "cannot tell"


JUDGES: dict[str, Callable[[Row], str]] = {OURS: verdict_of, STEPWISE: stepwise_of, PLAIN: plain_of}


def truth_of(row: Row) -> str:
    return "absent" if not row["acts"] else TRUTHS[2] if row["shows"] >= SHOWN else TRUTHS[1]


def matrix(rows: Iterable[Row], judge: Callable[[Row], str]) -> dict[str, dict[str, int]]:
    """truth -> verdict -> count."""
    found = {t: dict.fromkeys(VERDICTS, 0) for t in TRUTHS}
    for row in rows:
        found[truth_of(row)][judge(row)] += 1
    return found


def share(
    cases: Sequence[Case], among: Callable[[Row], bool], hit: Callable[[Row], bool], seed: int = 0
) -> dict[str, float]:
    """Hits among some rows with a 95 % interval: the wider of Clopper-Pearson's and that of whole cases
    resampled, since the terms of one case are judged from one record.

    Returns
    -------
    hits, of, low, high; low and high are nan where nothing is counted
    """
    pairs = [[hit(r) for r in c["terms"] if among(r)] for c in cases]
    hits, counts = np.array([sum(p) for p in pairs]), np.array([len(p) for p in pairs])
    total, number = int(hits.sum()), int(counts.sum())
    if not number:
        return {"hits": 0, "of": 0, "low": float("nan"), "high": float("nan")}
    low = float(beta.ppf(0.025, total, number - total + 1)) if total else 0.0
    high = float(beta.ppf(0.975, total + 1, number - total)) if total < number else 1.0
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(pairs), (RESAMPLED, len(pairs)))
    many = counts[drawn].sum(axis=1)
    shares = hits[drawn].sum(axis=1)[many > 0] / many[many > 0]
    ends = np.percentile(shares, [2.5, 97.5])
    return {"hits": total, "of": number, "low": min(low, float(ends[0])), "high": max(high, float(ends[1]))}


def permuted(cases: Sequence[Case], seed: int) -> list[dict[str, Any]]:
    """Cases whose truth is dealt out anew among the terms of each axis: no verdict can be right of it."""
    rng = np.random.default_rng(seed)
    out = []
    for case in cases:
        terms: list[dict[str, Any]] = []
        for axis in dict.fromkeys(r["name"][0] for r in case["terms"]):
            some = [r for r in case["terms"] if r["name"][0] == axis]
            order = rng.permutation(len(some))
            terms += [
                {**r, "acts": some[k]["acts"], "shows": some[k]["shows"]}
                for r, k in zip(some, order, strict=True)
            ]
        out.append({**case, "terms": terms})
    return out


def wrong_and_caught(cases: Sequence[Case], judge: Callable[[Row], str]) -> dict[str, dict[str, float]]:
    """Shares a judge is measured by."""
    return {
        "found singly and absent": share(cases, lambda r: judge(r) == "found", lambda r: not r["acts"]),
        "shows and found singly": share(
            cases, lambda r: truth_of(r) == TRUTHS[2], lambda r: judge(r) == "found"
        ),
        "shows and found": share(
            cases, lambda r: truth_of(r) == TRUTHS[2],
            lambda r: judge(r) in ("found", "found in a group"),
        ),
        "shows and not needed": share(
            cases, lambda r: truth_of(r) == TRUTHS[2], lambda r: judge(r) in ("not needed", "not excited")
        ),
        "not needed and shows": share(
            cases, lambda r: judge(r) == "not needed", lambda r: truth_of(r) == TRUTHS[2]
        ),
    }  # fmt: skip


def counted(cases: Sequence[Case], seed: int = 0) -> dict[str, Any]:
    """All numbers of the report."""
    rows = [r for c in cases for r in c["terms"]]
    values = [
        abs(r["value"] - r["true"]) / r["sd"] for r in rows
        if verdict_of(r) == "found" and r["acts"] and r["sd"]
    ]  # fmt: skip
    dealt = permuted(cases, seed)
    empty = Counter(s for c in cases for s in c["white_force"])
    return {
        "cases": len(cases),
        "terms": len(rows),
        "matrices": {name: matrix(rows, judge) for name, judge in JUDGES.items()},
        "shares": {name: wrong_and_caught(cases, judge) for name, judge in JUDGES.items()}
        | {"control: labels permuted": wrong_and_caught(dealt, verdict_of)},
        "white_force": {"found": empty["found"], "of": sum(empty.values())},
        "groups": groups_of(cases),
        "values": {"within 3 sd": int(np.sum(np.array(values) <= 3)), "of": len(values)},
        "fisher": by_fisher(rows),
        "by": {
            "manoeuvre": _by(cases, lambda c: " + ".join(c["runs"])),
            "truth": _by(cases, lambda c: c["truth"]),
            "vehicle": _by(cases, lambda c: c["vehicle"]),
        },
        "absent_found": dict(
            Counter(r["name"] for r in rows if verdict_of(r) == "found" and not r["acts"]).most_common()
        ),
        "seconds": {k: float(np.mean([c["seconds"][k] for c in cases])) for k in ("pysindy", "stepwise")},
    }


def groups_of(cases: Sequence[Case]) -> dict[str, float]:
    """Groups of two terms and more that are found: how many hold a term that acts, and how large they are."""
    sizes, right = [], 0
    for case in cases:
        acting = {r["name"] for r in case["terms"] if r["acts"]}
        found = {tuple(r["group"]) for r in case["terms"] if verdict_of(r) == "found in a group"}
        sizes += [len(g) for g in found]
        right += sum(bool(acting & set(g)) for g in found)
    median = float(np.median(sizes)) if sizes else 0.0
    return {"found": len(sizes), "with a term that acts": right, "median size": median}


def by_fisher(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Verdicts on terms of the vehicle file by what whole tracks say of the coefficient, acting and "
    "absent."""
    out = {}
    for acts in (True, False):
        for low, high in BANDS:
            some = [r for r in rows if r["acts"] == acts and r["fisher"] is not None
                    and low <= r["fisher"] < high]  # fmt: skip
            key = f"{'acts' if acts else 'absent'}, {low:g} to {min(high, 1):g}"
            out[key] = {v: sum(verdict_of(r) == v for r in some) for v in VERDICTS}
    return out


def _by(cases: Sequence[Case], key: Callable[[Case], str]) -> dict[str, dict[str, int]]:
    out: dict[str, dict[str, int]] = {}
    for name in dict.fromkeys(key(c) for c in cases):
        table = matrix((r for c in cases if key(c) == name for r in c["terms"]), verdict_of)
        shown = table[TRUTHS[2]]
        out[name] = {
            "found singly": sum(table[t]["found"] for t in TRUTHS),
            "of these absent": table["absent"]["found"],
            "terms that show": sum(shown.values()),
            "found": shown["found"], "in a group": shown["found in a group"],
            "cannot tell": shown["cannot tell"], "missed": shown["not needed"] + shown["not excited"],
        }  # fmt: skip
    return out
