"""What a manoeuvre can tell about coefficients, before anything is fitted.

Takes a `Model`, parameters, a plan and names. Gives sensitivities per relative change, singular values, named
flat directions, and the coefficient sets that no track can tell apart. Does not fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.errors import ModelError
from bayesid.likelihood import Direction, flat_directions, rank, singular_values
from bayesid.model import Model
from bayesid.simulate import Plan, sensitivities
from bayesid.terms import term

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Sensitivity of a run to relative changes of coefficients.

    Attributes
    ----------
    names : (k,)
    norms : (k,) root sum of squares of each column, in units of sigma
    values : (k,) singular values, falling
    flat : named directions below the level asked for
    rank : number of singular values above rounding
    """

    names: tuple[str, ...]
    norms: Array
    values: Array
    flat: tuple[Direction, ...]
    rank: int


def sensitivity_columns(
    model: Model, par: Array, plan: Plan, x0: Array, names: Sequence[str], channels: Sequence[str]
) -> Array:
    """(n, c, k) change of each state listed for a relative change of one of each coefficient."""
    where = model.positions(names)
    result = sensitivities(model, par, plan, x0, where, initial=False)
    picked = [model.states.index(c) for c in channels]
    return result.jacobian[:, picked] * np.asarray(par)[where]


def spectrum(
    model: Model,
    par: Array,
    runs: Sequence[tuple[Plan, Array]],
    names: Sequence[str],
    channels: Sequence[str] = ("x", "y", "psi"),
    sigma: Sequence[float] | None = None,
    level: float = 0.5,
) -> Spectrum:
    """Singular values of the stacked sensitivities of several runs.

    Parameters
    ----------
    runs : plan and initial state of each
    sigma : noise per channel [SI], 1 by default
    level : relative sd beyond which a direction counts as flat
    """
    weight = np.ones(len(channels)) if sigma is None else np.asarray(sigma, dtype=float)
    blocks = [
        (sensitivity_columns(model, par, plan, x0, names, channels) / weight[:, None]).reshape(-1, len(names))
        for plan, x0 in runs
    ]
    jac = np.vstack(blocks)
    values, _ = singular_values(jac)
    flat = flat_directions(names, jac, level)
    return Spectrum(tuple(names), np.linalg.norm(jac, axis=0), values, flat, rank(values))


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
        twin, sign = f"N{name[1:]}", 1.0
        if name == "Y_v|r|":
            twin, sign = "N_|v|r", -1.0
        if twin not in model.index or term(twin).axis != "N":
            raise ModelError(f"{name} has no counterpart among the N rows of this model")
        out[model.index[twin]] += sign * lever * (par[i] - body.get(name, 0.0))
    return out
