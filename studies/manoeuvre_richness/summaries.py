"""Summaries of the richness study's records that a reader could check from them.

Takes plain data, None for what is missing. Gives arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.analysis.design.paired_comparison import paired

Array = np.ndarray

WELL = 0.5  # contraction from which a coefficient counts as well determined

FACTOR = 1.5

ALPHA = 0.05


def table_of(rows: Any) -> Array:
    """Numbers of a record; null is nan, "inf" is inf."""
    return np.array([[np.nan if x is None else float(x) for x in row] for row in rows])


def vector_of(row: Any) -> Array:
    return np.array([np.nan if x is None else float(x) for x in row])


def maps_of(v: Mapping[str, Any]) -> tuple[list[str], list[str], Array, Array | None, Array | None]:
    # older records call the inclusion by our own sparse regression "sindy_inclusion"
    rows = [{"sparse_inclusion": r.get("sindy_inclusion"), **r} for r in v["comparison"]["manoeuvres"]]
    names = list(v["comparison"]["coefficients"])
    out = [
        None if rows[0][key] is None else table_of([[r[key][n] for n in names] for r in rows])
        for key in ("contraction", "contraction_refits", "sparse_inclusion")
    ]
    assert out[0] is not None
    return [r["name"] for r in rows], names, out[0], out[1], out[2]


def well_determined(v: Mapping[str, Any]) -> tuple[Array, Array]:
    """Posterior over prior sd of well-determined coefficients: expected and by refits."""
    _, _, expected, found, _ = maps_of(v)
    if found is None:
        return np.zeros(0), np.zeros(0)
    good = expected > WELL
    return 1 - expected[good], 1 - found[good]


def error_over_others(table: Array) -> Array:
    logs = np.log(np.maximum(table, 1e-12))
    np.fill_diagonal(logs, np.nan)
    return np.exp(np.nanmean(logs, axis=1))


def crossing_of(v: Mapping[str, Any]) -> tuple[list[str], Array, Array, Array]:
    """Names, gains, predicted and actual error over the others."""
    c = v["comparison"]["crossing"]
    gains = {m["name"]: m["gain_nats"] for m in v["comparison"]["manoeuvres"]}
    return (
        c["names"],
        np.array([gains[n] for n in c["names"]]),
        table_of(c["predicted"]),
        table_of(c["refits"]),
    )


def paired_tests(v: Mapping[str, Any], goal: str) -> list[list[Any]]:
    """Paired test of a design against every rival: ratio, share won, p; of the posterior, then of errors."""
    test = v["test"]
    names = test["names"]
    spread, error = (
        table_of(test[k]) for k in (("left", "wrong") if goal == "shrink" else ("spread", "missed"))
    )
    ours = names.index(f"designed to {goal}")
    rows = []
    for k, name in enumerate(names):
        if name.startswith("designed"):
            continue
        rows.append([name, *paired(spread[ours], spread[k]), *paired(error[ours], error[k])])
    return sorted(rows, key=lambda row: row[1])


def margins_of(discrimination: Mapping[str, Any]) -> dict[str, Array]:
    """Evidence of the true cause over the other [nats] per campaign."""
    labels = list(dict.fromkeys(row[2] for row in discrimination["rows"]))
    return {
        k: np.array([row[3] for row in discrimination["rows"] if row[2] == k], dtype=float) for k in labels
    }
