"""The study of ridges counts what it says it counts."""

from __future__ import annotations

import numpy as np

from studies.ridges.report import counted, ridges_report

VECTORS = np.eye(3)[[1, 0, 2]]  # X_vr known, the two others left open


def case(seed, rng, shrink=1.0):
    """Truth in prior sd; one combination known to 1 %, two left to the prior; posterior means drawn so that
    intervals hold."""
    along = np.array([0.01, 1.0, 1.0])
    truth = rng.standard_normal(3)
    mean = np.where(along < 0.5, VECTORS @ truth + along * rng.standard_normal(3), 0.0)
    z = (VECTORS @ truth - mean) / along / shrink
    names = ("X_vr", "X_vv", "X_rr")
    said = {
        "left": [1.0, 0.01, 1.0], "along": along.tolist(), "sentence": "Of X_vv, X_vr and X_rr ...",
        "combinations": [
            {"name": n, "vector": v.tolist(), "left": a, "status": ""}
            for n, v, a in zip(names, VECTORS, along, strict=True)
        ],
    }  # fmt: skip
    curve = {"left": [1.1, 0.01, 1.0], "data_share": [0.0, 1.0, 0.0]}
    return {
        "set": "steady turn", "prior": 0.5, "seed": seed, "vehicles_drawn": 1, "truth": truth.tolist(),
        "z": z.tolist(), "combinations": said["combinations"], "draws": rng.standard_normal((50, 3)).tolist(),
        "said": {"Laplace": said, "emcee": {**said, "converged": True}, "profile": curve},
        "cpu_seconds": 1.0,
    }  # fmt: skip


def test_right_intervals_hold_and_another_truth_leaves_the_fixed_combination():
    rng = np.random.default_rng(0)
    cases = [case(k, rng) for k in range(200)]
    found = counted(cases)
    assert found["held"]["fixed"]["of"] == 200 and found["held"]["not fixed"]["of"] == 400
    assert 0.84 < found["held"]["fixed"]["hits"] / 200 < 0.96
    assert found["control"]["fixed"]["hits"] < 10  # within 1.6 % of another: 0.9 % of pairs
    assert found["control"]["not fixed"]["hits"] > 320  # nothing known: the prior holds any truth
    agreement = found["agreement"]["profile"]
    assert agreement["of"] == 600 and agreement["within"] == 600 and agreement["largest"] == 1.1


def test_too_narrow_intervals_stand_in_the_headline():
    rng = np.random.default_rng(0)
    cases = [case(k, rng, shrink=0.5) for k in range(100)]
    failures = ridges_report(cases, counted(cases)).failures
    assert any("too narrow" in f and "fixed" in f for f in failures)
    right = [case(k, rng) for k in range(100)]
    assert not any("too narrow" in f for f in ridges_report(right, counted(right)).failures)
