"""Terms a missing force may be made of, on every axis: rows of the force table and a few more.

Takes a `Model`. Gives named columns, their values along a path and the unit of their coefficients. Does not
choose among them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.analysis.excitation.columns import LibraryColumn, evaluate
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.run_data import Array
from bayesid.model.terms import TERMS, Term, term
from bayesid.simulation import mean_positions

_ROWS = {
    "X": ("vr", "vv", "rr", "uu", "drdr", "prop_un", "prop_n|n|"),
    "Y": ("v", "r", "v|v|", "r|r|", "v|r|", "|v|r", "vvv", "vvr", "vrr", "rrr", "dr", "*"),
    "N": ("v", "r", "v|v|", "r|r|", "v|r|", "|v|r", "vvv", "vvr", "vrr", "rrr", "dr", "*"),
    "Z": ("w", "q", "w|w|", "w|q|", "vv", "rr", "vr", "ds", "*"),
    "K": ("v", "r", "p", "v|v|", "p|p|", "dr", "*"),
    "M": ("w", "q", "w|w|", "q|q|", "vv", "rr", "vr", "ds", "*"),
}
_EARTH = {"cos(psi)": "cos(psi)", "sin(psi)": "sin(psi)"}
_SIDE = {
    "dr|dr|": "u*u*delta_r*abs(delta_r)", "|dr|": "u*u*abs(delta_r)", "|v|": "u*abs(v)", "|r|": "u*abs(r)",
    "nn": "n*abs(n)", **_EARTH,
}  # fmt: skip
_MORE = {
    "X": {"|v|": "u*abs(v)", "|dr|": "u*u*abs(delta_r)", **_EARTH},
    "Y": _SIDE,
    "N": _SIDE,
    "Z": {
        "ds|ds|": "u*u*delta_s*abs(delta_s)",
        "nn": "n*abs(n)",
        "cos(phi)cos(theta)": "cos(phi)*cos(theta)",
    },
    "K": {"|dr|": "u*u*abs(delta_r)", "nn": "n*abs(n)", "sin(phi)": "sin(phi)*cos(theta)"},
    "M": {"ds|ds|": "u*u*delta_s*abs(delta_s)", "nn": "n*abs(n)", "sin(theta)": "sin(theta)"},
}


def force_library(model: Model) -> tuple[LibraryColumn, ...]:
    """Terms a missing force may be made of: rows of the force table and a few more, on every axis."""
    known = {t.name: t for t in TERMS}
    out = []
    for axis in [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]:
        for name in (f"{axis}_{n}" for n in _ROWS[axis]):
            if name in known and (model.dof == 6 or known[name].planar):
                nominal = float(model.nominal[model.index[name]]) if name in model.index else 0.0
                out.append(LibraryColumn(name, axis, known[name].regressor, nominal))
        out += [LibraryColumn(f"{axis}_{n}", axis, text, is_row=False) for n, text in _MORE[axis].items()]
    return tuple(out)


def along(model: Model, path: Linearisation, columns: Sequence[LibraryColumn]) -> Array:
    """(n-1, k) columns at the middles of the sample intervals of a path."""
    nx = len(model.states)
    middle = 0.5 * (path.point.states[1:, :nx] + path.point.states[:-1, :nx])
    act = actuator_means(model, path)
    return np.column_stack([evaluate(c.expression, model, middle, act) for c in columns])


def actuator_means(model: Model, path: Linearisation) -> Array:
    """(n-1, na) mean positions of the actuators over the sample intervals of a path [rad, rpm]."""
    return mean_positions(model, path.point.par, path.log.plan)


def unit_of(column: LibraryColumn) -> str:
    """SI unit of the coefficient."""
    if column.is_row:
        return term(column.name).unit
    if "(psi)" in column.name or "(phi)" in column.name or "(theta)" in column.name:
        return "N" if column.axis in "XYZ" else "N m"
    return Term(column.name, column.axis, column.expression, "assumed: description of a missing force").unit
