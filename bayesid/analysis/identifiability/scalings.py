"""Coefficient sets that no track can tell apart: whole equations scaled, or one added to another.

Takes a `Model` and parameters. Gives the changed parameters, and the directions such changes take within the
free parameters of a `FitProblem`. Finite changes are exact; does not look at data, so the one that holds for
one-sided turns only is a candidate until data confirm it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.analysis.identifiability.equal_accelerations import equal_accelerations
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.model.terms import term

Array = np.ndarray
WORDS = {
    "X": "scale of the surge equation",
    "Y": "scale of the sway equation",
    "N": "scale of the yaw equation",
    "Y in N": "sway equation added to the yaw equation (one-sided turns)",
}
NEW = 1e-3  # of its length: what a direction must have beside those known already
ROUNDING = 1e-9  # of a column: what is left of a combination that vanishes


@dataclass(frozen=True, eq=False)
class Scaling:
    """One change of the equations that leaves every track as it is, or every one-sided one.

    name : in words, see `WORDS`; several joined by their shares where fixed coefficients leave only a mixture
    tangent : (k,) change of the free parameters along it [SI], of any length
    """

    name: str
    tangent: Array


def scalings(problem: FitProblem, z: Array) -> tuple[Scaling, ...]:
    """Structural directions that lie within the free parameters of a problem at `z`.

    A scaling counts only as far as every coefficient it moves is free, or tied so that it can follow: with
    one coefficient of each of two equations fixed, no equation can be scaled by itself.

    Returns
    -------
    single equations first, then mixtures; then what is not known in closed form (in six degrees of freedom
    all of it) and found as combinations that change no acceleration
    """
    closed = _in_closed_form(problem, z)
    size = np.array([p.scale for p in problem.params.free])
    known = np.array([s.tangent / size for s in closed]).reshape(len(closed), len(size))
    out = list(closed)
    for words, tangent in equal_accelerations(problem, z):
        left = tangent / size
        if len(known):
            basis = np.linalg.qr(known.T)[0]
            left = left - basis @ (basis.T @ left)
        if np.linalg.norm(left) > NEW * np.linalg.norm(tangent / size):
            out.append(Scaling(words, tangent))
            known = np.vstack([known, tangent / size])
    return tuple(out)


def _in_closed_form(problem: FitProblem, z: Array) -> tuple[Scaling, ...]:
    """Those of planar models; in six degrees of freedom at most the one of one-sided turns, a candidate."""
    model, par = problem.model, problem.split(z)[0]
    names, columns = [], []
    for key in WORDS:
        try:
            moved = yaw_mixed(model, par, 1.0) if key == "Y in N" else row_scaled(model, par, key, 2.0)
        except ModelError:
            continue
        change = moved - par  # both are linear in their factor: a finite difference is the tangent
        if np.any(change):
            names.append(key)
            columns.append(change)
    if not columns:
        return ()
    generators = np.array(columns).T
    positions, slopes = problem.params.chain(model.index)
    size = np.maximum(np.abs(generators).max(axis=1), np.abs(par))
    size[size == 0] = 1.0
    generators = generators / size[:, None]
    follow = slopes / size[positions][:, None]
    # what the free parameters cannot follow must cancel between generators
    q, _ = np.linalg.qr(follow)
    left = generators.copy()
    left[positions] -= q @ (q.T @ generators[positions])
    length = np.linalg.norm
    found = [c for c in np.eye(len(names)) if length(left @ c) < ROUNDING * length(generators @ c)]
    found += _mixtures(left, generators, found)
    out = []
    for c in found:
        tangent = np.linalg.lstsq(follow, (generators @ c)[positions], rcond=None)[0]
        out.append(Scaling(_words(names, c), tangent))
    return tuple(out)


def _mixtures(left: Array, generators: Array, single: list[Array]) -> list[Array]:
    """Combinations of generators, beyond those that stand alone, whose fixed parts cancel."""
    scale = np.linalg.norm(generators, axis=0)
    _, s, vt = np.linalg.svd(left / scale, full_matrices=True)
    values = np.zeros(vt.shape[0])
    values[: s.size] = s
    null = vt[values < ROUNDING] / scale
    if single:
        basis = np.linalg.qr(np.array(single).T)[0]
        null = null - (null @ basis) @ basis.T
    keep: list[Array] = []
    for row in null:
        for other in keep:
            row = row - (row @ other) * other
        length = np.linalg.norm(row * scale)
        if length > 1e-6:
            keep.append(row / np.linalg.norm(row))
    return keep


def _words(names: list[str], shares: Array) -> str:
    shares = shares / np.abs(shares).max()
    picked = [i for i in np.argsort(-np.abs(shares)) if abs(shares[i]) > 1e-6]
    if len(picked) == 1:
        return WORDS[names[picked[0]]]
    return "mixture: " + ", ".join(f"{shares[i]:+.2g} {WORDS[names[i]]}" for i in picked)


def row_scaled(model: Model, par: Array, axis: str, factor: float) -> Array:
    """Coefficients of one equation changed so that the whole equation is multiplied by `factor`; planar
    models.

    Accelerations, and so every track, stay the same whatever the manoeuvre: the rigid-body terms, which
    cannot change, are made up for by the added mass and the rows that look like them (m - Y_vdot, Y_r - m,
    X_vr + m ...).

    Raises
    ------
    ModelError
        for a 6-DOF model or an axis other than X, Y, N
    """
    if model.dof != 3 or axis not in "XYN":
        raise ModelError(f"rows can be scaled in planar models and for X, Y, N, not {model.dof}-DOF {axis}")
    out = np.array(par, dtype=float)
    for name, i in model.index.items():
        if ("." not in name and name[:2] == f"{axis}_") or (axis == "X" and name.startswith("X_prop")):
            out[i] *= factor
    for name, value in _rigid_body(model, par, axis).items():
        out[model.index[name]] += (1.0 - factor) * value
    return out


def _rigid_body(model: Model, par: Array, axis: str) -> dict[str, float]:
    """Rigid-body part of a row, written as the coefficients it would be on the force side."""
    m, inertia, x_g, y_g = (float(par[model.index[n]]) for n in ("m", "Izz", "x_G", "y_G"))
    if y_g != 0.0:
        raise ModelError("the centre of mass is off the centre plane; there are no rows to make up for it")
    return {
        "X": {"X_udot": m, "X_vr": -m, "X_rr": -m * x_g},
        "Y": {"Y_vdot": m, "Y_rdot": m * x_g, "Y_r": m},
        "N": {"N_rdot": inertia, "N_vdot": m * x_g, "N_r": m * x_g},
    }[axis]


def yaw_mixed(model: Model, par: Array, factor: float) -> Array:
    """`factor` times length times the sway equation added to the yaw equation, for one-sided turns (v r < 0).

    Y_v|r| v|r| is put on N_|v|r as -|v|r, which holds only while v and r keep opposite signs.
    """
    lever = factor * model.vehicle.L
    out = np.array(par, dtype=float)
    body = _rigid_body(model, par, "Y")
    for name, i in model.index.items():
        if "." in name or name[:2] != "Y_" or par[i] == 0.0:
            continue
        recovery, sign = f"N{name[1:]}", 1.0
        if name == "Y_v|r|":
            recovery, sign = "N_|v|r", -1.0
        if recovery not in model.index or term(recovery).axis != "N":
            raise ModelError(f"{name} has no counterpart among the N rows of this model")
        out[model.index[recovery]] += sign * lever * (par[i] - body.get(name, 0.0))
    return out
