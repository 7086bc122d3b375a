"""Which combinations of parameters the data do not see, in words.

Takes a residual Jacobian in relative changes of the parameters. Gives singular values and named flat
directions. Does not fit, and does not decide what level counts as flat: the caller states it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
SHOWN = 0.12  # entries of a unit vector smaller than this are left out of its name
# Singular values below this share of the largest are zero. Exact sensitivities leave 1e-16 where theory says
# zero; the smallest one that is not zero in the paper's spiral is 4e-10.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Direction:
    """A combination of parameters that data leave open.

    name : "0.71 Y_v + 0.70 Y_r", relative changes of the parameters named
    singular_value : length of the residual change for a unit step along it; its inverse is the sd the data
        leave
    exact : zero to rounding
    decided_by : what holds it instead: "prior", "bounds" or "nothing"
    vector : (k,) unit vector
    """

    name: str
    singular_value: float
    exact: bool
    decided_by: str
    vector: Array

    @property
    def sd(self) -> float:
        """Relative standard deviation the data alone leave along it."""
        return float("inf") if self.singular_value == 0 or self.exact else 1.0 / self.singular_value


def combination(names: Sequence[str], vector: Array) -> str:
    """A unit vector as a sum of names, largest entry first and positive."""
    order = np.argsort(-np.abs(vector))
    sign = np.sign(vector[order[0]]) or 1.0
    words: list[str] = []
    least = (
        SHOWN if np.sum(np.abs(vector) >= SHOWN) > 1 else 0.02
    )  # one name alone would hide the combination
    for i in order:
        value = sign * vector[i]
        if abs(value) < least:
            break
        glue = ("" if value > 0 else "-") if not words else ("+ " if value > 0 else "- ")
        words.append(f"{glue}{abs(value):.2f} {names[i]}")
    return " ".join(words)


def singular_values(jac: Array) -> tuple[Array, Array]:
    """Singular values (k,), falling, and right vectors (k, k) as rows; of a triangular factor, to save
    memory.
    """
    triangle = np.linalg.qr(jac, mode="r") if jac.shape[0] > jac.shape[1] else jac
    _, s, vt = np.linalg.svd(triangle, full_matrices=True)
    values = np.zeros(jac.shape[1])
    values[: s.size] = s
    return values, vt


def rank(values: Array, rounding: float = ROUNDING) -> int:
    """Number of singular values above rounding."""
    return int(np.sum(values > rounding * values.max())) if values.size else 0


def flat_directions(
    names: Sequence[str],
    jac: Array,
    level: float,
    prior_sd: Array | None = None,
    half_width: Array | None = None,
    rounding: float = ROUNDING,
) -> tuple[Direction, ...]:
    """Directions along which the data leave a relative sd larger than `level`.

    Parameters
    ----------
    names : (k,)
    jac : (n, k) whitened residuals by relative change of each parameter, without the prior
    level : relative sd, e.g. 0.5 for half the parameter's scale
    prior_sd, half_width : (k,) relative prior sd and half the distance between the bounds, inf where there is
        none

    Returns
    -------
    flattest first. Directions that are flat to rounding span a space without preferred axes; they are turned
    to few names each (varimax).
    """
    values, vt = singular_values(jac)
    limit = rounding * values.max() if values.size else 0.0
    zero = values <= limit
    vectors = vt.copy()
    if zero.sum() > 1:
        vectors[zero] = varimax(vt[zero])
    found = []
    for value, vector in zip(values[::-1], vectors[::-1], strict=True):
        exact = bool(value <= limit)
        if not exact and value * level >= 1.0:
            continue
        left = np.inf if exact else 1.0 / value
        found.append(
            Direction(
                combination(names, vector),
                float(value),
                exact,
                _holder(vector, left, prior_sd, half_width),
                vector,
            )
        )
    return tuple(found)


def _holder(vector: Array, left: float, prior_sd: Array | None, half_width: Array | None) -> str:
    def along(widths: Array | None) -> float:
        if widths is None:
            return np.inf
        with np.errstate(divide="ignore"):
            total = float(np.sum(vector**2 / np.asarray(widths) ** 2))
        return np.inf if total == 0 else 1.0 / np.sqrt(total)

    prior, bounds = along(prior_sd), along(half_width)
    if min(prior, bounds) >= left:
        return "nothing"
    return "prior" if prior <= bounds else "bounds"


def varimax(vectors: Array, sweeps: int = 100) -> Array:
    """Rotate orthonormal rows (m, k) among themselves so that each has few large entries (Kaiser 1958)."""
    rows = vectors.copy()
    m, k = rows.shape
    for _ in range(sweeps):
        largest = 0.0
        for i in range(m - 1):
            for j in range(i + 1, m):
                a, b = rows[i], rows[j]
                u, v = a * a - b * b, 2 * a * b
                top = 2 * (u @ v - u.sum() * v.sum() / k)
                bottom = (u @ u - v @ v) - (u.sum() ** 2 - v.sum() ** 2) / k
                angle = 0.25 * np.arctan2(top, bottom)
                c, s = np.cos(angle), np.sin(angle)
                rows[i], rows[j] = c * a + s * b, c * b - s * a
                largest = max(largest, abs(angle))
        if largest < 1e-9:
            break
    return rows
