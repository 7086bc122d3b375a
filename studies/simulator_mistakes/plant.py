"""Mistakes planted into a vehicle file: what somebody's simulator would have written.

Takes a `Vehicle`; gives the one with the mistake. Written out by hand, not by the table of mends it checks.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from bayesid.model.terms import TERMS
from bayesid.model.vehicles import Vehicle

KNOWN = {term.name for term in TERMS}

Change = Callable[[Vehicle], Vehicle | None]


@dataclass(frozen=True)
class Planted:
    """A mistake to plant.

    Attributes
    ----------
    name : of the row
    change : the vehicle with it; None where it cannot have it
    right : mistakes that are the right name
    effects : effects of the catalogue that are one as well
    inputs : mistakes of the log that nobody can tell from it
    spatial : whether it is planted in 6-DOF alone: in the plane it is another row, or nothing
    """

    name: str
    change: Change
    right: tuple[str, ...]
    effects: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    spatial: bool = False


def _with(vehicle: Vehicle, coef: dict[str, float]) -> Vehicle:
    return replace(vehicle, coef={k: v for k, v in coef.items() if v != 0.0})


def _munk(times: float) -> Change:
    """N_v and M_w with so many Munk moments more."""

    def change(v: Vehicle) -> Vehicle:
        c = dict(v.coef)
        surge = c.get("X_udot", 0.0)
        c["N_v"] = c.get("N_v", 0.0) + times * (c["Y_vdot"] - surge)
        if "Z_wdot" in c:
            c["M_w"] = c.get("M_w", 0.0) + times * (surge - c["Z_wdot"])
        return _with(v, c)

    return change


def _coriolis(times: float) -> Change:
    """-C_A(nu) nu of the symmetric half of the added mass, so many times more, read off numerically.

    The share of a product of two velocities is what both bring beyond each alone.
    """

    def change(v: Vehicle) -> Vehicle:
        mass = np.array([[-v.coef.get(f"{axis}_{dot}dot", 0.0) for dot in "uvwpqr"] for axis in "XYZKMN"])
        mass = 0.5 * (mass + mass.T)

        def force(nu: np.ndarray) -> np.ndarray:
            momentum = mass @ nu
            turned = np.cross(nu[3:], momentum[:3])
            return -np.concatenate((turned, np.cross(nu[:3], momentum[:3]) + np.cross(nu[3:], momentum[3:])))

        c, unit = dict(v.coef), np.eye(6)
        for i, j in combinations_with_replacement(range(6), 2):
            both = force(unit[i] + unit[j]) - force(unit[i]) - force(unit[j])
            for axis, value in zip("XYZKMN", 0.5 * both if i == j else both, strict=True):
                if abs(value) > 1e-12 * np.abs(mass).max():
                    name = _row(axis, "uvwpqr"[i], "uvwpqr"[j])
                    c[name] = c.get(name, 0.0) + times * value
        return _with(v, c)

    return change


def _row(axis: str, one: str, other: str) -> str:
    """Name of the coefficient of a product; u is left out of it."""
    if "u" in (one, other):
        return f"{axis}_{one}{other}".replace("u", "", 1)
    return next(n for n in (f"{axis}_{one}{other}", f"{axis}_{other}{one}") if n in KNOWN)


def _times(ending: str, factor: float) -> Change:
    return lambda v: _with(v, {k: factor * x if k.endswith(ending) else x for k, x in v.coef.items()})


def _diagonal(v: Vehicle) -> Vehicle:
    return _with(v, {k: 0.0 if k in ("Y_r", "N_v", "M_w", "Z_q") else x for k, x in v.coef.items()})


def _munk_only(v: Vehicle) -> Vehicle:
    """Cross rows of potential flow alone: damping without cross terms beside a Coriolis matrix."""
    c = dict(v.coef)
    surge = c.get("X_udot", 0.0)
    c |= {"N_v": c["Y_vdot"] - surge, "Y_r": surge}
    if "Z_wdot" in c and "M_w" in c:
        c |= {"M_w": surge - c["Z_wdot"], "Z_q": -surge}
    return _with(v, c)


def _fins(factor: float) -> Change:
    one = ("Y_dr", "N_dr", "Z_ds", "M_ds", "K_dr", "Y_|r|dr", "N_|r|dr", "X_rdr", "X_vdr", "X_qds", "X_wds")
    power = {**dict.fromkeys(one, 1), "X_drdr": 2, "X_dsds": 2}
    return lambda v: _with(v, {k: x * factor ** power.get(k, 0) for k, x in v.coef.items()})


def _one_sign(letters: str) -> Change:
    """Rows odd in one fin's angle turned, where the file has another fin."""

    def change(v: Vehicle) -> Vehicle | None:
        if not all(any(k.endswith(fin) for k in v.coef) for fin in ("dr", "ds")):
            return None
        odd = [k for k in v.coef if k.partition("_")[2].count(letters) == 1]
        return _with(v, {k: -x if k in odd else x for k, x in v.coef.items()})

    return change


def _rates(factor: float) -> Change:
    """Every row by its power of p, q and r, read off its name; angular accelerations stay."""

    def power(name: str) -> int:
        letters = re.sub(r"d[rsb]|[uvwpqr]dot|prop_|eta", "", name[2:])
        return sum(letters.count(c) for c in "pqr")

    return lambda v: _with(v, {k: x * factor ** power(k) for k, x in v.coef.items()})


def _length(ratio: float) -> Change:
    """Primes by another length: 1/2 rho L^k of each row with that one."""

    def change(v: Vehicle) -> Vehicle:
        from bayesid.model.terms import term

        return _with(v, {k: x * ratio ** term(k).length_power for k, x in v.coef.items()})

    return change


def _factor(factor: float) -> Change:
    return lambda v: _with(v, {k: x * factor for k, x in v.coef.items()})


def _point(share: float) -> Change:
    """Coefficients about x = share L stated as about the origin."""

    def change(v: Vehicle) -> Vehicle:
        x = -share * (1.0 if v.nondimensional else v.L)
        c = dict(v.coef)
        for end in ("", "dot"):
            yv, yr, nv, nr = (c.get(f"{n}{end}", 0.0) for n in ("Y_v", "Y_r", "N_v", "N_r"))
            c[f"Y_r{end}"] = yr + x * yv
            c[f"N_v{end}"] = nv + x * yv
            c[f"N_r{end}"] = nr + x * (yr + nv) + x * x * yv
            zw, zq, mw, mq = (c.get(f"{n}{end}", 0.0) for n in ("Z_w", "Z_q", "M_w", "M_q"))
            c[f"Z_q{end}"] = zq - x * zw
            c[f"M_w{end}"] = mw - x * zw
            c[f"M_q{end}"] = mq - x * (zq + mw) + x * x * zw
        c["N_v|v|"] = c.get("N_v|v|", 0.0) + x * c.get("Y_v|v|", 0.0)
        c["M_w|w|"] = c.get("M_w|w|", 0.0) - x * c.get("Z_w|w|", 0.0)
        c["N_dr"] = c.get("N_dr", 0.0) + x * c.get("Y_dr", 0.0)
        c["M_ds"] = c.get("M_ds", 0.0) - x * c.get("Z_ds", 0.0)
        return _with(v, c)

    return change


def _centres(v: Vehicle) -> Vehicle | None:
    return None if v.planar_only else replace(v, r_G=v.r_B, r_B=v.r_G)


def _buoyancy(share: float) -> Change:
    return lambda v: replace(v, r_B=(v.r_B[0] + share * v.L, *v.r_B[1:]))


CORIOLIS = (
    "added-mass Coriolis missing",
    "added-mass Coriolis twice",
    "added-mass Coriolis of the wrong sign",
)


def planted() -> tuple[Planted, ...]:
    """All mistakes a vehicle file can hold."""
    return (
        Planted("Munk moment missing", _munk(-1.0), ("Munk moment missing",)),
        Planted("Munk moment twice", _munk(1.0), ("Munk moment twice",)),
        Planted("added-mass Coriolis missing", _coriolis(-1.0), (CORIOLIS[0],)),
        Planted("added-mass Coriolis twice", _coriolis(1.0), (CORIOLIS[1],)),
        Planted("added-mass Coriolis of the wrong sign", _coriolis(-2.0), (CORIOLIS[2],)),
        Planted("added mass twice", _times("dot", 2.0), ("added mass twice",), ("added_mass_error",)),
        Planted("added mass halved", _times("dot", 0.5), ("added mass halved",), ("added_mass_error",)),
        Planted("no cross terms", _diagonal, ("diagonal damping",)),
        Planted("no cross terms but potential flow", _munk_only, ("diagonal damping",)),
        Planted("sign of the fins", _fins(-1.0), ("sign of the fins",), (), ("sign of delta_r",)),
        Planted(
            "fins per degree", _fins(0.0174533), ("fin angles in degrees",), (),
            ("delta_r: degrees read as radians", "delta_r: radians read as degrees"),
        ),
        Planted("rates per degree", _rates(0.0174533), ("rates in degrees",)),
        Planted("another length (1.06)", _length(1 / 1.06), ("another length",)),
        Planted("another length (0.9)", _length(1 / 0.9), ("another length",)),
        Planted("all coefficients halved", _factor(0.5), ("coefficients by a factor",)),
        Planted("moments about x = 0.05 L", _point(0.05), ("moments about another point",)),
        Planted("moments about x = -0.03 L", _point(-0.03), ("moments about another point",)),
        Planted(
            "centres of gravity and buoyancy exchanged", _centres,
            ("centres of gravity and buoyancy exchanged", "z upwards"),
        ),
        Planted(
            "centre of buoyancy 0.005 L forward", _buoyancy(0.005),
            ("centre of buoyancy at the wrong point",), ("trim_weight", "cg_offset_x"),
        ),
        Planted(
            "sign of the rudder", _one_sign("dr"), ("sign of the rudder",), (), ("sign of delta_r",), True
        ),
        Planted(
            "sign of the stern planes", _one_sign("ds"), ("sign of the stern planes",), (),
            ("sign of delta_s",), True,
        ),
    )  # fmt: skip
