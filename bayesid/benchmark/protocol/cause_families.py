"""Which names count as the same cause, and where each may be located.

Takes names of the effect contract or of the plant's unlisted causes. Does not judge.
"""

from __future__ import annotations

from collections.abc import Iterable

from bayesid.model.effects import CATALOGUE

_FAMILY = {e.name: e.family for e in CATALOGUE} | {a: e.family for e in CATALOGUE for a in e.aliases}
_NAME = {a: e.name for e in CATALOGUE for a in e.aliases}
_WHERE = {e.name: e.where for e in CATALOGUE}
_SIDE = ("Y", "N", "Y+N", "X+Y+N")
# Where a cause without a name acts. Force on the hull: the axes it pushes; else the signal that is wrong.
_STRANGERS = {
    "bank_suction": _SIDE,
    "vortex_shedding": _SIDE,
    "hull_moment": (*_SIDE, "rudder"),  # in answers from before it was listed, as hull_misalignment
    "bent_fin": (*_SIDE, "rudder"),
    "sloshing_mass": (*_SIDE, "K"),
    "stuck_rudder": ("rudder", *_SIDE),
    "servo_hunting": ("rudder", *_SIDE),
    "governor_hunting": ("X", "rpm"),
    "compass_creep": ("psi",),  # in answers from before it was listed, as heading_drift
    "compass_swing": ("psi",),
}
_CAUSES = tuple(e for e in CATALOGUE if e.as_form != "only")
CATALOGUE_NAMES = tuple(e.name for e in _CAUSES)
FAMILIES = tuple(dict.fromkeys(e.family for e in _CAUSES))


def family_of(name: str) -> str:
    """Family of a name; "none", "outside", "coefficient_error" and unknown names are their own."""
    return _FAMILY.get(name, name)


def name_of(name: str) -> str:
    """Name in the contract of an alias; any other name is kept."""
    return _NAME.get(name, name)


def families_of(names: Iterable[str]) -> frozenset[str]:
    """Families of several names."""
    return frozenset(family_of(n) for n in names)


def places_of(name: str) -> tuple[str, ...]:
    """Channels that count as right localisation; empty where nothing is said."""
    if name == "coefficient_error":
        return ("X", *_SIDE, "Z", "M", "Z+M", "K")
    return _WHERE.get(name, _STRANGERS.get(name, ()))


def by_family(probabilities: dict[str, float]) -> dict[str, float]:
    """Probability of every family, names of one family added."""
    out = dict.fromkeys(("none", *FAMILIES, "coefficient_error", "outside"), 0.0)
    for name, p in probabilities.items():
        out[family_of(name)] = out.get(family_of(name), 0.0) + float(p)
    return out
