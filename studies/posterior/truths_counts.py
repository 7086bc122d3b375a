"""Counts over truths drawn from the prior: what is left, how often intervals and predictions hold the truth.

Takes the records of `studies.posterior.truths`. Gives plain numbers. Does not choose words.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.excited_terms.counting import share

Case = Mapping[str, Any]
FIXED, OPEN = 0.1, 0.7071  # of the prior sd, as `bayesid sample` says fixed and open
CENTRE_90 = (0.05, 0.95)
WRONG_VALLEY = 2.0  # nats by which a search ends above another one
WAYS = ("Laplace", "fit", "emcee", "NUTS")
KINDS = ("fixed", "narrowed", "open")


def counted(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """One record per set of runs and prior."""
    return [
        _one([c for c in cases if (c["set"], c["prior"]) == key])
        for key in dict.fromkeys((c["set"], c["prior"]) for c in cases)
    ]


def found_valley(cases: Sequence[Case]) -> list[Case]:
    """Cases whose search did not end above what a search from the truth finds."""
    return [c for c in cases if c["above_truth"] <= WRONG_VALLEY]


def pooled(cases: Sequence[Case], way: str) -> dict[str, Any]:
    """Coverage over all priors of a set of cases, and its control."""
    some = [c for c in cases if way in c["said"]]
    return {
        key: {kind: _held(some, way, rank, kind) for kind in KINDS}
        for key, rank in (("held", "rank"), ("control", "control_rank"))
    } | {"cases": len(some)}


def _one(some: Sequence[Case]) -> dict[str, Any]:
    widths = np.array([c["said"]["Laplace"]["widths"] for c in some])
    found: dict[str, Any] = {
        "set": some[0]["set"], "prior": some[0]["prior"], "truths": len(some),
        "drawn_anew": sum(c["vehicles_drawn"] - 1 for c in some),
        "fixed": float(np.median(np.sum(widths <= FIXED, axis=1))),
        "open": float(np.median(np.sum(widths >= OPEN, axis=1))),
        "from_file_too_high": sum(c["starts"][0] - min(c["starts"]) > WRONG_VALLEY for c in some),
        "too_high": sum(c["above_truth"] > WRONG_VALLEY for c in some),
        "left": {
            n: float(np.median([c["said"]["Laplace"]["left"][n] for c in some])) for n in some[0]["names"]
        },
        "ways": {},
    }  # fmt: skip
    for way in WAYS:
        those = [c for c in some if way in c["said"]]
        if not those:
            continue
        told = [c["said"][way] for c in those]
        ends = [{"terms": [{"in": v} for v in t["predicted"]["holds_at_end"].values()]} for t in told]
        found["ways"][way] = {
            "cases": len(those),
            **{kind: _held(those, way, "rank", kind) for kind in KINDS},
            "single": share(
                [{"terms": [{"in": _central(r)} for r in t["coefficient_rank"]]} for t in told],
                lambda row: True, lambda row: row["in"],
            ),
            "predicted": share(ends, lambda row: True, lambda row: row["in"]),
            "radius": float(np.median([t["predicted"]["radius"] for t in told])),
            "rhat": max((t["rhat"] for t in told if "rhat" in t), default=None),
            "narrowest_over_laplace": float(np.median([
                t["widths"][0] / c["said"]["Laplace"]["widths"][0] for t, c in zip(told, those, strict=True)
            ])),
        }  # fmt: skip
    return found


def _held(some: Sequence[Case], way: str, rank: str, kind: str) -> dict[str, float]:
    terms = [
        {"terms": [
            {"kind": _kind(w), "in": _central(r)}
            for w, r in zip(c["said"][way]["widths"], c["said"][way][rank], strict=True)
        ]}
        for c in some
    ]  # fmt: skip
    return share(terms, lambda row: row["kind"] == kind, lambda row: row["in"])


def _central(rank: float) -> bool:
    return CENTRE_90[0] <= rank <= CENTRE_90[1]


def _kind(width: float) -> str:
    return "fixed" if width <= FIXED else "open" if width >= OPEN else "narrowed"
