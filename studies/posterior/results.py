"""The posterior study as plain numbers, targets of the paper included.

Takes sampled cases and plain facts. Gives what results.json holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.estimation.sampling.compare_samplers import agreement
from bayesid.report.identify import derived_numbers, numbers
from studies.posterior.sampled_case import Sampled, Tracks, in_prior_units
from studies.posterior.truths_counts import counted


def posterior_results(
    cases: Mapping[str, Sampled], logs: Mapping[str, Sampled], facts: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """Everything as plain numbers."""
    every = {**cases, **logs}
    tracks: Mapping[str, Tracks] = facts["tracks"]
    return {
        "inputs": {
            k: v for k, v in facts.items() if k not in ("tracks", "accelerations", "collapse", "truths")
        },
        "seeds": [seed],
        "rhat_max": max(
            float(np.nanmax(p.convergence.rhat)) for c in every.values() for p in c.posteriors.values()
        ),
        "chains": {
            f"{key} {name}": p.summary() for key, c in every.items() for name, p in c.posteriors.items()
        },
        "agreement": {key: _agreement_numbers(c) for key, c in cases.items() if len(c.posteriors) > 1},
        "identifiability": {key: numbers(c.seen) for key, c in every.items()},
        "derived": {key: derived_numbers(*c.behaviour) for key, c in every.items()},
        "truths": counted(facts["truths"]),
        "collapse": facts["collapse"],
        "accelerations": facts["accelerations"],
        "predictions": {
            n: {w: {"radius_m": b.end_spread, "coverage": b.coverage(t.truth)} for w, b in t.bands.items()}
            for n, t in tracks.items()
        },
        "targets": targets(cases, facts),
    }


def targets(cases: Mapping[str, Sampled], facts: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """T9: intervals report the structural directions as flat, and priors on accelerations remove them."""
    case = cases.get("spiral22")
    if case is None:
        return {}
    spread = [float(np.std(in_prior_units(case) @ d.vector)) for d in case.seen.structural]
    flat = {
        "pass": len(spread) == 3 and min(spread) > 0.9 and case.seen.agreement > 0.99,
        "structural": [d.words for d in case.seen.structural],
        "draws_along_over_prior": spread,
        "least_agreement": case.seen.agreement,
    }
    before, after = facts["accelerations"].values()
    ratio = {k: before[k] / after[k] for k in before}
    closed = {"pass": bool(ratio) and min(ratio.values()) > 10.0, "narrower_by": ratio}
    return {"T9 flat": flat, "T9 closed by priors": closed}


def _agreement_numbers(case: Sampled) -> dict[str, Any]:
    one, two = list(case.posteriors.values())[:2]
    found = agreement(one, two)
    return {
        "samplers": list(case.posteriors)[:2],
        "means_apart_in_errors": float(np.abs(found.mean).max()),
        "means_apart_in_sd": float(np.abs(found.shift).max()),
        "sd_ratio": [float(found.spread.min()), float(found.spread.max())],
        "sd_ratio_error": float(found.spread_error.max()),
        "ess_per_cpu_second": [one.ess_per_second, two.ess_per_second],
    }
