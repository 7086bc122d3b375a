"""The first screen of identifiability: what the runs tell of the vehicle, which coefficients to trust singly.

Takes an `Identifiability` and derived quantities. Gives sentences and blocks. Does not simulate or fit.
"""

from __future__ import annotations

import numpy as np

from bayesid.analysis.identifiability import Derived, Identifiability
from bayesid.analysis.identifiability.derived import UNITS
from bayesid.diagnosis.plain_words import number
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import steers
from bayesid.places import NOWHERE, Places
from bayesid.report import identify_figures as figures
from bayesid.report.manoeuvre_words import APART
from bayesid.report.writer import Block, Figure, Section, Text, literal
from bayesid.words import first_few

TOLD = ("tactical diameter", "first overshoot")
MOST_NAMED = 6
KNOWN = "fixed by data"


def headline(found: Identifiability, behaviour: tuple[Derived, Derived] | None) -> str:
    """How narrow the runs make what the vehicle does, and how many coefficients they tell singly.

    Widths only: the centre is that of the coefficients looked at, which nothing here has fitted.
    """
    sure = [e.name for e in found.entries if e.verdict == KNOWN]
    k = len(found.names)
    singly = f"{len(sure)} of {k} coefficients singly" + (f" ({named(sure)})" if 0 < len(sure) < k else "")
    told = [] if behaviour is None else [_narrowed(name, *behaviour) for name in TOLD]
    told = [t for t in told if t]
    if told:
        joined = " and the ".join(told)
        return f"A fit of these runs can tell the {joined}. It can tell {singly}."
    return f"A fit of these runs can tell {found.n_fixed} of {k} combinations of coefficients, and {singly}."


def _narrowed(name: str, prior: Derived, posterior: Derived) -> str:
    """Half the width of a quantity's 90 % interval with the runs, and with the prior alone."""
    if name not in posterior.values:
        return ""
    (_, a, b), (middle, low, high) = prior.interval(name), posterior.interval(name)
    if not np.isfinite(middle):
        return ""
    return (
        f"{name} to ± {number(0.5 * (high - low))} {_unit(name)} (the prior alone: ± {number(0.5 * (b - a))})"
    )


def _unit(name: str) -> str:
    return UNITS[name].replace("deg", "degrees")


def cautions(found: Identifiability) -> list[str]:
    """What must not be read off a coefficient table."""
    out = []
    names = [e.name for e in found.entries if e.verdict not in (KNOWN, "too small to matter")]
    if names:
        kinds = len(found.structural)
        structural = f"; {kinds} of these combinations no run of this kind can tell" if kinds else ""
        out.append(
            f"Do not read these singly: {literal(named(names))}. {len(found.directions)} of their "
            f"combinations rest on the prior{structural}."
        )
    return out


def named(names: list[str]) -> str:
    """Names, the first few of many."""
    return first_few(names, MOST_NAMED)


def next_steps(found: Identifiability, places: Places = NOWHERE, vehicle: Vehicle | None = None) -> list[str]:
    """What to do about what is open; no manoeuvre is designed for a vehicle that has no rudder."""
    if not found.directions:
        return [f"`bayesid fit {places.fitted}` gives the coefficients with intervals that hold singly."]
    designed = vehicle is None or steers(vehicle)
    steps = [
        f"`bayesid design {places.fitted}` looks for the manoeuvre that shrinks what is open most, `bayesid "
        f"compare {places.fitted}` says what each standard manoeuvre adds."
        if designed
        else f"Run {APART}.",
        "For a simulator of this vehicle in this kind of motion use all coefficients of one fit together; do "
        "not take single ones over to another vehicle.",
    ]
    if found.structural:
        steps.append(
            "For combinations no run of this kind can tell, keep one coefficient of each at a value known "
            "otherwise: `--fix NAME`."
        )
    return steps


def first_blocks(
    found: Identifiability, places: Places = NOWHERE, vehicle: Vehicle | None = None
) -> list[Block]:
    """The picture of coefficients, and what next."""
    share, contraction = (np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction"))
    drawn = figures.index(found.names, share, contraction, [e.verdict for e in found.entries])
    caption = (
        "Bars: share of the data in what is known of each coefficient (1: the runs alone, 0: the prior "
        "alone); marks: how much of the prior's variance is gone. A mark high above its bar is a coefficient "
        "known only through its partners' priors."
    )
    return [
        Figure("index", drawn, caption, alt="Share of the data per coefficient"),
        Section("What to do next", [Text("\n".join(f"- {s}" for s in next_steps(found, places, vehicle)))]),
    ]
