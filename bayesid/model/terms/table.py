"""The force table: every coefficient bayesid knows, one row each.

Takes: nothing. Holds axis, name, regressor, source; everything else is computed in `row`.
Does not: hold values, rigid-body or hydrostatic terms (those follow from mass properties, not from rows).

Regressors use body velocity THROUGH THE WATER (u v w p q r) and its rate (udot ... rdot), delta_r,
delta_s, delta_b [rad], n [rpm], eta1 = u_c/U - 1, and the cross-flow speeds Rv and Rw: sqrt(v^2 + w^2)
in Gertler-Hagen sets, |v| and |w| in `plain_abs` sets. sgn(v) Rv |r| is (v/|v|) R |r| with 0 at v = 0; the
kernels round its jump (`kernels.flow.SIDE`). Ship rows of the MMG method divide by the speed U (`mmg`).
"""

from __future__ import annotations

from bayesid.model.terms.mmg import HULL_ROWS, NUMBER_ROWS
from bayesid.model.terms.row import Term


def _rows(axis: str, source: str, group: str, rows: dict[str, str]) -> tuple[Term, ...]:
    return tuple(Term(f"{axis}_{name}", axis, regressor, source, group) for name, regressor in rows.items())


def _gertler(axis: str, rows: dict[str, str]) -> tuple[Term, ...]:
    return _rows(axis, "gertler1967", "base", rows)


GERTLER_HAGEN = (
    *_gertler(
        "X",
        {
            "udot": "udot",
            "qq": "q*q",
            "rr": "r*r",
            "rp": "r*p",
            "vr": "v*r",
            "wq": "w*q",
            "uu": "u*u",
            "vv": "v*v",
            "ww": "w*w",
            "drdr": "u*u*delta_r*delta_r",
            "dsds": "u*u*delta_s*delta_s",
            "dbdb": "u*u*delta_b*delta_b",
        },
    ),
    *_gertler(
        "Y",
        {
            "vdot": "vdot",
            "rdot": "rdot",
            "pdot": "pdot",
            "p|p|": "p*abs(p)",
            "pq": "p*q",
            "qr": "q*r",
            "vq": "v*q",
            "wp": "w*p",
            "wr": "w*r",
            "r": "u*r",
            "p": "u*p",
            "|r|dr": "u*abs(r)*delta_r",
            "v|r|": "sgn(v)*Rv*abs(r)",
            "*": "u*u",
            "v": "u*v",
            "v|v|": "v*Rv",
            "vw": "v*w",
            "dr": "u*u*delta_r",
        },
    ),
    *_gertler(
        "Z",
        {
            "wdot": "wdot",
            "qdot": "qdot",
            "pp": "p*p",
            "rr": "r*r",
            "rp": "r*p",
            "vr": "v*r",
            "vp": "v*p",
            "q": "u*q",
            "|q|ds": "u*abs(q)*delta_s",
            "w|q|": "sgn(w)*Rw*abs(q)",
            "*": "u*u",
            "w": "u*w",
            "w|w|": "w*Rw",
            "|w|": "u*abs(w)",
            "ww": "abs(w*Rw)",
            "vv": "v*v",
            "ds": "u*u*delta_s",
            "db": "u*u*delta_b",
        },
    ),
    *_gertler(
        "K",
        {
            "pdot": "pdot",
            "rdot": "rdot",
            "vdot": "vdot",
            "qr": "q*r",
            "pq": "p*q",
            "p|p|": "p*abs(p)",
            "p": "u*p",
            "r": "u*r",
            "vq": "v*q",
            "wp": "w*p",
            "wr": "w*r",
            "*": "u*u",
            "v": "u*v",
            "v|v|": "v*Rv",
            "vw": "v*w",
            "dr": "u*u*delta_r",
        },
    ),
    *_gertler(
        "M",
        {
            "qdot": "qdot",
            "wdot": "wdot",
            "pp": "p*p",
            "rr": "r*r",
            "rp": "r*p",
            "q|q|": "q*abs(q)",
            "vr": "v*r",
            "vp": "v*p",
            "q": "u*q",
            "|q|ds": "u*abs(q)*delta_s",
            "|w|q": "Rw*q",
            "*": "u*u",
            "w": "u*w",
            "w|w|": "w*Rw",
            "|w|": "u*abs(w)",
            "ww": "abs(w*Rw)",
            "vv": "v*v",
            "ds": "u*u*delta_s",
            "db": "u*u*delta_b",
        },
    ),
    *_gertler(
        "N",
        {
            "rdot": "rdot",
            "vdot": "vdot",
            "pdot": "pdot",
            "pq": "p*q",
            "qr": "q*r",
            "r|r|": "r*abs(r)",
            "wr": "w*r",
            "wp": "w*p",
            "vq": "v*q",
            "p": "u*p",
            "r": "u*r",
            "|r|dr": "u*abs(r)*delta_r",
            "|v|r": "Rv*r",
            "*": "u*u",
            "v": "u*v",
            "v|v|": "v*Rv",
            "vw": "v*w",
            "dr": "u*u*delta_r",
        },
    ),
)

FURTHER = (
    *_rows("X", "prestero2001", "base", {"u|u|": "u*abs(u)"}),
    *_rows("X", "dasilva2007", "base", {"u0": "u"}),
    *_rows(
        "X",
        "healey1993",
        "base",
        {
            "pp": "p*p",
            "vp": "v*p",
            "qds": "u*q*delta_s",
            "rdr": "u*r*delta_r",
            "vdr": "u*v*delta_r",
            "wds": "u*w*delta_s",
        },
    ),
    *_rows("Y", "prestero2001", "base", {"r|r|": "r*abs(r)"}),
    *_rows("Z", "prestero2001", "base", {"q|q|": "q*abs(q)"}),
    *_rows("Y", "dasilva2007", "base", {"|v|r": "Rv*r", "v0": "v", "r0": "r"}),
    *_rows("N", "dasilva2007", "base", {"v|r|": "sgn(v)*Rv*abs(r)", "v0": "v", "r0": "r"}),
    *_rows("Z", "dasilva2007", "base", {"w0": "w", "q0": "q"}),
    *_rows("M", "dasilva2007", "base", {"w0": "w", "q0": "q"}),
    *_rows("K", "dasilva2007", "base", {"p0": "p"}),
)

# what completes the cubes of drift and turning: all of third order in drift, turning and rudder
_FIN_CUBES = {
    "drdrdr": "u*u*delta_r*delta_r*delta_r",
    "vdrdr": "u*v*delta_r*delta_r",
    "rdrdr": "u*r*delta_r*delta_r",
    "vvdr": "v*v*delta_r",
    "vrdr": "v*r*delta_r",
    "rrdr": "r*r*delta_r",
}

SHIP = (
    *_rows("X", "yasukawa2015", "base", {"vvvv": "v*v*v*v"}),
    *_rows("Y", "yasukawa2015", "base", {"vvv": "v*v*v", "vvr": "v*v*r", "vrr": "v*r*r", "rrr": "r*r*r"}),
    *_rows("N", "yasukawa2015", "base", {"vvv": "v*v*v", "vvr": "v*v*r", "vrr": "v*r*r", "rrr": "r*r*r"}),
    *_rows("Y", "abkowitz1964", "base", _FIN_CUBES),
    *_rows("N", "abkowitz1964", "base", _FIN_CUBES),
)

_ETA = {
    "X": ("vv", "ww", "drdr", "dsds"),
    "Y": ("r", "v", "v|v|", "dr"),
    "Z": ("q", "w", "w|w|", "ds"),
    "K": ("*",),
    "M": ("q", "w", "w|w|", "ds"),
    "N": ("r", "v", "v|v|", "dr"),
}
_BASE = {row.name: row for row in GERTLER_HAGEN}
ETA = tuple(
    Term(f"{axis}_{name},eta", axis, f"{_BASE[f'{axis}_{name}'].regressor}*eta1", "gertler1967", "eta")
    for axis, names in _ETA.items()
    for name in names
)

PROPULSION = (
    *_rows(
        "X", "gertler1967", "propulsion", {"prop_u|u|": "u*abs(u)", "prop_un": "u*n", "prop_n|n|": "n*abs(n)"}
    ),
    *_rows("X", "dasilva2007", "propulsion", {"prop_n": "n"}),
)

#: every row; the order is the order of parameters everywhere, so new rows go to the end of their block
TERMS: tuple[Term, ...] = (*GERTLER_HAGEN, *FURTHER, *SHIP, *ETA, *PROPULSION, *HULL_ROWS, *NUMBER_ROWS)
