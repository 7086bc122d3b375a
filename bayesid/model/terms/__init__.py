"""The table of force terms: `TERMS`, and `term(name)` for one row.

Takes: a canonical name; other spellings go through `canonical_name` first.
Does not: hold coefficient values (vehicles) or evaluate forces (kernels).
"""

from __future__ import annotations

import difflib

from bayesid.errors import VehicleError
from bayesid.model.terms.dialects import alias, canonical_name
from bayesid.model.terms.references import REFERENCES
from bayesid.model.terms.row import Factor, Term, factors
from bayesid.model.terms.table import TERMS

__all__ = [
    "ADDED_MASSES",
    "REFERENCES",
    "TERMS",
    "Factor",
    "Term",
    "alias",
    "canonical_name",
    "factors",
    "term",
]

_BY_NAME = {row.name: row for row in TERMS}
#: minus the added mass or inertia along each axis itself
ADDED_MASSES = tuple(row.name for row in TERMS if row.is_added_mass)


def term(name: str) -> Term:
    """Row of a canonical coefficient name.

    Raises
    ------
    VehicleError
        if the table has no such row; names the nearest rows
    """
    row = _BY_NAME.get(name)
    if row is None:
        near = difflib.get_close_matches(name, _BY_NAME, n=3, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise VehicleError(f"no coefficient {name!r} in the force table{hint}")
    return row
