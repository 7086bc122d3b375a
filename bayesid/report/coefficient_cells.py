"""A coefficient as every table prints it: prime value, SI value beside it, SI unit.

Takes a vehicle and SI values. Gives cells. Does not choose what is shown beside them.
"""

from __future__ import annotations

import math
from typing import Any

from bayesid.model.terms import TERMS, term
from bayesid.model.vehicles import Vehicle, prime_unit

COLUMNS = ("prime", "SI", "SI unit")
FORM = "Prime values (SNAME), SI beside them; a dash where a number has no prime form."
_NAMES = frozenset(row.name for row in TERMS)


def prime(vehicle: Vehicle | None, name: str, value: float) -> float | None:
    """Prime value of an SI value; None for what has none, such as propulsion, noise or an effect."""
    if vehicle is None or name not in _NAMES:
        return None
    unit = prime_unit(vehicle, name)
    return float(value) / unit if math.isfinite(unit) else None


def cells(vehicle: Vehicle | None, name: str, value: float) -> list[Any]:
    """Cells of `COLUMNS` for an SI value."""
    unit = term(name).unit if name in _NAMES else None
    return [prime(vehicle, name, value), float(value), unit]
