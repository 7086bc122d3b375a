"""Ranks and coverage of every condition, with intervals, over all replicates and over those that converged.

Takes records of replicates. Gives plain numbers. Does not sample or choose sentences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.estimation.sampling.rank_statistics import RankBands, bands, coverage, distribution
from studies.calibration.replicate import RANKS, Condition

Array = np.ndarray
Record = Mapping[str, Any]
LEVELS = {"50 %": 0.5, "90 %": 0.9}
FIELDS = {"50 %": "inside50", "90 %": "inside90"}
BAR = (0.87, 0.93)


def interval(found: Mapping[str, float]) -> tuple[float, float]:
    """95 % interval of a share from its standard error, a replicate as one observation."""
    return found["share"] - 1.96 * found["standard_error"], found["share"] + 1.96 * found["standard_error"]


def ranked(rows: Sequence[Record]) -> tuple[RankBands, Array]:
    """Band for all unknowns at once, and the distributions of their ranks."""
    ranks = np.array([r["rank"] for r in rows], dtype=np.int64)
    return bands(ranks.shape[0], ranks.shape[1], RANKS), distribution(ranks, RANKS)


def judged(records: Mapping[str, Sequence[Record]], conditions: Mapping[str, Condition]) -> dict[str, Any]:
    """Numbers and standing of every condition."""
    return {"conditions": {n: _condition(rows, conditions[n]) for n, rows in records.items() if rows}}


def _condition(rows: Sequence[Record], condition: Condition) -> dict[str, Any]:
    names = list(rows[0]["names"])
    n = sum(":" not in name for name in names)
    good = [r for r in rows if r["converged"]]
    found: dict[str, Any] = {
        "replicates": len(rows), "converged": len(good), "control": condition.control,
        "vehicles_drawn_anew": sum(r["vehicles_drawn"] - 1 for r in rows),
        "cpu_seconds": float(sum(r["cpu_seconds"] for r in rows)),
        "tau_median": float(np.median([r["tau"] for r in rows])),
        "sd_over_prior": _by_name(names, np.median([r["sd_over_prior"] for r in rows], axis=0)),
    }  # fmt: skip
    for word, key in FIELDS.items():
        hits = np.array([r[key] for r in rows], dtype=float)
        found[word] = coverage(hits[:, :n])
        found[f"{word}, noise"] = coverage(hits[:, n:])
        found[f"{word}, each"] = _by_name(names, hits.mean(axis=0))
        if good:
            found[f"{word}, converged"] = coverage(np.array([r[key] for r in good], dtype=float)[:, :n])
    for vehicle in dict.fromkeys(r["vehicle"] for r in rows):
        some = np.array([r["inside90"] for r in rows if r["vehicle"] == vehicle], dtype=float)
        found.setdefault("90 %, vehicles", {})[vehicle] = coverage(some[:, :n])
    if len(rows) > 1:
        band, shares = ranked(rows)
        found["in_band"] = _by_name(names, band.holds(shares))
    found["standing"] = standing(found)
    return found


def standing(found: Mapping[str, Any]) -> str:
    """Whether 90 % intervals hold what they promise: "met", "undecided" or "missed"; of a control whether it
    fails, as it must: "fails" or "does not fail"."""
    low, high = interval(found["90 %"])
    uniform = all(found.get("in_band", {"": True}).values())
    if found["control"]:
        return "fails" if high < BAR[0] or not uniform else "does not fail"
    if not np.isfinite(low):
        return "undecided"
    if low > BAR[1] or high < BAR[0] or not uniform:
        return "missed"
    return "met" if BAR[0] <= found["90 %"]["share"] <= BAR[1] else "undecided"


def _by_name(names: Sequence[str], values: Array) -> dict[str, Any]:
    return dict(zip(names, values.tolist(), strict=True))
