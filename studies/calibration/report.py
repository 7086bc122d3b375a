"""The report of a calibration: under which conditions intervals hold the truth as often as they say.

Takes the numbers of the conditions. Does not sample or judge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.report.writer import Figure, Report, Section, Table, Text
from studies.calibration import figures
from studies.calibration.judging import BAR, LEVELS, interval, ranked

Records = Mapping[str, Sequence[Mapping[str, Any]]]


def percent(found: Mapping[str, float]) -> str:
    """ "89.1 ± 0.8"."""
    return f"{100 * found['share']:.1f} ± {100 * found['standard_error']:.1f}"


def calibration_report(records: Records, findings: Mapping[str, Any], inputs: Mapping[str, Any]) -> Report:
    """Report of the study."""
    found = findings["conditions"]
    shares = {n: {w: interval_of(c[w]) for w in LEVELS} for n, c in found.items()}
    picture = Figure(
        "coverage",
        figures.coverages(shares, LEVELS, [n for n, c in found.items() if c["control"]]),
        "Share of the intervals of all coefficients that hold the truth, with 95 % intervals, a replicate "
        "taken as one "
        "observation. Dashed: what they claim. A right condition stands on the dashes; controls, hollow, "
        "must not.",
    )
    sections = [
        _coverage_section(found),
        _rank_section(records, found),
        _vehicles_section(found),
        _design_section(found, inputs),
    ]
    return Report(
        "Do the intervals hold what they promise?",
        lead(found, bool(inputs["quick"])),
        sections,
        failures=failures(found),
        first=[picture],
    )


def interval_of(found: Mapping[str, float]) -> tuple[float, float, float]:
    """Share and its 95 % interval."""
    return (found["share"], *interval(found))


def lead(found: Mapping[str, Any], quick: bool) -> str:
    """The answer."""
    right = {n: c for n, c in found.items() if not c["control"]}
    shares = [100 * c["90 %"]["share"] for c in right.values()]
    count = sum(c["replicates"] for c in found.values())
    by_standing = {
        s: [n for n, c in right.items() if c["standing"] == s] for s in ("met", "undecided", "missed")
    }
    words = (
        f"**Where the density knows what the noise is like, {min(shares):.0f} to {max(shares):.0f} % of the "
        "90 % "
        f"intervals hold the truth; {len(by_standing['met'])} of {len(right)} conditions meet the bar** "
        f"({100 * BAR[0]:.0f} to {100 * BAR[1]:.0f} %, ranks uniform)"
    )
    for s in ("undecided", "missed"):
        if by_standing[s]:
            words += f", {s}: {', '.join(by_standing[s])}"
    converged = sum(c["converged"] for c in found.values())
    words += f". {count} replicates on three vehicles, {converged} converged, all counted."
    controls = {n: c for n, c in found.items() if c["control"]}
    if controls:
        told = "; ".join(
            f"{n.removeprefix('control: ')} {100 * c['90 %']['share']:.0f} %" for n, c in controls.items()
        )
        words += f" Controls: {told}. Nothing in an interval warns of that; `bayesid diagnose` does."
    return words + (" A quick run of few replicates: it decides nothing." if quick else "")


def failures(found: Mapping[str, Any]) -> list[str]:
    """Conditions short of their bar, controls that do not fail, chains that did not converge."""
    out = []
    for name, c in found.items():
        low, high = interval(c["90 %"])
        share = f"{100 * c['90 %']['share']:.1f} % of the 90 % intervals hold the truth"
        told = f"{share} ({100 * low:.1f} to {100 * high:.1f})"
        off = [n for n, ok in c.get("in_band", {}).items() if not ok]
        ranks = f", ranks not uniform: {', '.join(off)}" if off else ""
        if c["standing"] == "missed":
            out.append(f"{name}: {told}{ranks}.")
        if c["standing"] == "does not fail":
            out.append(f"{name} does not fail: {told}.")
    short = {n: c for n, c in found.items() if c["converged"] < c["replicates"]}
    if short:
        told = "; ".join(
            f"{n} {c['replicates'] - c['converged']} of {c['replicates']}" for n, c in short.items()
        )
        out.append(f"Chains that did not converge, counted all the same: {told}.")
    return out


def _coverage_section(found: Mapping[str, Any]) -> Section:
    rows = []
    for name, c in found.items():
        off = sum(not ok for ok in c.get("in_band", {}).values())
        rows.append(
            [
                name, f"{c['converged']} of {c['replicates']}", *(percent(c[w]) for w in LEVELS),
                percent(c["90 %, converged"]) if "90 %, converged" in c else None,
                f"{100 * c['90 %, noise']['share']:.0f}", f"{off} of {len(c.get('in_band', {}))}",
                c["standing"],
            ]
        )  # fmt: skip
    columns = (
        "condition", "converged", "50 % intervals [%]", "90 % intervals [%]", "converged only [%]", "of the "
        "noise [%]",
        "ranks off", "standing",
    )  # fmt: skip
    text = (
        "Pooled over the coefficients with one standard error, a replicate taken as one observation, since "
        "intervals "
        "of one run go wrong together. All replicates count, also those whose chain did not converge; those "
        "that did "
        "stand beside. A condition is met within the bar with uniform ranks, undecided where only its "
        "interval "
        "reaches the bar, and missed otherwise; a control must leave it."
    )
    return Section("Coverage", [Text(text), Table(columns, rows)])


def _rank_section(records: Records, found: Mapping[str, Any]) -> Section:
    text = (
        "The truth is drawn from the prior, runs are simulated with it and sampled; if sampler and density "
        "are right, "
        "the truth is as likely to have any rank among the draws as any other. Lines above the band on the "
        "left mean "
        "posteriors that are too high, an arch or a trough ones that are too narrow or too wide. The band "
        "holds all "
        "unknowns of a panel at once in 95 of 100 studies."
    )
    panels = {}
    for name, rows in records.items():
        if len(rows) > 1:
            band, shares = ranked(rows)
            panels[name] = (band.at, band.low, band.high, shares, list(rows[0]["names"]))
    if not panels:
        return Section("Ranks", [Text("Fewer than two replicates: cannot tell.")])
    caption = (
        "Distribution of ranks among 99 draws minus the uniform one, a line per unknown. Orange: leaves the "
        "band."
    )
    return Section("Ranks", [Text(text), Figure("ranks", figures.rank_panels(panels), caption)])


def _vehicles_section(found: Mapping[str, Any]) -> Section:
    vehicles = list(dict.fromkeys(v for c in found.values() for v in c["90 %, vehicles"]))
    rows = [
        [n, *(percent(c["90 %, vehicles"][v]) if v in c["90 %, vehicles"] else None for v in vehicles)]
        for n, c in found.items()
    ]
    return Section(
        "By vehicle", [Table(["condition", *vehicles], rows, "90 % intervals that hold the truth [%].")]
    )


def _design_section(found: Mapping[str, Any], inputs: Mapping[str, Any]) -> Section:
    name, first = next(iter(found.items()))
    rows = [[n, first["90 %, each"][n], s] for n, s in first["sd_over_prior"].items()]
    cpu = sum(c["cpu_seconds"] for c in found.values())
    anew = sum(c["vehicles_drawn_anew"] for c in found.values())
    text = (
        f"{', '.join(inputs['vehicles'])}; rudder steps of 12 degrees for 24 L/U, position and heading "
        "twice per L/U; "
        "with three runs a turn and doublets of 16 L/U besides; pieces of 6 L/U, whose start is known "
        "before to 2 % of "
        f"L. Every coefficient has a normal prior of {100 * inputs['prior_sd']:g} %, the initial state one "
        "of its own "
        "and is integrated out with its effect linear, noise levels are sampled. Coloured noise is a "
        "first-order "
        "autoregression whose correlation is drawn between 0 and 1 for every channel; Student-t noise has "
        "four degrees "
        "of freedom, and its runs a known start. The current is 1 % of the speed. Simulation and model are "
        "the same "
        "code: this tests the inference, not the physics. Vehicles drawn anew because they diverged: "
        f"{anew}. "
        f"Processor time: {cpu:.0f} s."
    )
    columns = ("unknown", "share of its 90 % intervals", "median posterior sd over prior sd")
    return Section("Design", [Text(text), Table(columns, rows, f"{name}.", digits=3)])
