"""The report of a calibration: are ranks uniform, do intervals hold the truth, and when do they stop to.

Takes plain records of replicates. Judges them against the study's bars. Does not sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.estimation.sampling.rank_statistics import RankBands, bands, coverage, distribution
from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.calibration import figures

Array = np.ndarray
Records = Mapping[str, Sequence[Mapping[str, Any]]]
WELL = "well specified"
LEVELS = {"50 % intervals": 0.5, "90 % intervals": 0.9}
FIELDS = {"50 % intervals": "inside50", "90 % intervals": "inside90"}
BAR = (0.87, 0.93)
LEAST_REPLICATES = 200


def gated(records: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Replicates whose chain converged; the others say nothing about intervals."""
    return [r for r in records if r["converged"]]


def judged(records: Records, ranks: int) -> dict[str, Any]:
    """Ranks, coverage and targets as plain numbers."""
    found: dict[str, Any] = {"cases": {}}
    for name, rows in records.items():
        good = gated(rows)
        n_params = sum(":" not in n for n in rows[0]["names"])
        entry: dict[str, Any] = {
            "replicates": len(rows), "converged": len(good),
            "cpu_seconds": float(sum(r["cpu_seconds"] for r in rows)),
            "rhat_max": max((r["rhat"] for r in good), default=None),
            "tau_median": float(np.median([r["tau"] for r in rows])),
            "sd_over_prior": _by_name(rows, np.median([r["sd_over_prior"] for r in rows], axis=0)),
        }  # fmt: skip
        if good:
            for word, key in FIELDS.items():
                hits = np.array([r[key] for r in good], dtype=float)
                entry[word] = coverage(hits[:, :n_params])
                entry[f"{word}, noise"] = coverage(hits[:, n_params:])
                entry[f"{word}, each"] = _by_name(rows, hits.mean(axis=0))
            band, shares = _ranks(good, ranks)
            entry["in_band"] = _by_name(rows, band.holds(shares))
        found["cases"][name] = entry
    found["targets"] = _targets(found["cases"])
    return found


def _by_name(rows: Sequence[Mapping[str, Any]], values: Array) -> dict[str, float]:
    return dict(zip(rows[0]["names"], values.tolist(), strict=True))


def _ranks(rows: Sequence[Mapping[str, Any]], count: int) -> tuple[RankBands, Array]:
    ranks = np.array([r["rank"] for r in rows], dtype=np.int64)
    return bands(ranks.shape[0], ranks.shape[1], count), distribution(ranks, count)


def _targets(cases: Mapping[str, Any]) -> dict[str, Any]:
    well = cases[WELL]
    band = well.get("in_band", {})
    share = well.get("90 % intervals", {}).get("share", float("nan"))
    wrong = [c["90 % intervals"]["share"] for n, c in cases.items() if n != WELL and "90 % intervals" in c]
    worst = min(wrong, default=float("nan"))
    return {
        "ranks uniform": {
            "value": sum(band.values()), "bar": f"all {len(band)} in the band",
            "pass": bool(band) and all(band.values()),
        },
        "gated replicates": {
            "value": well["converged"], "bar": f">= {LEAST_REPLICATES}",
            "pass": well["converged"] >= LEAST_REPLICATES,
        },
        "pooled 90 % intervals": {
            "value": share, "bar": f"{BAR[0]:.2f} .. {BAR[1]:.2f}", "pass": bool(BAR[0] <= share <= BAR[1]),
        },
        "an unmodelled effect is seen to spoil them": {
            "value": worst, "bar": f"< {BAR[0]:.2f}", "pass": bool(worst < BAR[0]),
        },
    }  # fmt: skip


def calibration_report(records: Records, findings: Mapping[str, Any], inputs: Mapping[str, Any]) -> Report:
    """Report of the study."""
    targets = findings["targets"]
    lead = _lead(findings["cases"], bool(inputs["quick"]))
    rows = [[n, t["value"], t["bar"], "met" if t["pass"] else "missed"] for n, t in targets.items()]
    sections = [
        Section("Targets", (Table(("target", "found", "bar", "verdict"), tuple(map(tuple, rows))),)),
        _rank_section(records[WELL], inputs),
        _coverage_section(findings["cases"]),
        _design_section(findings["cases"], inputs),
    ]
    return Report("Do the intervals hold what they promise?", lead, tuple(sections))


def _lead(cases: Mapping[str, Any], quick: bool) -> str:
    well = cases[WELL]
    if "90 % intervals" not in well:
        return "No replicate converged: cannot tell."
    words = (
        f"Over {well['converged']} simulated runs whose truth was drawn from the prior, "
        f"{100 * well['90 % intervals']['share']:.1f} % of the 90 % intervals of the coefficients held it."
    )
    wrong = {n: c["90 % intervals"]["share"] for n, c in cases.items() if n != WELL and "90 % intervals" in c}
    if wrong:
        listed = " and ".join(f"{100 * v:.0f} % ({n})" for n, v in wrong.items())
        words += (
            f" With a current the model does not know, it was {listed}: intervals are conditional on "
            "the model, "
            "and nothing in them warns when it is wrong. `bayesid diagnose` is for that."
        )
    return words + (" A quick run of few replicates: it decides nothing." if quick else "")


def _rank_section(rows: Sequence[Mapping[str, Any]], inputs: Mapping[str, Any]) -> Section:
    good = gated(rows)
    if len(good) < 2:
        return Section("Ranks", (Text("Fewer than two replicates converged: cannot tell."),))
    count = 99
    band, shares = _ranks(good, count)
    names = list(rows[0]["names"])
    drawn = figures.rank_distributions(band.at, band.low, band.high, shares, names, count)
    text = (
        "The truth is drawn from the prior, a run is simulated with it and sampled; if the sampler and "
        "the density "
        "are right, the truth is as likely to have any rank among the draws as any other. Lines above "
        "the band on "
        "the left mean posteriors that are too high, an arch or a trough ones that are too narrow or "
        "too wide."
    )
    caption = (
        f"Ranks among {count} draws of {len(names)} unknowns in {len(good)} replicates. Orange: leaves "
        "the band, "
        "which all unknowns together leave by chance once in twenty studies."
    )
    return Section("Ranks", (Text(text), Figure("ranks", drawn, caption)))


def _coverage_section(cases: Mapping[str, Any]) -> Section:
    shown = {n: c for n, c in cases.items() if "90 % intervals" in c}
    drawn = figures.coverages(
        {n: {w: (c[w]["share"], c[w]["standard_error"]) for w in LEVELS} for n, c in shown.items()}, LEVELS
    )
    rows = []
    for name, c in shown.items():
        cells = [f"{100 * c[w]['share']:.1f} ± {100 * c[w]['standard_error']:.1f}" for w in LEVELS]
        noise = f"{100 * c['90 % intervals, noise']['share']:.1f}"
        rows.append((name, f"{c['converged']} of {c['replicates']}", *cells, noise))
    columns = ("case", "converged", "50 % intervals [%]", "90 % intervals [%]", "90 % of the noise [%]")
    text = (
        "Pooled over the coefficients; the standard error takes a replicate as one observation, since "
        "intervals of "
        "one run go wrong together. Replicates that did not converge are left out and counted."
    )
    caption = "Coverage with two standard errors."
    return Section("Coverage", (Text(text), Figure("coverage", drawn, caption), Table(columns, tuple(rows))))


def _design_section(cases: Mapping[str, Any], inputs: Mapping[str, Any]) -> Section:
    well = cases[WELL]
    narrowed = well["sd_over_prior"]
    rows = [
        (n, well["90 % intervals, each"][n] if "90 % intervals, each" in well else "", narrowed[n])
        for n in narrowed
    ]
    current = ", ".join(f"{k.split('.')[1]} {v:g} m/s" for k, v in inputs["current"].items())
    text = (
        f"{inputs['vehicle']}, rudder steps of 15 degrees for {inputs['duration']:g} s, position and "
        "heading every "
        f"{inputs['dt']:g} s. Every coefficient has a normal prior of {100 * inputs['prior_sd']:g} %, "
        "the initial "
        "state one of its own and is integrated out with its effect linear, the noise is sampled. "
        "Simulation and "
        f"model are the same code, so this tests the inference, not the physics. The current: {current}. "
        f"Processor time: {sum(c['cpu_seconds'] for c in cases.values()):.0f} s; median autocorrelation time "
        f"{well['tau_median']:.0f} steps."
    )
    columns = ("unknown", "share of its 90 % intervals", "median posterior sd over prior sd")
    return Section("Design", (Text(text), Table(columns, tuple(rows))))
