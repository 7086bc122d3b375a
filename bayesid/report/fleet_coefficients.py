"""Coefficients of one vehicle over its bundles on the page over all: sentences, tables and a figure.

Takes `diagnosis.shared_coefficients`. Does not compute.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from bayesid.diagnosis.plain_words import probability
from bayesid.diagnosis.shared_coefficients import (
    CHANGED,
    FIXED,
    NOT_ONE,
    ONE_SET,
    CoefficientOfBundle,
    CoefficientSharing,
    SharedCoefficient,
    SharedCoefficients,
)
from bayesid.estimation.hierarchical_fit import ALIKE
from bayesid.report.figure_style import COLOURS, FITTED, MEASURED, NOMINAL, styled, subplots
from bayesid.report.writer import Figure, Section, Table, Text, literal
from bayesid.words import and_list, counted, first_few

MOST_PANELS, COLUMNS = 12, 3
FEW = 6
DOUBTFUL = 0.05  # probability of a difference from which the table says where it is largest
RATE = round(1.0 / NOT_ONE) - 1  # `hierarchical_fit` derives it
COEFFICIENT_COLUMNS = (
    "vehicle", "coefficient", "given", "prior sd", "shared", "sd", "sd of a new bundle", "P(differs)",
    "bundle", "alone", "alone sd", "pooled", "pooled sd", "from the others", "sd of that",
)  # fmt: skip


def sharing_words(s: SharedCoefficients) -> str:
    """Whether the coefficients of a vehicle are one set, and what changed; markup."""
    name, number = literal(s.vehicle.name), len(s.bundles)
    every = "both bundles that count" if number == 2 else f"all {number} bundles that count"
    if s.changed:
        one, least = len(s.changed) == 1, min(c.changed for c in s.changed)
        named = and_list([literal(c.name) for c in s.changed])
        each = "; ".join(_change(c, number, "" if one else f"{literal(c.name)} ") for c in s.changed)
        return (
            f"**{named} of {name} {'is' if one else 'are'} not the same in {every}** (probability "
            f"{'' if one else 'of each '}{probability(least)}): {each}. The other coefficients {_spread(s)}."
        )
    if s.same >= ONE_SET:
        return (
            f"**The coefficients of {name} are one set in {every}**, the same to {ALIKE:g} of their stated "
            f"uncertainty (probability {probability(s.same)})."
        )
    if s.same > NOT_ONE:
        return (
            f"Whether the coefficients of {name} are one set in {every} cannot be told (probability "
            f"{probability(s.same)}); they {_spread(s)}."
        )
    text = f"**The coefficients of {name} are not one set in {every}** (probability that they are "
    if s.suspects:
        held = [f"{literal(c.name)} ({probability(c.changed)})" for c in s.suspects]
        return f"{text}{probability(s.same)}); it is open which differs: {first_few(held, FEW)}."
    return (
        f"{text}{probability(s.same)}): they vary by {s.spread:.2g} of their stated uncertainty, and no "
        "single one stands out."
    )


def left_out_words(sharing: CoefficientSharing, failures: Sequence[str]) -> str:
    """Which bundles do not count for shared coefficients, and why."""
    by_reason: dict[str, list[str]] = {}
    for name, why in sharing.left_out.items():
        by_reason.setdefault(why, []).append(literal(name))
    if failures:
        by_reason.setdefault("no verdict", []).extend(literal(n) for n in failures)
    return "".join(
        f"\n\nNot counted: {first_few(names, FEW)}: {why}." for why, names in sorted(by_reason.items())
    )


def sharing_blocks(sharing: CoefficientSharing, failures: Sequence[str]) -> list[Any]:
    """Blocks of the section, vehicle by vehicle."""
    left = left_out_words(sharing, failures)
    if not sharing.vehicles:
        return [Text("No vehicle has two bundles whose coefficients can be compared." + left)]
    several = len(sharing.vehicles) > 1
    blocks: list[Any] = []
    for number, s in enumerate(sharing.vehicles):
        own = [Text(sharing_words(s) + _notes(s)), *_drawn(s, number), _table(s)]
        blocks += [Section(s.vehicle.name, own)] if several else own
    return [*blocks, Text(_method() + left)]


def coefficient_rows(sharing: CoefficientSharing) -> list[list[Any]]:
    """One row per coefficient and bundle, `COEFFICIENT_COLUMNS`."""
    return [
        [
            s.vehicle.name, c.name, c.given, c.prior_sd, c.value, c.sd, c.new_sd, c.changed, e.bundle,
            e.alone, e.alone_sd, e.value, e.sd, e.apart, e.apart_sd,
        ]
        for s in sharing.vehicles
        for c in s.coefficients
        for e in c.each
    ]  # fmt: skip


def _change(c: SharedCoefficient, bundles: int, name: str) -> str:
    """Where a coefficient differs most, and by how much."""
    e = c.furthest
    others = "the other" if bundles == 2 else "the others"
    return f"{name}in {literal(e.bundle)} {_size(e)} from {others} ({e.value:.3g} beside {e.others:.3g})"


def _size(e: CoefficientOfBundle) -> str:
    deviations = f"{abs(e.apart) / e.apart_sd:.2g} sd"
    if abs(e.others) <= 2.0 * abs(e.apart_sd):
        return f"{e.apart:+.3g} ({deviations})"
    return f"{100 * e.apart / e.others:+.2g} % ({deviations})"


def _spread(s: SharedCoefficients) -> str:
    if s.spread_high == 0.0:
        return "show no spread"
    return f"vary by less than {s.spread_high:.2g} of their stated uncertainty (95 %)"


def _notes(s: SharedCoefficients) -> str:
    out = f" No vehicle file of them is written: {s.impossible}." if s.impossible else ""
    if s.widened:
        out += (
            f" The stated uncertainty of {first_few([literal(n) for n in s.widened], FEW)} does not hold in "
            "a bundle; the shared value has the wider prior of that explanation."
        )
    if s.cut:
        words = ", ".join(f"{literal(n)} {counted(k, 'direction')}" for n, k in s.cut.items())
        out += (
            " The explanations of a bundle differ by more than the prior in some combinations of "
            f"coefficients; its log counts for nothing there ({words})."
        )
    return out


def _method() -> str:
    return (
        "Every bundle counts with what its log alone says of the coefficients under its explanations: "
        "effects and model form integrated out, the prior taken out. Normal hierarchical model; the spread "
        "between bundles and the set of changed coefficients are averaged over. Vehicles that are the same "
        f"throughout are told to be not one set in at most 1 of {RATE} cases, if every log's uncertainty "
        f"holds; a coefficient is then named from a probability of {CHANGED:g}. A change is the vehicle's, "
        "or of what its explanation lacks. The shared set is a vehicle file below `shared_coefficients/` "
        "with the uncertainty of a bundle to come: `bayesid fit NEXT_BUNDLE --vehicle FILE` takes it as "
        "prior; a bundle that is counted here would count twice."
    )


def _shown(s: SharedCoefficients) -> list[SharedCoefficient]:
    """Those that data fix better than the prior, changed ones first, then the best known."""
    able = [c for c in s.coefficients if c.fixed or c in s.changed]
    return sorted(able, key=lambda c: (c not in s.changed, c.sd / c.prior_sd))


def _table(s: SharedCoefficients) -> Any:
    rows = []
    for c in _shown(s):
        told = (c.furthest.bundle, _size(c.furthest)) if c.changed >= DOUBTFUL else (None, None)
        rows.append([c.name, c.given, c.prior_sd, c.value, c.sd, probability(c.changed), *told])
    if not rows:
        return Text("The bundles fix no coefficient better than the prior.")
    caption = (
        "Shared values in the units of the vehicle file, with one standard deviation; coefficients whose "
        f"standard deviation is below {FIXED:g} of the prior's. P: that it differs between bundles beyond "
        f"the spread of all; from {DOUBTFUL:g} the bundle furthest from the others, and by how much."
    )
    columns = ["coefficient", "given", "prior sd", "shared", "sd", "P", "furthest", "by"]
    return Table(columns, rows, caption, digits=3)


def _drawn(s: SharedCoefficients, number: int) -> list[Any]:
    shown = _shown(s)[:MOST_PANELS]
    if not shown:
        return []
    more = len(_shown(s)) - len(shown)
    caption = (
        "Coefficients in the units of the vehicle file, 95 %: each bundle from its own log and the prior "
        "(black), and with what the others say (squares); shared value (line and band; orange where it "
        "changed) and value as given (dashes). Coefficients that trade against one another have wide "
        "intervals alone, though a change of one of them is sure."
        + (f" {more} more in the table." if more else "")
    )
    alt = f"Coefficients of {s.vehicle.name} in {len(s.bundles)} bundles beside their shared values"
    return [Figure(f"coefficients_{number + 1}", by_bundle(shown, [c.name for c in s.changed]), caption, alt)]


@styled
def by_bundle(shown: Sequence[SharedCoefficient], changed: Collection[str] = ()) -> Any:
    """A panel per coefficient: every bundle beside the shared value; names of those told as changed."""
    columns = min(COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    labels = [e.bundle for e in shown[0].each]
    figure, grid = subplots(rows, columns, height=1.75 * rows + 0.5, squeeze=False, sharex=True)
    place = np.arange(len(labels))
    for axes, c in zip(grid.ravel(), shown, strict=False):
        colour = COLOURS["orange"] if c.name in changed else FITTED
        axes.axhspan(c.value - 1.96 * c.sd, c.value + 1.96 * c.sd, color=colour, alpha=0.18, linewidth=0)
        axes.axhline(c.value, color=colour, linewidth=1.0)
        axes.axhline(c.given, color=NOMINAL, linestyle="--", linewidth=0.9)
        for shift, style, ink, points in (
            (-0.08, "o", MEASURED, [(e.alone, e.alone_sd) for e in c.each]),
            (0.08, "s", colour, [(e.value, e.sd) for e in c.each]),
        ):
            values, sd = np.array(points).T
            axes.errorbar(
                place + shift, values, 1.96 * sd, fmt=style, color=ink, markersize=3, linewidth=0.9, capsize=2
            )
        axes.set_title(c.name)
        axes.set_xlim(-0.5, len(labels) - 0.5)
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4))
        axes.grid(axis="x", visible=False)
    for axes in grid.ravel()[len(shown) :]:
        axes.axis("off")
    for column in range(columns):
        last = max(r for r in range(rows) if r * columns + column < len(shown))
        axes = grid[last, column]
        every = max(1, -(-len(labels) // 8))
        axes.set_xticks(place[::every], labels[::every], rotation=40, ha="right", rotation_mode="anchor")
        axes.tick_params(labelbottom=True)
    return figure
