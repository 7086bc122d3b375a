"""The report of identifiability: what the data fix, what they leave open, and who says so.

Takes an `Identifiability` and facts about its origin. Does not simulate or fit.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.identifiability import Derived, Identifiability, OpenDirection
from bayesid.analysis.identifiability.derived import UNITS
from bayesid.model.vehicles import Vehicle
from bayesid.places import NOWHERE, Places
from bayesid.report import coefficient_cells, writer
from bayesid.report import identify_figures as figures
from bayesid.report import identify_first_screen as screen
from bayesid.report.writer import Block, Figure, Report, Section, Table, Text, literal

MOST_PROFILES = 24
DIRECTION_COLUMNS = ("combination (relative changes)", "what it is", "sd from the data", "data share")
DERIVED_COLUMNS = ("quantity", "from the prior: 90 %", "with the data: median", "90 %", "narrower by")
COEFFICIENT_COLUMNS = (
    "coefficient", *coefficient_cells.COLUMNS, "prior sd [%]", "sd [%]", "index", "contraction", "verdict",
)  # fmt: skip


def write_identify_report(
    found: Identifiability,
    facts: Mapping[str, Any],
    folder: str | os.PathLike[str],
    behaviour: tuple[Derived, Derived] | None = None,
    vehicle: Vehicle | None = None,
    places: Places = NOWHERE,
) -> Path:
    """Write report.html, report.md, results.json and figures; returns the path of the HTML file.

    Parameters
    ----------
    behaviour : derived quantities of draws of the prior and of the posterior
    facts : "trial", "vehicle", "digest", "point" (where it was looked at, in words), "remarks" (list)
    vehicle : for prime values
    """
    results = {"inputs": dict(facts), "identifiability": numbers(found)}
    if behaviour is not None:
        results["derived"] = derived_numbers(*behaviour)
    return writer.write(identify_report(found, facts, behaviour, vehicle, places), folder, results)


def identify_report(
    found: Identifiability,
    facts: Mapping[str, Any],
    behaviour: tuple[Derived, Derived] | None = None,
    vehicle: Vehicle | None = None,
    places: Places = NOWHERE,
) -> Report:
    """The report as plain data."""
    lead = " ".join(
        [f"**{literal(screen.headline(found, behaviour))}**", *screen.cautions(found), sentence(found)]
    )
    sections = [*identify_sections(found, vehicle=vehicle, drawn=True), _inputs(found, facts)]
    if behaviour is not None:
        sections.insert(0, derived_section(*behaviour))
    return Report(
        f"What {literal(facts['trial'])} can tell", lead, sections,
        first=screen.first_blocks(found, places, vehicle),
    )  # fmt: skip


def derived_section(prior: Derived, posterior: Derived) -> Section:
    """What the vehicle does, from the prior alone and with the data."""
    text = (
        "Stability indices, a turning circle and a zig-zag of vehicles drawn from the prior and from the "
        "posterior: what a designer asks for is often well known where no single coefficient is."
    )
    table = Table(DERIVED_COLUMNS, derived_rows(prior, posterior))
    return Section("What matters anyway", [Text(text), table])


def derived_rows(prior: Derived, posterior: Derived) -> list[list[Any]]:
    """Rows of `DERIVED_COLUMNS`; quantities no draw has are left out."""
    rows = []
    for name in posterior.values:
        before, after = prior.interval(name), posterior.interval(name)
        if not np.isfinite(after[0]):
            continue
        widths = [one[2] - one[1] for one in (before, after)]
        unit = f" [{UNITS[name]}]" if UNITS[name] else ""
        rows.append(
            [
                f"{name}{unit}", f"{before[1]:.4g} to {before[2]:.4g}", after[0],
                f"{after[1]:.4g} to {after[2]:.4g}", _times(widths[0], widths[1]),
            ]
        )  # fmt: skip
    return rows


def _times(before: float, after: float) -> str:
    ratio = before / max(after, 1e-300)
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.1f}"


def derived_numbers(prior: Derived, posterior: Derived) -> dict[str, Any]:
    """Median and 90 % interval of every quantity, before and after."""
    return {
        name: {
            "unit": UNITS[name], "prior": prior.interval(name), "posterior": posterior.interval(name),
            "missing": [prior.missing(name), posterior.missing(name)],
        }
        for name in posterior.values
    }  # fmt: skip


def identify_sections(
    found: Identifiability, prefix: str = "", vehicle: Vehicle | None = None, drawn: bool = False
) -> list[Section]:
    """Coefficient table, open directions, spectrum and profiles; figure names start with `prefix`.

    `drawn`: the figure of the coefficients stands elsewhere already.
    """
    sections = [_coefficients(found, prefix, vehicle, drawn), _open(found, prefix), _spectrum(found, prefix)]
    if found.profiles:
        sections.append(_profiles(found, prefix))
    return sections


def sentence(found: Identifiability) -> str:
    """The finding in one sentence."""
    k, left = len(found.names), len(found.directions)
    sure = sum(e.verdict == "fixed by data" for e in found.entries)
    if not left:
        return f"The data fix all {k} combinations of the {k} coefficients; {sure} coefficients singly."
    text = f"The data fix {found.n_fixed} of {k} combinations and {sure} of {k} coefficients singly"
    n = len(found.structural)
    kinds = f", {n} of them structural: no run of this kind can fix them" if n else ""
    return f"{text}; {left} combination{'s' * (left > 1)} rest{'s' * (left == 1)} on the prior{kinds}."


def _agreement_words(found: Identifiability) -> str:
    if not found.directions:
        return ""
    lenses = list(found.directions[0].agreement)
    names = {
        "svd": "singular vectors of the sensitivities",
        "covariance": f"eigenvectors of the posterior covariance ({found.source})",
        "profile": "refits of the profile likelihood",
    }
    return (
        f"Every one of them lies within what each lens calls open ({', '.join(names[n] for n in lenses)}): "
        f"least |cos| {found.agreement:.4f}."
    )


def direction_rows(directions: Sequence[OpenDirection]) -> list[list[Any]]:
    """Rows of `DIRECTION_COLUMNS`."""
    rows = []
    for d in directions:
        words = d.words or (f"the data fix {d.fixed}, not each" if d.fixed else "")
        if d.words and d.fixed:
            words += f"; they fix {d.fixed}"
        rows.append([d.name, words, percent(d.sd), f"{d.data_share:.2g}"])
    return rows


def percent(sd: float) -> str:
    """A relative sd in words."""
    if not np.isfinite(sd):
        return "none at all"
    if sd > 1e4:
        return "more than a million %"
    return f"{100 * sd:.2g} %" if sd < 1 else f"{100 * sd:.0f} %"


def coefficient_rows(found: Identifiability, vehicle: Vehicle | None = None) -> list[list[Any]]:
    """Rows of `COEFFICIENT_COLUMNS`; no prime values without a vehicle."""
    rows = []
    for e, size in zip(found.entries, found.information.scale, strict=True):
        prior = f"{100 * e.prior_sd / size:.3g}" + ("" if e.stated else " assumed")
        value = coefficient_cells.cells(vehicle, e.name, e.value)
        rows.append(
            [e.name, *value, prior, 100 * e.sd / size, f"{e.index:.2f}", f"{e.contraction:.2f}", e.words]
        )
    return rows


def _coefficients(found: Identifiability, prefix: str, vehicle: Vehicle | None, elsewhere: bool) -> Section:
    text = (
        "`index` is the share of the data in the posterior variance: raise the likelihood to a power of 1.01 "
        "and the variance falls by that share of 1 %; the prior's share is 1 minus it. `contraction` is how "
        "much of the prior's variance is gone. It can be high where the index is low: partners of a flat "
        "direction lend each other their priors. Relative numbers refer to the size of the coefficient."
    )
    share, contraction = (np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction"))
    drawn = figures.index(found.names, share, contraction, [e.verdict for e in found.entries])
    picture = Figure(f"{prefix}index", drawn, "Share of the data in what is known of each coefficient.")
    table = Table(COEFFICIENT_COLUMNS, coefficient_rows(found, vehicle), coefficient_cells.FORM, digits=3)
    blocks: list[Block] = [Text(text), table] if elsewhere else [Text(text), picture, table]
    return Section("Prior and data, coefficient by coefficient", blocks)


def _open(found: Identifiability, prefix: str) -> Section:
    if not found.directions:
        return Section(
            "What the data leave open",
            [Text("Nothing: the data know more than the prior along every direction.")],
        )
    text = (
        "Along these combinations the prior knows more than the data; moving along one changes the "
        "coefficients and not the fit. Structural ones leave every track of this kind of run as it is, "
        "exactly, for finite changes too."
    )
    kinds = [d.kind if d.kind != "ridge" else d.words.split(":")[0] for d in found.directions]
    drawn = figures.directions(found.names, np.array([d.relative for d in found.directions]), kinds)
    lenses = list(found.directions[0].agreement)
    views = [[i, *(f"{d.agreement[n]:.4f}" for n in lenses)] for i, d in enumerate(found.directions, 1)]
    blocks: list[Block] = [
        Text(f"{text} {_agreement_words(found)}"),
        Table(DIRECTION_COLUMNS, direction_rows(found.directions)),
        Figure(
            f"{prefix}directions",
            drawn,
            "Open directions, one per row: coefficients with a sign change together along it, + up, − down, "
            "the darker the more, and the runs do not notice.",
        ),
        Table(["direction", *lenses], views, "|cos| with the space each lens calls open."),
    ]
    return Section("What the data leave open", blocks)


def _spectrum(found: Identifiability, prefix: str) -> Section:
    drawn = figures.spectra({"data": found.singular_values})
    caption = (
        "Singular values of the whitened sensitivities, per prior standard deviation, initial states free. "
        "Values at the lower edge are zero to rounding."
    )
    return Section("Spectrum", [Figure(f"{prefix}spectrum", drawn, caption)])


def _profiles(found: Identifiability, prefix: str) -> Section:
    text = (
        "Each coefficient was held 1 and 2 posterior standard deviations off, all others fitted again "
        f"({sum(p.offsets.size for p in found.profiles)} refits, "
        f"{sum(p.evaluations for p in found.profiles)} Jacobians). Grey: what a normal posterior does. "
        "Shaded: the part of the rise that is misfit of the data; the rest is the prior's. Triangles: the "
        "profile likelihood, for which the others were fitted with no prior at all; at zero the data alone "
        "do not object to any value. `data share` is the index again, without any linearisation; the 90 % "
        "intervals, with the prior and of the data alone, are in posterior standard deviations, -1.64 to "
        "1.64 if normal; `none` is a side on which nothing resists."
    )
    shown = [(p.name, p.offsets, p.rise, p.data_rise, p.likelihood) for p in found.profiles[:MOST_PROFILES]]
    rows = []
    for p in found.profiles:
        low, high = p.interval()
        rows.append(
            [
                p.name,
                f"{found.entry(p.name).index:.3f}",
                f"{p.data_share:.3f}",
                f"{low:.2f} to {high:.2f}",
                " to ".join(_end(x) for x in p.data_interval()),
            ]
        )
    return Section(
        "Profile likelihood",
        [
            Text(text),
            Figure(f"{prefix}profiles", figures.profiles(shown), "Profiles."),
            Table(["coefficient", "index", "data share", "90 %", "90 % of the data alone"], rows),
        ],
    )


def _end(x: float) -> str:
    """An end of an interval in posterior sd."""
    return f"{x:.2f}" if np.isfinite(x) else "none" if np.isinf(x) else "–"


def _inputs(found: Identifiability, facts: Mapping[str, Any]) -> Section:
    lines = [
        f"- Trial: {literal(facts['trial'])}; vehicle: {literal(facts['vehicle'])}; "
        f"problem `{facts['digest']}`",
        f"- Looked at: {facts['point']}",
        f"- Readings: {found.n_readings}, white noise; initial states of all runs unknown",
        *(f"- {literal(line)}" for line in facts.get("remarks", ())),
    ]
    return Section("Inputs", [Text("\n".join(lines))])


def numbers(found: Identifiability) -> dict[str, Any]:
    """Everything as plain numbers for JSON; coefficients in SI."""
    return {
        "names": found.names,
        "n_readings": found.n_readings,
        "n_fixed": found.n_fixed,
        "singular_values": found.singular_values,
        "least_agreement": found.agreement,
        "covariance_from": found.source,
        "entries": {e.name: {**vars(e), "words": e.words} for e in found.entries},
        "directions": [
            {
                "name": d.name, "kind": d.kind, "words": d.words, "fixed": d.fixed, "exact": d.exact,
                "data_share": d.data_share, "sd": d.sd, "agreement": d.agreement,
                "relative": dict(zip(found.names, d.relative.tolist(), strict=True)),
            }
            for d in found.directions
        ],
        "profiles": {
            p.name: {
                "offsets": p.offsets, "rise": p.rise, "data_rise": p.data_rise, "data_share": p.data_share,
                "interval90": p.interval(), "likelihood_rise": p.likelihood,
                "likelihood_interval90": p.data_interval(),
            }
            for p in found.profiles
        },
    }  # fmt: skip
