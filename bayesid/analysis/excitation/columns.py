"""The library: one named column per row of the force table, and further columns no row has.

Takes a `Model` and a `Motion`. Gives columns [regressor units] and the wrench they must supply [N, N m]. Rows
are evaluated by the model's own kernel; extra columns by their expression, in the symbols of effects. Does
not regress.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.excitation.motion import Motion
from bayesid.equations.layout import rows_of
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.model.terms import term
from bayesid.simulation import rates_on

Array = np.ndarray

#: what an extra column may call; each means the same in an effect's equation
FUNCTIONS = {"abs": np.abs, "sgn": np.sign, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}


@dataclass(frozen=True)
class LibraryColumn:
    """One column of the library.

    Attributes
    ----------
    name : as a row of the force table, axis first
    axis : X Y Z K M N
    expression : the regressor; SI and radians, rpm for n
    nominal : coefficient in the vehicle file [SI], 0 where it has none
    is_row : whether the force table holds it
    """

    name: str
    axis: str
    expression: str
    nominal: float = 0.0
    is_row: bool = True

    @property
    def in_model(self) -> bool:
        return self.nominal != 0.0


#: columns beyond the table that a low order of odd and even terms in rudder, drift and shaft speed leaves out
EXTRA = {
    "X": {"|v|": "u*abs(v)", "|dr|": "u*u*abs(delta_r)"},
    "Y": {
        "dr|dr|": "u*u*delta_r*abs(delta_r)", "|dr|": "u*u*abs(delta_r)", "|v|": "u*abs(v)",
        "|r|": "u*abs(r)", "nndr": "n*n*delta_r", "nn": "n*abs(n)",
    },
    "N": {
        "dr|dr|": "u*u*delta_r*abs(delta_r)", "|dr|": "u*u*abs(delta_r)", "|v|": "u*abs(v)",
        "|r|": "u*abs(r)", "nndr": "n*n*delta_r", "nn": "n*abs(n)",
    },
}  # fmt: skip


def library(model: Model, extra: bool = True) -> tuple[LibraryColumn, ...]:
    """Columns of a model: every row its kernel reads but accelerations, which the vehicle file supplies.

    A row of the balance, its acceleration derivatives free, may be multiplied by any number without a change
    of the track; the acceleration derivatives of the vehicle file set its scale.
    """
    out = []
    for row in rows_of(model.kernel.spec):
        if not row.is_inertia and not row.is_number:
            value = float(model.nominal[model.index[row.name]])
            out.append(LibraryColumn(row.name, row.axis, row.regressor, value))
    if extra:
        for axis, columns in EXTRA.items():
            out += [LibraryColumn(f"{axis}_{n}", axis, text, is_row=False) for n, text in columns.items()]
    return tuple(out)


def evaluate(expression: str, model: Model, states: Array, actuators: Array) -> Array:
    """Value of an expression at n points.

    Parameters
    ----------
    states : (n, nx) order of `model.states`
    actuators : (n, na) order of the kernel's actuators

    Raises
    ------
    ModelError
        if the expression reads a symbol there is none of
    """
    zero = np.zeros(len(states))
    names = dict.fromkeys(("z", "phi", "theta", "w", "p", "q", "delta_s", "delta_b"), zero)
    names |= {n: states[:, i] for i, n in enumerate(model.states)}
    names |= {n: actuators[:, i] for i, n in enumerate(model.kernel.actuators)}
    cross = float(model.nominal[model.index["cross"]]) if "cross" in model.index else 0.0
    names["Rv"] = np.sqrt(names["v"] ** 2 + cross * names["w"] ** 2)
    names["Rw"] = np.sqrt(names["w"] ** 2 + cross * names["v"] ** 2)
    slowest = 4e-4 * model.scales["U"] ** 2
    names["U"] = np.sqrt(np.maximum(names["u"] ** 2 + names["v"] ** 2, slowest))
    names["S"] = np.clip(10.0 * names["u"] / names["U"], -1.0, 1.0)
    used = {node.id for node in ast.walk(ast.parse(expression, mode="eval")) if isinstance(node, ast.Name)}
    unknown = used - names.keys() - FUNCTIONS.keys()
    if unknown:
        raise ModelError(f"column {expression!r}: no symbol {', '.join(sorted(unknown))}")
    value = eval(compile(expression, "<column>", "eval"), {"__builtins__": {}, **FUNCTIONS}, names)
    return np.broadcast_to(np.asarray(value, dtype=float), zero.shape)


def theta(
    model: Model, columns: Sequence[LibraryColumn], states: Array, actuators: Array
) -> tuple[Array, Array, Array]:
    """Columns at n points, the wrench of everything that is no column, and the mass matrix.

    Returns
    -------
    (n, k) columns, each on its own axis; (n, nv) wrench of rigid-body Coriolis forces, statics, strip drag
    and thrust curve over the mass matrix [m/s^2, rad/s^2]; (nv, nv) mass matrix with the added mass
    """
    rows = [c for c in columns if c.is_row]
    free = model.positions([c.name for c in rows])
    par = model.nominal.copy()
    par[model.positions([c.name for c in library(model, extra=False)])] = 0.0
    rest, slope, mass = rates_on(model, par, states, actuators, free)
    axes = [AXIS[v] for v in model.kernel.velocities]
    wrench = np.einsum("ab,nbk->nak", mass, slope)
    out = np.empty((len(states), len(columns)))
    at = {c.name: k for k, c in enumerate(rows)}
    for k, column in enumerate(columns):
        if column.is_row:
            out[:, k] = wrench[:, axes.index(column.axis), at[column.name]]
        else:
            out[:, k] = evaluate(column.expression, model, states, actuators)
    return out, rest, mass


AXIS = {"u": "X", "v": "Y", "w": "Z", "p": "K", "q": "M", "r": "N"}


@dataclass(frozen=True, eq=False)
class Rows:
    """A regression of wrenches on columns, all runs stacked.

    Attributes
    ----------
    columns : names and expressions of `theta`
    axes : axis letters of `target`
    theta : (m, k) regressor values; (m, k) `error` one sd of what sensor noise does to them
    target : (m, nv) wrench the columns must supply [N, N m]
    moved : (s, m, k) change of the columns by one sd of each velocity and angle
    rate : (m, nv) acceleration in each row [m/s^2, rad/s^2]
    weight : (m,) time each row stands for [s]
    block : (m,) number of the stretch of time a row lies in
    """

    columns: tuple[LibraryColumn, ...]
    axes: tuple[str, ...]
    theta: Array
    error: Array
    target: Array
    weight: Array
    block: Array
    moved: Array
    rate: Array


def rows(
    model: Model,
    motions: Sequence[Motion],
    columns: Sequence[LibraryColumn],
    form: str = "weak",
    window: float = 3.0,
    block: float = 6.0,
) -> Rows:
    """Regression rows of several motions.

    Parameters
    ----------
    form : "strong" reads accelerations; "weak" averages the balance under a bump that vanishes at both ends,
        so that its slope takes over from the acceleration (Messenger and Bortz 2021)
    window : length of the bump, L/U
    block : length of a stretch that the bootstrap keeps together, L/U

    Raises
    ------
    ModelError
        if the form is unknown, or weak and a motion has no intervals or is shorter than a window
    """
    if form not in ("strong", "weak"):
        raise ModelError(f"form {form!r}: choose weak or strong")
    time = model.scales["L"] / model.scales["U"]
    parts, first = [], 0
    for motion in motions:
        values, rest, mass = theta(model, columns, motion.states, motion.actuators)
        moved = _moved(model, columns, motion, values)
        error = np.sqrt(np.sum(moved**2, axis=0))
        rate = motion.rate
        if form == "strong":
            target = (motion.rate - rest) @ mass.T
            t, weight = motion.t, motion.gap
        else:
            average, slope, t = _bumps(motion, window * time)
            nv = motion.rate.shape[1]
            rate = -slope @ motion.states[:, -nv:]
            target = (rate - average @ rest) @ mass.T
            values = average @ values
            error = np.sqrt(average @ error**2) * np.sqrt(np.minimum(1.0, 1.0 / window))
            moved = (average @ moved) * np.sqrt(np.minimum(1.0, 1.0 / window))
            weight = np.full(t.size, 0.25 * window * time)
        span = max(motion.t[-1] - motion.t[0], 1e-12)
        count = max(1, round(span / (block * time)))
        own = np.minimum((count * (t - motion.t[0]) / span).astype(int), count - 1)
        parts.append((values, error, target, weight, own + first, moved, rate))
        first += count
    joined = [np.concatenate([p[i] for p in parts], axis=1 if i == 5 else 0) for i in range(7)]
    axes = tuple(AXIS[v] for v in model.kernel.velocities)
    return Rows(tuple(columns), axes, *joined)


def _moved(model: Model, columns: Sequence[LibraryColumn], motion: Motion, values: Array) -> Array:
    """(s, n, k) change of every column by one sd of each state the forces depend on."""
    found = []
    for i, name in enumerate(model.states):
        if name in ("x", "y", "z"):
            continue
        moved = motion.states.copy()
        moved[:, i] += motion.sd[:, i]
        change = np.zeros_like(values)
        if motion.sd[:, i].any():
            change = theta(model, columns, moved, motion.actuators)[0] - values
        found.append(change)
    return np.array(found)


def _bumps(motion: Motion, length: float) -> tuple[Array, Array, Array]:
    """(w, n) averages under bumps (1 - s^2)^3, (w, n) integrals of their slopes, and (w,) centres."""
    if motion.edges is None:
        raise ModelError(f"{motion.name}: points in time have no weak form; use form='strong'")
    begin, end = motion.edges[0], motion.edges[-1]
    if end - begin < length:
        raise ModelError(
            f"{motion.name}: {end - begin:.3g} s is shorter than one window of the weak form ({length:.3g} s)"
        )
    count = max(2, int(np.ceil((end - begin - length) / (0.25 * length))) + 1)
    centre = np.linspace(begin + 0.5 * length, end - 0.5 * length, count)

    def bump(at: Array) -> Array:
        s = 2.0 * (at[None, :] - centre[:, None]) / length
        return np.maximum(1.0 - s**2, 0.0) ** 3

    average = bump(motion.t) * motion.gap
    edge = bump(motion.edges)
    total = average.sum(axis=1, keepdims=True)
    return average / total, np.diff(edge, axis=1) / total, centre


def describe(column: LibraryColumn) -> str:
    """Name and regressor for a reader."""
    return f"{column.name} ({term(column.name).regressor if column.is_row else column.expression})"
