"""The report of the posterior study: chains and their convergence check, what is known, traded off and
predicted.

Takes sampled cases and plain facts. Does not sample or simulate; the sections themselves are in the modules
`posterior_*` beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report.writer import Report, Section, Text
from studies.posterior.chain_sections import chains_section, samplers_section
from studies.posterior.knowledge_sections import (
    accelerations_section,
    collapse_section,
    known_section,
    ridges_section,
    widths_section,
)
from studies.posterior.prediction_sections import logs_section, predictions_section
from studies.posterior.sampled_case import Sampled, Tracks
from studies.posterior.truths_counts import found_valley, pooled
from studies.posterior.truths_sections import foretold_section, held_section, told, truths_section


def posterior_report(
    cases: Mapping[str, Sampled], logs: Mapping[str, Sampled], facts: Mapping[str, Any]
) -> Report:
    """The report."""
    truths = facts["truths"]
    sections = [
        *([truths_section(truths), held_section(truths), foretold_section(truths)] if truths else []),
        chains_section({**cases, **logs}),
        *([samplers_section(cases)] if any(len(c.posteriors) > 1 for c in cases.values()) else []),
        ridges_section(cases),
        widths_section(cases),
        *([collapse_section(facts["collapse"])] if facts["collapse"] else []),
        *(known_section(case) for case in cases.values()),
        *([accelerations_section(facts["accelerations"])] if facts["accelerations"] else []),
        predictions_section(cases, facts["tracks"]),
        *([logs_section(logs)] if logs else []),
        _inputs(facts),
    ]
    return Report(
        f"What the data fix: posteriors of a spiral{' and of real logs' if logs else ''}",
        _lead(cases, logs, facts),
        sections,
    )


def _lead(cases: Mapping[str, Sampled], logs: Mapping[str, Sampled], facts: Mapping[str, Any]) -> str:
    every = {**cases, **logs}
    case = cases.get("spiral22") or next(iter(cases.values()))
    runs: Mapping[str, Tracks] = facts["tracks"]
    held = {name: t.bands[case.words].end_spread for name, t in runs.items()}
    parts = [
        f"**Of {len(case.seen.names)} coefficients a {case.words.split(',')[0]} fixes "
        f"{sum(e.verdict == 'fixed by data' for e in case.seen.entries)} singly and {case.seen.n_fixed} "
        f"combinations; {len(case.seen.structural)} open directions are structural.**"
    ]
    prior, after = case.behaviour
    name = "tactical diameter"
    if np.isfinite(after.interval(name)[0]):
        one, two = prior.interval(name), after.interval(name)
        parts.append(
            f"Yet it predicts the same run from a known start to {held['spiral']:.2g} m (90 % radius) and "
            f"the tactical diameter to {two[1]:.4g} .. {two[2]:.4g} m, where the prior says "
            f"{one[1]:.4g} .. {one[2]:.4g}; a zig-zag "
            f"not executed to {held['zig-zag']:.2g} m, a rich run to {held['rich']:.2g} m."
        )
    if facts["truths"]:
        parts.append(_over_truths(facts["truths"]))
    bad = [c.words for c in every.values() for p in c.posteriors.values() if not p.converged]
    parts.append(f"Not converged: {', '.join(bad)}." if bad else "All chains passed their gate.")
    if facts["by_laplace"]:
        parts.append(f"By Laplace approximation only, no chain: {', '.join(facts['by_laplace'])}.")
    if facts["quick"]:
        parts.append("Quick run: short chains, one case; it decides nothing.")
    return " ".join(parts)


WORDS = {"Laplace": "linear theory", "fit": "a fit", "emcee": "emcee"}


def _over_truths(cases: Sequence[Mapping[str, Any]]) -> str:
    """Who holds the truths drawn from the priors: linear theory, a fit, draws of emcee."""
    parts, good = [], found_valley(cases)
    for name in dict.fromkeys(c["set"] for c in cases):
        some = [c for c in good if c["set"] == name]
        ways = {way: pooled(some, way) for way in WORDS}
        words = ", ".join(
            f"{told(w['held']['fixed'])} by {WORDS[way]}" for way, w in ways.items() if w["cases"]
        )
        parts.append(f"{name} {words}")
    return (
        f"Of {len(cases)} truths drawn from priors of 10, 50 and 100 % about the vehicle file, 90 % "
        f"intervals along combinations that the runs fix hold the truth: {'; '.join(parts)} "
        f"({len(cases) - len(good)} left out whose search ended in another valley). A long ridge bends: "
        "linear theory follows its tangent, a fit counts the bend, emcee follows it."
    )


def _inputs(facts: Mapping[str, Any]) -> Section:
    noise = ", ".join(f"{c} {s:.3g}" for c, s in facts["noise"].items())
    lines = [
        f"- Simulated recovery on `{facts['vehicle']}`; white noise (SI) {noise}, its level "
        "unknown and sampled",
        f"- Prior: every unknown coefficient normal about the vehicle file's value, sd "
        f"{100 * facts['prior']:g} %; the truth is drawn from it",
        "- Initial states unknown, integrated out",
    ]
    return Section("Inputs", [Text("\n".join(lines))])
