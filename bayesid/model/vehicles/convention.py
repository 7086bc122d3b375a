"""Bring coefficients into the one convention used inside: Gertler-Hagen complete, positive rudder to port.

Takes: canonical name -> SI or prime value, a covariance alongside. Both conversions are linear in the values.
Does not: touch mass properties, or decide which convention a file is in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from bayesid.model.notation import AXES, VELOCITY
from bayesid.model.terms import TERMS, term
from bayesid.model.vehicles.vehicle import CoefficientPrior

_ROWS = {
    (row.axis, tuple(sorted(f.symbol for f in row.factors))): row.name
    for row in TERMS
    if row.group == "base"
    and len(row.factors) == 2
    and all(f.symbol in VELOCITY and not f.wrap for f in row.factors)
}
_CROSS = ((1, 2), (2, 0), (0, 1))  # (a x b)_i = a_j b_k - a_k b_j


def munk_and_coriolis(coef: Mapping[str, float]) -> dict[str, float]:
    """Velocity rows that the acceleration rows of a set bring with them (Kirchhoff's equations).

    Parameters
    ----------
    coef : canonical name -> value; only acceleration rows are read, and the symmetric half of them is used,
        for only that has a kinetic energy

    Returns
    -------
    dict
        canonical name -> value to add, e.g. N_v: Y_vdot - X_udot (the Munk moment), X_vr: -Y_vdot

    Raises
    ------
    KeyError
        never for the acceleration rows of the table: each product has a row (tested)

    Fossen (2021), added-mass Coriolis; holds for prime values as for SI, the powers of L agree.
    """
    matrix = np.zeros((6, 6))
    for name, value in coef.items():
        row = term(name)
        if row.is_inertia:
            matrix[AXES.index(row.axis), VELOCITY.index(row.arguments.removesuffix("dot"))] = -value
    matrix = 0.5 * (matrix + matrix.T)
    found: dict[str, float] = {}

    def add(axis: int, first: int, second: int, value: float) -> None:
        if value != 0.0:
            key = (AXES[axis], tuple(sorted((VELOCITY[first], VELOCITY[second]))))
            found[_ROWS[key]] = found.get(_ROWS[key], 0.0) + value

    # force -omega x P and moment -(v x P + omega x Q), with momenta (P, Q) = matrix nu
    products: dict[tuple[int, int, int], float] = {}
    for i, (j, k) in enumerate(_CROSS):
        for arm, momentum, out in ((3, 0, 0), (0, 0, 3), (3, 3, 3)):
            for a, b, sign in ((j, k, -1.0), (k, j, 1.0)):
                for n in range(6):
                    key = (out + i, min(arm + a, n), max(arm + a, n))
                    products[key] = products.get(key, 0.0) + sign * float(matrix[momentum + b, n])
    for (axis, first, second), value in products.items():
        add(axis, first, second, value)
    return {name: value for name, value in found.items() if value != 0.0}


def complete_from_fossen(coef: Mapping[str, float]) -> dict[str, float]:
    """Gertler-Hagen complete set of a set whose added-mass Coriolis and Munk parts are kept apart."""
    extra = munk_and_coriolis(coef)
    names = [row.name for row in TERMS if row.name in coef or row.name in extra]
    return {name: coef.get(name, 0.0) + extra.get(name, 0.0) for name in names}


def moving_with(names: Iterable[str]) -> tuple[str, ...]:
    """Velocity rows that hold added masses among `names` by Kirchhoff's equations."""
    extra = munk_and_coriolis({name: 1.0 + k for k, name in enumerate(names)})
    return tuple(row.name for row in TERMS if row.name in extra)


def rudder_to_port(coef: Mapping[str, float]) -> dict[str, float]:
    """Set of a boat whose positive rudder turns to starboard, for positive rudder to port."""
    return {name: -value if term(name).odd_in_rudder else value for name, value in coef.items()}


#: what a file may ask for, by the word it uses
CONVERSIONS: dict[str, Callable[[Mapping[str, float]], dict[str, float]]] = {
    "fossen": complete_from_fossen,
    "starboard": rudder_to_port,
}


def jacobian(
    convert: Callable[[Mapping[str, float]], dict[str, float]], before: list[str], after: list[str]
) -> np.ndarray:
    """(len(after), len(before)) matrix of a linear conversion of coefficients."""
    columns = [convert({name: float(name == one) for name in before}) for one in before]
    return np.array([[column.get(name, 0.0) for column in columns] for name in after])


def converted(
    convert: Callable[[Mapping[str, float]], dict[str, float]],
    coef: dict[str, float],
    prior: CoefficientPrior | None,
) -> tuple[dict[str, float], CoefficientPrior | None]:
    """Coefficients and prior after a conversion; a covariance follows exactly, separate sds as marginals."""
    after = convert(coef)
    if prior is None or (not prior.relative_sd and prior.covariance is None):
        return after, prior
    before, names = list(coef), list(after)
    sd = np.array([prior.relative_sd.get(key, 0.0) * abs(coef[key]) for key in before])
    known = np.diag(sd**2)
    at = [before.index(key) for key in prior.names]
    if prior.covariance is not None:
        known[np.ix_(at, at)] = prior.covariance
    matrix = jacobian(convert, before, names)
    spread = matrix @ known @ matrix.T
    joint: tuple[str, ...] = ()
    covariance = None
    if prior.covariance is not None:
        reached = np.any(matrix[:, at] != 0.0, axis=1)
        joint = tuple(key for key, hit in zip(names, reached, strict=True) if hit)
        covariance = spread[np.ix_(reached, reached)]
        covariance.setflags(write=False)
    relative = {
        key: math.sqrt(spread[i, i]) / abs(after[key])
        for i, key in enumerate(names)
        if key not in joint and after[key] != 0.0 and spread[i, i] > 0.0
    }
    return after, CoefficientPrior(relative, joint, covariance)
