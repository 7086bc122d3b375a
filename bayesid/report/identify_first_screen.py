"""The first screen of identifiability: what the runs tell of the vehicle, which coefficients to trust singly.

Takes an `Identifiability` and derived quantities. Gives sentences and blocks. Does not simulate or fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bayesid.analysis.identifiability import Derived, Identifiability
from bayesid.analysis.identifiability.derived import UNITS
from bayesid.report import identify_figures as figures
from bayesid.report.writer import Block, Figure, Section, Text, literal

TOLD = ("tactical diameter", "first overshoot")
MOST_NAMED = 6
KNOWN = "fixed by data"


def headline(found: Identifiability, behaviour: tuple[Derived, Derived] | None) -> str:
    """What is known of the vehicle, and of how many coefficients singly."""
    sure = [e.name for e in found.entries if e.verdict == KNOWN]
    k = len(found.names)
    singly = f"{len(sure)} of {k} coefficients singly" + (f" ({named(sure)})" if 0 < len(sure) < k else "")
    told = [] if behaviour is None else [_known(name, *behaviour) for name in TOLD]
    told = [t for t in told if t]
    if told:
        joined = " and the ".join(told)
        return f"The runs tell the {joined}; they tell {singly}."
    return f"The runs tell {found.n_fixed} of {k} combinations of coefficients, and {singly}."


def _known(name: str, prior: Derived, posterior: Derived) -> str:
    """A quantity with its 90 % interval, and the width of what was known before."""
    if name not in posterior.values:
        return ""
    (_, a, b), (middle, low, high) = prior.interval(name), posterior.interval(name)
    if not np.isfinite(middle):
        return ""
    digits = max(0, -int(np.floor(np.log10(max(0.5 * (high - low), 1e-12)))))
    spread = f"{middle:.{digits}f} ± {0.5 * (high - low):.{digits}f} {_unit(name)}".rstrip()
    return f"{name} to {spread} (90 %; before them {a:.3g} to {b:.3g})"


def _unit(name: str) -> str:
    return UNITS[name].replace("deg", "degrees")


def failures(found: Identifiability) -> list[str]:
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
    if len(names) <= MOST_NAMED:
        return ", ".join(names)
    return f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more"


def next_steps(found: Identifiability, facts: Mapping[str, Any]) -> list[str]:
    """What to do about what is open."""
    if not found.directions:
        return ["`bayesid fit` gives the coefficients with intervals that hold singly."]
    steps = [
        "`bayesid design BUNDLE` looks for the manoeuvre that shrinks what is open most, `bayesid compare "
        "BUNDLE` says what each standard manoeuvre adds.",
        "For a simulator of this vehicle in this kind of motion use all coefficients of one fit together; do "
        "not take single ones over to another vehicle.",
    ]
    if found.structural:
        steps.append(
            "For combinations no run of this kind can tell, keep one coefficient of each at a value known "
            "otherwise: `--fix NAME`."
        )
    return steps


def first_blocks(found: Identifiability, facts: Mapping[str, Any], prefix: str = "") -> list[Block]:
    """The picture of coefficients, and what next."""
    share, contraction = (np.array([getattr(e, k) for e in found.entries]) for k in ("index", "contraction"))
    drawn = figures.index(found.names, share, contraction, [e.verdict for e in found.entries])
    caption = (
        "Bars: share of the data in what is known of each coefficient (1: the runs alone, 0: the prior "
        "alone); marks: how much of the prior's variance is gone. A mark high above its bar is a coefficient "
        "known only through its partners' priors."
    )
    return [
        Figure(f"{prefix}index", drawn, caption, alt="Share of the data per coefficient"),
        Section("What to do next", [Text("\n".join(f"- {s}" for s in next_steps(found, facts)))]),
    ]
