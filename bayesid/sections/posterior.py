"""The report of the posterior study: chains and their gate, what is known, traded off and predicted.

Takes sampled cases and plain facts. Does not sample or simulate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.figures import identify as shares
from bayesid.figures import posterior as figures
from bayesid.identifiability import Bands, Derived, Identifiability
from bayesid.likelihood import Problem
from bayesid.report import Block, Figure, Report, Section, Table, Text, literal
from bayesid.sample import Posterior
from bayesid.sample.compare import agreement
from bayesid.sections.identify import (
    DERIVED_COLUMNS,
    DIRECTION_COLUMNS,
    LEDGER_COLUMNS,
    derived_numbers,
    derived_rows,
    direction_rows,
    ledger_rows,
    numbers,
    percent,
    sentence,
)

Array = np.ndarray
GATE_COLUMNS = (
    "case", "sampler", "R-hat", "ESS bulk", "tail", "tau", "in tau", "CPU [s]", "ESS / s", "passed",
)  # fmt: skip
CORNERS = {  # one posterior laid over another
    ("spiral22", "joint22"): (
        ("X_vv", "X_vr", "X_rr"),
        ("N_v", "N_r", "N_|v|r", "N_r|r|"),
        ("Y_v|v|", "Y_v|r|", "Y_v", "Y_r"),
    ),
    ("fine14", "finejoint14"): (("X_vr", "X_rr"), ("N_r", "N_|v|r", "N_r|r|"), ("Y_r", "Y_v|r|")),
}


@dataclass(frozen=True, eq=False)
class Sampled:
    """One case: a problem, its posterior by one or two samplers, and what identifiability says of it.

    posteriors : by sampler; empty where the case was looked at by its Laplace approximation only
    draws : (m, k) of the parameters [SI], of the first posterior or of Laplace
    behaviour : derived quantities of prior and posterior
    """

    key: str
    words: str
    problem: Problem
    z: Array
    posteriors: Mapping[str, Posterior]
    draws: Array
    seen: Identifiability
    behaviour: tuple[Derived, Derived]

    @property
    def nominal(self) -> Array:
        """(k,) values of the vehicle file; the truth of a twin."""
        return np.asarray(self.problem.model.nominal[self.problem.model.positions(self.seen.names)])


@dataclass(frozen=True, eq=False)
class Tracks:
    """One run of the true vehicle (n, nx), and the bands of prior and posteriors around it."""

    name: str
    truth: Array
    bands: Mapping[str, Bands]


def posterior_report(
    cases: Mapping[str, Sampled], logs: Mapping[str, Sampled], facts: Mapping[str, Any]
) -> Report:
    """The report."""
    sections = [
        _chains({**cases, **logs}),
        *([_samplers(cases)] if any(len(c.posteriors) > 1 for c in cases.values()) else []),
        _ridges(cases),
        _widths(cases),
        *([_collapse(facts["collapse"])] if facts["collapse"] else []),
        *(_known(case) for case in cases.values()),
        *([_accelerations(facts["accelerations"])] if facts["accelerations"] else []),
        _predictions(cases, facts["tracks"]),
        *([_logs(logs)] if logs else []),
        _inputs(facts),
    ]
    return Report(
        "What the data fix: posteriors of a spiral and of real logs", _lead(cases, logs, facts), sections
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
            f"not flown to {held['zig-zag']:.2g} m, a rich run to {held['rich']:.2g} m."
        )
    bad = [c.words for c in every.values() for p in c.posteriors.values() if not p.converged]
    parts.append(f"Not converged: {', '.join(bad)}." if bad else "All chains passed their gate.")
    if facts["by_laplace"]:
        parts.append(f"By Laplace approximation only, no chain: {', '.join(facts['by_laplace'])}.")
    if facts["quick"]:
        parts.append("Quick run: short chains, one case; it decides nothing.")
    return " ".join(parts)


def _chains(every: Mapping[str, Sampled]) -> Section:
    text = (
        "A chain is converged when R-hat over independent ensembles (chains) is at most 1.01, it is at least "
        "50 autocorrelation times long with a stable estimate, and the effective size (ESS, ArviZ) of every "
        "unknown is at least 400 in bulk and tail. tau is in steps of the ensembles or draws of NUTS, "
        "`in tau` the length of the chain in it, `ESS / s` the least bulk size per processor second. Where a "
        "gate stays shut, intervals are not final."
    )
    rows: list[list[Any]] = []
    reasons = []
    for case in every.values():
        if not case.posteriors:
            rows.append([case.words, "none: Laplace", *[None] * 8])
        for name, p in case.posteriors.items():
            g = p.gate
            rows.append(
                [
                    case.words, name, f"{np.nanmax(g.rhat):.4f}",
                    round(float(g.ess_bulk.min())), round(float(g.ess_tail.min())), float(g.tau.max()),
                    round(g.n_tau), p.seconds, p.ess_per_second, p.converged,
                ]
            )  # fmt: skip
            if g.reasons:
                reasons.append(f"- {literal(case.words)}, {name}: {literal('; '.join(g.reasons))}")
    blocks: list[Block] = [Text(text), Table(GATE_COLUMNS, rows, digits=3)]
    if reasons:
        blocks.append(Text("Short of the gate:\n\n" + "\n".join(reasons)))
    for case in every.values():
        if not case.posteriors or case.key.startswith("fine"):
            continue
        p = next(iter(case.posteriors.values()))
        count = min(p.n_params, 24)
        e = p.draws.shape[0]
        drawn = p.draws[..., :count].reshape(e, -1, count)
        drawn = drawn[:, :: max(1, drawn.shape[1] // 20_000)]
        caption = (
            f"Rank plots, {literal(case.words)}: the share of each ensemble's draws per twentieth of all."
        )
        blocks.append(Figure(f"ranks_{case.key}", figures.ranks(p.names[:count], drawn), caption))
    return Section("Chains", blocks)


def _samplers(cases: Mapping[str, Sampled]) -> Section:
    text = (
        "The ensembles know the density only, NUTS follows its gradient (adjoint) in Laplace-whitened "
        "coordinates; both sample the same density and are measured in the same unknowns. Means are apart "
        "by their Monte Carlo errors if the second column is of the order of 2 to 3, spreads are the same if "
        "the ratio is 1 within a few of its errors."
    )
    rows = []
    for case in cases.values():
        if len(case.posteriors) < 2:
            continue
        (a, one), (b, two) = list(case.posteriors.items())[:2]
        found = agreement(one, two)
        rows.append(
            [
                case.words, float(np.abs(found.mean).max()), float(np.abs(found.shift).max()),
                f"{found.spread.min():.3f} to {found.spread.max():.3f}", float(found.spread_error.max()),
                one.ess_per_second, two.ess_per_second,
            ]
        )  # fmt: skip
    columns = [
        "case",
        "means apart [errors]",
        "[posterior sd]",
        "ratio of sd",
        "its error",
        f"ESS/s {a}",
        f"ESS/s {b}",
    ]
    return Section("Two samplers, one posterior", [Text(text), Table(columns, rows, digits=3)])


def _ridges(cases: Mapping[str, Sampled]) -> Section:
    text = (
        "Values over the true ones, contours of 50 and 90 %. On the spiral v², v r and r² are one regressor, "
        "and so are v and r: their coefficients stand on ridges that the prior ends. What a zig-zag and a "
        "rich run do to them depends on the noise; numbers follow."
    )
    blocks: list[Block] = [Text(text)]
    for keys, groups in CORNERS.items():
        chosen = [cases[k] for k in keys if k in cases]
        for number, names in enumerate(groups, 1):
            if not chosen:
                continue
            sets = {}
            for c in chosen:
                where = [c.seen.names.index(n) for n in names]
                sets[c.words] = c.draws[:, where] / c.nominal[where]
            drawn = figures.corner(names, sets, np.ones(len(names)))
            caption = f"{', '.join(names)}: value over true value."
            blocks.append(Figure(f"corner_{keys[0]}_{number}", drawn, caption))
    return Section("Ridges", blocks)


def _in_units(case: Sampled) -> Array:
    """(m, k) draws of the parameters in prior standard deviations."""
    return case.draws / case.seen.information.unit


def _widths(cases: Mapping[str, Sampled]) -> Section:
    found, rows = {}, []
    for case in cases.values():
        drawn, laplace = (
            np.sqrt(np.maximum(np.linalg.eigvalsh(c)[::-1], 0.0))
            for c in (np.cov(_in_units(case), rowvar=False), case.seen.information.covariance)
        )
        found[case.words] = (drawn, laplace)
        rows.append([case.words, drawn.size, int(np.sum(drawn > np.sqrt(0.5))), float(drawn[-1])])
    spectra = {c.words: c.seen.singular_values for c in cases.values()}
    text = (
        "Eigenvalues of the posterior covariance in units of the prior, dots from draws, lines from the "
        "Laplace approximation; and the singular values of the whitened sensitivities, zero to rounding for "
        "the structural directions. Draws and sensitivities say the same."
    )
    columns = ["case", "unknowns", "wider than 0.71 of the prior", "narrowest (posterior sd / prior sd)"]
    return Section(
        "Eigen-spectrum",
        [
            Text(text),
            Figure("widths", figures.widths(found), "Posterior over prior, along eigenvectors."),
            Figure("spectrum", shares.spectra(spectra), "Singular values per prior sd."),
            Table(columns, rows, digits=3),
        ],
    )


def _collapse(found: Mapping[str, Any]) -> Section:
    ends = "; ".join(f"{key}: from {one['open'][0]} to {one['open'][1]}" for key, one in found.items())
    text = (
        "The directions a spiral leaves open, at the true vehicle (Laplace): the relative standard deviation "
        "the data alone leave along each, from the spiral and from spiral, zig-zag and rich run together, "
        "and the posterior standard deviation over the prior's. A ridge counts as open while the data know "
        f"less along it than the prior of 10 %. Open directions, one run and three: {ends}. What is "
        "structural for any run, the scales of the sway and of the yaw equation, stays."
    )
    overview = [[key, *one["open"], *one["structural"]] for key, one in found.items()]
    columns = [
        "unknowns, noise of positions",
        "open: spiral",
        "three runs",
        "structural: spiral",
        "three runs",
    ]
    blocks: list[Block] = [Text(text), Table(columns, overview)]
    for key, one in found.items():
        if "0.3 m" in key:
            continue
        rows = []
        for r in one["rows"]:
            sd = [f"{v:.2f}" for v in r["sd_over_prior"]]
            rows.append([r["words"].split(":")[0] or r["name"], *(percent(v) for v in r["data_sd"]), *sd])
        head = ["open on the spiral", "data: spiral", "three runs", "sd / prior: spiral", "three runs"]
        blocks.append(Table(head, rows, f"{key}."))
    return Section("How the ridges collapse", blocks)


def _known(case: Sampled) -> Section:
    found = case.seen
    share, contraction = (np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction"))
    drawn = shares.index(found.names, share, contraction, [e.verdict for e in found.entries])
    least = (
        f" Least |cos| of an open direction with what a lens calls open: {found.agreement:.4f}."
        if found.directions
        else ""
    )
    blocks: list[Block] = [
        Text(sentence(found) + least + f" Covariance from {found.source}."),
        Figure(f"index_{case.key}", drawn, "Share of the data per coefficient."),
        Table(LEDGER_COLUMNS, ledger_rows(found), "Ledger, SI.", digits=3),
    ]
    if found.directions:
        blocks.append(Table(DIRECTION_COLUMNS, direction_rows(found.directions), "Open directions."))
    blocks.append(Table(DERIVED_COLUMNS, derived_rows(*case.behaviour), "What the vehicle does."))
    return Section(f"Known and unknown: {case.words}", blocks)


def _accelerations(found: Mapping[str, Mapping[str, float]]) -> Section:
    columns = ["structural direction", *(f"accelerations known to {k}" for k in found)]
    first = next(iter(found.values()))
    rows = [[name, *(percent(found[k][name]) for k in found)] for name in first]
    text = (
        "An equation can be scaled only if its added mass follows. What a strip calculation or a planar "
        "motion mechanism says of the acceleration derivatives therefore closes these directions: the "
        "relative standard deviation along each on the spiral, data and prior together."
    )
    return Section(
        "Priors on acceleration derivatives close structural directions", [Text(text), Table(columns, rows)]
    )


def _predictions(cases: Mapping[str, Sampled], runs: Mapping[str, Tracks]) -> Section:
    text = (
        "Bands of the vehicle, without sensor noise, for runs with the true vehicle's orders. `radius` is "
        "the 90 % radius of the position around the median track, largest over the run; `holds` the share of "
        "samples with the truth inside the 90 % band, least of x, y and heading (one truth and one seed: 0 "
        "or 1 are both possible for a sound band, since errors persist along a run)."
    )
    words = list(next(iter(runs.values())).bands)
    rows = []
    for name, run in runs.items():
        for w in words:
            band = run.bands[w]
            rows.append([name, w, band.end_spread, f"{band.coverage(run.truth):.2f}", band.diverged])
    t = {name: run.bands[words[0]].t for name, run in runs.items()}
    radius = {name: {w: run.bands[w].spread for w in words} for name, run in runs.items()}
    blocks: list[Block] = [
        Text(text),
        Table(["run", "draws of", "radius [m]", "holds", "diverged"], rows, digits=3),
        Figure("radius", figures.spread(t, radius), "90 % radius of predicted positions."),
    ]
    for name in ("spiral", "zig-zag"):
        run = runs[name]
        chosen = [w for w in words if w != "prior"]
        lines = []
        for label, state, factor in (
            ("x [m]", "x", 1.0),
            ("y [m]", "y", 1.0),
            ("heading [deg]", "psi", 180 / np.pi),
        ):
            found = {}
            for w in chosen:
                j = run.bands[w].states.index(state)
                found[w] = factor * run.bands[w].quantiles[[0, -1], :, j]
            lines.append((label, found, factor * run.truth[:, j]))
        picture = figures.bands(t[name], lines)
        blocks.append(Figure(f"band_{_slug(name)}", picture, f"{name}: 90 % bands minus the true run."))
    return Section("What it predicts", blocks)


def _logs(logs: Mapping[str, Sampled]) -> Section:
    text = (
        "Two sets of real logs, rows and pieces of the study of real logs, wind left out. Residuals there "
        "are errors of the model more than of sensors and persist; each channel counts for as many readings "
        "as its residuals are worth. The priors are those of the vehicle files."
    )
    blocks: list[Block] = [Text(text)]
    for case in logs.values():
        found = case.seen
        rows = [
            [e.name, *(f"{v:.2f}" for v in _standing(case, i)), f"{e.index:.2f}", e.words]
            for i, e in enumerate(found.entries)
        ]
        columns = ["coefficient", "mean / prior mean", "prior sd", "posterior sd", "index", "verdict"]
        share, contraction = (
            np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction")
        )
        drawn = shares.index(found.names, share, contraction, [e.verdict for e in found.entries])
        inner: list[Block] = [
            Text(sentence(found)),
            Figure(f"index_{case.key}", drawn, "Share of the data per coefficient."),
            Table(columns, rows, "Standard deviations relative to the prior mean."),
        ]
        if found.directions:
            inner.append(Table(DIRECTION_COLUMNS, direction_rows(found.directions), "Open directions."))
        inner.append(Table(DERIVED_COLUMNS, derived_rows(*case.behaviour), "What the ship does."))
        blocks.append(Section(literal(case.words), inner))
    return Section("Real logs", blocks)


def _standing(case: Sampled, i: int) -> tuple[float, float, float]:
    """Mean of the posterior over that of the prior, and both standard deviations over its size."""
    before = float(case.problem.params.start[i])
    size = abs(before) or float(case.seen.information.scale[i])
    mean, sd = float(np.mean(case.draws[:, i])), float(np.std(case.draws[:, i]))
    return mean / (before or size), case.seen.entries[i].prior_sd / size, sd / size


def _inputs(facts: Mapping[str, Any]) -> Section:
    noise = ", ".join(f"{c} {s:.3g}" for c, s in facts["noise"].items())
    lines = [
        f"- Twin of `{facts['vehicle']}`; white noise (SI) {noise}, its level unknown and sampled",
        f"- Prior: every unknown coefficient normal about its true value, sd {100 * facts['prior']:g} %",
        "- Initial states unknown, integrated out",
    ]
    return Section("Inputs", [Text("\n".join(lines))])


def posterior_results(
    cases: Mapping[str, Sampled], logs: Mapping[str, Sampled], facts: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """Everything as plain numbers."""
    every = {**cases, **logs}
    tracks: Mapping[str, Tracks] = facts["tracks"]
    return {
        "inputs": {k: v for k, v in facts.items() if k not in ("tracks", "accelerations", "collapse")},
        "seeds": [seed],
        "rhat_max": max(float(np.nanmax(p.gate.rhat)) for c in every.values() for p in c.posteriors.values()),
        "chains": {
            f"{key} {name}": p.summary() for key, c in every.items() for name, p in c.posteriors.items()
        },
        "agreement": {key: _agreement_numbers(c) for key, c in cases.items() if len(c.posteriors) > 1},
        "identifiability": {key: numbers(c.seen) for key, c in every.items()},
        "derived": {key: derived_numbers(*c.behaviour) for key, c in every.items()},
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
    spread = [float(np.std(_in_units(case) @ d.vector)) for d in case.seen.structural]
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


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)
